"""A plant: a rigid body plus a list of named physical effects, stepped one instant at a time."""

from typing import Protocol, runtime_checkable

import jax.numpy as jnp
from flax import struct

from jaxidl.effects import Effect
from jaxidl.types import Joints, State


@runtime_checkable
class RigidBody(Protocol):
    """What a plant and a model need of a body; see :class:`jaxidl.systems.point_mass.PointMass`."""

    def forward_dynamics(self, q: Joints, qd: Joints, tau: Joints) -> Joints: ...

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints: ...


class Plant(struct.PyTreeNode):
    """A body and its effects. Knows neither time nor batch: scan and vmap come from outside."""

    body: RigidBody
    effects: tuple[Effect, ...] = ()

    def acceleration(self, state: State, tau: Joints) -> Joints:
        """Acceleration (J,) [m/s^2] under the commanded torque ``tau`` (J,) [N]."""
        q, qd = state
        total, held = tau, jnp.zeros(qd.shape, bool)
        for effect in self.effects:
            total = total + effect.torque(q, qd, tau)
            held = held | effect.holds(q, qd, tau)
        return jnp.where(held, 0.0, self.body.forward_dynamics(q, qd, total))

    def step(self, state: State, tau: Joints, dt: float) -> State:
        """The state one time step ``dt`` [s] later: q + dt·qd + dt²·qdd/2, qd + dt·qdd."""
        return integrate(state, self.acceleration(state, tau), dt)

    def sense(self, q: Joints, noise: Joints) -> Joints:
        """Encoder reading (J,) at ``q`` (J,), given standard-normal draws ``noise`` (J,)."""
        for effect in self.effects:
            q = effect.sense(q, noise)
        return q


def integrate(state: State, qdd: Joints, dt: float) -> State:
    """Constant acceleration over one step: the house's integrator, for plants and for desired trajectories."""
    q, qd = state
    return State(q + dt * qd + 0.5 * dt**2 * qdd, qd + dt * qdd)
