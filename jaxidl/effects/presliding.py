"""Friction that builds up over a distance: seals, hoses and gears give way before they slide."""

from typing import ClassVar

import jax.numpy as jnp

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Parameter, Scale, Variant
from jaxidl.types import Joints, Scalar

SHARES = (0.005, 0.02, 0.06, 0.15)  # of the joint's range: distances that a search begins with
SHORTEST, LONGEST = (
    1e-3,
    0.5,
)  # of the range: what is shorter is dry friction, what is longer a spring


class PreslidingFriction(Effect):
    """−F·z, where z runs to ±1 over a distance d: dz/dt = (qd − |qd|·z)/d.

    This is Dahl's model (1968). After each reversal it is a spring of stiffness F/d, later dry
    friction of level F. Dry friction that acts at once is beside it, if a joint has both.
    """

    level: Joints  # (J,) F [N or Nm]
    distance: Joints  # (J,) d [m or rad]

    name: ClassVar[str] = "presliding_friction"
    sentence: ClassVar[str] = "dry friction that builds up over a distance after each reversal"
    parameters: ClassVar = {
        "level": Parameter("N", 0.0, 1e5, "the friction of a joint that slides"),
        "distance": Parameter("m", 1e-9, 1e3, "the distance after which it mostly slides"),
    }
    advice: ClassVar[str] = (
        "reverse often, after short ways and after long ones, slowly, at several places of the"
        " range"
    )

    def start(self, q: Joints) -> Joints:
        return jnp.zeros_like(q)

    def actuate(
        self, memory: Joints, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Joints]:
        """Return the torque that this friction leaves, on average over a step, and the new z."""
        way = jnp.abs(qd) * dt / self.distance
        # (1 − exp(−way)) / way: the speed is constant over a step
        share = jnp.where(way > 0.0, -jnp.expm1(-way) / jnp.where(way > 0.0, way, 1.0), 1.0)
        after = memory + share * (qd - jnp.abs(qd) * memory) * dt / self.distance
        return tau - self.level * 0.5 * (memory + after), after

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with distances from a small part of the range to a large one."""
        within = {"distance": (SHORTEST * scale.width, LONGEST * scale.width)}
        return [Variant({"distance": share * scale.width}, ("level",), within) for share in SHARES]
