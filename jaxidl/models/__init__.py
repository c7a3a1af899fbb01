"""The error model and its training."""

from jaxidl.models.mlp import ErrorModel, Mlp, Params
from jaxidl.models.training import Learner, Progress, Training, adam, draw_batches, fit, start

__all__ = [
    "ErrorModel",
    "Learner",
    "Mlp",
    "Params",
    "Progress",
    "Training",
    "adam",
    "draw_batches",
    "fit",
    "start",
]
