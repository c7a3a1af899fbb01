"""What ``__init__.py`` imports when it is asked for."""

from .hidden import Logged
from .pick import PickAndPlace, pick_and_place
from .run import ArmRun, run_all
from .setup import ArmStudy, learn_arm
from .study import ArmGrid, run_study

EXPERIMENTS: tuple[str, ...]

__all__ = [
    "ArmGrid",
    "ArmRun",
    "ArmStudy",
    "Logged",
    "PickAndPlace",
    "learn_arm",
    "pick_and_place",
    "run_all",
    "run_study",
]
