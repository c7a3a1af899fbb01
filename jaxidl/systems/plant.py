"""A plant: a rigid body plus a list of named physical effects, stepped one instant at a time."""

from typing import Any, Protocol, runtime_checkable

import jax.numpy as jnp
from flax import struct

from jaxidl.effects import Effect
from jaxidl.types import Joints, State


@runtime_checkable
class RigidBody(Protocol):
    """What a plant and a model need of a body; see :class:`jaxidl.systems.point_mass.PointMass`."""

    def forward_dynamics(self, q: Joints, qd: Joints, tau: Joints) -> Joints: ...

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints: ...

    def add_inertia(self, extra: Joints) -> "RigidBody": ...


class Plant(struct.PyTreeNode):
    """A body and its effects. Knows neither time nor batch: scan and vmap come from outside."""

    body: RigidBody
    effects: tuple[Effect, ...] = ()

    def start(self, q: Joints) -> tuple[Any, ...]:
        """Hidden states of all effects at rest at ``q`` (J,)."""
        return tuple(effect.start(q) for effect in self.effects)

    def acceleration(self, state: State, tau: Joints) -> Joints:
        """Acceleration (J,) [m/s^2] under the delivered torque ``tau`` (J,) [N]."""
        q, qd = state
        body, total, held = self.body, tau, jnp.zeros(qd.shape, bool)
        for effect in self.effects:
            body = effect.alter(body)
            total = total + effect.torque(q, qd, tau)
            held = held | effect.holds(q, qd, tau)
        return jnp.where(held, 0.0, body.forward_dynamics(q, qd, total))

    def step(self, state: State, hidden: tuple[Any, ...], tau: Joints, dt: float) -> tuple[State, tuple[Any, ...]]:
        """State and hidden states one time step ``dt`` [s] later, under the commanded torque ``tau`` (J,) [N].

        The command passes the effects' ``actuate`` in their order; the state then moves by q + dt·qd + dt²·qdd/2, qd + dt·qdd.
        """
        after = []
        for effect, memory in zip(self.effects, hidden, strict=True):
            tau, memory = effect.actuate(memory, state.q, state.qd, tau, dt)
            after.append(memory)
        return integrate(state, self.acceleration(state, tau), dt), tuple(after)

    def sense(self, q: Joints, noise: Joints) -> Joints:
        """Encoder reading (J,) at ``q`` (J,), given standard-normal draws ``noise`` (J,)."""
        for effect in self.effects:
            q = effect.sense(q, noise)
        return q


def integrate(state: State, qdd: Joints, dt: float) -> State:
    """Constant acceleration over one step: the house's integrator, for plants and for desired trajectories."""
    q, qd = state
    return State(q + dt * qd + 0.5 * dt**2 * qdd, qd + dt * qdd)
