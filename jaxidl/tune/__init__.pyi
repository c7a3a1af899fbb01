"""What ``__init__.py`` imports when it is asked for."""

from .problem import Problem, arm_problem, point_mass_problem
from .run import tune
from .search import Search

__all__ = ["Problem", "Search", "arm_problem", "point_mass_problem", "tune"]
