"""The torque that an effect adds, along a log, to the command that the model predicts.

The log drives the effect: a hidden state is simulated under the measured motion and the logged
command, while an effect that reads the torque reads the *predicted* command, since otherwise it
would explain a command by itself. Many effects of one class are computed side by side, so each
class is compiled once, for all its shapes and joints.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxidl.backend import jit_quickly
from jaxidl.effects import Effect, OnJoint
from jaxidl.gap.evidence.behind import NOTHING, Behind
from jaxidl.gap.evidence.friction import mean_sign
from jaxidl.gap.evidence.links import Columns, narrowed
from jaxidl.logs.low_pass import by_run
from jaxidl.logs.signals import Signals
from jaxidl.systems.free import inner
from jaxidl.systems.tabled_body import TabledBody
from jaxidl.types import Scalar

WILD = 1e6  # times the largest command: a simulation that adds more has diverged
SIDE_BY_SIDE = 4  # effects of one class per program; one that remembers takes steps: faster alone
OFTEN = 100_000  # instants times squared joints from which programs run often, or take long


class Drive(NamedTuple):
    """The inputs of an effect: (T, J) each, or (T, 1) of its own joint."""

    q: Any
    qd: Any
    qdd: Any
    tau: Any  # command as logged
    predicted: Any  # command as predicted by the model
    load: Any  # the torque that passes the gear
    table: Any  # tables; none for an effect that alters no body


class Terms(NamedTuple):
    """Contributions (T, J) of an effect."""

    change: Any  # change of the command on its way to the joint
    torque: Any
    level: Any  # dry friction of moving joints
    up: Any  # dry friction of joints at rest that are pushed forwards
    down: Any  # dry friction of joints at rest that are pushed backwards
    inertia: Any  # torque that its change of the body requires
    q: Any  # true position


def additions(
    effects: Sequence[Effect],
    signals: Signals,
    tau: np.ndarray,
    predicted: np.ndarray,
    undone: bool = False,
    unloaded: np.ndarray | float = 0.0,
    behind: Behind = NOTHING,
) -> tuple[Float[np.ndarray, "G N J"], np.ndarray]:
    """Return the torque that each of G effects adds to the predicted command [N or Nm].

    The effects have one structure. Also return the command that the last one delivers.

    Args:
        effects: of the whole mechanism (effects of one joint name it), all of one class with the
            same static fields.
        signals: the log, N rows of T instants.
        tau: commands (T, J) that arrive at their ``actuate`` [N or Nm].
        predicted: commands (T, J) that their ``torque`` reads [N or Nm].
        undone: true if the effects' changes of the encoders are already undone in the signals, so
            that they are not counted again.
        unloaded: torques (T, J) of :func:`before_gears`. With them, ``predicted`` is the load that
            their ``dry`` reads.
        behind: links and friction, which act where the joints truly are. Where these effects change
            the encoders, their change counts, too.
    """
    joints = signals.q.shape[1]
    columns, alone, places = narrowed(effects)
    each = (signals.q, signals.qd, signals.qdd, tau, predicted, predicted + unloaded)
    kind = type(inner(alone[0]))
    # as if the other joints did not move
    tables = None if kind.alter is Effect.alter else signals.tables.part(columns)
    drive = Drive._make([*(x[:, columns] for x in each), tables])
    starts = np.zeros(len(tau), bool)
    starts[[s.start for s in signals.slices]] = True
    inputs = jax.tree.map(_longer, (drive, starts))
    times = signals.dt, round(signals.dt / signals.interval)
    many = _often if signals.q.size * joints > OFTEN else _seldom
    together = 1 if kind.actuates() and kind.start is not Effect.start else SIDE_BY_SIDE
    out, delivered = np.zeros((len(effects), len(signals.rows), joints)), tau
    for first in range(0, len(alone), together):
        part = alone[first : first + together]
        filled = part + [part[-1]] * (together - len(part))
        leaves = [
            np.stack([np.asarray(x, float) for x in each])
            for each in zip(*map(jax.tree.leaves, filled), strict=True)
        ]
        where = np.resize(np.asarray(places[first : first + together]), together)
        terms = many(jax.tree.structure(part[0]), leaves, where, *inputs, *times)
        terms = Terms(*(np.asarray(x)[: len(part), : len(tau)] for x in terms))
        with np.errstate(over="ignore", invalid="ignore"):
            added = _rows(terms, signals, columns, drive, undone, behind)
        # a diverging simulation adds nothing
        wild = ~(np.abs(added) < WILD * (np.abs(tau).max() or 1.0))
        out[first : first + together][:, :, columns] = np.where(wild, 0.0, added)
        if np.any(terms.change[-1]):
            delivered = tau.copy()
            delivered[:, columns] += terms.change[-1]
    return out, delivered


def _longer(x: np.ndarray) -> np.ndarray:
    """Return an array (T, ...) that goes on as it ends, so that logs share compiled programs.

    It is at most an eighth longer.
    """
    step = 2 ** max(0, len(x).bit_length() - 4)
    more = np.broadcast_to(x[-1:], (-len(x) % step, *x.shape[1:]))
    return np.concatenate([x, more])


def _many(
    structure: Any, leaves: Any, where: Any, drive: Drive, starts: Any, dt: Scalar, finer: int
) -> Terms:
    """Return terms (G, T, J) of G effects of one structure, on joints ``where`` (G,) or alone."""

    def one(values: Any, joint: Any) -> Terms:
        effect = jax.tree.unflatten(structure, values)
        if isinstance(effect, OnJoint):
            effect = effect.replace(joint=joint)
        return along(effect, drive, starts, dt, finer)

    return jax.vmap(one)(leaves, where)


_seldom, _often = (
    jit_quickly(_many, often, static_argnames=("structure", "finer")) for often in (False, True)
)


def along(effect: Any, drive: Drive, starts: Any, dt: Scalar, finer: int = 1) -> Terms:
    """Return the terms (T, J) of one effect along a motion; differentiable by the motion.

    ``starts`` (T,) says at which instants a run begins. A hidden state takes ``finer`` steps in
    each ``dt``.
    """
    change = drive.tau * 0.0
    if type(inner(effect)).actuates():
        command = effect.seen(drive.tau, drive.predicted)
        change = _delivered(effect, drive._replace(tau=command), starts, dt, finer) - command

    def instant(q: Any, qd: Any, qdd: Any, tau: Any, load: Any, table: Any) -> Any:
        rest, one = jnp.zeros_like(q), jnp.ones_like(q)
        inertia = rest
        if table is not None:
            inertia = effect.alter(TabledBody(table, qdd, jnp.zeros_like(qdd))).extra
        levels = (
            effect.dry(q, qd, load, qd),
            effect.dry(q, rest, load, one),
            effect.dry(q, rest, load, -one),
        )
        return effect.torque(q, qd, tau) + rest, *(level + rest for level in levels), inertia

    torque, level, up, down, inertia = jax.vmap(instant)(
        drive.q, drive.qd, drive.qdd, drive.predicted, drive.load, drive.table
    )
    place = effect.true_position(drive.q, dt) + jnp.zeros_like(drive.q)
    return Terms(change, torque, level, up, down, inertia, place)


def _delivered(effect: Any, drive: Drive, starts: Any, dt: Scalar, finer: int) -> Any:
    """Return the command after the effect, its mean over each step.

    Its hidden state follows the measured motion and restarts with each run.
    """
    memory = effect.start(drive.q[0])
    finer = finer if jax.tree.leaves(memory) else 1
    last = jnp.append(starts[1:], True)[:, None]
    ahead = lambda x: jnp.where(last, 0.0, jnp.concatenate([x[1:] - x[:-1], 0.0 * x[:1]]))

    def step(memory: Any, now: Any) -> Any:
        q, qd, tau, begins, further, faster, stronger = now
        memory = jax.tree.map(lambda old, new: jnp.where(begins, new, old), memory, effect.start(q))
        total = 0.0
        for k in np.arange(finer) / finer:
            command = tau + (k + 0.5 / finer - 0.5) * stronger
            motion = q + k * further, qd + k * faster
            delivered, memory = effect.actuate(memory, *motion, command, dt / finer)
            total = total + delivered
        return memory, total / finer

    further, faster, stronger = map(ahead, (drive.q, drive.qd, drive.tau))
    before = jnp.where(starts[:, None], 0.0, jnp.roll(stronger, 1, 0))
    inputs = drive.q, drive.qd, drive.tau, starts, further, faster, 0.5 * (before + stronger)
    if not jax.tree.leaves(memory):
        return jax.vmap(lambda now: step(memory, now)[1])(inputs)
    return jax.lax.scan(step, memory, inputs)[1]


def _rows(
    terms: Terms,
    signals: Signals,
    columns: Columns,
    drive: Drive,
    undone: bool,
    behind: Behind,
) -> np.ndarray:
    """Return the additional command (G, N, J) that is needed, filtered and thinned out."""
    rows = signals.rows

    def kept(x: np.ndarray, through: Any = lambda x: x) -> np.ndarray | float:
        return np.moveaxis(through(np.moveaxis(x, 0, 1))[rows], 1, 0) if np.any(x) else 0.0

    resting = signals.resting[:, columns]
    way = by_run(signals.qd[:, columns], signals.slices, mean_sign)
    slide = terms.level * np.where(resting, 0.0, way)
    held = (
        np.where(signals.pushed[:, columns], terms.up[:, rows], -terms.down[:, rows])
        * resting[rows]
    )
    # the torque of a joint at rest is not filtered, either: no sliding before and after is in it
    alone = np.where(resting, slide - terms.torque, 0.0)[:, rows]
    moving = kept(slide - terms.torque, signals.smooth) * ~resting[rows]
    net = moving + alone - kept(terms.change, signals.command) + kept(terms.inertia) + held
    for k in [] if undone else np.flatnonzero(np.any(terms.q != drive.q, axis=(1, 2))):
        shift = terms.q[k] - drive.q
        net[k] += behind.moved(shift, signals, drive.load)[:, columns]
    return net
