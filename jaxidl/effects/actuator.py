"""What happens between the commanded torque and the joint."""

from typing import ClassVar

import jax.numpy as jnp

from jaxidl.effects.base import Effect, Parameter
from jaxidl.types import Joints


class ActuatorLag(Effect):
    """The delivered torque x follows the command with a first-order lag: T·ẋ = tau − x, exact for a command held over a step."""

    time_constant: Joints  # (J,) T [s]

    name: ClassVar[str] = "actuator_lag"
    sentence: ClassVar[str] = "the motor follows its command with a lag"
    parameters: ClassVar = {"time_constant": Parameter("s", 1e-6, 10.0, "the time constant")}

    def start(self, q: Joints) -> Joints:
        return jnp.zeros_like(q)

    def actuate(self, memory: Joints, q: Joints, qd: Joints, tau: Joints, dt: float) -> tuple[Joints, Joints]:
        delivered = tau + (memory - tau) * jnp.exp(-dt / self.time_constant)
        return delivered, delivered


class ConstantOffset(Effect):
    """A torque bias on each joint, whatever the motion."""

    offset: Joints  # (J,) [N or Nm]

    name: ClassVar[str] = "constant_offset"
    sentence: ClassVar[str] = "a constant torque that is always there"
    parameters: ClassVar = {"offset": Parameter("N", -1e4, 1e4, "the torque bias")}
    linear: ClassVar[bool] = True

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return self.offset
