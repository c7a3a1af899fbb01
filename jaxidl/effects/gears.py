"""Friction of gears: under load, when cold, and where one motor drives two joints."""

from typing import Any, ClassVar

import jax.numpy as jnp
from flax import struct
from jaxtyping import Array

from jaxidl.effects.base import Effect
from jaxidl.effects.dry import SPEEDS
from jaxidl.effects.spec import Parameter, Scale, Variant
from jaxidl.effects.varying import MOST_OF_LOAD, POSTURES
from jaxidl.types import Joints, Scalar


class DirectionalLoadFriction(Effect):
    """−μ·|tau|·sign(qd) with different μ for driving and for being driven.

    One holds where the motor drives the joint, the other where the joint drives the motor; tau is
    the torque that passes the gear (:mod:`jaxidl.effects.load`).
    """

    driving: Joints  # (J,) μ where torque and motion have the same sign [1]
    driven: Joints  # (J,) μ where they are opposed [1]

    name: ClassVar[str] = "directional_load_friction"
    sentence: ClassVar[str] = "friction under load that differs between driving and being driven"
    parameters: ClassVar = {
        "driving": Parameter(
            "1", 0.0, 0.99, "friction over transmitted torque where the motor drives"
        ),
        "driven": Parameter(
            "1", 0.0, 0.99, "friction over transmitted torque where the motor is driven"
        ),
    }
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = POSTURES

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        return jnp.where(tau * direction > 0.0, self.driving, self.driven) * jnp.abs(tau)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        return [
            Variant({}, tuple(cls.parameters), dict.fromkeys(cls.parameters, (0.0, MOST_OF_LOAD)))
        ]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        return ("load_dependent_friction",)


class ThermalFriction(Effect):
    """−(w + x·exp(−t/T))·qd: viscous friction that falls as the grease warms up.

    t is the time since the start.
    """

    warm: Joints  # (J,) w, when warm [N s/m or Nm s/rad]
    excess: Joints  # (J,) x, in addition when cold [N s/m or Nm s/rad]
    time_constant: Joints  # (J,) T [s]

    name: ClassVar[str] = "thermal_friction"
    sentence: ClassVar[str] = "friction that falls while the joint warms up"
    parameters: ClassVar = {
        "warm": Parameter("N s/m", 0.0, 1e7, "torque per speed when warm"),
        "excess": Parameter("N s/m", 0.0, 1e7, "additional torque per speed when cold"),
        "time_constant": Parameter("s", 1e-2, 1e6, "the time in which this addition mostly fades"),
    }
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = (
        "record the same motion with the joint cold, and again after it has moved for ten minutes"
    )

    def start(self, q: Joints) -> Joints:
        return jnp.zeros_like(q)

    def actuate(
        self, memory: Joints, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Joints]:
        """Return the torque less the additional friction when cold, and the new hidden state.

        The hidden state is the time since the start (J,) [s].
        """
        return tau - self.excess * jnp.exp(-memory / self.time_constant) * qd, memory + dt

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -self.warm * qd

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with time constants from a few seconds to a few minutes.

        A log is rarely longer, and anything faster is not thermal.
        """
        within = {"time_constant": (2.0, 600.0)}
        return [
            Variant({"time_constant": time}, ("warm", "excess"), within)
            for time in (5.0, 15.0, 45.0, 150.0)
        ]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        return ("viscous_friction",)


class SublinearFriction(Effect):
    """a·(6s² − 6s + 1)·sign(qd), s = |qd|/v: how friction bends away from a straight line.

    For a > 0 it makes friction smaller at either end of the line and larger in its middle. Friction
    that grows less than in proportion to speed is dry and viscous friction, the line that
    conventional identification fits over speeds up to v, plus this term, which is orthogonal to
    both (a Legendre polynomial). So their values stay the same as without it. Beyond v it stays
    constant.
    """

    bend: Joints  # (J,) a [N or Nm]
    speed: Joints  # (J,) v [m/s or rad/s]

    name: ClassVar[str] = "sublinear_friction"
    sentence: ClassVar[str] = "friction that grows less than in proportion to speed"
    parameters: ClassVar = {
        "bend": Parameter(
            "N", 0.0, 1e5, "by how much friction at rest and at full speed falls short of the line"
        ),
        "speed": Parameter("m/s", 1e-6, 1e3, "the full speed"),
    }
    fixed: ClassVar[tuple[str, ...]] = ("speed",)
    prior: ClassVar[float] = 0.3
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = SPEEDS

    def dry(self, q: Joints, qd: Joints, tau: Joints, direction: Joints) -> Joints:
        s = jnp.minimum(jnp.abs(qd) / self.speed, 1.0)
        return -self.bend * (6.0 * s * (s - 1.0) + 1.0)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return one variant over the speeds of the log."""
        return [Variant({"speed": scale.speed}, ("bend",))]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return drag that bends the other way: beside it, viscous friction would be its sum."""
        return ("quadratic_drag",)


class CoupledJointFriction(Effect):
    """Friction on the sum or the difference w of the speeds of two joints.

    It is −b·w − c·tanh(w/v) on both joints, ``joint`` and ``other``.
    """

    coefficient: Scalar  # b [N s/m or Nm s/rad]
    level: Scalar  # c [N or Nm]
    speed: Scalar  # v, over which dry friction reverses [m/s or rad/s]
    joint: int = struct.field(pytree_node=False, default=0)
    other: int = struct.field(pytree_node=False, default=1)
    difference: bool = struct.field(pytree_node=False, default=False)

    name: ClassVar[str] = "coupled_joint_friction"
    sentence: ClassVar[str] = (
        "friction on the sum or difference of the speeds of two joints, as in a wrist"
    )
    parameters: ClassVar = {
        "coefficient": Parameter("N s/m", 0.0, 1e7, "torque per speed"),
        "level": Parameter("N", 0.0, 1e5, "the level of dry friction"),
        "speed": Parameter("m/s", 1e-9, 1e3, "the speed over which dry friction reverses"),
    }
    fixed: ClassVar[tuple[str, ...]] = ("speed",)
    prior: ClassVar[float] = 0.02
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = (
        "move the two joints together and against each other, and each with the other at rest, at"
        " the same speeds"
    )

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        sign = -1.0 if self.difference else 1.0
        speed = qd[self.joint] + sign * qd[self.other]
        torque = -self.coefficient * speed - self.level * jnp.tanh(speed / self.speed)
        return jnp.zeros_like(qd).at[self.joint].set(torque).at[self.other].set(sign * torque)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with the next joint, if both move together.

        The gears of a wrist connect neighbours.
        """
        values = {"speed": max(scale.rest_speed, 0.003 * scale.speed, 1e-6)}
        options = [
            {"joint": scale.joint, "other": o, "difference": d}
            for o in scale.neighbours()
            for d in (False, True)
            if o > scale.joint
        ]
        return [
            Variant(values, free, options=o)
            for o in options
            for free in (("coefficient",), ("coefficient", "level"))
        ]


class MotorCoupling(Effect):
    """The motor of joint ``joint`` also drives joint ``other``, by a share of its torque."""

    share: Scalar  # [1]
    joint: int = struct.field(pytree_node=False, default=0)
    other: int = struct.field(pytree_node=False, default=1)

    name: ClassVar[str] = "motor_coupling"
    sentence: ClassVar[str] = "the motor of one joint also turns another one"
    parameters: ClassVar = {
        "share": Parameter("1", -10.0, 10.0, "torque on the other joint over the motor's own")
    }
    prior: ClassVar[float] = 0.02
    advice: ClassVar[str] = (
        "command one motor alone with the other joint free, and see whether that joint moves"
    )

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        passed: Array = self.share * tau[self.joint]
        return tau.at[self.other].add(passed), memory

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants between neighbouring joints, in either direction."""
        return [
            Variant({}, ("share",), {"share": (-1.5, 1.5)}, {"joint": scale.joint, "other": o})
            for o in scale.neighbours()
        ]
