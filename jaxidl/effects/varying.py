"""Friction that depends on the mechanism's position or on its load."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Array, Float

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Guess, Parameter, Scale, Variant
from jaxidl.types import Joints, Scalar

ByPosition = Float[Array, "*J K"]  # a value at each of K evenly spaced positions

_ENDS = {
    "lower": Parameter("m", -1e4, 1e4, "the position of the table's first value"),
    "upper": Parameter("m", -1e4, 1e4, "the position of the table's last value"),
}


KNOTS = (6, 12)  # knots of the tables that a search tries
# largest share of the transmitted torque that friction takes: with all of it, friction would
# "explain" any command
MOST_OF_LOAD = 0.6

POSTURES = (
    "run the same speeds through the whole range of every joint, in both directions, with the other"
    " joints in several postures, and once with a load"
)
"""How to tell kinds of varying friction apart."""


def table_value(table: ByPosition, lower: Scalar, upper: Scalar, q: Scalar) -> Float[Array, ""]:
    """Return the table (K,) at ``q``.

    It is linear between its evenly spaced positions and constant beyond the ends.
    """
    return interp_evenly(q, jnp.linspace(lower, upper, table.shape[-1]), table)


@jax.jit
def interp_evenly(
    q: Scalar, at: Float[Array, " K"], values: Float[Array, " K"]
) -> Float[Array, ""]:
    """Return ``jnp.interp(q, at, values)`` for evenly spaced positions.

    Nothing is searched for, so it compiles in a fraction of the time.
    """
    last, width = len(values) - 1.0, at[-1] - at[0]
    place = jnp.clip((q - at[0]) / jnp.where(width > 0.0, width, 1.0) * last, 0.0, last)
    return jnp.maximum(1.0 - jnp.abs(place - jnp.arange(len(values))), 0.0) @ values


class PositionDependentFriction(Effect):
    """−c(q)·sign(qd) − b(q)·qd with c and b tables over position.

    A negative b feeds motion, a negative c counts as zero.
    """

    level: ByPosition  # (J, K) c [N or Nm]
    coefficient: ByPosition  # (J, K) b [N s/m or Nm s/rad]
    lower: Joints  # (J,) [m or rad]
    upper: Joints  # (J,) [m or rad]

    name: ClassVar[str] = "position_dependent_friction"
    sentence: ClassVar[str] = "friction that varies with position"
    fixed: ClassVar[tuple[str, ...]] = ("lower", "upper")
    parameters: ClassVar = {
        "level": Parameter("N", -1e5, 1e5, "dry friction at the table's positions"),
        "coefficient": Parameter("N s/m", -1e7, 1e7, "torque per speed at the table's positions"),
        **_ENDS,
    }
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = POSTURES

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        return jax.vmap(table_value)(self.level, self.lower, self.upper, q)

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -jax.vmap(table_value)(self.coefficient, self.lower, self.upper, q) * qd

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"level": 0.0, "coefficient": 0.0, "lower": scale.lower, "upper": scale.upper}]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return dry or viscous friction with few or many knots.

        The knots span the range that the joint covers.
        """

        def values(knots: int) -> Guess:
            table = np.zeros((1, knots))
            return {
                "level": table,
                "coefficient": table,
                "lower": scale.lower,
                "upper": scale.upper,
            }

        return [
            Variant(values(knots), (free,)) for free in ("level", "coefficient") for knots in KNOTS
        ]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        parts = {"level": "coulomb_friction", "coefficient": "viscous_friction"}
        return tuple(parts[name] for name in free if name in parts)


class CoupledFriction(Effect):
    """Friction of one joint that varies with the position of another.

    It is −c(q_o)·sign(qd_j) − b(q_o)·qd_j with j the joint ``joint`` and o the joint ``other``.
    """

    level: ByPosition  # (K,) c [N or Nm]
    coefficient: ByPosition  # (K,) b [N s/m or Nm s/rad]
    lower: Scalar  # [m or rad]
    upper: Scalar  # [m or rad]
    joint: int = struct.field(pytree_node=False, default=0)
    other: int = struct.field(pytree_node=False, default=1)

    name: ClassVar[str] = "coupled_friction"
    sentence: ClassVar[str] = "friction that varies with another joint's position"
    fixed: ClassVar[tuple[str, ...]] = ("lower", "upper")
    parameters: ClassVar = PositionDependentFriction.parameters
    prior: ClassVar[float] = 0.02
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = POSTURES

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        level = table_value(self.level, self.lower, self.upper, q[self.other])
        return jnp.zeros_like(qd).at[self.joint].set(level)

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        coefficient = table_value(self.coefficient, self.lower, self.upper, q[self.other])
        return jnp.zeros_like(qd).at[self.joint].set(-coefficient * qd[self.joint])

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        """Return starting values.

        ``scale`` must be that of the joint whose position matters.
        """
        return PositionDependentFriction.guesses(scale)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return dry or viscous friction over the position of each other joint that moves."""

        def variant(free: str, knots: int, other: int, low: float, high: float) -> Variant:
            table = np.zeros(knots)
            values = {"level": table, "coefficient": table, "lower": low, "upper": high}
            return Variant(values, (free,), options={"joint": scale.joint, "other": other})

        return [
            variant(free, knots, *o)
            for o in scale.others()
            for free in ("level", "coefficient")
            for knots in KNOTS
        ]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        return PositionDependentFriction.contains(free)


class LoadDependentFriction(Effect):
    """−μ·|tau|·sign(qd): gears and screws under load.

    tau is the torque that passes the gear (:mod:`jaxidl.effects.load`).
    """

    coefficient: Joints  # (J,) μ [1]

    name: ClassVar[str] = "load_dependent_friction"
    sentence: ClassVar[str] = "dry friction in proportion to the transmitted torque"
    parameters: ClassVar = {
        "coefficient": Parameter("1", 0.0, 0.99, "friction over transmitted torque")
    }
    linear: ClassVar[bool] = True
    changes: ClassVar[float] = 0.05
    prior: ClassVar[float] = 0.15
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = POSTURES

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        return self.coefficient * jnp.abs(tau)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        return [Variant({}, ("coefficient",), {"coefficient": (0.0, MOST_OF_LOAD)})]
