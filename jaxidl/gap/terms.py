"""What one effect contributes along a log, and the derivative of that by its parameters.

The log drives the effect: it sees measured motion and logged commands, so a hidden state is simulated under the measured motion,
and every effect is an explicit function of its own parameters. Each class is compiled once for all joints.
"""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxidl.effects import CoupledFriction, Effect, OnJoint
from jaxidl.gap.signals import Signals, on_encoders
from jaxidl.systems.tables import TabledBody, Tables, inverse_dynamics


class Drive(NamedTuple):
    """What an effect sees: (T, J) each, or (T, 1) of its own joint."""

    q: Any
    qd: Any
    qdd: Any
    tau: Any
    table: Tables


class Terms(NamedTuple):
    """Contributions (T, J) of an effect; with derivatives, (P, T, J) for P parameters."""

    delivered: Any  # torque after the effect
    torque: Any
    level: Any  # of dry friction, of moving joints
    up: Any  # of joints at rest that are pushed forwards
    down: Any  # ... backwards
    inertia: Any  # torque that its change of the body takes
    q: Any  # true position


class Contribution(NamedTuple):
    """Of one effect at N kept rows of J joints, filtered; ``(N, J)``, and ``(P, N, J)`` for its derivatives."""

    net: Float[np.ndarray, "*P N J"]  # to the torque balance
    slide: Float[np.ndarray, "*P N J"]  # dry friction of moving joints, with the sign of the velocity
    grip: Float[np.ndarray, "*P N J"]  # what dry friction can hold of resting joints


Free = tuple[str, ...]
Columns = slice | list[int]  # joints


def parameters_of(effect: Effect, free: Free) -> Float[np.ndarray, " P"]:
    """The named parameters as one vector."""
    return np.concatenate([np.zeros(0), *(np.ravel(np.asarray(getattr(effect, name), float)) for name in free)])


def with_parameters(effect: Any, free: Free, values: Any) -> Any:
    """``effect`` with its named parameters set from one vector."""
    out, at = {}, 0
    for name in free:
        old = jnp.asarray(getattr(effect, name))
        out[name] = jnp.asarray(values[at : at + old.size].reshape(old.shape))
        at += old.size
    return effect.replace(**out)


def alone(effect: Effect) -> bool:
    """Does the effect concern one joint only, whatever the others do?"""
    changes_bodies = any(np.any(np.asarray(getattr(effect, name, 0.0)) != 0.0) for name in ("mass", "moment", "tensor"))
    return not (effect.whole or isinstance(effect, CoupledFriction) or changes_bodies or on_encoders(effect))


def contribution(
    effect: Effect,
    joint: int | None,
    free: Free,
    signals: Signals,
    tau: np.ndarray,
    everywhere: bool = False,
    undone: bool = False,
) -> tuple[tuple[int, ...], Contribution, Contribution, np.ndarray]:
    """The J joints it may concern; on these value, derivatives by the ``free`` parameters, and delivered torque (T, J) [N or Nm].

    Args:
        effect: of a one-joint mechanism if ``joint`` is a number, else of the whole one.
        joint: its joint, or None.
        free: the parameters to differentiate by.
        signals: the log.
        tau: what arrives at the effect (T, K) of all K joints [N or Nm]: commands after the effects before this one.
        everywhere: compute on all joints even if the effect looks as if it concerned one only.
        undone: are the signals' positions already without what the effect does to the encoders? It is not to count again.
    """
    joints = signals.q.shape[1]
    own = joint is not None and alone(effect) and not everywhere
    if joint is not None and not own:
        wrapped: Effect = OnJoint(effect, joint, joints)
    else:
        wrapped = effect
    columns: Columns = slice(joint, joint + 1) if own and joint is not None else slice(None)
    if isinstance(effect, CoupledFriction):  # its two joints as a mechanism of their own: one program for all pairs
        columns, wrapped = [effect.joint, effect.other], effect.replace(joint=0, other=1)
    drive, starts = _driven(signals, tau, columns)
    value, slopes = _terms(wrapped, free, drive, starts, signals.dt)
    value, slopes = jax.tree.map(np.asarray, (value, slopes))
    if undone:
        value = value._replace(q=drive.q)
    change = value._replace(delivered=value.delivered - drive.tau, q=value.q - drive.q)
    concerned = tuple(np.arange(joints)[columns].tolist())
    return concerned, _rows(change, signals, columns), _rows(slopes, signals, columns), value.delivered


def trial_changes(effects: list[Effect], joint: int, signals: Signals, tau: np.ndarray) -> np.ndarray:
    """Changes (N, G) [N or Nm] of one joint's balance by each of G one-joint effects of one class.

    Many starting values are so simulated side by side; ``tau`` (T, J) arrives at them.
    """
    columns = slice(joint, joint + 1)
    drive, starts = _driven(signals, tau, columns)
    values = [jnp.stack(leaves) for leaves in zip(*map(jax.tree.leaves, effects), strict=True)]
    delivered, inertia = jax.tree.map(np.asarray, _many(jax.tree.structure(effects[0]), values, drive, starts, signals.dt))
    return signals.command(delivered - drive.tau)[signals.rows] - inertia[signals.rows]


def _driven(signals: Signals, tau: np.ndarray, columns: Columns) -> tuple[Drive, np.ndarray]:
    """What an effect on some joints sees under the commands ``tau`` (T, J), and at which instants (T,) a run begins."""
    starts = np.zeros(len(tau), bool)
    starts[[s.start for s in signals.slices]] = True
    q, qd, qdd = (x[:, columns] for x in (signals.q, signals.qd, signals.qdd))
    return Drive(q, qd, qdd, tau[:, columns], _sliced(signals.tables, columns)), starts


@partial(jax.jit, static_argnames=("structure", "dt"))
def _many(structure: Any, values: list[Array], drive: Drive, starts: Any, dt: float) -> Any:
    """Delivered torque and torque of added inertia, (T, G) each, of G effects on one joint: one structure, G values a leaf."""
    terms = jax.vmap(lambda leaves: _along(jax.tree.unflatten(structure, leaves), drive, starts, dt), out_axes=1)(values)
    return terms.delivered[..., 0], terms.inertia[..., 0]


def _sliced(table: Tables, columns: Columns) -> Tables:
    """The tables of some joints, as if the others did not move."""
    return table.part(columns)


@partial(jax.jit, static_argnames=("free", "dt"))
def _terms(effect: Any, free: Free, drive: Drive, starts: Any, dt: float) -> tuple[Terms, Terms]:
    """Terms of an effect along a log, and their derivatives by its free parameters."""

    def of(values: Any) -> Terms:
        if isinstance(effect, OnJoint):
            return _along(effect.replace(effect=with_parameters(effect.effect, free, values)), drive, starts, dt)
        return _along(with_parameters(effect, free, values), drive, starts, dt)

    inner = effect.effect if isinstance(effect, OnJoint) else effect
    values = jnp.concatenate([jnp.zeros(0), *(jnp.ravel(jnp.asarray(getattr(inner, name), float)) for name in free)])
    if not free:
        value = of(values)
        return value, jax.tree.map(lambda x: jnp.zeros((0, *x.shape)), value)
    slopes = jax.vmap(lambda direction: jax.jvp(of, (values,), (direction,))[1])(jnp.eye(len(values)))
    return of(values), slopes


def _along(effect: Any, drive: Drive, starts: Any, dt: float) -> Terms:
    """Terms of an effect along a log."""
    inner = type(effect.effect if isinstance(effect, OnJoint) else effect)
    delivered = drive.tau if inner.actuate is Effect.actuate else _delivered(effect, drive, starts, dt)

    def instant(q: Any, qd: Any, qdd: Any, tau: Any, table: Any) -> Any:
        body = effect.alter(TabledBody(table, qdd, jnp.zeros_like(qdd)))
        rest, one = jnp.zeros_like(q), jnp.ones_like(q)
        levels = effect.dry(q, qd, tau, qd), effect.dry(q, rest, tau, one), effect.dry(q, rest, tau, -one)
        return effect.torque(q, qd, tau) + rest, *(level + rest for level in levels), body.extra

    torque, level, up, down, inertia = jax.vmap(instant)(drive.q, drive.qd, drive.qdd, delivered, drive.table)
    return Terms(delivered, torque, level, up, down, inertia, effect.true_position(drive.q, dt) + jnp.zeros_like(drive.q))


def _delivered(effect: Any, drive: Drive, starts: Any, dt: float) -> Any:
    """The command after the effect, whose hidden state follows the measured motion and begins anew with each run."""

    def step(memory: Any, now: Any) -> Any:
        q, qd, tau, begins = now
        memory = jax.tree.map(lambda old, new: jnp.where(begins, new, old), memory, effect.start(q))
        delivered, memory = effect.actuate(memory, q, qd, tau, dt)
        return memory, delivered

    return jax.lax.scan(step, effect.start(drive.q[0]), (drive.q, drive.qd, drive.tau, starts))[1]


def _rows(terms: Terms, signals: Signals, columns: Columns) -> Contribution:
    """Filter and thin out. ``terms`` are changes, with any leading axes."""
    lead = terms.torque.shape[:-2]

    def kept(x: np.ndarray, through: Any = lambda x: x) -> np.ndarray:
        if not np.any(x):
            return np.zeros((*lead, len(signals.rows), x.shape[-1]))
        return np.moveaxis(through(np.moveaxis(x, -2, 0))[signals.rows], 0, -2)

    sign = np.sign(signals.qd[:, columns]) * ~signals.resting[:, columns]
    net = kept(terms.delivered, signals.command) + kept(terms.torque, signals.smooth) - kept(terms.inertia)
    net = net - _moved(terms.q, signals, columns)
    pushed = signals.balance[:, columns] > 0.0
    slide = kept(terms.level * sign, signals.smooth)
    grip = np.where(pushed, kept(terms.up), kept(terms.down)) * signals.resting[:, columns][signals.rows]
    return Contribution(net, slide, grip)


def _moved(shift: np.ndarray, signals: Signals, columns: Columns) -> np.ndarray:
    """Change (..., N, J) of the inverse dynamics if true positions are ``shift`` (..., T, J) beside the measured ones.

    Exact for a shift, linear for derivatives, which have an axis more.
    """
    rows, table = signals.rows, signals.tables
    if not np.any(shift):
        return np.zeros((*shift.shape[:-2], len(rows), shift.shape[-1]))
    along = np.moveaxis(shift, -2, 0)
    speed = signals.differentiate(along)
    if shift.ndim == 2:
        there = (signals.q + along, signals.qd + speed, signals.qdd + signals.differentiate(speed))
        return inverse_dynamics(signals.body, *(x[rows] for x in there)) - table.torque[rows]
    parts = zip((table.by_q, table.by_qd, table.inertia), (along, speed, signals.differentiate(speed)), strict=True)
    total = sum(np.einsum("nij,n...j->n...i", t[rows][:, columns][:, :, columns], x[rows]) for t, x in parts)
    return np.moveaxis(np.asarray(total), 0, -2)


def as_effect(cls: type[Effect], values: Mapping[str, Any], **options: Any) -> Effect:
    """An effect of a one-joint mechanism from plain numbers; what is not named is zero."""
    filled = {name: np.atleast_1d(np.asarray(values.get(name, 0.0), float)) for name in cls.parameters}
    return cls(**{name: jnp.asarray(value) for name, value in filled.items()}, **options)
