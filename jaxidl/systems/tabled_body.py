"""A body along a log, or at one instant of it, known by its tables: effects alter it as others."""

from typing import Any

import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Float

from jaxidl.systems.tables import Tables
from jaxidl.types import Joints, Scalar


class TabledBody(struct.PyTreeNode):
    """A body at T instants of a log, with the change of its inverse dynamics when it is altered.

    It can be altered as any other body. The change is linear: the effect of changed gravity on what
    was added is left out. There is no axis T inside a ``vmap``.
    """

    table: Tables
    qdd: Float[Any, "*T J"]
    extra: Float[Any, "*T J"]  # torque that the alterations add [N or Nm]

    def add_inertia(self, extra: Joints) -> "TabledBody":
        return self._plus("...i,i->...i", self.qdd, extra)

    def add_mass(self, extra: Joints | Scalar) -> "TabledBody":
        each = extra + jnp.zeros(self.qdd.shape[-1])
        return self._plus("...ij,j->...i", self.table.by_mass, each)

    def add_moment(self, extra: Float[Array, "J 3"]) -> "TabledBody":
        return self._plus("...ija,ja->...i", self.table.by_moment, extra)

    def add_link(self, extra: Float[Array, "J 10"]) -> "TabledBody":
        return self._plus("...ijp,jp->...i", self.table.by_link, extra)

    def add_payload(self, extra: Float[Array, "10"]) -> "TabledBody":
        return self._plus("...ip,p->...i", self.table.by_payload, extra)

    def tilt(self, angles: Float[Array, "2"]) -> "TabledBody":
        return self._plus("...ia,a->...i", self.table.by_tilt, angles)

    def _plus(self, product: str, derivative: Any, by: Any) -> "TabledBody":
        return self.replace(extra=self.extra + jnp.einsum(product, derivative, by))
