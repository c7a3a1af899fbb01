"""What ``__init__.py`` imports when it is asked for."""

from .pieces import Pieces
from .results import Variable, read
from .statistics import Mean, geometric
from .sweeping import sweep

__all__ = ["Mean", "Pieces", "Variable", "geometric", "read", "sweep"]
