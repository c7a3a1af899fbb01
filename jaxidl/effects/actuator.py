"""What happens between the commanded torque and the joint."""

from typing import Any, ClassVar

import jax.numpy as jnp
from flax import struct

from jaxidl.effects.base import Effect, Guess, Parameter, Scale
from jaxidl.effects.delay import DELAYS, Line, late, line, push
from jaxidl.types import Joints


class ActuatorLag(Effect):
    """The delivered torque x follows the command with a first-order lag: T·ẋ = tau − x, exact for a command held over a step."""

    time_constant: Joints  # (J,) T [s]

    name: ClassVar[str] = "actuator_lag"
    sentence: ClassVar[str] = "the motor follows its command with a lag"
    parameters: ClassVar = {"time_constant": Parameter("s", 1e-6, 10.0, "the time constant")}
    mjcf: ClassVar = {"time_constant": "general/dynprm"}

    def start(self, q: Joints) -> Joints:
        return jnp.zeros_like(q)

    def actuate(self, memory: Joints, q: Joints, qd: Joints, tau: Joints, dt: float) -> tuple[Joints, Joints]:
        delivered = tau + (memory - tau) * jnp.exp(-dt / self.time_constant)
        return delivered, delivered

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"time_constant": x} for x in DELAYS]


class ActuatorDelay(Effect):
    """The delivered torque is the command of ``delay`` ago, by linear interpolation; at most ``steps`` steps."""

    delay: Joints  # (J,) [s]
    steps: int = struct.field(pytree_node=False, default=64)

    name: ClassVar[str] = "actuator_delay"
    sentence: ClassVar[str] = "the torque arrives late, after a dead time"
    parameters: ClassVar = {"delay": Parameter("s", 0.0, 1.0, "the dead time")}

    def start(self, q: Joints) -> Line:
        return line(jnp.zeros_like(q), self.steps)

    def actuate(self, memory: Line, q: Joints, qd: Joints, tau: Joints, dt: float) -> tuple[Joints, Line]:
        return late(tau, memory, self.delay / dt + jnp.zeros_like(q)), push(memory, tau)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"delay": x} for x in DELAYS]


class TorqueScale(Effect):
    """The motor delivers ``scale`` times its command: a motor constant or gear ratio that is not what one believes."""

    scale: Joints  # (J,) [1]

    name: ClassVar[str] = "torque_scale"
    sentence: ClassVar[str] = "the motor delivers another share of its command than believed"
    parameters: ClassVar = {"scale": Parameter("1", 0.05, 20.0, "delivered over commanded torque")}
    mjcf: ClassVar = {"scale": "general/gear"}

    def actuate(self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: float) -> tuple[Joints, Any]:
        return self.scale * tau, memory

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"scale": 1.0}]


class TorqueSaturation(Effect):
    """The motor delivers no more than ±limit, whatever it is told."""

    limit: Joints  # (J,) [N or Nm]

    name: ClassVar[str] = "torque_saturation"
    sentence: ClassVar[str] = "the motor cannot deliver more than a certain torque"
    parameters: ClassVar = {"limit": Parameter("N", 1e-6, 1e6, "the largest torque")}
    mjcf: ClassVar = {"limit": "general/forcerange"}

    def actuate(self, memory: Any, q: Joints, qd: Joints, tau: Joints, dt: float) -> tuple[Joints, Any]:
        return jnp.clip(tau, -self.limit, self.limit), memory

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"limit": share * scale.torque} for share in (0.9, 0.75, 0.6, 0.45, 0.3, 0.2)]


class ConstantOffset(Effect):
    """A torque bias on each joint, whatever the motion."""

    offset: Joints  # (J,) [N or Nm]

    name: ClassVar[str] = "constant_offset"
    sentence: ClassVar[str] = "a constant torque that is always there"
    parameters: ClassVar = {"offset": Parameter("N", -1e4, 1e4, "the torque bias")}
    linear: ClassVar[bool] = True

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return self.offset
