"""The three data sources: training data from one execution for the error of the modelled body."""

from collections.abc import Callable

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxidl.errors import one_of
from jaxidl.types import Dataset, History, Trajectory

TRAIN_ON = ("true_state", "sensed_state")


def _inputs(run: Trajectory, qdd: History, train_on: str) -> Float[Array, "T F"]:
    """Return network inputs (T, 3J + C).

    The reference program trains on the true state; a robot has only the sensed one.
    """
    if train_on not in TRAIN_ON:
        raise one_of("train_on", train_on, TRAIN_ON)
    state = (run.q, run.qd) if train_on == "true_state" else (run.q_sensing, run.qd_sensing)
    told = () if run.circumstances is None else (run.circumstances,)
    return jnp.concatenate([*state, qdd, *told], axis=1)


def indirect(run: Trajectory, train_on: str = "true_state") -> Dataset:
    """Return T rows at the *actual* acceleration (eq. data_indirect).

    The target is tau − modelled rigid body there.
    """
    return Dataset(_inputs(run, run.qdd_actual, train_on), run.tau - run.tau_inverse_actual)


def direct(run: Trajectory, train_on: str = "true_state") -> Dataset:
    """Return T − 1 rows at the *desired* acceleration (eq. data_direct).

    The target is learning feedback one step later + feedforward.
    """
    x = _inputs(run, run.qdd_desired, train_on)[:-1]
    return Dataset(x, run.tau_feedback[1:] + run.tau_feedforward[:-1])


def joint(run: Trajectory, train_on: str = "true_state") -> Dataset:
    """Return 2T − 1 rows: the indirect ones, then the direct ones (eq. data_joint)."""
    pair = zip(indirect(run, train_on), direct(run, train_on), strict=True)
    return Dataset(*(jnp.concatenate(parts) for parts in pair))


SOURCES: dict[str, Callable[..., Dataset]] = {
    "indirect": indirect,
    "direct": direct,
    "joint": joint,
}
