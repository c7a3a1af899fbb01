"""jaxidl: learn what a robot's rigid-body model gets wrong, for thousands of configurations at once.

The public names, in one place. A plant is a rigid body plus a list of named physical effects; executing a task on it gives
data from three sources; an error model learns from them, iteration by iteration; a sweep does that for a whole grid.
"""

from importlib.metadata import version as _version

from jaxidl import effects
from jaxidl.control import Doomed, LqrPolicy, PdPolicy, Pid, PidGains, lqr
from jaxidl.effects import CATALOGUE, Effect
from jaxidl.errors import ConfigurationError, EffectError, JaxidlError, StoreError
from jaxidl.learning.execute import Task, desired_trajectory, execute
from jaxidl.learning.iterate import Metrics, Setting, learn, measure
from jaxidl.learning.paper import Condition, PaperStudy, draw_noise
from jaxidl.learning.sources import SOURCES, direct, indirect, joint
from jaxidl.models import ErrorModel, Training
from jaxidl.sweep.grid import QUICK, Grid, Label
from jaxidl.sweep.launch import run_sweep
from jaxidl.sweep.results import read as read_results
from jaxidl.sweep.verdicts import check_claims
from jaxidl.systems import Plant, PointMass, point_mass
from jaxidl.types import Dataset, State, Trajectory

__version__ = _version("jaxidl")

__all__ = [
    "CATALOGUE",
    "QUICK",
    "SOURCES",
    "Condition",
    "ConfigurationError",
    "Dataset",
    "Doomed",
    "Effect",
    "EffectError",
    "ErrorModel",
    "Grid",
    "JaxidlError",
    "Label",
    "LqrPolicy",
    "Metrics",
    "PaperStudy",
    "PdPolicy",
    "Pid",
    "PidGains",
    "Plant",
    "PointMass",
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
]
