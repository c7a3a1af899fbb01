"""The exponential moving average used by both feedback laws, and the same without delay."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from jaxidl.types import History, Joints, Scalar


class Average(NamedTuple):
    """State of an exponential moving average."""

    value: Joints  # (J,) the average so far; zero before the first sample
    started: Bool[Array, ""]  # true after the first sample


def start_average(like: Joints) -> Average:
    """Return an average of values shaped as ``like`` (J,) that has no sample yet."""
    return Average(jnp.zeros_like(like), jnp.array(False))


def update_average(average: Average, sample: Joints, alpha: Scalar) -> Average:
    """Return alpha·sample + (1 − alpha)·average; the first sample is taken as it is."""
    mixed = alpha * sample + (1.0 - alpha) * average.value
    return Average(jnp.where(average.started, mixed, sample), jnp.array(True))


def average_along(x: History, alpha: Scalar, *, reverse: bool = False) -> History:
    """Return the moving average of a history (T, J), from its first step on or from its last."""

    def step(average: Joints, sample: Joints) -> tuple[Joints, Joints]:
        average = average + alpha * (sample - average)
        return average, average

    return jax.lax.scan(step, x[-1] if reverse else x[0], x, reverse=reverse)[1]


def average_around(x: History, alpha: Scalar) -> History:
    """Return the moving average of a history (T, J) forwards, then backwards: without delay.

    Away from the ends a sample k steps away counts in proportion to (1 − alpha)^|k|.
    """
    return average_along(average_along(x, alpha), alpha, reverse=True)
