"""The public names of jaxidl: what ``__init__.py`` imports when it is asked for."""

from . import effects
from .control import Doomed, LqrPolicy, PdPolicy, Pid, PidGains, lqr
from .effects import CATALOGUE, Effect
from .errors import ConfigurationError, EffectError, JaxidlError, StoreError
from .learning.execute import Task, desired_trajectory, execute
from .learning.guard import Guard
from .learning.iterate import Metrics, Setting, learn, measure
from .learning.schedule import Schedule
from .learning.sources import SOURCES, direct, indirect, joint, weighted
from .models import ErrorModel, Training
from .paper.grid import Grid
from .paper.runs import read_results, run_sweep
from .paper.study import Condition, PaperStudy, draw_noise
from .paper.verdicts import check_claims
from .systems import Plant, PointMass, point_mass
from .types import Dataset, State, Trajectory

__version__: str

__all__ = [
    "CATALOGUE",
    "SOURCES",
    "Condition",
    "ConfigurationError",
    "Dataset",
    "Doomed",
    "Effect",
    "EffectError",
    "ErrorModel",
    "Grid",
    "Guard",
    "JaxidlError",
    "LqrPolicy",
    "Metrics",
    "PaperStudy",
    "PdPolicy",
    "Pid",
    "PidGains",
    "Plant",
    "PointMass",
    "Schedule",
    "Setting",
    "State",
    "StoreError",
    "Task",
    "Training",
    "Trajectory",
    "check_claims",
    "desired_trajectory",
    "direct",
    "draw_noise",
    "effects",
    "execute",
    "indirect",
    "joint",
    "learn",
    "lqr",
    "measure",
    "point_mass",
    "read_results",
    "run_sweep",
    "weighted",
]
