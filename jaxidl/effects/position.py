"""Torques that depend on position alone."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Guess, Parameter, Scale, Variant
from jaxidl.types import Joints

Waves = Float[Array, " J"] | Float[Array, "J H"]

ROUNDING = 1e-6  # share of a spring that stays where all of it is taken away
LEAST_WAVES = 1.5  # fewest periods within the range of positions that a search looks for

HOLDING = (
    "hold still at many positions over the whole range, in several postures: offset, spring,"
    " ripple, encoder bias and load differ in how the holding torque changes with position"
)
"""How to tell torques that depend on position apart."""


class Spring(Effect):
    """−k·(q − rest): a spring, a cable or a hose parallel to the joint."""

    stiffness: Joints  # (J,) k [N/m or Nm/rad]
    rest: Joints  # (J,) [m or rad]

    name: ClassVar[str] = "spring"
    sentence: ClassVar[str] = "a spring that pulls towards a rest position"
    parameters: ClassVar = {
        "stiffness": Parameter("N/m", 0.0, 1e6, "torque per displacement"),
        "rest": Parameter("m", -1e4, 1e4, "the position where it does not pull"),
    }
    mjcf: ClassVar = {"stiffness": "joint/stiffness", "rest": "joint/springref"}
    advice: ClassVar[str] = HOLDING

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -self.stiffness * (q - self.rest)

    def plus(self, other: Any) -> "Spring":
        """Return both springs as one. Where one takes the other away, none is left."""
        mine, stiffness = self.stiffness, self.stiffness + other.stiffness
        gone = jnp.abs(stiffness) < ROUNDING * jnp.abs(mine)
        stiffness = jnp.where(gone, 0.0, stiffness)
        pull = mine * self.rest + other.stiffness * other.rest
        none = stiffness == 0.0
        rest = jnp.where(none, other.rest, pull / jnp.where(none, 1.0, stiffness))
        return self.replace(stiffness=stiffness, rest=rest)

    def write_mjcf(self, numbers: Any) -> str:
        """Add the spring to what the attributes have, and return their names."""
        both = self.plus(Spring(jnp.asarray(numbers.stiffness), jnp.asarray(numbers.springref)))
        numbers.stiffness[:], numbers.springref[:] = both.stiffness, both.rest
        return "joint/stiffness, joint/springref"

    @classmethod
    def read_mjcf(cls, numbers: Any) -> "Spring | None":
        return (
            cls(jnp.asarray(numbers.stiffness), jnp.asarray(numbers.springref))
            if np.any(numbers.stiffness)
            else None
        )

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        middle, width = (scale.lower + scale.upper) / 2, scale.upper - scale.lower
        return [{"stiffness": scale.residual / max(width, 1e-9), "rest": middle}]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return springs relaxed at the low end, in the middle or at the high end of the range.

        A preloaded one, such as a gas spring, is relaxed far outside; farther than ten ranges out,
        it looks like an offset.
        """
        within = {"rest": (scale.lower - 10.0 * scale.width, scale.upper + 10.0 * scale.width)}
        rests = (scale.lower, (scale.lower + scale.upper) / 2, scale.upper)
        return [Variant({"rest": rest}, ("stiffness",), within) for rest in rests]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return the constant offset: a different rest position is a constant torque."""
        return ("constant_offset",)


class TorqueRipple(Effect):
    """s·sin(2π·q/p) + c·cos(2π·q/p): cogging of a motor's poles, or a gear's teeth.

    With tables of amplitudes it has H harmonics: the sum over h = 1 … H of those for the period
    p/h.
    """

    sine: Waves  # (J,) or (J, H) s [N or Nm]
    cosine: Waves  # (J,) or (J, H) c [N or Nm]
    period: Joints  # (J,) p [m or rad]

    name: ClassVar[str] = "torque_ripple"
    sentence: ClassVar[str] = "a torque that repeats periodically with position"
    parameters: ClassVar = {
        "sine": Parameter("N", -1e5, 1e5, "the sine's amplitude"),
        "cosine": Parameter("N", -1e5, 1e5, "the cosine's amplitude"),
        "period": Parameter("m", 1e-6, 1e4, "the period"),
    }
    advice: ClassVar[str] = HOLDING

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        angle = 2.0 * jnp.pi * q / self.period
        if self.sine.ndim == 1:
            return self.sine * jnp.sin(angle) + self.cosine * jnp.cos(angle)
        angles = angle[:, None] * jnp.arange(1.0, self.sine.shape[1] + 1.0)[None, :]
        return jnp.sum(self.sine * jnp.sin(angles) + self.cosine * jnp.cos(angles), axis=1)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        # a period is passed slowly enough to be seen
        least = max(scale.width / 60.0, scale.speed / max(scale.band, 1e-9))
        waves = np.arange(1.5, max(scale.width / least, 2.0), 0.4)
        return [{"sine": 0.0, "cosine": 0.0, "period": scale.width / n} for n in waves]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with several periods within the range, some with two harmonics.

        A single period would not show that it repeats.
        """
        within = {"period": (0.0, scale.width / LEAST_WAVES)}
        periods = [
            p
            for guess in cls.guesses(scale)
            if (p := float(guess["period"])) <= within["period"][1]
        ]
        none = np.zeros((1, 2))
        two = [{"sine": none, "cosine": none, "period": period} for period in periods[::3]]
        return [
            Variant(values, ("sine", "cosine"), within)
            for values in [*({"period": p} for p in periods), *two]
        ]
