"""The rigid body is not the one it is said to be."""

from typing import Any, ClassVar

from jaxidl.effects.base import Effect, Parameter
from jaxidl.types import Joints


class InertiaError(Effect):
    """Inertia that the model lacks on each joint, rotor inertia for one; negative where it has too much."""

    extra: Joints  # (J,) [kg or kg m^2]

    name: ClassVar[str] = "inertia_error"
    sentence: ClassVar[str] = "a joint carries another inertia than the model says"
    parameters: ClassVar = {"extra": Parameter("kg", -1e4, 1e4, "the missing inertia")}
    mjcf: ClassVar = {"extra": "joint/armature"}

    def alter(self, body: Any) -> Any:
        return body.add_inertia(self.extra)
