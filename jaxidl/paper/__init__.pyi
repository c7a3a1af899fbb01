"""What ``__init__.py`` imports when it is asked for."""

from .claims import CLAIMS
from .effects import PaperFriction, paper_stiction
from .grid import Grid
from .runs import read_results, run_sweep
from .study import Condition, PaperStudy, draw_noise
from .vary import varied
from .verdicts import check_claims

__all__ = [
    "CLAIMS",
    "Condition",
    "Grid",
    "PaperFriction",
    "PaperStudy",
    "check_claims",
    "draw_noise",
    "paper_stiction",
    "read_results",
    "run_sweep",
    "varied",
]
