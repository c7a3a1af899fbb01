"""The library: what every effect of the catalogue would add to the command of this log.

It covers every shape that an effect offers. What is linear in an effect's amplitudes is one group
of columns. What has a shape (a speed, a period, a delay ...) is one group for each starting shape;
of these the few that promise most beside all common effects are kept.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from jaxidl.effects import CATALOGUE, Effect
from jaxidl.gap.evidence.friction import friction_along
from jaxidl.gap.evidence.gram import Anchor, Item, samples_alike
from jaxidl.gap.evidence.items import columns_of, items_of
from jaxidl.gap.evidence.links import links_of
from jaxidl.gap.evidence.projection import Projection, aligned, alignments
from jaxidl.gap.evidence.recurrence import copies, without_pauses
from jaxidl.gap.evidence.rows import Rows, rms
from jaxidl.gap.evidence.samples import correlation_beside
from jaxidl.gap.evidence.shape import Present, Shape, effect_at, shapes_of, vector
from jaxidl.gap.fit.prior import plausible
from jaxidl.gap.fit.scales import heavier, scales
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.logs.low_pass import at_instants

ALIKE = 20.0  # correlated samples that count as one, before their number is known
PUSH = 0.01  # additional commands, over its spread, to test whether they are delivered
HELD = 0.1  # time for which it is held [s]: oscillating or late drives deliver it by then
DEAF = 0.8


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

    long = max(3, round(HELD / (signals.dt * float(np.median(np.diff(signals.rows, prepend=0))))))
    use = rows.used & rows.training[:, None]
    ways = np.stack([np.sign(rows.command), signals.command(noise)[signals.rows]])
    out = {}
    for i, along, back, held in zip(
        acting, kept(np.sign(rows.tau)), kept(noise), kept(np.ones_like(rows.tau)), strict=True
    ):
        deaf = (uniform_filter1d(held, long, axis=1) > DEAF) & use
        on = list(i.joints)
        out[id(i)] = {
            "push": (ways[:, :, on], np.stack([along, back])[..., on]),
            "deaf": (deaf.sum(1) / np.maximum(use.sum(0), 1))[:, on],
        }
    return [replace(i, **out[id(i)]) if i.actuates else i for i in items]


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
    signals = rows.signals
    every = scales(rows)
    moving = [s.joint for s in every if s.speed > 0.0 and rows.used[:, s.joint].any()]
    predicted = rows.tau

    def offered(cls: type[Effect]) -> list[Shape]:
        on = [0] if cls.whole else moving
        return [s for j in on for s in shapes_of(cls, every[j], own, reference is not None)]

    classes = [CATALOGUE[name] for name in names]
    links = links_of(signals.body)
    # parts before the effects that contain them
    classes = sorted(classes, key=lambda cls: len(cls.contains()))
    common: list[Item] = []
    for cls in classes:
        if cls.common:
            common += [
                plausible(i, links, ALIKE) for i in items_of(offered(cls), rows, predicted, common)
            ]
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
    shared = (
        tuple(again(i, rows, predicted) for i in reference.items) if reference is not None else ()
    )
    items = [*common, *shared, *alignments(rows, predicted, alike)]
    projected = Projection(rows, items, noise)
    for cls in classes:
        if not cls.common:
            best = projected.best(items_of(offered(cls), rows, predicted, items), left, effective)
            items += [
                i if i.actuates else plausible(i, links, alike)
                for i in pushed(best, rows, predicted)
            ]
    basic = [i for i in items if i.common or i.always]
    score = Score(
        rows,
        items,
        noise,
        effective,
        reference and reference._replace(items=shared),
    )
    return Library(rows, score, score.solve(basic), predicted)


def again(i: Item, rows: Rows, predicted: np.ndarray) -> Item:
    """Return an item of another log on this one: both have it in common, so it is no finding."""
    (columns,) = columns_of([i.shape], rows, predicted)
    far = np.full(len(i.lower), np.inf)
    joints = tuple(range(columns.shape[2]))
    group = (*i.key, f"{i.group[2]} before")
    return Item(group, i.shape, joints, columns, -far, far, 0.0, i.precision, always=True)


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
            beside = [
                rows.steady(i.columns[:, :, i.joints.index(j)], j) for i in items if j in i.joints
            ]
            columns = np.concatenate([np.zeros((0, len(left))), *beside])[:, here]
            alike, repeated = copies(rows.returns, left[here, j], at[here])
            alike *= correlation_beside(left[here, j], columns, repeated)
            effective[j] = here.sum() / alike
    return noise, effective


def residual(
    rows: Rows,
    found: Solution,
    members: Sequence[Item] | None = None,
    joints: Sequence[int] | None = None,
) -> np.ndarray:
    """Return the residual (N, K) [N or Nm] of a set, or of some members, on K of the joints."""
    on_all = list(range(rows.gap.shape[1]) if joints is None else joints)
    left = rows.gap[:, on_all]
    for m in found.members if members is None else members:
        on = [k for k, j in enumerate(on_all) if j in m.joints]
        if on:
            own = [m.joints.index(on_all[k]) for k in on]
            left[:, on] -= np.tensordot(found.x[found.of(m)], m.columns[:, :, own], 1)
    return left


def load_of(rows: Rows, found: Solution) -> np.ndarray:
    """Return the torque (T, J) that a set predicts to reach the joints [N or Nm].

    It is the load that friction reads: the command that the set predicts, after the motor.
    """
    acting = [m for m in found.members if m.actuates]
    held_back = rows.gap - residual(rows, found, acting)
    return upsampled(rows, rows.command - residual(rows, found) - held_back)


def with_friction(rows: Rows, found: Solution) -> Rows:
    """Return the rows with the friction of a set that needs no load; it reduces the load."""
    rows = rubbed(rows, found)
    return rows._replace(unloaded=friction_along(rows.rubbing, rows.signals, rows.tau))


def rubbed(rows: Rows, found: Solution) -> Rows:
    """Return the rows with the friction that acts behind an encoder: the model's and a set's."""
    own = [
        effect_at(m.shape, vector(m.shape, found.x[found.of(m)]))
        for m in found.members
        if m.shape is not None and m.shape.cls.friction
    ]
    return rows._replace(rubbing=(*rows.effects, *own))


def upsampled(rows: Rows, command: np.ndarray) -> np.ndarray:
    """Return a command (T, J) from its values (N, J) at the rows.

    It is the logged one where a joint rests and near the ends of runs.
    """
    out, at = rows.tau.copy(), rows.signals.rows
    value = np.where(rows.used, command, rows.command)
    for run in rows.signals.slices:
        inside = (at >= run.start) & (at < run.stop)
        if inside.sum() > 3:
            between = np.arange(at[inside][0], at[inside][-1] + 1)
            out[between] = at_instants(value[inside], at[inside], between)
    return out
