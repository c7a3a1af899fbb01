"""What happens between the commanded torque and the joint."""

from typing import ClassVar

from jaxidl.effects.base import Effect, Parameter
from jaxidl.types import Joints


class ConstantOffset(Effect):
    """A torque bias on each joint, whatever the motion."""

    offset: Joints  # (J,) [N or Nm]

    name: ClassVar[str] = "constant_offset"
    sentence: ClassVar[str] = "a constant torque that is always there"
    parameters: ClassVar = {"offset": Parameter("N", -1e4, 1e4, "the torque bias")}
    linear: ClassVar[bool] = True

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return self.offset
