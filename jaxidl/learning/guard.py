"""A guard for learned torques: they act only where they are known to be right.

It uses what a robot has: the rows that the model was trained on, and how far earlier executions
strayed from the desired trajectory.

1. The model's inputs are clipped to the range of its training inputs, its torque to the range of
   its training targets: a network does not extrapolate.
2. Its torque fades with the distance of the sensed position from the desired trajectory, from full
   at ``near`` times its reach to none at ``far`` times. The reach is the geometric mean of the
   largest distances of the first execution, before any learning, and of the best so far, the one
   that strayed least on average.

So a bad model spoils only part of one execution: where the robot strays, feedback and rigid body
continue alone. What was measured, and what did not help: :doc:`/explanation/trust`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Array, Float

from jaxidl.errors import ConfigurationError
from jaxidl.models import ErrorModel, Params
from jaxidl.models.training import root
from jaxidl.types import Circumstances, Dataset, History, Joints, Scalar, State


class Strayed(NamedTuple):
    """How far executions strayed from the desired trajectory [m or rad]."""

    first: Scalar  # largest distance of the first execution
    best: Scalar  # largest distance of the best one
    mean: Scalar  # mean distance of the best one

    @classmethod
    def of(cls, first: Float[Array, " T"]) -> "Strayed":
        """Return it after the first execution, whose distances are ``first`` (T,)."""
        return cls(first.max(), first.max(), first.mean())

    def after(self, later: Float[Array, " T"]) -> "Strayed":
        """Return it after another execution; one with NaN is never the best."""
        better = later.mean() < self.mean
        where = lambda a, b: jnp.where(better, a, b)
        return Strayed(self.first, where(later.max(), self.best), where(later.mean(), self.mean))

    @property
    def reach(self) -> Scalar:
        """The geometric mean of the largest distances of the first and the best execution."""
        return root(self.first * self.best)


@dataclass(frozen=True)
class Guard:
    """The guard's settings, as multiples of its reach.

    Raises:
        ConfigurationError: unless 0 < near < far.
    """

    near: float = 1.2  # up to here the whole torque of the model is applied
    far: float = 2.4  # from here on none

    def __post_init__(self) -> None:
        if not 0.0 < self.near < self.far < jnp.inf:
            raise ConfigurationError(
                "a guard with 0 < near < far", f"near={self.near}, far={self.far}", "correct it"
            )

    def region(self, data: Dataset, strayed: Strayed) -> "Region":
        """Return where a model that was trained on ``data`` (N rows) may drive."""
        x, y = data
        return Region(x.min(0), x.max(0), y.min(0), y.max(0), strayed.reach, self.near, self.far)


class Region(struct.PyTreeNode):
    """Where a model may drive."""

    lowest: Float[Array, " F"]  # inputs
    highest: Float[Array, " F"]
    least: Joints  # (J,) torque [N or Nm]
    most: Joints
    reach: Scalar  # [m or rad]
    near: float = struct.field(pytree_node=False)
    far: float = struct.field(pytree_node=False)

    def feedforward(
        self, model: ErrorModel, params: Params
    ) -> Callable[[State, Joints, Circumstances | None], Joints]:
        """Return the model's torque (J,) with inputs and outputs in the range of its data.

        It is a function of state, acceleration (J,) and circumstances (C,).
        """

        def torque(state: State, qdd: Joints, circumstances: Circumstances | None) -> Joints:
            given = (*state, qdd) if circumstances is None else (*state, qdd, circumstances)
            x = jnp.clip(jnp.concatenate(given), self.lowest, self.highest)
            q, qd, *rest = jnp.split(x, np.cumsum([len(part) for part in given[:-1]]))
            return jnp.clip(model.torque(params, State(q, qd), *rest), self.least, self.most)

        return torque

    def fade(self, sensed: State, desired: State) -> Scalar:
        """Return the share of the model's torque that is applied, from 1 to 0."""
        # an execution that never strayed leaves no room at all
        strayed = distance(sensed.q, desired.q) / jnp.maximum(self.reach, 1e-12)
        return jnp.clip((self.far - strayed) / (self.far - self.near), 0.0, 1.0)


def distance(q: History, desired: History) -> Float[Array, "*T"]:
    """Return the distance (T,) of positions (T, J), or of one (J,), from the desired ones."""
    return root(jnp.sum((q - desired) ** 2, axis=-1))
