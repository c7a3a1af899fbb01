"""The rigid body is not the one it is said to be."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Parameter, Scale, Variant
from jaxidl.types import Joints, Scalar

LINK = 0.2  # probability of an error in a link's mass, centre or inertia

ACCELERATIONS = (
    "repeat the motion with a known mass attached, and hold still in several postures: a wrong rotor inertia shows only under "
    "acceleration, a wrong mass or centre at rest too, a load in every posture"
)
"""How errors of the rigid body are told from each other."""


class InertiaError(Effect):
    """Inertia that the model lacks: of each joint's rotor, and of the body that a joint carries; negative where it has too much.

    A body's inertia about its centre of mass changes in proportion to its mass.
    """

    extra: Joints  # (J,) of the rotor [kg or kg m^2]
    mass: Joints | Scalar = 0.0  # (J,) or (): of the body [kg]

    name: ClassVar[str] = "inertia_error"
    sentence: ClassVar[str] = "a joint carries another inertia than the model says"
    parameters: ClassVar = {
        "extra": Parameter("kg", -1e4, 1e4, "the missing rotor inertia"),
        "mass": Parameter("mass", -1e4, 1e4, "the missing mass of the body"),
    }
    linear: ClassVar[bool] = True
    mjcf: ClassVar = {"extra": "joint/armature", "mass": "body/inertial"}
    prior: ClassVar[float] = 0.5  # of a rotor's
    common: ClassVar[bool] = True
    advice: ClassVar[str] = ACCELERATIONS

    def alter(self, body: Any) -> Any:
        return body.add_mass(self.mass).add_inertia(self.extra)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Of the rotor, or of the body."""
        return [Variant({}, ("extra",)), Variant({}, ("mass",), prior=LINK)]


class Payload(Effect):
    """A point-like mass carried by the last body, at ``com`` in that body's frame."""

    mass: Scalar  # [kg]
    com: Float[Array, "3"]  # [m]

    name: ClassVar[str] = "payload"
    sentence: ClassVar[str] = "the last body carries a load that the model does not have"
    parameters: ClassVar = {
        "mass": Parameter("mass", 0.0, 1e4, "the load"),
        "com": Parameter("length", -5.0, 5.0, "where it is in the last body's frame"),
    }
    whole: ClassVar[bool] = True
    prior: ClassVar[float] = 0.15
    advice: ClassVar[str] = ACCELERATIONS
    mjcf: ClassVar = {"mass": "body/inertial", "com": "body/inertial"}

    def alter(self, body: Any) -> Any:
        return body.add_payload(self.mass, jnp.asarray(self.com))

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        return [Variant({"mass": 0.0, "com": np.zeros(3)}, ("mass",))]
