"""Gains that fall as the error model earns trust, and return at once when it fails.

1. If the mean distance of an execution from the desired trajectory is at most ``slack`` times that
   of the best one so far, the applied gains of the next execution are multiplied by ``down``,
   otherwise by ``up``. They stay between ``least`` and 1 times their original values.
2. Within an execution they rise to 1 as the sensed position leaves the desired trajectory, from
   ``near`` to ``far`` times the largest distance of the best execution.

So gains fall as far as tracking allows. What was measured: :doc:`/explanation/trust`.
"""

from dataclasses import dataclass

import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Float

from jaxidl.errors import ConfigurationError
from jaxidl.learning.guard import Strayed, distance
from jaxidl.types import Scalar, State


@dataclass(frozen=True)
class Schedule:
    """The settings of the schedule.

    Raises:
        ConfigurationError: unless 0 < least <= 1, slack >= 1, 0 < down <= 1 <= up and 0 < near <
            far.
    """

    least: float = 0.25  # share of the gains that always stays
    slack: float = 1.1  # tracking may be so much worse than the best
    down: float = 0.8
    up: float = 1.6
    near: float = 1.2  # from here on gains rise, in largest distances of the best execution
    far: float = 2.4  # from here on they are whole

    def __post_init__(self) -> None:
        right = 0.0 < self.least <= 1.0 <= self.slack < jnp.inf
        right &= 0.0 < self.down <= 1.0 <= self.up < jnp.inf
        if not (right and 0.0 < self.near < self.far < jnp.inf):
            raise ConfigurationError(
                "a schedule with 0 < least <= 1 <= slack, 0 < down <= 1 <= up and 0 < near < far",
                ", ".join(f"{name}={value}" for name, value in vars(self).items()),
                "correct it",
            )

    def after(self, share: Scalar, strayed: Float[Array, " T"], past: Strayed) -> Scalar:
        """Return the next execution's share of the gains.

        Args:
            share: that of the last one.
            strayed: its distances from the desired trajectory (T,) [m or rad].
            past: of all executions, this one included.
        """
        tracked = strayed.mean() <= self.slack * past.mean  # never true of NaN
        change = jnp.where(tracked, self.down, self.up)
        return jnp.clip(share * change, self.least, 1.0)

    def gains(self, share: Scalar, past: Strayed) -> "Gains":
        """Return the gains of an execution."""
        return Gains(share, past.best, self.near, self.far)


class Gains(struct.PyTreeNode):
    """The share of the applied gains in one execution."""

    share: Scalar  # on the desired trajectory [-]
    best: Scalar  # largest distance of the best execution [m or rad]
    near: float = struct.field(pytree_node=False)
    far: float = struct.field(pytree_node=False)

    def __call__(self, sensed: State, desired: State) -> Scalar:
        """Return the share in a sensed state, from ``share`` to 1."""
        strayed = distance(sensed.q, desired.q) / jnp.maximum(self.best, 1e-12)
        back = jnp.clip((strayed - self.near) / (self.far - self.near), 0.0, 1.0)
        return self.share + (1.0 - self.share) * back
