"""The effects of a set with all of their parameters, physical and with standard errors.

All are fitted together by least squares, but for shapes that the encoder's noise would bias: those
are fitted one by one (:mod:`jaxidl.gap.fit.shapes`); the rest says how well they are known.

A standard error has three parts: the jackknife's over blocks, of all parameters of all effects
together; that of least squares with the effective number of samples
(:meth:`jaxidl.gap.fit.score.Score.covariance`), since a motion that repeats itself also repeats the
errors of the model, and its blocks scatter less than their errors; and that of unknown torque
constants (:mod:`jaxidl.gap.fit.torque_constants`). No time is known better than to a sampling
interval. Once the log was resampled, the jackknife's part is not less than how far values are off
on draws, each of which chooses its own set (:func:`resampled`).
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jaxidl.effects import Effect, place_of
from jaxidl.gap.evidence.gram import Group, Item, Key
from jaxidl.gap.evidence.items import absorbed
from jaxidl.gap.evidence.noise import accelerates
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import (
    Shape,
    build,
    effect_at,
    limits,
    movable,
    on_bound,
    present,
    vector,
)
from jaxidl.gap.fit.consistent import physical_fits
from jaxidl.gap.fit.held_out import covariance_of, jackknife, wald
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.shapes import arriving, fitted, tangent
from jaxidl.gap.fit.torque_constants import swayed


class Value(NamedTuple):
    """An effect with its parameters."""

    key: Key
    items: tuple[Item, ...]
    effect: Effect  # ready for a plant
    # value and standard error of the fitted parameters
    parameters: dict[str, tuple[np.ndarray, np.ndarray]]
    on_bound: bool  # whether a parameter besides the amplitudes is on a plausible bound
    # several coefficients that are all its parameters: root mean square [standard errors], jointly
    together: float = 0.0
    # least share of it that is there, by two standard errors; 0 where parameters tell
    share: float = 0.0
    scatter: Mapping[str, np.ndarray] = {}  # the jackknife's part of the standard errors
    # the fitted parameters if the coefficients of its items are off by (P,)
    moved: Callable[[np.ndarray], Mapping[str, np.ndarray]] = lambda by: {}


def resampled(
    value: Value,
    draws: Sequence[Mapping[Group, np.ndarray]],
    others: Sequence[tuple[float, Mapping[Group, np.ndarray]]] = (),
) -> Value:
    """Return an effect with standard errors that cover the choice of the set, too.

    Coefficients are off on ``draws``, which are resampled logs, and in ``others``, which are sets
    that explain the log as well, each with its probability. Errors of fitted shapes, and of what
    was found on less than two draws, stay as they are. Changes since a reference log have no draws:
    on these, part of a load is taken for changes of links that the search rejects.
    """
    off = [
        np.concatenate([d[i.group] for i in value.items])
        for d in draws
        if all(i.group in d for i in value.items)
    ]
    if len(off) < 2 or not all(map(_plain, value.items)):
        return value
    moved = [value.moved(by) for by in off]
    elsewhere = [
        (share, value.moved(np.concatenate([by[i.group] for i in value.items])))
        for share, by in others
        if all(i.group in by for i in value.items)
    ]
    parameters = {}
    for n, (v, e) in value.parameters.items():
        square = np.mean([(m[n] - v) ** 2 for m in moved], axis=0) - value.scatter[n] ** 2
        apart = np.max([0.0 * v, *(share * (m[n] - v) ** 2 for share, m in elsewhere)], axis=0)
        parameters[n] = v, np.sqrt(e**2 + np.maximum(square, 0.0) + apart)
    return value._replace(parameters=parameters)


def values(
    score: Score,
    now: Solution,
    rows: Rows,
    predicted: np.ndarray,
    apart: Collection[Key] = frozenset(),
) -> list[Value]:
    """Return the effects of a set, fitted to all training ``rows``, in the catalogue's order.

    ``predicted`` (T, J) is the command that the set predicts [N or Nm]. An effect takes up its
    parts, but for those ``apart``, which are only what they add to their parts.
    """
    members, noisy = now.members, [spares(m) for m in now.members]
    clean = spared(score, now, rows, predicted) if any(noisy) else now
    x = [clean.x[clean.of(m)] for m in clean.members]
    starts = [v if _plain(m) else vector(m.shape, v) for m, v in zip(clean.members, x, strict=True)]
    tangents, gap, command = [], rows.gap.copy(), rows.command.copy()
    for m, theta in zip(clean.members, starts, strict=True):
        if _plain(m):
            tangents.append(somewhere(m, score) if m.key[0] == ALIGNMENT else m)
            continue
        there = arriving(m, clean.members, x, rows, predicted)
        t = tangent(m.shape, theta, there, predicted)
        base = t.value - np.tensordot(theta, t.columns, 1)
        gap -= base
        command -= base * m.actuates
        lower, upper = limits(m.shape)
        tangents.append(
            replace(
                m,
                columns=t.columns[:, :, list(m.joints)],
                lower=lower,
                upper=upper,
                precision=np.zeros(len(theta)),
                push=None,
                deaf=None,
            )
        )
    near = rows._replace(gap=gap, command=command)
    fit = _fitted(tangents, near, rows, score)
    if any(noisy):
        pinned = [
            replace(t, lower=theta, upper=theta) if fixed else t
            for fixed, t, theta in zip(noisy, tangents, starts, strict=True)
        ]
        value = _fitted(pinned, near, rows, score).x
        fit = fit._replace(x=value, folds=fit.folds + value - fit.x)
    groups: dict[Key, list[int]] = {}
    for n, m in enumerate(members):
        if not m.always:
            groups.setdefault(m.key, []).append(n)
    parts = {part: whole for part, whole in absorbed(members).items() if whole not in apart}
    out = []
    for key, numbers in sorted(groups.items(), key=lambda group: place_of(group[0][0])):
        if key in parts:
            continue
        whole = [(members[n], fit.places[n]) for n in numbers]
        taken = [
            (k[0], fit.places[groups[k][0]]) for k in parts if k[1] == key[1] and parts[k] == key
        ]
        value = _value(key, whole, taken, fit, rows.signals.interval)
        # where no parameter says so: a drive without stiffness is not one without a spring
        at = [clean.of(m) for n in numbers if noisy[n] and not (m := clean.members[n]).shape.free]
        share = [float(clean.x[a][0] - 2.0 * jackknife(clean.folds[:, a])[0]) for a in at]
        out.append(value._replace(share=max([0.0, *share])))
    return out


def somewhere(m: Item, score: Score) -> Item:
    """Return an alignment of torques with the prior that it is anywhere within its bounds.

    When a logged torque acts is known no worse than that. The search has a wider one, so that only
    the log tells it from a delay.
    """
    known = 12.0 / (m.upper - m.lower) ** 2  # inverse variance of a uniform distribution
    return replace(m, precision=np.maximum(m.precision, score.alike * known))


def spared(score: Score, now: Solution, rows: Rows, predicted: np.ndarray) -> Solution:
    """Return a set with the shapes fitted that the encoder's noise would bias."""

    def solve(every: Sequence[Item]) -> Solution:
        return Score(rows, every, score.noise, score.effective, score.anchor).solve(every)

    before, members = solve(now.members), now.members
    x = [before.x[before.of(m)] for m in members]
    there = lambda m: arriving(m, members, x, rows, predicted)
    anew = lambda m: fitted(m, before, there(m), predicted, score) if spares(m) else m
    return solve([anew(m) for m in members])


def spares(m: Item) -> bool:
    """Return whether the encoder's noise would bias a member's parameters."""
    return not m.always and accelerates(m.shape) and bool(movable(m.shape))


def _plain(m: Item) -> bool:
    """Return whether a member's coefficients are all of its parameters."""
    return m.always or not movable(m.shape)


class _Fit(NamedTuple):
    """Coefficients of all members, side by side: P coefficients, B blocks."""

    places: list[slice]  # of each member
    x: np.ndarray  # (P,)
    folds: np.ndarray  # (B, P) without one block each
    covariance: np.ndarray  # (P, P)


def _fitted(members: Sequence[Item], near: Rows, rows: Rows, score: Score) -> _Fit:
    fresh = Score(near, members, score.noise, score.effective, score.anchor)
    best = fresh.solve(members)
    x = physical_fits(fresh, best, near)
    x = np.concatenate([best.x[None], best.folds]) if x is None else x
    covariance = fresh.covariance(best) + swayed(fresh, best, rows, residual(near, best))
    return _Fit([best.of(m) for m in members], x[0], x[1:], covariance)


def _value(
    key: Key, whole: list[tuple[Item, slice]], taken: list[tuple[str, slice]], fit: _Fit, dt: float
) -> Value:
    """Return an effect of one or several items, such as a rotor and a body.

    Its parts' share is added to its own parameters.
    """
    items = tuple(i for i, _ in whole)
    shape: Shape = items[0].shape

    def at(x: np.ndarray) -> Effect:
        (sums,) = present([effect_at(i.shape, x[place]) for i, place in whole]).values()
        total = dict(sums)
        for name, place in taken:
            amplitudes = dict(shape.parts)[name] * float(x[place][0])
            for n, part in shape.cut(shape.free, amplitudes).items():
                total[n] = total[n] + part.reshape(total[n].shape)
        return build(shape.cls, shape.joint, shape.joints, total, shape.options)

    read = lambda e, n: np.ravel(np.asarray(getattr(getattr(e, "effect", e), n), float))
    every = _places([place for _, place in (*whole, *taken)])
    size, u = np.linalg.eigh(fit.covariance[np.ix_(every, every)])
    apart = np.repeat(fit.x[None], len(every), 0)
    apart[:, every] += (u * np.sqrt(np.maximum(size, 0.0))).T  # by a standard error in each way
    fitted = {n for i in items for n in (*i.shape.free, *movable(i.shape))}
    hidden = shape.cls.internal  # converted into others, all of which are then shown,
    names = [n for n in shape.cls.parameters if n not in hidden and (hidden or n in fitted)]
    final = lambda x: at(x).settled()
    if any(np.any(read(final(fit.x), n) != 0.0) for n in hidden):  # but for a load without mass
        names, final = [n for n in shape.cls.parameters if n in fitted], at
    effect, others, moved = final(fit.x), [*map(final, fit.folds)], [*map(final, apart)]
    parameters, scatter = {}, {}
    for n in names:
        value = read(effect, n)
        scatter[n] = jackknife(np.stack([read(e, n) for e in others]))
        alike = np.sqrt(np.sum([(read(e, n) - value) ** 2 for e in moved], 0))
        least = dt / np.sqrt(12.0) if shape.cls.parameters[n].unit == "s" else 0.0
        parameters[n] = (value, np.sqrt(scatter[n] ** 2 + alike**2 + least**2))
    parameters = {
        n: (v, e) for n, (v, e) in parameters.items() if np.any(v != 0.0) or np.any(e != 0.0)
    } or parameters
    bound = any(movable(i.shape) and on_bound(i.shape, fit.x[place]) for i, place in whole)
    own, together = _places([place for _, place in whole]), 0.0
    if len(own) > 1 and all(map(_plain, items)):
        spread = covariance_of(fit.folds[:, own])
        together = wald(fit.x[own], spread + fit.covariance[np.ix_(own, own)])

    def off(by: np.ndarray) -> dict[str, np.ndarray]:
        x = fit.x.copy()
        x[own] += by
        there = final(x)
        return {n: read(there, n) for n in parameters}

    return Value(key, items, effect, parameters, bound, together, scatter=scatter, moved=off)


def _places(places: Sequence[slice]) -> np.ndarray:
    return np.concatenate([np.arange(p.start, p.stop) for p in places])
