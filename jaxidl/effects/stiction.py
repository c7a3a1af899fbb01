"""Static friction: a joint at rest stays at rest until the torque breaks it away."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Array

from jaxidl.effects.base import Effect
from jaxidl.effects.dry import SPEEDS
from jaxidl.effects.smooth import Share, choose, inside
from jaxidl.effects.spec import Guess, Parameter, Scale, Variant
from jaxidl.types import JointMask, Joints, Scalar

BORDERS = (0.25, 0.5, 0.75)  # shares of the range of positions below which alone a joint may stick


class Stiction(Effect):
    """A resting joint withstands the breakaway torque before it moves.

    This is in addition to what other dry friction holds. A joint rests where |qd| < ``speed``; the
    effect acts below position ``below`` only. Both borders are strict. With ``signed`` it behaves
    as the paper's program: a resting joint does not accelerate (its speed stays what it was) while
    the delivered torque itself, not its magnitude, is below the breakaway torque, so that it is
    held against every negative torque, and the program's results depend on it.

    Whether a joint sticks is a yes or no, so breakaway torque, resting speed and position below
    have derivative zero in the signed form, and so has the time at which a joint breaks away: a
    controller's gain that would free a joint seems to have no effect. With ``width`` > 0 each
    border is a logistic over that share of its own size (of 1 where it is 0), and a joint that
    sticks to a share s keeps 1 − s of its acceleration, or withstands s of the breakaway torque. At
    rest it then creeps at exp(−1/width) of its acceleration: widths of 0.02 to 0.1 are suitable.
    Values converge to the sharp ones as the width goes to 0.
    """

    breakaway: Joints  # (J,) torque that sets a resting joint moving [N or Nm]
    speed: Joints | Scalar  # (J,) or (): a joint rests below this speed [m/s or rad/s]
    below: Joints | Scalar  # (J,) or (): a joint sticks below this position [m]
    signed: bool = struct.field(pytree_node=False, default=False)
    # width of the borders as a share of each [-]; 0: sharp
    width: float = struct.field(pytree_node=False, default=0.0)

    name: ClassVar[str] = "stiction"
    sentence: ClassVar[str] = "a joint at rest sticks until the torque exceeds a breakaway value"
    fixed: ClassVar[tuple[str, ...]] = ("speed", "below")
    parameters: ClassVar = {
        "breakaway": Parameter("N", 0.0, 1e5, "the breakaway torque"),
        "speed": Parameter("m/s", 0.0, 1.0, "the resting speed"),
        "below": Parameter(
            "m", -float("inf"), float("inf"), "the position below which the joint sticks"
        ),
    }
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = SPEEDS

    def _sticks(self, q: Joints, qd: Joints, *beyond: tuple[Joints | Scalar, Joints]) -> Share:
        """Return whether each value is below its border.

        These are speed, position, and those given as (border, value).
        """
        pairs = ((self.speed, jnp.abs(qd)), (self.below, q), *beyond)
        return inside(
            self.width,
            *(
                (border - value) / (1.0 if self.width == 0.0 else _size(border))
                for border, value in pairs
            ),
        )

    def grips(self) -> bool:
        return not self.signed

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        if self.signed:
            return jnp.zeros_like(qd)
        return choose(self._sticks(q, qd), self.breakaway, 0.0)

    def holds(self, q: Joints, qd: Joints, tau: Joints) -> JointMask | Joints:
        if not self.signed:
            return jnp.zeros(qd.shape, bool)
        return self._sticks(q, qd, (self.breakaway, tau))

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"breakaway": scale.residual, "speed": 1e-9 * scale.speed, "below": np.inf}]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants that stick everywhere, or below one of a few positions only."""
        borders = [np.inf, *(scale.lower + share * scale.width for share in BORDERS)]
        return [
            Variant({"speed": 1e-9 * scale.speed, "below": border}, ("breakaway",))
            for border in borders
        ]


def _size(border: Joints | Scalar) -> Array:
    """Return the unit of a border's width: its own size, or 1 where that is zero or infinite."""
    size = jnp.abs(jnp.asarray(border))
    return jnp.where((size > 0.0) & (size < jnp.inf), size, 1.0)
