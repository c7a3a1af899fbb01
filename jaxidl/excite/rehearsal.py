"""A rehearsal: a motion is made smaller until every explanation keeps its limits in a closed loop.

What a suspected effect does to a controlled joint (it lags behind, overshoots, asks for more
torque) is in no inverse dynamics. So each explanation's plant follows the motion under controllers
as robots have them: the model's torque ahead, and proportional-derivative feedback of several
natural frequencies, cut at the torque limit. Half of the margins of positions, speeds and
accelerations must be left. A loop that leaves them even along a tiny motion is no witness: with it
the robot could not have made its log.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxidl.backend import jit_quickly
from jaxidl.effects.catalogue import place_of
from jaxidl.effects.on_joint import OnJoint
from jaxidl.excite.design import Designed
from jaxidl.excite.doubt import Explanation
from jaxidl.excite.limits import Limits
from jaxidl.excite.prepare import Prepared
from jaxidl.excite.table import evidence
from jaxidl.systems import Plant
from jaxidl.types import History, Joints, State

NATURAL = (2.0, 3.0, 5.0)  # of the controllers [Hz]
DAMPING = 0.7
SMALLER = 0.9  # factor by which the motion is made smaller until it keeps its limits
TINY = 0.02  # size of the motion along which a witness keeps them
SETTLE = 1.0  # at rest at the start before it, so that springs and weight are in balance [s]
MARGIN = 0.5  # share of the plan's margins that execution leaves


class Gains(NamedTuple):
    """Of a controller."""

    position: Joints  # (J,) [N/m or Nm/rad]
    speed: Joints  # (J,) [N s/m or Nm s/rad]


class Reference(NamedTuple):
    """What a controller follows: T instants of J joints."""

    q: Float[Array | np.ndarray, "T J"]
    qd: Float[Array | np.ndarray, "T J"]
    tau: Float[Array | np.ndarray, "T J"]  # ahead [N or Nm]


def rehearsed(
    found: Designed,
    made: Prepared,
    explanations: Sequence[Explanation],
    limits: Limits,
    dt: float,
) -> Designed:
    """Return the motion, made smaller if one of the ``explanations`` would leave the limits.

    Args:
        found: the motion.
        made: its plan.
        explanations: of a diagnosis in doubt.
        limits: of execution.
        dt: interval at which the controllers run [s], that of the log.
    """
    plan = made.plan
    inside = limits.planned(MARGIN)
    bounds = (inside.lower, inside.upper, inside.speed, inside.acceleration, limits.torque)
    size, tiny = 1.0, _reference(found, made, TINY, dt)
    for explanation in explanations:
        plant = explained(plan.know.model.plant, explanation)
        witness = np.asarray(_kept(plant, tiny, bounds, dt))
        while size > TINY:
            kept = np.asarray(_kept(plant, _reference(found, made, size, dt), bounds, dt))
            if kept[witness].all():
                break
            size *= SMALLER
    if size == 1.0:
        return found
    q, qd, qdd = _smaller(found, size)
    again = found._replace(
        q=q, qd=qd, qdd=qdd, tau=plan.needed(q, qd, qdd), smaller=size * found.smaller
    )
    return again._replace(value=float(plan.value(evidence(made, again)[1])))


def explained(plant: Plant, explanation: Explanation) -> Plant:
    """Return the plant with an explanation's effects, in the order in which a command passes."""
    inner = lambda effect: effect.effect if isinstance(effect, OnJoint) else effect
    more = sorted(explanation.effects, key=lambda effect: place_of(inner(effect).name))
    return Plant(plant.body, (*plant.effects, *more))


def _reference(found: Designed, made: Prepared, size: float, dt: float) -> Reference:
    """Return the motion at a size, after a rest at its start, every ``dt`` [s]."""
    q, qd, qdd = _smaller(found, size)
    tau = made.plan.needed(q, qd, qdd)
    instants = np.arange(-SETTLE, float(found.time[-1]) + 0.5 * dt, dt)
    at = lambda x: np.stack([np.interp(instants, found.time, row) for row in x.T], 1)
    return Reference(at(q), at(qd), at(tau))


def _smaller(found: Designed, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    start = found.q[:1]
    return start + size * (found.q - start), size * found.qd, size * found.qdd


def gains(plant: Plant, q: Joints) -> Gains:
    """Return gains (C, J) of C controllers at a posture (J,)."""
    body: Any = plant.body
    for effect in plant.effects:
        body = effect.alter(body)
    rest = jnp.zeros_like(q)
    weight = body.inverse_dynamics(q, rest, rest)
    inertia = jax.vmap(lambda unit: unit @ (body.inverse_dynamics(q, rest, unit) - weight))
    omega = 2.0 * jnp.pi * jnp.asarray(NATURAL)[:, None]
    own = inertia(jnp.eye(len(q)))[None]
    return Gains(own * omega**2, 2.0 * DAMPING * own * omega)


def execute(
    plant: Plant, reference: Reference, control: Gains, torque: Joints, dt: float
) -> History:
    """Return readings (T, J) of a plant that follows a motion, without noise.

    Commands are cut at ``torque`` (J,) [N or Nm].
    """
    q, qd, tau = (jnp.asarray(x) for x in reference)
    none = jnp.zeros_like(q[0])
    hidden = plant.start(q[0])
    # encoders that read something else than the position are at the motion's start
    true = 2.0 * q[0] - plant.sense(hidden, q[0], none)

    def step(carry: Any, wanted: Reference) -> tuple[Any, Joints]:
        state, hidden, before = carry
        reading = plant.sense(hidden, state.q, none)
        command = (
            wanted.tau
            + control.position * (wanted.q - reading)
            + control.speed * (wanted.qd - (reading - before) / dt)
        )
        command = jnp.clip(command, -torque, torque)
        state, hidden = plant.step(state, hidden, command, dt, implicit=True)
        return (state, hidden, reading), reading

    start = (State(true, none), plant.start(true), q[0])
    return jax.lax.scan(step, start, Reference(q, qd, tau))[1]


@partial(jit_quickly, static_argnames="dt")
def _kept(plant: Any, reference: Reference, limits: Any, dt: float) -> Bool[Array, " C"]:
    """Return whether each of C controllers keeps the limits along a motion."""
    lower, upper, speed, acceleration, torque = limits

    def one(control: Gains) -> Any:
        q = execute(plant, reference, control, torque, dt)[round(SETTLE / dt) :]
        qd: Any = jnp.gradient(q, dt, axis=0)
        qdd: Any = jnp.gradient(qd, dt, axis=0)
        within = [q.min(0) > lower, q.max(0) < upper]
        within += [jnp.abs(x).max(0) < m for x, m in ((qd, speed), (qdd, acceleration))]
        return jnp.stack(within).all()

    return jax.vmap(one)(gains(plant, jnp.asarray(reference.q)[0]))
