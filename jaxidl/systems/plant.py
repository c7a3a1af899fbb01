"""A plant: a rigid body plus a list of named physical effects, stepped one instant at a time."""

from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Float

from jaxidl.backend import rounds_at_once
from jaxidl.effects import Effect
from jaxidl.effects.load import dissipates, load, loaded
from jaxidl.effects.smooth import Share, choose, either
from jaxidl.types import Joints, Scalar, State

# an arm of two links needs up to 12 to rest without creeping; six coupled joints need more
GAUSS_SEIDEL_ROUNDS = 40
LOAD_ROUNDS = 4  # until friction under load and the rotor's acceleration agree


@runtime_checkable
class RigidBody(Protocol):
    """The methods that a plant and a model require of a body.

    See :class:`jaxidl.systems.PointMass`.
    """

    @property
    def armature(self) -> Joints:
        """The inertia (J,) [kg or kg m^2] of rotors on the motors' side of gears."""
        ...

    def forward_dynamics(self, q: Joints, qd: Joints, tau: Joints) -> Joints: ...

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints: ...

    def mobility(self, q: Joints) -> Float[Array, "J J"]: ...

    def add_inertia(self, extra: Joints) -> "RigidBody": ...

    def add_mass(self, extra: Joints | Scalar) -> "RigidBody": ...

    def add_moment(self, extra: Float[Array, "J 3"]) -> "RigidBody": ...

    def add_link(self, extra: Float[Array, "J 10"]) -> "RigidBody": ...

    def add_payload(self, extra: Float[Array, "10"]) -> "RigidBody": ...

    def tilt(self, angles: Float[Array, "2"]) -> "RigidBody": ...


class Plant(struct.PyTreeNode):
    """A body and its effects.

    It knows neither time nor batch: scan and vmap are applied from outside.
    """

    body: RigidBody
    effects: tuple[Effect, ...] = ()

    def start(self, q: Joints) -> tuple[Any, ...]:
        """Return the hidden states of all effects at rest at ``q`` (J,)."""
        return tuple(effect.start(q) for effect in self.effects)

    def acceleration(
        self, state: State, tau: Joints, dt: Scalar, *, implicit: bool = False
    ) -> Joints:
        """Return the acceleration (J,) [m/s^2] over a step ``dt`` [s].

        ``tau`` (J,) [N] is the delivered torque. Dry friction takes the velocity towards zero by as
        much as its level can in one step, and never through it. With ``implicit``, a joint's
        damping is that at the end of the step, linearised (Hairer and Wanner 1996, IV.7): friction
        on a small inertia then is stable in steps of any length, as in MuJoCo.
        """
        q, qd = state
        body, total = self.body, tau
        held: Share = jnp.zeros(qd.shape, bool)
        for effect in self.effects:
            body = effect.alter(body)
            total = total + effect.torque(q, qd, tau)
            held = either(held, effect.holds(q, qd, tau))
        qdd = body.forward_dynamics(q, qd, total)
        dry = any(effect.grips() for effect in self.effects)
        if not (implicit or dry):
            return choose(held, 0.0, qdd)
        mobility = body.mobility(q)
        if implicit:
            damped = jnp.eye(len(q)) + dt * mobility * self.damping(q, qd, tau)[None]
            qdd, mobility = jnp.linalg.solve(damped, qdd), jnp.linalg.solve(damped, mobility)
        qdd = choose(held, 0.0, qdd)
        if not dry:
            return qdd
        free = qd + dt * qdd
        given = passed = load(self.effects, q, qd, tau, free)
        rounds = LOAD_ROUNDS if any(loaded(e, len(q)) for e in self.effects) else 0
        for _ in range(rounds):  # exact where joints slide, and where they are about to
            brake = self.grip(q, qd, passed, free) * jnp.sign(free)
            slowed = jnp.sum(mobility * brake[None], 1)  # which fuses, unlike @
            passed = given - body.armature * (qdd - slowed)
        grip = self.grip(q, qd, passed, free)
        return qdd - mobility @ friction_torque(free / dt, mobility, grip)

    def damping(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        """Return by how much (J,) [N s/m] a joint's own speed reduces the torque on it, or zero."""

        def torque(qd: Joints) -> Joints:
            return sum((e.torque(q, qd, tau) for e in self.effects), jnp.zeros_like(qd))

        return jnp.maximum(-jnp.diagonal(jax.jacfwd(torque)(qd)), 0.0)

    def grip(self, q: Joints, qd: Joints, load: Joints, direction: Joints) -> Joints:
        """Return the level (J,) [N or Nm] of all dry friction together.

        See :meth:`jaxidl.effects.Effect.dry`; ``load`` (J,) is what passes the gears.
        """
        levels = (effect.dry(q, qd, load, direction) for effect in self.effects if effect.grips())
        return jnp.maximum(sum(levels, jnp.zeros_like(qd)), 0.0)

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints:
        """Return the torque (J,) [N or Nm] that produces the acceleration ``qdd`` (J,) in a state.

        A corrected model can thus command as a body does. Friction of a joint at rest is overcome
        in the direction of ``qdd``. What the motor and the encoders do to a command over time (lag,
        delay, hidden states) has no inverse at one instant and is left out; friction that depends
        on the load is that of the torque without it.
        """
        body = self.body
        torque, rubbed = jnp.zeros_like(qd), jnp.zeros_like(qd)
        for effect in self.effects:
            body = effect.alter(body)
        needed = body.inverse_dynamics(q, qd, qdd)
        for effect in self.effects:
            added = effect.torque(q, qd, needed)
            torque, rubbed = torque + added, rubbed + (added if dissipates(effect) else 0.0)
        direction = jnp.where(jnp.abs(qd) > 0.0, qd, qdd)
        passed = needed - torque + rubbed - body.armature * qdd
        grip = self.grip(q, qd, passed, direction)
        return needed - torque + grip * jnp.sign(direction)

    def step(
        self,
        state: State,
        hidden: tuple[Any, ...],
        tau: Joints,
        dt: Scalar,
        *,
        implicit: bool = False,
    ) -> tuple[State, tuple[Any, ...]]:
        """Return state and hidden states one time step ``dt`` [s] later.

        ``tau`` (J,) [N] is the commanded torque. The command passes the effects' ``actuate`` in
        their order; the state then moves by q + dt·qd + dt²·qdd/2, qd + dt·qdd. ``implicit`` is as
        for :meth:`acceleration`.
        """
        after = []
        for effect, memory in zip(self.effects, hidden, strict=True):
            tau, memory = effect.actuate(memory, state.q, state.qd, tau, dt)
            after.append(memory)
        qdd = self.acceleration(state, tau, dt, implicit=implicit)
        return integrate(state, qdd, dt), tuple(after)

    def sense(self, hidden: tuple[Any, ...], q: Joints, noise: Joints) -> Joints:
        """Return the encoder reading (J,) at ``q`` (J,).

        ``noise`` (J,) are standard-normal draws.
        """
        for effect, memory in zip(self.effects, hidden, strict=True):
            q = effect.sense(memory, q, noise)
        return q


def friction_torque(push: Joints, mobility: Float[Array, "J J"], level: Joints) -> Joints:
    """Return the torque (J,) within ±``level`` that brings the joints closest to rest.

    Projected Gauss-Seidel, joint by joint and repeated: each joint brakes what the others leave of
    ``push`` (J,), the acceleration [m/s^2] to be braked to come to rest in one step. One joint
    needs one round, joints coupled by inertia need more.
    """
    joints, own = range(push.shape[0]), jnp.diagonal(mobility)
    alone, coupling = push / own, mobility / own[:, None]

    # on numbers instead of vectors: a round is one kernel of a GPU instead of several for each
    # joint
    def around(_: Any, grip: tuple[Array, ...]) -> tuple[Array, ...]:
        now = list(grip)
        for j in joints:
            left = alone[j] - sum(coupling[j, i] * now[i] for i in joints if i != j)
            now[j] = jnp.clip(left, -level[j], level[j])
        return tuple(now)

    rounds = 1 if len(joints) == 1 else GAUSS_SEIDEL_ROUNDS
    grip = tuple(jnp.zeros_like(push[j]) for j in joints)
    return jnp.stack(jax.lax.fori_loop(0, rounds, around, grip, unroll=rounds_at_once()))


def integrate(state: State, qdd: Joints, dt: Scalar) -> State:
    """Return the state after one step of constant acceleration.

    This integrator serves plants and desired trajectories.
    """
    q, qd = state
    return State(q + dt * qd + 0.5 * dt**2 * qdd, qd + dt * qdd)
