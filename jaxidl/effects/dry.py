"""Dry friction: a level up to which motion is opposed, and a resting joint kept at rest.

An effect here gives its level only; the plant applies the levels of all its effects together, as an
impulse over the step that takes the velocity towards zero and never through it. So a joint sticks
where friction can hold it, without a smoothing width and without chattering, and a derivative
through a step is that of the branch taken: a sliding joint feels the level, a stuck one does not.
"""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Guess, Parameter, Scale, Variant
from jaxidl.types import Joints

FADED = 0.3  # share of the top speed by which a Stribeck curve has mostly faded
SPEEDS = (
    "move at several constant speeds from creeping to fast, in both directions, with reversals and"
    " rests in between, and measure the torque that just starts the joint"
)
"""How to tell kinds of friction apart."""


class CoulombFriction(Effect):
    """−c·sign(qd)."""

    level: Joints  # (J,) c [N or Nm]

    name: ClassVar[str] = "coulomb_friction"
    sentence: ClassVar[str] = "dry friction of the same size at every speed"
    parameters: ClassVar = {"level": Parameter("N", 0.0, 1e5, "the level of dry friction")}
    linear: ClassVar[bool] = True
    mjcf: ClassVar = {"level": "joint/frictionloss"}
    changes: ClassVar[float] = 0.05
    prior: ClassVar[float] = 0.5
    common: ClassVar[bool] = True
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = SPEEDS

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        return self.level + jnp.zeros_like(qd)

    def write_mjcf(self, numbers: Any) -> str | None:
        numbers.frictionloss += np.asarray(self.level)
        return "joint/frictionloss"

    @classmethod
    def read_mjcf(cls, numbers: Any) -> "CoulombFriction | None":
        return cls(jnp.asarray(numbers.frictionloss)) if np.any(numbers.frictionloss) else None


class AsymmetricFriction(Effect):
    """Dry and viscous friction that differ by direction.

    They are −(c₊ + b₊·qd) for qd > 0 and c₋ − b₋·qd for qd < 0. A pure difference in dry friction
    gives the same motion as Coulomb friction of the mean level with a constant offset. Beside other
    friction on the same joint the values may be negative: then one direction has less friction than
    the other friction alone would give.
    """

    _DRY: ClassVar = ("positive", "negative")
    _VISCOUS: ClassVar = ("viscous_positive", "viscous_negative")

    positive: Joints  # (J,) c₊ [N or Nm]
    negative: Joints  # (J,) c₋ [N or Nm]
    viscous_positive: Joints  # (J,) b₊ [N s/m or Nm s/rad]
    viscous_negative: Joints  # (J,) b₋ [N s/m or Nm s/rad]

    name: ClassVar[str] = "asymmetric_friction"
    sentence: ClassVar[str] = "friction that differs between the two directions"
    parameters: ClassVar = {
        "positive": Parameter("N", -1e5, 1e5, "dry friction in the positive direction"),
        "negative": Parameter("N", -1e5, 1e5, "dry friction in the negative direction"),
        "viscous_positive": Parameter(
            "N s/m", -1e7, 1e7, "torque per speed in the positive direction"
        ),
        "viscous_negative": Parameter(
            "N s/m", -1e7, 1e7, "torque per speed in the negative direction"
        ),
    }
    linear: ClassVar[bool] = True
    prior: ClassVar[float] = 0.1
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = SPEEDS

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        return jnp.where(direction > 0.0, self.positive, self.negative)

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -jnp.where(qd > 0.0, self.viscous_positive, self.viscous_negative) * qd

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with dry friction, viscous friction or both by direction."""
        return [Variant({}, free) for free in (cls._DRY, cls._VISCOUS, cls._DRY + cls._VISCOUS)]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return the effects that are the means of both directions.

        For dry friction also their difference, which is an offset.
        """
        dry = ("coulomb_friction", "constant_offset") if set(free) & set(cls._DRY) else ()
        return dry + (("viscous_friction",) if set(free) & set(cls._VISCOUS) else ())


class StribeckFriction(Effect):
    """−(c + a·exp(−(qd/v)²))·sign(qd): dry friction with an excess a at low speed."""

    level: Joints  # (J,) c, at high speed [N or Nm]
    excess: Joints  # (J,) a, above it when starting [N or Nm]
    speed: Joints  # (J,) v, at which the excess has mostly faded [m/s or rad/s]

    name: ClassVar[str] = "stribeck_friction"
    sentence: ClassVar[str] = "dry friction that is larger at low speed"
    parameters: ClassVar = {
        "level": Parameter("N", 0.0, 1e5, "the level at high speed"),
        "excess": Parameter("N", 0.0, 1e5, "the excess at low speed"),
        "speed": Parameter("m/s", 1e-6, 1e3, "the speed at which the excess fades"),
    }
    prior: ClassVar[float] = 0.15
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = SPEEDS

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        return self.level + self.excess * jnp.exp(-((qd / self.speed) ** 2))

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        size = scale.residual
        return [
            {"level": size, "excess": size, "speed": share * scale.speed}
            for share in (0.02, 0.05, 0.1, 0.2, 0.4)
        ]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants whose excess fades over plausible speeds.

        An excess at speeds too low to be seen as motion would be stiction; one that fades over most
        speeds bends the whole curve.
        """
        within = {
            "speed": (3.0 * scale.rest_speed, max(FADED * scale.speed, 6.0 * scale.rest_speed))
        }
        speeds = [
            v
            for share in (0.02, 0.05, 0.1, 0.2)
            if (v := share * scale.speed) >= within["speed"][0]
        ]
        return [
            Variant({"speed": v}, ("level", "excess"), within)
            for v in speeds or [within["speed"][0]]
        ]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        return ("coulomb_friction",)
