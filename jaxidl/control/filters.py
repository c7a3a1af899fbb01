"""The exponential moving average used by both feedback laws."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool

from jaxidl.types import Joints, Scalar


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
