"""Whether the log's columns, signs, zeros, units, gravity and clocks are those of the model.

Each of a few other readings of the log (a joint's torque or position with the opposite sign, its
zero 90° or 180° away, its position in degrees, the columns of two joints exchanged, the base
mounted another way round, torques without those that carry the weight, torques in a unit that is
powers of ten away, all positions in degrees) is tried with the model's own inertias and with
friction, rotor inertia and offset on every joint. The best one is taken while it reduces some
joint's error to a third or less, also of what is left without any model: where friction alone
explains a torque, every larger unit makes errors look smaller. What was taken is reported, with
others that are as good, and nothing is changed; but no effect is named with confidence on joints
that seem to be misread.

A motor may act late, but no motion precedes its torque. Where the torques of most joints fit the
motion far better a while earlier, the log's two clocks differ, or its torques were filtered. This
is reported, too.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar, nnls

from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.projection import CONVENTION, Projection
from jaxidl.gap.evidence.rows import Rows
from jaxidl.systems.free import inner
from jaxidl.systems.tables import inverse_dynamics

WRONG = 0.2  # of the command's spread: joints with more error than this make one ask
FEWER = 1.0 / 3.0  # of a joint's error: what another reading has to leave at most
ALIKE = 0.01  # difference of squared errors below which two readings are equally good
ENOUGH = 400  # rows
UNITS = (1e3, 1e-3, 1e2, 1e-2, 1e1, 1e-1)  # factors of torques
LONGEST = 0.2  # that torques may be logged late [s]
LESS = 0.7  # of a joint's error: what has to be left at most then,
ABOVE = 1.5  # where it is this many times its floor
MOUNTED = {
    "the base stood upright, with its z axis up": (0, 0, -1),
    "the base hung upside down": (0, 0, 1),
    "the base stood on a wall with its x axis up": (-1, 0, 0),
    "the base stood on a wall with its x axis down": (1, 0, 0),
    "the base stood on a wall with its y axis up": (0, -1, 0),
    "the base stood on a wall with its y axis down": (0, 1, 0),
    "the torques that carry the weight had been left out": (0, 0, 0),
}


class Reading(NamedTuple):
    """How a log of J joints is read."""

    position: np.ndarray  # (J,) factors of positions, velocities and accelerations
    zero: np.ndarray  # (J,) what is added to positions [rad]
    torque: np.ndarray  # (J,) factors of torques
    down: np.ndarray  # (3,) direction of gravity, or none
    moved: np.ndarray  # (J,) columns in which positions are
    driven: np.ndarray  # (J,) columns in which torques are


def conventions(rows: Rows, names: Sequence[str]) -> tuple[list[str], np.ndarray]:
    """Return sentences about joints, called ``names``, that another reading explains far better.

    Also return which joints (J,) seem to be misread.
    """
    source, misread = getattr(rows.signals.body, "source", None), np.zeros(len(names), bool)
    if source is None:
        return [], misread
    size, last = len(names), len(rows.gap) - 1
    some = np.linspace(0, last, min(ENOUGH, last + 1)).astype(int)
    gravity = np.array(source.opt.gravity)
    strength = float(np.linalg.norm(gravity))
    one, own = np.ones(size), np.arange(size)
    now = Reading(one, 0.0 * one, one, gravity / max(strength, 1e-300), own, own)
    left = _left(rows, some, now, strength)
    bare = _left(rows, some, now, strength, share=0.0)
    # only joints that move under a torque can be exchanged: the others' torque needs no explanation
    able = np.flatnonzero(rows.signals.moving.any(0) & (rows.spread > 0.0)).tolist()
    said: list[str] = []
    while np.any(left > WRONG) and len(said) <= size:
        others = _others(now, source, names, able)
        tried = [(*other, _left(rows, some, other[-1], strength)) for other in others]
        most = FEWER * np.minimum(left, bare)
        better = [t for t in tried if np.any((t[-1] <= most) & (left > WRONG))]
        error = [float(np.sum(t[-1] ** 2)) for t in better]
        if not better or min(error) >= np.sum(left**2):
            break
        alike = [t for t, e in zip(better, error, strict=True) if e <= min(error) + ALIKE]
        after = alike[0][-1]
        worst = int(np.argmax(left - after))
        how = " or ".join(
            f"{'the log' if joint is None else names[joint]} reads as if {what}"
            for joint, what, *_ in alike
        )
        said.append(
            f"{how}: friction and the model's inertias would then leave {after[worst]:.0%} of"
            f" {names[worst]}'s torque instead of {left[worst]:.0%}; check how positions and"
            " torques were recorded"
        )
        misread |= (after <= most) & (left > WRONG)
        now, left = alike[0][-2:]
    return said, misread


def _others(
    now: Reading, source: Any, names: Sequence[str], able: Sequence[int]
) -> Iterator[tuple[int | None, str, Reading]]:
    """Yield the readings next to one: the joint, what is different there, and the reading.

    Columns of joints that are ``able`` to be exchanged are.
    """
    size = len(names)
    degrees = np.where(source.jnt_type == 3, np.pi / 180.0, 1.0)  # of hinges
    for j in range(size):
        turned = lambda values, j=j: np.where(np.arange(size) == j, -values, values)
        yield j, "its torque had the opposite sign", now._replace(torque=turned(now.torque))
        back = now._replace(position=turned(now.position))
        yield j, "its position had the opposite sign", back
        both = back._replace(torque=turned(now.torque))
        yield j, "its position and torque had the opposite sign", both
        if degrees[j] != 1.0:
            here = np.arange(size) == j
            for angle in (90, -90, 180):
                what = f"{angle}° had to be added to its position"
                yield j, what, now._replace(zero=now.zero + np.deg2rad(angle) * here)
            scaled = now.position * np.where(here, degrees, 1.0)
            yield j, "its position was in degrees", now._replace(position=scaled)
    for a, b in combinations(able, 2):
        order = np.arange(size)
        order[[a, b]] = b, a
        moved, driven, both = now.moved[order], now.driven[order], f"of {names[a]} and {names[b]}"
        yield None, f"the positions {both} had been exchanged", now._replace(moved=moved)
        yield None, f"the torques {both} had been exchanged", now._replace(driven=driven)
        exchanged = now._replace(moved=moved, driven=driven)
        yield None, f"the positions and torques {both} had been exchanged", exchanged
    for factor in UNITS:
        larger = now._replace(torque=now.torque * factor)
        yield None, f"its torques had to be multiplied by {factor:g}", larger
    yield None, "its positions were in degrees", now._replace(position=now.position * degrees)
    if now.down.any():
        for what, down in MOUNTED.items():
            yield None, what, now._replace(down=np.array(down, float))


def _left(
    rows: Rows, some: np.ndarray, reading: Reading, strength: float, share: float = 1.0
) -> np.ndarray:
    """Return the error (J,) that is left over the command's spread, zero where nothing moves.

    Of the model a ``share`` is taken: with none, friction, rotor inertia and offset are left.
    """
    signals, kept, moved, driven = rows.signals, rows.signals.rows[some], *reading[-2:]
    q, qd, qdd = (
        reading.position * x[kept][:, moved] for x in (signals.q, signals.qd, signals.qdd)
    )
    sources = [b.source for b in (signals.body, signals.body.following) if b is not None]
    standing = np.array(sources[0].opt.gravity)
    try:
        for source in sources:
            source.opt.gravity = strength * reading.down
        torque = inverse_dynamics(signals.body, q + reading.zero, qd, qdd)
    finally:
        for source in sources:
            source.opt.gravity = standing
    if not all(inner(e).friction for e in rows.effects):
        # what the model's own effects need but its friction, of which it may have too much
        own = rows.command - rows.gap - signals.tables.torque[signals.rows] - rows.friction
        torque = torque + own[some]
    target = reading.torque * rows.command[some][:, driven] - share * torque
    out, spread = np.zeros(len(reading.zero)), rows.spread[driven]
    # not where a joint rests: what counts there is the torque that broke it away
    for j, use in enumerate(signals.moving[kept][:, moved].T):
        if use.sum() > 8 and spread[j] > 0.0:
            slow = max(float(abs(reading.position[j]) * signals.rest_speed[moved[j]]), 1e-12)
            x = np.stack([qd[:, j], np.tanh(qd[:, j] / slow), qdd[:, j]], 1)[use]
            size = np.maximum(np.abs(x).max(0), 1e-300)
            # an offset of either sign takes the means
            x, y = (part - part.mean(0) for part in (x / size, target[use, j]))
            there = spread[j]
            if (moved[j], driven[j]) != (j, j):  # the other joint's torque may be constant then
                there = min(there, float(np.std(rows.command[some][use, driven[j]])))
            left = nnls(x, y, maxiter=1000)[1] / np.sqrt(use.sum())
            out[j] = left / max(float(there), 1e-300) / abs(reading.torque[j])
    return out


def late_torques(
    rows: Rows, items: Sequence[Item], names: Sequence[str]
) -> tuple[list[str], np.ndarray]:
    """Return a sentence if torques of most joints were logged late, and which joints' (J,).

    They are compared beside ``items``: all that is common, and what was found.
    """
    which = np.zeros(len(names), bool)
    moves = (rows.used & rows.training[:, None]).any(0)
    moving = np.flatnonzero(moves & (rows.spread > 0.0))
    once = list({i.group: i for i in items}.values())
    projected, dt = Projection(rows, once), rows.signals.interval

    def error(late: float) -> np.ndarray:
        left = projected.residuals(rows.shifted(-late))
        return np.array([np.sqrt(np.mean(left[j] ** 2)) for j in moving])

    total = lambda late: float(np.sum(np.log(error(late) + 1e-300)))
    usual = -CONVENTION[0] * dt
    last, late = total(usual), usual
    while 2.0 * late < LONGEST and (more := total(2.0 * late)) < last:
        last, late = more, 2.0 * late
    if late == usual:
        return [], which
    bounds = late / 2.0, 2.0 * late
    found: Any = minimize_scalar(total, bounds=bounds, options={"xatol": 0.1 * dt})
    best = float(found.x)
    before, after = error(0.0), error(best)
    able, better = before > ABOVE * rows.floor[moving], after < LESS * before
    if 2 * np.count_nonzero(better) <= np.count_nonzero(able):
        return [], which
    which[moving[better]] = True
    return [
        f"the torques of {', '.join(np.array(names)[moving[better]])} fit the motion if they were"
        f" logged {1e3 * best:.2g} ms late, later than they act: check the clocks of positions and"
        " torques, and filters of the torques"
    ], which
