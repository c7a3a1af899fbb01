"""Gains that fall as the error model earns trust, and return at once when it fails.

1. Between executions the applied gains of each joint are multiplied by the share of learning
   feedback that is left: its mean size in the last execution over that in the first one, at least
   ``least``. The learning feedback has gains of its own, which do not fall; so low gains do not
   make themselves look trusted.
2. Within an execution the share rises to 1 again as the sensed position leaves the desired
   trajectory, from ``near`` to ``far`` times the largest distance of the best execution so far.

What it is worth: :doc:`/explanation/trust`.
"""

from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp
from flax import struct

from jaxidl.errors import ConfigurationError
from jaxidl.learning.guard import distance
from jaxidl.types import History, Joints, Scalar, State


class Trust(NamedTuple):
    """How much the learner asks of feedback: means over an execution of its size, by joint."""

    first: Joints  # (J,) in the first execution [N or Nm]
    last: Joints  # (J,) in the last one

    @classmethod
    def of(cls, tau_feedback: History) -> "Trust":
        """Return it after the first execution, from its learning feedback (T, J)."""
        size = jnp.abs(tau_feedback).mean(0)
        return cls(size, size)

    def after(self, tau_feedback: History) -> "Trust":
        """Return it after another execution; one that did not stay finite earns none."""
        size = jnp.abs(tau_feedback).mean(0)
        return Trust(self.first, jnp.where(jnp.isfinite(size), size, self.first))


@dataclass(frozen=True)
class Schedule:
    """The settings of the schedule.

    Raises:
        ConfigurationError: unless 0 <= least <= 1 and 0 < near < far.
    """

    least: float = 0.25  # share of the gains that always stays
    near: float = 1.2  # from here on gains rise, in largest distances of the best execution
    far: float = 2.4  # from here on they are whole

    def __post_init__(self) -> None:
        if not (0.0 <= self.least <= 1.0 and 0.0 < self.near < self.far < jnp.inf):
            raise ConfigurationError(
                "a schedule with 0 <= least <= 1 and 0 < near < far",
                f"least={self.least}, near={self.near}, far={self.far}",
                "correct it",
            )

    def gains(self, trust: Trust, best: Scalar) -> "Gains":
        """Return the gains of the next execution.

        ``best`` is the largest distance of the best execution so far [m or rad].
        """
        left = trust.last / jnp.maximum(trust.first, 1e-12)
        return Gains(jnp.clip(left, self.least, 1.0), best, self.near, self.far)


class Gains(struct.PyTreeNode):
    """The share of the applied gains in one execution."""

    share: Joints  # (J,) on the desired trajectory [-]
    best: Scalar  # [m or rad]
    near: float = struct.field(pytree_node=False)
    far: float = struct.field(pytree_node=False)

    def __call__(self, sensed: State, desired: State) -> Joints:
        """Return the share (J,) in a sensed state, from ``share`` to 1."""
        strayed = distance(sensed.q, desired.q) / jnp.maximum(self.best, 1e-12)
        back = jnp.clip((strayed - self.near) / (self.far - self.near), 0.0, 1.0)
        return self.share + (1.0 - self.share) * back
