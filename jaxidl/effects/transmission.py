"""Transmissions between motor and link, with a motor-side state hidden from the joint's encoder.

The motor carries ``motor_inertia``, a part of the joint's inertia; the link keeps the rest. In one
step the motor moves under the command and the transmission's torque in ``SUBSTEPS`` small steps,
the link's velocity taken as constant, and the link receives the transmission's mean torque.
"""

from abc import abstractmethod
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.effects.base import Effect
from jaxidl.effects.delay import LATE
from jaxidl.effects.spec import Guess, Parameter, Scale, Variant
from jaxidl.types import Joints, Scalar

SUBSTEPS = 4
MOST_TWIST = 0.1  # share of the joint's range: no drive is softer
# softest transmission searched for: frequency of the motor with the link held still [Hz]
SOFTEST = 3.0
MOTOR = (0.04, 0.8)  # the motor's share of the joint's inertia

_MOTOR = Parameter("kg", 1e-9, 1e7, "the inertia on the motor's side")


class Transmission(Effect):
    """Base of all transmissions: the motor's inertia is taken off the link.

    Its twist and speed are hidden state.
    """

    prior: ClassVar[float] = 0.02
    advice: ClassVar[str] = LATE

    @abstractmethod
    def transmitted(self, twist: Joints, rate: Joints) -> Joints:
        """Return the transmitted torque (J,) at a ``twist`` (J,) of motor against link.

        ``rate`` (J,) is the twist's rate.
        """

    def alter(self, body: Any) -> Any:
        return body.add_inertia(-self._inertia)

    def start(self, q: Joints) -> Any:
        return jnp.zeros_like(q), jnp.zeros_like(q)

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        """Return the mean transmitted torque (J,) over a step and the new hidden state.

        The state is the twist (J,) and the motor's speed (J,).
        """

        def small(state: Any, _: None) -> tuple[Any, Joints]:
            twist, speed = state
            torque = self.transmitted(twist, speed - qd)
            speed = speed + dt / SUBSTEPS * (tau - torque) / self._inertia
            return (twist + dt / SUBSTEPS * (speed - qd), speed), torque

        memory, torques = jax.lax.scan(small, memory, None, length=SUBSTEPS, unroll=True)
        return jnp.mean(torques, axis=0), memory

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with a motor that carries a part of the joint's inertia."""

        motor = (MOTOR[0] * scale.inertia, MOTOR[1] * scale.inertia)
        softest = max(
            (2.0 * np.pi * SOFTEST) ** 2 * motor[0], scale.torque / (MOST_TWIST * scale.width)
        )

        def variant(guess: Guess) -> Variant:
            begin = dict(guess) | {"stiffness": max(float(guess["stiffness"]), softest)}
            return Variant(
                begin,
                within={
                    "motor_inertia": motor,
                    "stiffness": (softest, cls.parameters["stiffness"].upper),
                },
            )

        return [variant(guess) for guess in cls.guesses(scale)]

    @property
    def _inertia(self) -> Joints:
        return getattr(self, "motor_inertia")  # noqa: B009 - a field of the subclasses, behind their others


class JointElasticity(Transmission):
    """Motor and link are joined by a spring and a damper: k·twist + d·(twist's rate)."""

    stiffness: Joints  # (J,) k [N/m or Nm/rad]
    damping: Joints  # (J,) d [N s/m or Nm s/rad]
    motor_inertia: Joints  # (J,) [kg or kg m^2]

    name: ClassVar[str] = "joint_elasticity"
    sentence: ClassVar[str] = "motor and link are joined by a spring and swing against each other"
    parameters: ClassVar = {
        "stiffness": Parameter("N/m", 1e-6, 1e9, "the transmission's stiffness"),
        "damping": Parameter("N s/m", 0.0, 1e6, "the transmission's damping"),
        "motor_inertia": _MOTOR,
    }

    def transmitted(self, twist: Joints, rate: Joints) -> Joints:
        return self.stiffness * twist + self.damping * rate

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        def guess(share: float, hertz: float, ratio: float) -> Guess:
            # of the motor with the link held still
            inertia, omega = share * scale.inertia, 2.0 * np.pi * hertz
            return {
                "stiffness": omega**2 * inertia,
                "damping": 2.0 * ratio * omega * inertia,
                "motor_inertia": inertia,
            }

        top = min(1.5 * scale.band, 0.2 / scale.dt)
        tones = [hertz for hertz in (5.0, 9.0, 16.0, 28.0, 50.0, 90.0) if hertz < top]
        return [guess(share, f, 0.15) for share in (0.1, 0.25, 0.6) for f in tones]


class Backlash(Transmission):
    """A dead zone of width ``gap`` between motor and link; beyond it a stiff, damped contact."""

    gap: Joints  # (J,) total play [m or rad]
    stiffness: Joints  # (J,) of the contact [N/m or Nm/rad]
    damping: Joints  # (J,) of the contact [N s/m or Nm s/rad]
    motor_inertia: Joints  # (J,) [kg or kg m^2]

    name: ClassVar[str] = "backlash"
    jumps: ClassVar[bool] = True
    sentence: ClassVar[str] = "there is play between motor and link"
    parameters: ClassVar = {
        "gap": Parameter("m", 0.0, 10.0, "the total play"),
        "stiffness": Parameter("N/m", 1e-6, 1e9, "the contact's stiffness"),
        "damping": Parameter("N s/m", 0.0, 1e6, "the contact's damping"),
        "motor_inertia": _MOTOR,
    }

    def transmitted(self, twist: Joints, rate: Joints) -> Joints:
        pressed = twist - jnp.clip(twist, -self.gap / 2, self.gap / 2)
        return self.stiffness * pressed + jnp.where(pressed == 0.0, 0.0, self.damping * rate)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        width = scale.upper - scale.lower

        def guess(share: float, gap: float, hertz: float) -> Guess:
            inertia, omega = share * scale.inertia, 2.0 * np.pi * hertz
            stiffness = omega**2 * inertia
            return {
                "gap": gap * width,
                "stiffness": stiffness,
                "damping": 0.6 * omega * inertia,
                "motor_inertia": inertia,
            }

        top = 0.25 / scale.dt
        tones = [min(share * scale.band, top) for share in (0.6, 2.0)]
        gaps = (0.0007, 0.0017, 0.004, 0.009, 0.02)
        return [guess(share, gap, f) for share in (0.1, 0.35) for gap in gaps for f in tones]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        return ("joint_elasticity",)
