"""The library: what every effect of the catalogue, in every shape that it offers, would add to the command of this log.

What is linear in an effect's amplitudes is a group of columns as it is. What has a shape (a speed, a period, a delay ...) is one
group for each starting shape; of these the few that promise most beside everything common stay.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import CubicSpline

from jaxidl.effects import CATALOGUE, Effect, OnJoint, Scale, Variant
from jaxidl.gap.additions import additions
from jaxidl.gap.links import Links, change_of, links_of
from jaxidl.gap.rows import Rows
from jaxidl.gap.score import Anchor, Item, Score, Solution, correlation_time
from jaxidl.gap.signals import Signals

SHAPES = 3  # kept of each effect on a joint
ALIGNMENT = "alignment"
CLEAR = 2.0  # rise of the log likelihood
ALIKE = 20.0  # samples that say as much as one, before it is known how many
PUSH = 0.01  # of the command's spread, to see whether more command delivers more
MOST_SCALED = 2.0  # what an effect adds may be scaled by so much before its shape is fitted


class Shape(NamedTuple):
    """An effect on a joint with values of all its parameters; ``free`` are its amplitudes."""

    cls: type[Effect]
    joint: int | None
    joints: int
    free: tuple[str, ...]
    values: Mapping[str, Any]
    options: Mapping[str, Any]
    within: Mapping[str, tuple[float, float]]
    amplitudes: frozenset[str] = frozenset()  # of all shapes of the effect
    basis: np.ndarray | None = None  # (A, P): of the amplitudes, those combinations that the effect's parts cannot imitate
    parts: tuple[
        tuple[str, np.ndarray], ...
    ] = ()  # names of the parts, and the amplitudes (A,) that add what one unit of them adds

    def probes(self) -> tuple[list[Effect], np.ndarray]:
        """Return an effect for each amplitude (P), or one at the values, and by what their additions are to be divided (P,)."""
        if not self.free:
            return [self.effect()], np.ones(1)
        whole = self._replace(basis=None)
        far = np.minimum(np.abs(whole.limits()[1]), np.abs(whole.limits()[0]) + np.abs(whole.limits()[1]))
        size = np.where(np.isfinite(far) & (far > 0.0), np.minimum(0.5 * far, 1.0), 1.0)  # a motor's curve ends at its bound
        return [whole.at(row) for row in np.diag(size)], size

    def effect(self, **changes: Any) -> Effect:
        """Return the effect of the whole mechanism with some parameters changed."""
        return build(self.cls, self.joint, self.joints, {**self.values, **changes}, self.options)

    def at(self, x: np.ndarray) -> Effect:
        """Return the effect with amplitudes ``x`` (P,), or scaled to a first approximation by the one number ``x``."""
        if not self.free:
            return self.effect(**self.scaled(float(x[0])))
        sizes = [np.size(self.values[name]) for name in self.free]
        amplitudes = np.asarray(x, float) if self.basis is None else self.basis @ x
        parts = np.split(amplitudes, np.cumsum(sizes)[:-1])
        return self.effect(**{n: p.reshape(np.shape(self.values[n])) for n, p in zip(self.free, parts, strict=True)})

    def scaled(self, share: float) -> dict[str, np.ndarray]:
        """Return values of an effect without amplitudes that adds about ``share`` of what it adds at its own."""
        if len(self.values) != 1 or not np.isfinite(self.cls.neutral):
            return {}
        (name,) = self.values
        low, high = self.bounds(name)
        value = np.asarray(self.values[name])
        return {name: np.asarray(np.clip(self.cls.neutral + share * (value - self.cls.neutral), low, high))}

    def bounds(self, name: str) -> tuple[float, float]:
        """Return the bounds of a parameter: the variant's within the catalogue's."""
        spec = self.cls.parameters[name]
        return self.within.get(name, (spec.lower, spec.upper))

    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Return lower and upper bounds (P,) of the coefficients."""
        if self.free:
            pairs = np.array([self.bounds(name) for name in self.free for _ in range(np.size(self.values[name]))]).T
            if self.basis is None:
                return pairs[0], pairs[1]
            whole = [np.flatnonzero(column)[0] if np.count_nonzero(column) == 1 else -1 for column in self.basis.T]
            low, high = (
                np.array([s[k] if k >= 0 else far for k in whole]) for s, far in zip(pairs, (-np.inf, np.inf), strict=True)
            )
            return low, high
        neutral, least = self.cls.neutral, 0.0
        if len(self.values) == 1 and np.isfinite(neutral):
            (name,) = self.values
            low, high = self.bounds(name)
            other = neutral - MOST_SCALED * (np.asarray(self.values[name]) - neutral)
            least = -MOST_SCALED if np.all((other >= low) & (other <= high)) else 0.0
        return np.array([least]), np.array([MOST_SCALED])


def build(cls: type[Effect], joint: int | None, joints: int, values: Mapping[str, Any], options: Mapping[str, Any]) -> Effect:
    """Return an effect of the whole mechanism from values of one joint, or of all if it belongs to no one."""
    own = cls.alone() and joint is not None
    arrays = {n: jnp.asarray(np.atleast_1d(np.asarray(v, float)) if own else np.asarray(v, float)) for n, v in values.items()}
    effect = cls(**arrays, **options)
    return OnJoint(effect, joint, joints) if own and joint is not None else effect


def shapes_of(
    cls: type[Effect], scale: Scale, own: "Present" = MappingProxyType({}), changed: bool = False
) -> list[tuple[Shape, float]]:
    """Return the shapes that an effect offers on a joint, each with its prior: the effect's, shared by shapes that compete.

    Beside what the model has of it (``own``) an effect may be less by as much. Where it is asked what ``changed`` since another
    log, the prior is that of a change.
    """
    found = []
    variants = cls.variants(scale)
    amplitudes = frozenset(name for v in variants for name in v.free)
    rivals = {v.free: sum(o.free == v.free for o in variants) if cls.linear else len(variants) for v in variants}
    for variant in variants:
        values = {name: np.asarray(variant.values.get(name, 0.0), float) for name in cls.parameters}
        bounds = {n: variant.within[n] for n in variant.within if n not in variant.free}
        if any(np.any(values[n] < low) or np.any(values[n] > high) for n, (low, high) in bounds.items()):
            continue  # not plausible on this joint
        joint = None if cls.whole else scale.joint
        there = own.get((cls.name, joint), {})
        less = {n: float(np.min(there[n])) for n in variant.free if n in there and np.ndim(there[n]) <= 1}
        within = {**variant.within}
        for n, value in less.items():
            low, high = within.get(n, (cls.parameters[n].lower, cls.parameters[n].upper))
            within[n] = (low - max(value, 0.0), high)
        if changed:  # it may be less, too: a load that is gone
            within |= {n: (-np.inf, within.get(n, (0.0, np.inf))[1]) for n in variant.free}
        shape = Shape(cls, joint, scale.joints, variant.free, values, variant.options, within, amplitudes)
        prior = cls.changes if changed else cls.prior if variant.prior is None else variant.prior
        found.append((shape, prior / rivals[variant.free]))
    return found


def plausible(i: Item, links: Links | None, alike: float) -> Item:
    """Return an item with the prior on its coefficients: how large a change of a link is plausible, where it changes links.

    Neighbouring samples are alike, ``alike`` of them say as much as one, and the prior is weighted like the data.
    """
    if links is None or i.shape is None or i.shape.joint is None or i.shape.cls.alter is Effect.alter or not i.shape.free:
        return i
    changes = np.stack([change_of(i.shape.at(row), links) for row in np.eye(len(i.lower))])
    return replace(i, precision=alike * np.sum((changes / links.plausible) ** 2, (1, 2)))


def pushed(i: Item, rows: Rows, predicted: np.ndarray) -> Item:
    """Return an item of an actuator with what it keeps back of a little more command, per command."""
    nudge = PUSH * np.maximum(rows.spread, 1e-300)
    more = rows._replace(tau=rows.tau + nudge * np.sign(rows.tau))
    change = columns_of(i.shape, more, predicted + nudge * np.sign(predicted)) - columns_of(i.shape, rows, predicted)
    return replace(i, push=(change * np.sign(rows.command) / nudge)[:, :, list(i.joints)])


def scales(signals: Signals, residual: np.ndarray) -> list[Scale]:
    """Return how large things are on each joint, of whose command the model leaves ``residual`` (J,) [N or Nm]."""
    lows, highs = np.quantile(signals.q, [0.002, 0.998], axis=0)
    inertia = np.median(np.diagonal(signals.tables.inertia, axis1=1, axis2=2), axis=0)
    speed = np.quantile(np.abs(signals.qd), 0.998, axis=0)
    torque, count = np.abs(signals.tau).max(0), len(lows)
    return [
        Scale(
            float(torque[j]), float(speed[j]), float(lows[j]), float(highs[j]), float(inertia[j]), float(residual[j]),
            signals.band, signals.dt, j, count, tuple(lows.tolist()), tuple(highs.tolist()), float(signals.rest_speed[j]),
        )
        for j in range(count)
    ]  # fmt: skip


def beside(shape: Shape, columns: np.ndarray, parts: Sequence[tuple[str, np.ndarray]]) -> tuple[Shape, np.ndarray]:
    """Return a shape with those combinations of its amplitudes only that add what its ``parts`` (N, J) do not, and its columns.

    So an effect never stands in for a simpler one that it contains: beside the simpler one it is what is special about it.
    """
    flat, directions = columns.reshape(len(columns), -1), []
    inverse = np.linalg.pinv(flat @ flat.T, rcond=1e-12, hermitian=True)
    for name, part in parts:
        amplitudes = inverse @ (flat @ part.ravel())
        if np.linalg.norm(part.ravel() - amplitudes @ flat) < 1e-6 * np.linalg.norm(part):
            directions.append((name, amplitudes))
    if not directions:
        return shape, columns
    u, s, _ = np.linalg.svd(np.array([d for _, d in directions]).T)
    basis = np.where(np.abs(left := u[:, int(np.sum(s > 1e-9 * s[0])) :]) > 1e-9, left, 0.0)
    return shape._replace(basis=basis, parts=tuple(directions)), np.tensordot(basis.T, columns, 1)


def items_of(shapes: Sequence[tuple[Shape, float]], rows: Rows, predicted: np.ndarray, others: Sequence[Item] = ()) -> list[Item]:
    """Return items of shapes of one class, beside ``others`` that they may have as parts: their columns computed side by side."""
    out, jobs = [], [(shape, prior, *shape.probes()) for shape, prior in shapes]
    together: dict[Any, list[int]] = {}
    for number, (_, _, probes, _) in enumerate(jobs):
        alike = [np.shape(x) for x in jax.tree.leaves(probes[0])]
        together.setdefault((jax.tree.structure(probes[0]), str(alike)), []).append(number)
    columns: dict[int, np.ndarray] = {}
    for numbers in together.values():
        every = [p for n in numbers for p in jobs[n][2]]
        added, _ = additions(every, rows.signals, rows.tau, predicted)
        for n, part in zip(numbers, np.split(added, np.cumsum([len(jobs[n][2]) for n in numbers])[:-1]), strict=True):
            columns[n] = part / jobs[n][3][:, None, None]
    for n, (shape, prior, _, _) in enumerate(jobs):
        names = shape.cls.contains(shape.free) if shape.free and shape.joint is not None else ()
        simpler = [
            (o.key[0], spread(o, rows)[0])
            for o in others
            if o.key in {(name, shape.joint) for name in names} and len(o.lower) == 1
        ]
        shape, own = beside(shape._replace(basis=None, parts=()), columns[n], simpler)
        if len(own):
            out.append(item(shape, prior, own))
    return [i for i in out if i.joints]


def columns_of(shape: Shape, rows: Rows, predicted: np.ndarray) -> np.ndarray:
    """Return the columns (P, N, J) of a shape."""
    probes, size = shape.probes()
    columns = additions(probes, rows.signals, rows.tau, predicted)[0] / size[:, None, None]
    return columns if shape.basis is None else np.tensordot(shape.basis.T, columns, 1)


def spread(i: Item, rows: Rows) -> np.ndarray:
    """Return an item's columns (P, N, J) on all joints."""
    out = np.zeros((len(i.lower), *rows.gap.shape))
    out[:, :, list(i.joints)] = i.columns
    return out


def item(shape: Shape, prior: float, columns: np.ndarray) -> Item:
    """Return the item of a shape with columns (P, N, J); joints that it does not touch are left out."""
    cls = shape.cls
    size = np.sqrt(np.mean(columns**2, 1))  # (P, J)
    joints = tuple(np.flatnonzero((size > 1e-9 * np.maximum(size.max(initial=0.0), 1e-300)).any(0)).tolist())
    lower, upper = shape.limits()
    part = "+".join(shape.free) if cls.linear else ""
    acts = cls.actuate is not Effect.actuate
    odds = float(np.log(prior / (1.0 - prior)))
    group, none = (cls.name, shape.joint, part), np.zeros(len(lower))
    return Item(group, shape, joints, columns[:, :, list(joints)], lower, upper, odds, none, acts, cls.common)


class Library(NamedTuple):
    """Items of a log, what everything common together leaves, and the score made for them."""

    rows: Rows
    score: Score
    envelope: Solution
    predicted: np.ndarray  # (T, J) command as everything common predicts it [N or Nm]
    still: tuple[int, ...]  # joints that never move


Present = Mapping[tuple[str, int | None], Mapping[str, np.ndarray]]


def present(effects: Sequence[Effect]) -> Present:
    """Return what a model has already: the sums of the parameters of effects of one name and joint."""
    found: dict[tuple[str, int | None], dict[str, np.ndarray]] = {}
    for effect in effects:
        inner = effect.effect if isinstance(effect, OnJoint) else effect
        own = found.setdefault((inner.name, getattr(effect, "joint", None)), {})
        for name in inner.parameters:
            own[name] = own.get(name, 0.0) + np.asarray(getattr(inner, name), float)
    return found


class Reference(NamedTuple):
    """Another log of the same machine: what both have in common, and what that log says of it."""

    items: tuple[Item, ...]  # of that log
    information: np.ndarray  # (P, P)
    pull: np.ndarray  # (P,)


def library(rows: Rows, names: Sequence[str], own: Present, reference: Reference | None = None) -> Library:
    """Return the library of the effects ``names``.

    Args:
        rows: N rows of the log.
        names: of the catalogue.
        own: what the model has of them.
        reference: another log, for which the model was made; then only what changed since competes.
    """
    signals = rows.signals
    every = scales(signals, rms(rows.gap, rows.used))
    moving = [s for s in every if s.speed > 0.0 and rows.used[:, s.joint].any()]
    predicted = rows.tau
    classes = [CATALOGUE[name] for name in names]
    offered = {
        cls: [s for scale in (every[:1] if cls.whole else moving) for s in shapes_of(cls, scale, own, reference is not None)]
        for cls in classes
    }
    links = links_of(signals.body)
    common = [plausible(i, links, ALIKE) for cls in classes if cls.common for i in items_of(offered[cls], rows, predicted)]
    rows = aligned(rows, common)
    spread = np.maximum(rms(rows.gap, rows.used & rows.training[:, None]), rows.floor)
    first = Score(rows, common, spread, np.ones(len(spread)))
    envelope = first.solve(common)
    left = residual(rows, envelope)
    noise, effective = noise_of(rows, left)
    predicted = upsampled(rows, rows.command - left)
    alike = float(np.median((rows.used & rows.training[:, None]).sum(0) / np.maximum(effective, 1.0)))
    common = [plausible(i, links, alike) for i in common]
    shared = tuple(again(i, rows, predicted) for i in reference.items) if reference is not None else ()
    items = [*common, *shared, *alignments(rows, predicted)]
    projected = Projection(rows, items, noise)
    for cls in classes:
        if not cls.common:
            best = projected.best(items_of(offered[cls], rows, predicted, common), left, effective)
            items += [pushed(i, rows, predicted) if i.actuates else plausible(i, links, alike) for i in best]
    basic = [i for i in items if i.common or i.always]
    score = Score(
        rows, items, noise, effective, Anchor(shared, reference.information, reference.pull) if reference is not None else None
    )
    still = tuple(j for j in range(len(every)) if every[j] not in moving)
    return Library(rows, score, score.solve(basic), predicted, still)


def again(i: Item, rows: Rows, predicted: np.ndarray) -> Item:
    """Return an item of another log on this one: what both have in common, and no finding."""
    columns = columns_of(i.shape, rows, predicted)
    far = np.full(len(i.lower), np.inf)
    joints = tuple(range(columns.shape[2]))
    group = (i.group[0], i.group[1], f"{i.group[2]} before")
    return replace(
        i,
        group=group,
        joints=joints,
        columns=columns,
        lower=-far,
        upper=far,
        odds=0.0,
        common=False,
        always=True,
        push=None,
        actuates=False,
    )


def aligned(rows: Rows, common: Sequence[Item]) -> Rows:
    """Return the rows with the torque of each joint shifted in time as everything common fits it best.

    Whether a logged torque acts at its instant, over the interval that follows or over the one before is the logger's convention,
    and no effect. A torque that comes before its motion by more than that is a delay, and left for the search.
    """
    joints = rows.gap.shape[1]
    projected = Projection(rows, common, np.ones(joints))
    steps = np.arange(-6, 3) * rows.signals.dt / 4
    values = np.stack([projected.left_of(rows.shifted(s)) for s in steps])  # (S, J)
    zero, best = int(np.argmin(np.abs(steps))), values.argmin(0)
    return rows.shifted(steps[np.where(values[zero] - values.min(0) < CLEAR, zero, best)])


def alignments(rows: Rows, predicted: np.ndarray) -> list[Item]:
    """Return for each joint what is left of that shift, which every set has: a quarter of a sample either way."""
    s, found = rows.signals, []
    slope = s.smooth(s.differentiate(predicted))[s.rows]
    for j in np.flatnonzero(np.any(slope != 0.0, 0)).tolist():
        column, reach = slope[None, :, j : j + 1], np.array([s.dt / 4])
        found.append(Item((ALIGNMENT, j, ""), None, (j,), column, -reach, reach, 0.0, np.zeros(1), always=True))
    return found


def noise_of(rows: Rows, left: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return root mean square (J,) [N or Nm] and effective number of samples (J,) of what is left (N, J) in training."""
    use = rows.used & rows.training[:, None]
    noise = np.maximum(rms(left, use), rows.floor)
    effective = [use[:, j].sum() / correlation_time(left[use[:, j], j]) if use[:, j].any() else 0.0 for j in range(len(noise))]
    return noise, np.array(effective)


def rms(x: np.ndarray, use: np.ndarray) -> np.ndarray:
    """Return the root mean square (J,) of ``x`` (N, J) where ``use`` (N, J) is true."""
    return np.sqrt(np.sum(x**2 * use, 0) / np.maximum(use.sum(0), 1))


def residual(rows: Rows, found: Solution) -> np.ndarray:
    """Return what a set leaves of the command (N, J) [N or Nm]."""
    left = rows.gap.copy()
    for m in found.members:
        left[:, list(m.joints)] -= np.tensordot(found.x[found.of(m)], m.columns, 1)
    return left


def upsampled(rows: Rows, command: np.ndarray) -> np.ndarray:
    """Return a command (T, J) from its values (N, J) at the rows; as logged where a joint rests and near the ends of runs."""
    out, at = rows.tau.copy(), rows.signals.rows
    value = np.where(rows.used, command, rows.command)
    for run in rows.signals.slices:
        inside = (at >= run.start) & (at < run.stop)
        if inside.sum() > 3:
            between = np.arange(at[inside][0], at[inside][-1] + 1)
            out[between] = CubicSpline(at[inside], value[inside])(between)
    return out


class Projection:
    """What everything common cannot imitate of a column, to see which shapes promise most."""

    def __init__(self, rows: Rows, common: Sequence[Item], noise: np.ndarray):
        self.use, self.noise, self.bases = rows.used & rows.training[:, None], noise, []
        for j in range(len(noise)):
            on = [i.columns[:, :, i.joints.index(j)][:, self.use[:, j]] for i in common if j in i.joints]
            x = np.concatenate([np.zeros((0, self.use[:, j].sum())), *on]).T
            x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
            u, s, _ = np.linalg.svd(x, full_matrices=False) if x.size else (x, np.zeros(0), None)
            self.bases.append(u[:, s > 1e-5 * s.max(initial=1e-300)])

    def left_of(self, rows: Rows) -> np.ndarray:
        """Return minus the log likelihood (J,) of what everything common leaves of the command."""
        total = np.zeros(len(self.bases))
        for j, basis in enumerate(self.bases):
            y = rows.gap[self.use[:, j], j]
            left = y - basis @ (basis.T @ y)
            square = float(left @ left) / max(len(y), 1)
            if square > 0.0:
                total[j] = 0.5 * len(y) / correlation_time(left) * np.log(max(square, rows.floor[j] ** 2))
        return total

    def best(self, items: Sequence[Item], left: np.ndarray, effective: np.ndarray) -> list[Item]:
        """Return the most promising shapes of each effect and joint."""
        groups: dict[Any, list[tuple[float, int, Item]]] = {}
        for number, i in enumerate(items):
            groups.setdefault(i.group, []).append((self._promise(i, left, effective), -number, i))
        return [i for group in groups.values() for _, _, i in sorted(group, key=lambda g: g[:2], reverse=True)[:SHAPES]]

    def _promise(self, i: Item, left: np.ndarray, effective: np.ndarray) -> float:
        parts, wanted = [], []
        for k, j in enumerate(i.joints):
            x = i.columns[:, self.use[:, j], k].T / self.noise[j]
            parts.append(x - self.bases[j] @ (self.bases[j].T @ x))
            wanted.append(left[self.use[:, j], j] / self.noise[j])
        x, y = np.concatenate(parts), np.concatenate(wanted)
        gram = x.T @ x
        step = np.linalg.solve(gram + (1e-6 * np.trace(gram) / len(gram) + 1e-300) * np.eye(len(gram)), x.T @ y)
        if len(step) == 1:
            step = np.clip(step, i.lower, i.upper)
        gain = float(2 * step @ (x.T @ y) - step @ gram @ step)
        rate = float(np.clip(gain / max(y @ y, 1e-300), 0.0, 1.0 - 1e-9))
        return -0.5 * effective[list(i.joints)].sum() * np.log(1.0 - rate) - len(step) + i.odds


__all__ = ["Library", "Shape", "Variant", "library"]
