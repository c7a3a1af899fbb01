"""The paper's rigid body: masses on independent axes, no gravity."""

import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Float

from jaxidl.types import Joints, Scalar


class PointMass(struct.PyTreeNode):
    """M·qdd = tau with M diagonal. Bodies of the house share these methods, so a plant does not ask
    which it has.
    """

    mass: Joints  # (J,) mass seen by each axis [kg]

    def forward_dynamics(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        """Acceleration (J,) [m/s^2] under the joint torque ``tau`` (J,) [N]."""
        return tau / self.mass

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints:
        """Torque (J,) [N] that makes acceleration ``qdd`` (J,) [m/s^2]."""
        return self.mass * qdd

    def mobility(self, q: Joints) -> Float[Array, "J J"]:
        """Inverse of the inertia matrix (J, J) [1/kg]."""
        return jnp.diag(1.0 / self.mass)

    def add_inertia(self, extra: Joints) -> "PointMass":
        """The body with ``extra`` (J,) [kg] on its axes."""
        return PointMass(self.mass + extra)

    def add_mass(self, extra: Joints | Scalar) -> "PointMass":
        """A point's mass and an axis' inertia are the same thing."""
        return PointMass(self.mass + extra)

    def add_link(self, extra: Float[Array, "J 10"]) -> "PointMass":
        """Of the ten inertial parameters only mass matters where nothing turns."""
        return PointMass(self.mass + extra[:, 0])

    def add_payload(self, extra: Float[Array, "10"]) -> "PointMass":
        """All axes move the load; where it sits makes no difference."""
        return PointMass(self.mass + extra[0])

    def tilt(self, angles: Float[Array, "2"]) -> "PointMass":
        """There is no gravity to point another way."""
        return self


def point_mass(mass: Scalar, joints: int = 2) -> PointMass:
    """The same ``mass`` [kg] on each of ``joints`` axes."""
    return PointMass(jnp.full(joints, mass, jnp.result_type(float)))
