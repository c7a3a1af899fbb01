"""The paper's rigid body: masses on independent axes, no gravity."""

import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Float

from jaxidl.types import Joints, Scalar


class PointMass(struct.PyTreeNode):
    """A rigid body with M·qdd = tau, M diagonal.

    All rigid bodies share these methods, so a plant need not distinguish them.
    """

    mass: Joints  # (J,) mass seen by each axis [kg]

    def forward_dynamics(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        """Return the acceleration (J,) [m/s^2] under the joint torque ``tau`` (J,) [N]."""
        return tau / self.mass

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints:
        """Return the torque (J,) [N] for the acceleration ``qdd`` (J,) [m/s^2]."""
        return self.mass * qdd

    def mobility(self, q: Joints) -> Float[Array, "J J"]:
        """Return the inverse of the inertia matrix (J, J) [1/kg]."""
        return jnp.diag(1.0 / self.mass)

    @property
    def armature(self) -> Joints:
        """The inertia (J,) [kg] of rotors: a point mass has no gear."""
        return jnp.zeros_like(self.mass)

    def add_inertia(self, extra: Joints) -> "PointMass":
        """Return the body with ``extra`` (J,) [kg] on its axes."""
        return PointMass(self.mass + extra)

    def add_mass(self, extra: Joints | Scalar) -> "PointMass":
        """Return the body with ``extra`` mass: for a point it is the same as an axis' inertia."""
        return PointMass(self.mass + extra)

    def add_moment(self, extra: Float[Array, "J 3"]) -> "PointMass":
        """Return the body unchanged: first moments need a rotation."""
        return self

    def add_link(self, extra: Float[Array, "J 10"]) -> "PointMass":
        """Return the body with extra mass: the other nine parameters need a rotation."""
        return PointMass(self.mass + extra[:, 0])

    def add_payload(self, extra: Float[Array, "10"]) -> "PointMass":
        """Return the body with the load's mass on all axes; its position makes no difference."""
        return PointMass(self.mass + extra[0])

    def tilt(self, angles: Float[Array, "2"]) -> "PointMass":
        """Return the body unchanged: it has no gravity."""
        return self


def point_mass(mass: Scalar, joints: int = 2) -> PointMass:
    """Return a body with the same ``mass`` [kg] on each of ``joints`` axes."""
    return PointMass(jnp.full(joints, mass, jnp.result_type(float)))
