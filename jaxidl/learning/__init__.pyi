"""What ``__init__.py`` imports when it is asked for."""

from .deploy import export_feedforward, feedforward
from .detector import Detector, Observer, calibrate
from .execute import Task, desired_trajectory
from .guard import Guard
from .iterate import Metrics, Setting, learn, measure
from .schedule import Schedule
from .sources import SOURCES, direct, indirect, joint, weighted

__all__ = [
    "SOURCES",
    "Detector",
    "Guard",
    "Metrics",
    "Observer",
    "Schedule",
    "Setting",
    "Task",
    "calibrate",
    "desired_trajectory",
    "direct",
    "export_feedforward",
    "feedforward",
    "indirect",
    "joint",
    "learn",
    "measure",
    "weighted",
]
