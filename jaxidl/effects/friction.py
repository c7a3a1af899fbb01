"""Friction that grows with speed."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np

from jaxidl.effects.base import Effect
from jaxidl.effects.dry import SPEEDS
from jaxidl.effects.spec import Parameter
from jaxidl.types import Joints


class ViscousFriction(Effect):
    """−b·qd on each joint."""

    coefficient: Joints  # (J,) b [N s/m or Nm s/rad]

    name: ClassVar[str] = "viscous_friction"
    sentence: ClassVar[str] = "friction that grows in proportion to speed"
    parameters: ClassVar = {"coefficient": Parameter("N s/m", 0.0, 1e6, "torque per speed")}
    linear: ClassVar[bool] = True
    mjcf: ClassVar = {"coefficient": "joint/damping"}
    changes: ClassVar[float] = 0.05
    prior: ClassVar[float] = 0.5
    common: ClassVar[bool] = True
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = SPEEDS

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -self.coefficient * qd

    def write_mjcf(self, numbers: Any) -> str | None:
        numbers.damping += np.asarray(self.coefficient)
        return "joint/damping"

    @classmethod
    def read_mjcf(cls, numbers: Any) -> "ViscousFriction | None":
        return cls(jnp.asarray(numbers.damping)) if np.any(numbers.damping) else None


class QuadraticDrag(Effect):
    """−d·qd·|qd| on each joint: air, water, a fan."""

    coefficient: Joints  # (J,) d [N s^2/m^2 or Nm s^2/rad^2]

    name: ClassVar[str] = "quadratic_drag"
    sentence: ClassVar[str] = "drag that grows with the square of speed"
    parameters: ClassVar = {
        "coefficient": Parameter("N s^2/m^2", 0.0, 1e7, "torque per squared speed")
    }
    linear: ClassVar[bool] = True
    prior: ClassVar[float] = 0.3
    friction: ClassVar[bool] = True
    advice: ClassVar[str] = SPEEDS

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -self.coefficient * qd * jnp.abs(qd)
