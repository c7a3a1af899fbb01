"""Static friction: a joint at rest stays at rest until the torque breaks it away."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from flax import struct

from jaxidl.effects.base import Effect, Guess, Parameter, Scale
from jaxidl.types import JointMask, Joints, Scalar


class Stiction(Effect):
    """A resting joint withstands the breakaway torque, beyond what other dry friction holds, before it moves.

    A joint rests where |qd| < ``speed``; the effect acts below position ``below`` only. Both borders are strict. With
    ``signed`` it is the paper's program: a resting joint does not accelerate (its speed stays what it was) while the delivered
    torque itself, not its magnitude, is below the breakaway torque, so that it is held against every negative torque, and the
    program's results depend on it.
    """

    breakaway: Joints  # (J,) torque that sets a resting joint moving [N or Nm]
    speed: Joints | Scalar  # (J,) or (): below it a joint counts as resting [m/s or rad/s]
    below: Joints | Scalar  # (J,) or (): positions from here on do not stick [m]
    signed: bool = struct.field(pytree_node=False, default=False)

    name: ClassVar[str] = "stiction"
    sentence: ClassVar[str] = "a joint at rest sticks until the torque exceeds a breakaway value"
    parameters: ClassVar = {
        "breakaway": Parameter("N", 0.0, 1e5, "the breakaway torque"),
        "speed": Parameter("m/s", 0.0, 1.0, "the resting speed"),
        "below": Parameter("m", -float("inf"), float("inf"), "the position below which the joint sticks"),
    }

    def _rests(self, q: Joints, qd: Joints) -> JointMask:
        return (jnp.abs(qd) < self.speed) & (q < self.below)

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        if self.signed:
            return jnp.zeros_like(qd)
        return jnp.where(self._rests(q, qd), self.breakaway, 0.0)

    def holds(self, q: Joints, qd: Joints, tau: Joints) -> JointMask:
        if not self.signed:
            return jnp.zeros(qd.shape, bool)
        return self._rests(q, qd) & (tau < self.breakaway)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"breakaway": scale.residual, "speed": 1e-9 * scale.speed, "below": np.inf}]


STICTION_LEVEL = Parameter("1", 0.0, 1000.0, "the stiction level")


def paper_stiction(level: Scalar) -> Stiction:
    """The paper's stiction of level s: breakaway (100 s, 50 s) N on joints 0 and 1, below 0.2 m and 0.0001 m/s, signed."""
    return Stiction(jnp.asarray([100.0, 50.0]) * level, jnp.asarray(1e-4), jnp.asarray(0.2), signed=True)
