"""Parts of what is hidden in a whole robot: effects, and what no effect covers."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxidl.gap.benchmark.reference import Array


class Part(NamedTuple):
    """A hidden effect or, as ``"outside"``, a part of the remainder.

    ``joint`` is None for one of the whole robot.
    """

    effect: str
    joint: int | None
    parameters: Mapping[str, Any]


def at(shape: Mapping[str, Any], size: float) -> dict[str, Any]:
    """Return parameters of a shape at ``size``: ("size", x) means x times it."""

    def value(x: Any) -> Any:
        if isinstance(x, tuple):
            return float(size * x[1]) if x[0] == "size" else [value(one) for one in x]
        return float(x) if isinstance(x, float | np.floating) else x

    return {key: value(x) for key, x in shape.items()}


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def listed(values: Array) -> list[float]:
    """Return values as a file holds them."""
    return [float(x) for x in values]
