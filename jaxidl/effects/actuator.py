"""Effects between the commanded torque and the joint."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from jaxidl.effects.base import Effect
from jaxidl.effects.delay import DELAYS, LATE, LONGEST, Delay, Line, late, line, push
from jaxidl.effects.spec import Guess, Motor, Parameter, Scale, Variant
from jaxidl.types import History, Joints, Scalar

REACHED = 0.95  # share of the limit from which on a motor counts as saturated


class ActuatorLag(Effect):
    """The delivered torque x follows the command with a first-order lag: T·ẋ = tau − x.

    It is exact for a command held over a step.
    """

    time_constant: Joints  # (J,) T [s]

    name: ClassVar[str] = "actuator_lag"
    sentence: ClassVar[str] = "the motor follows its command with a lag"
    parameters: ClassVar = {"time_constant": Parameter("s", 1e-6, 10.0, "the time constant")}
    mjcf: ClassVar = {"time_constant": "general/dynprm"}
    prior: ClassVar[float] = 0.02
    advice: ClassVar[str] = LATE

    def start(self, q: Joints) -> Joints:
        return jnp.zeros_like(q)

    def actuate(
        self, memory: Joints, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Joints]:
        delivered = tau + (memory - tau) * jnp.exp(-dt / self.time_constant)
        return delivered, delivered

    def mjcf_motor(self, motor: Motor, joint: int = 0) -> Motor | None:
        """Return ``motor`` with this lag, or None: a motor has one lag, before its limit."""
        free = motor.lag == 0.0 and motor.force == np.inf
        return motor._replace(lag=float(self.time_constant[joint])) if free else None

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"time_constant": x} for x in DELAYS]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        return [
            Variant(guess, within={"time_constant": (scale.dt / 10.0, LONGEST)})
            for guess in cls.guesses(scale)
        ]


class ActuatorDelay(Delay):
    """The delivered torque is the command of ``delay`` ago, interpolated linearly.

    The delay is at most ``steps`` steps.
    """

    name: ClassVar[str] = "actuator_delay"
    sentence: ClassVar[str] = "the torque arrives late, after a dead time"
    parameters: ClassVar = {"delay": Parameter("s", 0.0, 1.0, "the dead time")}

    def start(self, q: Joints) -> Line:
        return line(jnp.zeros_like(q), self.steps)

    def actuate(
        self, memory: Line, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Line]:
        return late(tau, memory, self.delay / dt + jnp.zeros_like(q)), push(memory, tau)


class TorqueScale(Effect):
    """The motor delivers ``scale`` times its command.

    Its motor constant or gear ratio is not what the model assumes.
    """

    scale: Joints  # (J,) [1]

    name: ClassVar[str] = "torque_scale"
    sentence: ClassVar[str] = "the motor delivers a different share of its command than believed"
    parameters: ClassVar = {"scale": Parameter("1", 0.05, 20.0, "delivered over commanded torque")}
    neutral: ClassVar[float] = 1.0
    mjcf: ClassVar = {"scale": "general/gear"}
    prior: ClassVar[float] = 0.05
    advice: ClassVar[str] = (
        "repeat the motion with a known mass attached, or hold the joint still against gravity or a"
        " force gauge: a wrong torque scale shows at rest, a wrong inertia only under acceleration"
    )

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        return self.scale * tau, memory

    def mjcf_motor(self, motor: Motor, joint: int = 0) -> Motor | None:
        return motor._replace(gear=motor.gear * float(self.scale[joint]))

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"scale": 1.0}]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return one variant with a scale between 0.4 and 2.5.

        A motor constant may be off by a factor of two and a half; beyond that it is a different
        motor.
        """
        return [Variant({"scale": 1.25}, within={"scale": (0.4, 2.5)})]


class TorqueCurve(Effect):
    """The motor's iron saturates: it delivers tau·(1 − l·|tau|), but at least half the command."""

    loss: Joints  # (J,) l [1/N or 1/Nm]

    name: ClassVar[str] = "torque_curve"
    sentence: ClassVar[str] = (
        "the motor delivers a smaller share of large torques than of small ones"
    )
    parameters: ClassVar = {"loss": Parameter("1/N", 0.0, 1e3, "missing share per unit of torque")}
    neutral: ClassVar[float] = 0.0
    prior: ClassVar[float] = 0.02
    advice: ClassVar[str] = (
        "hold still against known weights from light to heavy, up to the largest command"
    )

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        return tau * (1.0 - jnp.minimum(self.loss * jnp.abs(tau), 0.5)), memory

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with a loss of up to three tenths at the root mean square torque.

        That is the torque which a motor can deliver continuously.
        """
        largest = 0.3 / max(scale.effort or scale.torque / 3.0, 1e-9)
        return [
            Variant({"loss": share * largest}, within={"loss": (0.0, largest)})
            for share in (0.1, 0.3, 0.6)
        ]


class TorqueSaturation(Effect):
    """The motor delivers no more than ±limit, whatever its command."""

    limit: Joints  # (J,) [N or Nm]

    name: ClassVar[str] = "torque_saturation"
    sentence: ClassVar[str] = "the motor cannot deliver more than a certain torque"
    parameters: ClassVar = {"limit": Parameter("N", 1e-6, 1e6, "the largest torque")}
    neutral: ClassVar[float] = float("inf")
    mjcf: ClassVar = {"limit": "general/forcerange"}
    prior: ClassVar[float] = 0.02
    advice: ClassVar[str] = (
        "command steps of torque that grow beyond the largest so far, and watch the acceleration"
        " stop growing"
    )

    def actuate(
        self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: Scalar
    ) -> tuple[Joints, Any]:
        return jnp.clip(tau, -self.limit, self.limit), memory

    def mjcf_motor(self, motor: Motor, joint: int = 0) -> Motor | None:
        return motor._replace(force=min(motor.force, float(self.limit[joint]) / motor.gear))

    def seen(self, logged: History, predicted: History) -> History:
        """Return the logged command where it exceeds the limit and the required torque reaches it.

        The required torque is the one ``predicted`` for the motion; it is returned everywhere else.
        There, clipping would explain any gap by shrinking the command.
        """
        limit = jnp.broadcast_to(self.limit, predicted.shape)
        reaches = (jnp.abs(predicted) >= REACHED * limit) & (predicted * logged > 0.0)
        return jnp.where(reaches & (jnp.abs(logged) > limit), logged, predicted)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        shares = [0.93, 0.85, 0.76, 0.68, 0.6, 0.53, 0.46, 0.4, 0.34, 0.28, 0.2]
        while 0.7 * shares[-1] * scale.torque > scale.typical > 0.0:  # commands far beyond a limit
            shares.append(0.7 * shares[-1])
        return [{"limit": share * scale.torque} for share in shares]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with a limit up to the largest command, and not far below the usual one.

        A motor that always delivers the same torque is no motor; one that never reaches its limit
        does not show it.
        """
        least = min(0.1 * scale.torque, 0.5 * (scale.typical or scale.torque))
        within = {"limit": (least, scale.torque)}
        return [Variant(guess, within=within) for guess in cls.guesses(scale)]


class ConstantOffset(Effect):
    """A torque bias on each joint, whatever the motion."""

    offset: Joints  # (J,) [N or Nm]

    name: ClassVar[str] = "constant_offset"
    sentence: ClassVar[str] = "a constant torque that is always there"
    parameters: ClassVar = {"offset": Parameter("N", -1e7, 1e7, "the torque bias")}
    linear: ClassVar[bool] = True
    changes: ClassVar[float] = 0.05
    prior: ClassVar[float] = 0.3
    common: ClassVar[bool] = True
    advice: ClassVar[str] = (
        "measure the torque that just starts the joint in each direction, with the motor's offset"
        " zeroed"
    )

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return self.offset
