"""Errors of the modelled rigid body.

They are linear in the ten inertial parameters of a link.
"""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Parameter, Scale, Variant
from jaxidl.effects.ten import about, elements, matrix, ten
from jaxidl.types import Joints, Scalar

LINK = 0.2  # prior probability of an error in a link's mass, centre or inertia

ACCELERATIONS = (
    "repeat the motion with a known mass attached, and hold still in several postures: a wrong"
    " rotor inertia shows only under acceleration, a wrong mass or centre at rest too, a load in"
    " every posture"
)
"""How to tell errors of the rigid body apart."""


class InertiaError(Effect):
    """Inertia that the model lacks, of each joint's rotor and of the body that the joint carries.

    It is negative where the model has too much. A body's inertia changes in proportion to its mass;
    its centre stays.
    """

    extra: Joints  # (J,) of the rotor [kg or kg m^2]
    mass: Joints | Scalar = 0.0  # (J,) or (): of the body [kg]

    name: ClassVar[str] = "inertia_error"
    sentence: ClassVar[str] = "a joint carries another inertia than the model says"
    parameters: ClassVar = {
        "extra": Parameter("kg", -1e7, 1e7, "the missing rotor inertia"),
        "mass": Parameter("mass", -1e7, 1e7, "the missing mass of the body"),
    }
    linear: ClassVar[bool] = True
    mjcf: ClassVar = {"extra": "joint/armature", "mass": "body/inertial"}
    changes: ClassVar[float] = 0.001
    prior: ClassVar[float] = 0.5  # for the rotor
    common: ClassVar[bool] = True
    advice: ClassVar[str] = ACCELERATIONS

    def alter(self, body: Any) -> Any:
        return body.add_mass(self.mass).add_inertia(self.extra)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return a variant for the rotor and one for the body.

        The model may have too much of a rotor, but not more than moves: with less inertia than
        none a joint would accelerate against its torque.
        """
        least = max(-scale.free, cls.parameters["extra"].lower)
        rotor = Variant({}, ("extra",), within={"extra": (least, np.inf)})
        return [rotor, Variant({}, ("mass",), prior=LINK)]


class ComError(Effect):
    """A first moment that the model lacks on each joint's body.

    Its centre of mass is elsewhere, by the moment over its mass. The mass stays, and to first order
    so does the inertia about the centre, which is what models give.
    """

    moment: Float[Array, "J 3"]  # in the body's frame [kg m]

    name: ClassVar[str] = "com_error"
    sentence: ClassVar[str] = "a link's centre of mass is not where the model has it"
    parameters: ClassVar = {
        "moment": Parameter("kg m", -1e7, 1e7, "the missing first moment of the body")
    }
    linear: ClassVar[bool] = True
    mjcf: ClassVar = {"moment": "body/inertial"}
    changes: ClassVar[float] = 0.001
    prior: ClassVar[float] = LINK
    common: ClassVar[bool] = True
    advice: ClassVar[str] = ACCELERATIONS

    def alter(self, body: Any) -> Any:
        return body.add_moment(self.moment)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        return [Variant({"moment": np.zeros((1, 3))}, ("moment",))]


class InertiaTensorError(Effect):
    """Rotational inertia that the model lacks on each joint's body.

    Its elements are xx, yy, zz, xy, xz, yz about the origin of the body's frame.
    """

    tensor: Float[Array, "J 6"]  # in the body's frame [kg m^2]

    name: ClassVar[str] = "inertia_tensor_error"
    sentence: ClassVar[str] = "a link has another rotational inertia than the model says"
    parameters: ClassVar = {
        "tensor": Parameter("kg m^2", -1e7, 1e7, "the missing inertia tensor of the body")
    }
    linear: ClassVar[bool] = True
    mjcf: ClassVar = {"tensor": "body/inertial"}
    changes: ClassVar[float] = 0.001
    prior: ClassVar[float] = LINK
    common: ClassVar[bool] = True
    advice: ClassVar[str] = ACCELERATIONS

    def alter(self, body: Any) -> Any:
        return body.add_link(ten(inertia=self.tensor))

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        return [Variant({"tensor": np.zeros((1, 6))}, ("tensor",))]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return the inertia error that it includes.

        About the joint's own axis it is a rotor's inertia, unless other joints move the body too.
        """
        return ("inertia_error",)


class Payload(Effect):
    """A load on the last body that moves, in that body's frame.

    It is negative where the model has a load that is not there. It is a ``mass`` at ``com`` with
    ``inertia`` about that point, which reports show. In addition it has a first ``moment`` for
    fits: with the centre kept at the origin the torque is linear in mass, moment and inertia, and
    ``settled`` finds the centre.
    """

    mass: Scalar  # [kg]
    com: Float[Array, "3"]  # [m]
    moment: Float[Array, "3"] | Scalar = 0.0  # in addition to mass times com [kg m]
    inertia: Float[Array, "6"] | Scalar = 0.0  # xx, yy, zz, xy, xz, yz about com [kg m^2]

    name: ClassVar[str] = "payload"
    sentence: ClassVar[str] = "the last body carries another load than the model says"
    parameters: ClassVar = {
        "mass": Parameter("mass", -1e7, 1e7, "the load"),
        "com": Parameter("length", -5.0, 5.0, "where it is in the last body's frame"),
        "moment": Parameter(
            "mass length", -1e7, 1e7, "the first moment in addition to mass times centre"
        ),
        "inertia": Parameter("kg m^2", -1e7, 1e7, "the load's inertia about its centre"),
    }
    whole: ClassVar[bool] = True
    fixed: ClassVar[tuple[str, ...]] = ("com",)
    internal: ClassVar[tuple[str, ...]] = ("moment",)
    implied: ClassVar[tuple[str, ...]] = ("inertia",)  # of a compact body
    mjcf: ClassVar = {
        "mass": "body/inertial",
        "com": "body/inertial",
        "moment": "body/inertial",
        "inertia": "body/inertial",
    }
    changes: ClassVar[float] = 0.3
    prior: ClassVar[float] = 0.1
    advice: ClassVar[str] = ACCELERATIONS

    @jax.jit
    def numbers(self) -> Float[Array, "10"]:
        """Return the load's ten inertial parameters about the origin of its body's frame."""
        com = jnp.asarray(self.com)
        moment = self.mass * com + self.moment
        return ten(self.mass, moment, about(self.mass, com) + self.inertia)

    def settled(self) -> "Payload":
        """Return the same load with its first moment expressed by ``com``.

        A load without mass, or with a centre out of bounds, is returned as it is. The inertia about
        the centre has no principal moment whose sign differs from that of the mass: no such body
        could be simulated.
        """
        return _settled(self)

    def alter(self, body: Any) -> Any:
        return body.add_payload(self.numbers())

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return variants with the centre at the frame's origin.

        There mass, moment and inertia are amplitudes.
        """
        values = {"mass": 0.0, "com": np.zeros(3), "moment": np.zeros(3), "inertia": np.zeros(6)}
        return [Variant(values, ("mass", "moment", "inertia"), {"mass": (0.0, np.inf)})]

    @classmethod
    def contains(cls, free: tuple[str, ...] = ()) -> tuple[str, ...]:
        """Return all effects that are errors of the last link."""
        return ("inertia_error.mass", "com_error", "inertia_tensor_error")


class BaseTilt(Effect):
    """The base is not level: it is turned by small ``angles`` about two horizontal axes.

    These are x and y where gravity points along z. The effect is linear: gravity in the base's
    frame changes by minus the turn's cross product with it.
    """

    angles: Float[Array, "2"]  # [rad]

    name: ClassVar[str] = "base_tilt"
    sentence: ClassVar[str] = "the base is not level, so gravity points in another direction"
    parameters: ClassVar = {
        "angles": Parameter("rad", -0.5, 0.5, "the tilt about two horizontal axes")
    }
    linear: ClassVar[bool] = True
    whole: ClassVar[bool] = True
    mjcf: ClassVar = {"angles": "option/gravity"}
    prior: ClassVar[float] = 0.02
    advice: ClassVar[str] = (
        "put a level on the base, or hold still in many postures with the first joint turned all"
        " the way round: a tilt stays with the base, a wrong link or encoder with its joint"
    )

    def alter(self, body: Any) -> Any:
        return body.tilt(self.angles)

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return one variant with angles of at most a quarter of a radian.

        A larger tilt would have been noticed.
        """
        return [Variant({"angles": np.zeros(2)}, ("angles",), {"angles": (-0.25, 0.25)})]


@jax.jit  # one program, where operations one by one would be fifty
def _settled(load: Payload) -> Payload:
    numbers = load.numbers()
    heavy = jnp.abs(numbers[0]) > 1e-9
    com = numbers[1:4] / jnp.where(heavy, numbers[0], 1.0)
    there = heavy & jnp.all(jnp.abs(com) < load.parameters["com"].upper)
    moments, axes = jnp.linalg.eigh(matrix(numbers[4:] - about(numbers[0], com)))
    kept = jnp.where(moments * numbers[0] > 0.0, moments, 0.0)
    settled = Payload(load.mass, com, jnp.zeros(3), elements((axes * kept[None, :]) @ axes.T))
    mine = load.replace(
        com=jnp.asarray(load.com),
        moment=jnp.zeros(3) + load.moment,
        inertia=jnp.zeros(6) + load.inertia,
    )
    return jax.tree.map(lambda new, old: jnp.where(there, new, old), settled, mine)
