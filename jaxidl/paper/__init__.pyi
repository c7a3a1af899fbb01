"""What ``__init__.py`` imports when it is asked for."""

from .claims import CLAIMS
from .grid import Grid
from .runs import read_results, run_sweep
from .study import Condition, PaperStudy, draw_noise
from .vary import varied
from .verdicts import check_claims

__all__ = [
    "CLAIMS",
    "Condition",
    "Grid",
    "PaperStudy",
    "check_claims",
    "draw_noise",
    "read_results",
    "run_sweep",
    "varied",
]
