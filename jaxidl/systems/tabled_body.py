"""A body at one instant of a log, known by its tables: effects alter it as any other body."""

import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Float

from jaxidl.systems.tables import Tables
from jaxidl.types import Joints, Scalar


class TabledBody(struct.PyTreeNode):
    """A body at one instant of a log, with the change of its inverse dynamics when it is altered.

    It can be altered as any other body. The change is linear: the effect of changed gravity on what
    was added is left out.
    """

    table: Tables
    qdd: Joints
    extra: Joints  # (J,) torque that the alterations add [N or Nm]

    def add_inertia(self, extra: Joints) -> "TabledBody":
        return self.replace(extra=self.extra + extra * self.qdd)

    def add_mass(self, extra: Joints | Scalar) -> "TabledBody":
        return self.replace(
            extra=self.extra + self.table.by_mass @ (extra + jnp.zeros_like(self.qdd))
        )

    def add_moment(self, extra: Float[Array, "J 3"]) -> "TabledBody":
        return self.replace(extra=self.extra + jnp.einsum("ija,ja->i", self.table.by_moment, extra))

    def add_link(self, extra: Float[Array, "J 10"]) -> "TabledBody":
        return self.replace(extra=self.extra + jnp.einsum("ijp,jp->i", self.table.by_link, extra))

    def add_payload(self, extra: Float[Array, "10"]) -> "TabledBody":
        return self.replace(extra=self.extra + self.table.by_payload @ extra)

    def tilt(self, angles: Float[Array, "2"]) -> "TabledBody":
        return self.replace(extra=self.extra + self.table.by_tilt @ angles)
