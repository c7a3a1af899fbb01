"""The library: what every effect of the catalogue would add to the command of this log.

It covers every shape that an effect offers. What is linear in an effect's amplitudes is one group
of columns. What has a shape (a speed, a period, a delay ...) is one group for each starting shape;
of these the few that promise most beside all common effects are kept. Effects derive their starting
values from the magnitudes of the log on each joint (:func:`scales`).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from jaxidl.effects import CATALOGUE, Effect, Scale
from jaxidl.gap.evidence.behind import Behind
from jaxidl.gap.evidence.friction import before_gears
from jaxidl.gap.evidence.gram import Anchor, Item, columns_at
from jaxidl.gap.evidence.items import columns_of, item, items_of
from jaxidl.gap.evidence.links import links_of
from jaxidl.gap.evidence.projection import Projection, aligned, alignments
from jaxidl.gap.evidence.rows import Rows, rms
from jaxidl.gap.evidence.samples import (
    copies,
    correlation_beside,
    samples_alike,
    without_pauses,
)
from jaxidl.gap.evidence.shape import Present, Shape, effect_at, shapes_of, vector
from jaxidl.gap.fit.prior import plausible
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.logs.low_pass import at_instants

ALIKE = 20.0  # correlated samples that count as one, before their number is known
PUSH = 0.01  # additional commands, over its spread, to test whether they are delivered
HELD = 0.1  # time for which it is held [s]: oscillating or late drives deliver it by then
DEAF = 0.8
TOGETHER = 0.1  # share of a joint's motion in which another one has to move, too


def pushed(items: Sequence[Item], rows: Rows, predicted: np.ndarray) -> list[Item]:
    """Return items with the response of actuators to small additional commands.

    It is what they hold back of two: one along the command, and the residual backwards in time.
    The latter has the spectrum of the residual and nothing to do with the motion: an actuator that
    holds it back would also make noise smaller that is on the command. The items further have the
    share of samples at which they hold back all of a command while it is held.
    """
    acting = [i for i in items if i.actuates]
    signals, shapes = rows.signals, [i.shape for i in acting]
    size = np.where(rows.spread > 0.0, PUSH * rows.spread, 1.0)  # joints without a drive
    without = columns_of(shapes, rows, predicted)
    noise = (rows.tau - predicted)[::-1]
    noise = noise / np.maximum(np.sqrt(np.mean(noise**2, 0)), 1e-300)

    def kept(way: np.ndarray) -> list[np.ndarray]:
        more = columns_of(shapes, rows._replace(tau=rows.tau + size * way), predicted + size * way)
        return [(a - b) / size for a, b in zip(more, without, strict=True)]

    long = max(3, round(HELD / rows.step))
    use = rows.used & rows.training[:, None]
    ways = np.stack([np.sign(rows.command), signals.command(noise)[signals.rows]])
    out = {}
    for i, along, back, held in zip(
        acting, kept(np.sign(rows.tau)), kept(noise), kept(np.ones_like(rows.tau)), strict=True
    ):
        deaf = (uniform_filter1d(held, long, axis=1) > DEAF) & use
        on = list(i.joints)
        push = ways[:, :, on], np.stack([along, back])[..., on]
        share = deaf.sum(1) / np.maximum(use.sum(0), 1)
        out[id(i)] = replace(i, push=push, deaf=share[:, on])
    return [out.get(id(i), i) for i in items]


class Library(NamedTuple):
    """Items of a log, the residual of all common effects together, and the items' score."""

    rows: Rows
    score: Score
    envelope: Solution
    predicted: np.ndarray  # (T, J) command predicted by all common effects [N or Nm]


def library(
    rows: Rows, names: Sequence[str], own: Present, reference: Anchor | None = None
) -> Library:
    """Return the library of the effects ``names``.

    Args:
        rows: N rows of the log.
        names: names in the catalogue.
        own: effects that the model has already.
        reference: another log, for which the model was made; then only changes since then compete.
    """
    every = scales(rows)
    moving = [s.joint for s in every if s.speed > 0.0 and rows.used[:, s.joint].any()]
    predicted = rows.tau

    def offered(cls: type[Effect]) -> list[Shape]:
        on = [0] if cls.whole else moving
        return [s for j in on for s in shapes_of(cls, every[j], own, reference is not None)]

    links = links_of(rows.signals.body)
    # parts before the effects that contain them
    classes = sorted((CATALOGUE[name] for name in names), key=lambda cls: len(cls.contains()))
    common: list[Item] = []
    for cls in filter(lambda cls: cls.common, classes):
        fresh = items_of(offered(cls), rows, predicted, common)
        common += [plausible(i, links, ALIKE) for i in fresh]
    rows = aligned(rows, common)
    spread = np.maximum(rms(rows.gap, rows.used & rows.training[:, None]), rows.floor)
    first = Score(rows.sure(), common, spread, np.ones(len(spread)))
    envelope = first.solve(common)
    left = residual(rows, envelope)
    rubs = [m for m in envelope.members if m.shape is not None and m.shape.cls.friction]
    friction = rows.friction + rows.gap - residual(rows, envelope, rubs)
    rows = rows.agreeing(left, friction).evened(left).drifting(left)
    noise, effective = noise_of(rows, left, common)
    predicted = upsampled(rows, rows.command - left)
    rows, every = with_friction(rows, envelope), heavier(every, envelope, rows)
    alike = samples_alike((rows.used & rows.training[:, None]).sum(0), effective)
    common = [plausible(i, links, alike) for i in common]
    shared = [again(i, rows, predicted) for i in (reference.items if reference else ())]
    shared = tuple(pushed(shared, rows, predicted))
    items = [*common, *shared, *alignments(rows, predicted, alike)]
    projected = Projection(rows, items, noise)
    for cls in classes:
        if not cls.common:
            best = projected.best(items_of(offered(cls), rows, predicted, items), left, effective)
            items += [plausible(i, links, alike) for i in pushed(best, rows, predicted)]
    basic = [i for i in items if i.common or i.always]
    anchor = reference and reference._replace(items=shared)
    score = Score(rows, items, noise, effective, anchor)
    return Library(rows, score, score.solve(basic), predicted)


def scales(rows: Rows) -> list[Scale]:
    """Return the magnitudes on each joint.

    Positions are those of training rows: a table over others would not be fitted there.
    """
    signals, residual = rows.signals, rms(rows.gap, rows.used)
    lows, highs = np.quantile(signals.q[signals.rows[rows.training]], (0.002, 0.998), axis=0)
    inertia = np.median(np.diagonal(signals.tables.inertia, axis1=1, axis2=2), axis=0)
    mobility = np.diagonal(np.linalg.pinv(signals.tables.inertia, hermitian=True), axis1=1, axis2=2)
    free = 1.0 / np.maximum(mobility.max(axis=0), 1e-300)
    speed = np.quantile(np.abs(signals.qd), 0.998, axis=0)
    size, moving = np.abs(signals.tau), signals.moving.astype(float)
    together = moving.T @ moving >= TOGETHER * moving.sum(0)[:, None]
    torque, effort, typical = size.max(0), np.sqrt(np.mean(size**2, 0)), np.median(size, 0)
    ranges, out = (tuple(lows.tolist()), tuple(highs.tolist())), list[Scale]()
    for j in range(len(lows)):
        first = (float(x[j]) for x in (torque, speed, lows, highs, inertia, residual))
        place = signals.band, signals.interval, j, len(lows), *ranges
        last = (float(x[j]) for x in (signals.rest_speed, effort, typical, free))
        alone = tuple(np.flatnonzero(~together[j]).tolist())
        out.append(Scale._make([*first, *place, *last, alone]))
    return out


def heavier(scales: Sequence[Scale], found: Solution, rows: Rows) -> list[Scale]:
    """Return the magnitudes with the inertia that a set adds to single joints, such as rotors.

    A torque per acceleration is an inertia: the columns are computed again with one more.
    """
    members = [
        m
        for m in found.members
        if m.shape is not None and m.shape.cls.alter is not Effect.alter and len(m.joints) == 1
    ]
    faster = rows._replace(signals=rows.signals._replace(qdd=rows.signals.qdd + 1.0))
    extra = np.zeros(len(scales))
    for m, columns in zip(
        members, columns_of([m.shape for m in members], faster, rows.tau), strict=True
    ):
        (j,) = m.joints
        added = np.median(columns[:, :, j] - m.columns[:, :, 0], axis=1)
        extra[j] += float(found.x[found.of(m)] @ added)
    return [s._replace(inertia=s.inertia + max(extra[s.joint], 0.0)) for s in scales]


def again(i: Item, rows: Rows, predicted: np.ndarray) -> Item:
    """Return an item of another log on this one: both have it in common, so it is no finding."""
    far, group = np.full(len(i.lower), np.inf), (*i.key, f"{i.group[2]} before")
    fresh = item(i.shape, *columns_of([i.shape], rows, predicted))
    return replace(fresh, group=group, lower=-far, upper=far, odds=0.0, common=False, always=True)


def noise_of(rows: Rows, left: np.ndarray, items: Sequence[Item]) -> tuple[np.ndarray, np.ndarray]:
    """Return root mean square (J,) [N or Nm] and effective number of samples (J,) of a residual.

    The residual ``left`` is (N, J), that of ``items``. Training rows count, and drift is weighted
    down.
    """
    use = rows.used & rows.training[:, None]
    left = np.stack([rows.steady(part, j) for j, part in enumerate(left.T)], 1)
    noise = np.maximum(rms(left, use), rows.floor)
    effective, at = np.zeros(len(noise)), without_pauses(rows.signals)[rows.signals.rows]
    for j, here in enumerate(use.T):
        if here.any():
            columns = rows.steady(columns_at(items, j, len(left)), j)[:, here]
            alike, repeated = copies(rows.returns, left[here, j], at[here])
            alike *= correlation_beside(left[here, j], columns, repeated)
            effective[j] = here.sum() / alike
    return noise, effective


def residual(rows: Rows, found: Solution, members: Sequence[Item] | None = None) -> np.ndarray:
    """Return the residual (N, J) [N or Nm] of a set, or of some of its members."""
    left = rows.gap.copy()
    for m in found.members if members is None else members:
        left[:, list(m.joints)] -= np.tensordot(found.x[found.of(m)], m.columns, 1)
    return left


def load_of(rows: Rows, found: Solution) -> np.ndarray:
    """Return the torque (T, J) that a set predicts to reach the joints [N or Nm].

    It is the load that friction reads: the command that the set predicts, after the motor.
    """
    acting = [m for m in found.members if m.actuates]
    held_back = rows.gap - residual(rows, found, acting)
    return upsampled(rows, rows.command - residual(rows, found) - held_back)


def with_friction(rows: Rows, found: Solution) -> Rows:
    """Return the rows with what of a set passes no gear; it reduces the load."""
    rows = behind_encoders(rows, found)
    return rows._replace(unloaded=before_gears(rows.behind.effects, rows.signals, rows.tau))


def behind_encoders(rows: Rows, found: Solution) -> Rows:
    """Return the rows with what acts behind an encoder, links and friction of model and set."""
    own = [
        effect_at(m.shape, vector(m.shape, found.x[found.of(m)]))
        for m in found.members
        if m.shape is not None and (m.shape.cls.friction or m.shape.cls.alter is not Effect.alter)
    ]
    return rows._replace(behind=Behind((*rows.effects, *own), rows.signals.body))


def upsampled(rows: Rows, command: np.ndarray) -> np.ndarray:
    """Return a command (T, J) from the rows' (N, J); the logged one at rests and ends of runs."""
    out, at = rows.tau.copy(), rows.signals.rows
    value = np.where(rows.used, command, rows.command)
    for run in rows.signals.slices:
        inside = (at >= run.start) & (at < run.stop)
        if inside.sum() > 3:
            between = np.arange(at[inside][0], at[inside][-1] + 1)
            out[between] = at_instants(value[inside], at[inside], between)
    return out
