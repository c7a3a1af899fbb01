"""A small version of the paper's study, and one execution of the whole one."""

import jax
import jax.numpy as jnp

from jaxidl.learning.execute import execute
from jaxidl.models import ErrorModel, Training
from jaxidl.paper.grid import GAINS
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.types import Trajectory

SMALL_STUDY = PaperStudy(
    steps=80, error_model=ErrorModel(layers=(12, 6, 1)), training=Training(batch=16)
)
# what the reference program stores of an execution
ARRAYS = (
    "q",
    "qd",
    "q_sensing",
    "qd_sensing",
    "qdd_desired",
    "qdd_actual",
    "tau",
    "tau_inverse_desired",
    "tau_inverse_actual",
    "tau_feedback",
)


def run_of(controller, gain, friction, stiction, noise=5e-4, seed=1) -> Trajectory:
    """The first execution of the study in one of its conditions."""
    study = PaperStudy()
    condition = Condition(
        GAINS.index(gain), *map(jnp.asarray, (noise, float(friction), float(stiction)))
    )
    setting = study.setting(controller, condition)
    draws = jnp.asarray(draw_noise(seed, 1, study.steps)[0])
    return jax.jit(execute)(setting.plant, setting.model, setting.law, setting.task, draws)
