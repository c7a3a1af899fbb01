"""The effects of a set with all of their parameters, as they are handed out: physical, and with standard errors.

Standard errors are the jackknife's over blocks, of all parameters of all effects together; no time is known better than to a
sampling interval.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.consistent import physical_fits
from jaxidl.gap.diagnosis import Key
from jaxidl.gap.find import jackknife
from jaxidl.gap.rows import Rows
from jaxidl.gap.score import Item, Score
from jaxidl.gap.shape import Shape, build, effect_at, limits, movable, vector
from jaxidl.gap.shapes import tangent


class Value(NamedTuple):
    """An effect with its parameters."""

    key: Key
    items: tuple[Item, ...]
    effect: Effect  # ready for a plant
    parameters: dict[str, tuple[np.ndarray, np.ndarray]]  # value and standard error of those that were fitted


def values(members: Sequence[Item], x: Sequence[np.ndarray], rows: Rows, score: Score, predicted: np.ndarray) -> list[Value]:
    """Return the effects of a set, fitted to all rows of training.

    Args:
        members: the set.
        x: coefficients of each member, where to begin.
        rows: those to fit: N rows of J joints.
        score: that the members were found with; its noise is the joints' weight.
        predicted: (T, J) command as the set predicts it [N or Nm].
    """
    starts = [v if _plain(m) else vector(m.shape, v) for m, v in zip(members, x, strict=True)]
    tangents, gap = [], rows.gap.copy()
    for m, theta in zip(members, starts, strict=True):
        if _plain(m):
            tangents.append(m)
            continue
        t = tangent(m.shape, theta, rows, predicted)
        gap -= t.value - np.tensordot(theta, t.columns, 1)
        lower, upper = limits(m.shape)
        tangents.append(
            replace(
                m, columns=t.columns[:, :, list(m.joints)], lower=lower, upper=upper, precision=np.zeros(len(theta)), push=None
            )
        )
    thetas, folds = _fitted(tangents, rows._replace(gap=gap), score)
    groups: dict[Key, list[int]] = {}
    for n, m in enumerate(members):
        if not m.always:
            groups.setdefault(m.key, []).append(n)
    parts = _absorbed(members)
    out = []
    for key, numbers in groups.items():
        if key in parts:
            continue
        whole = [(members[n], thetas[n], folds[n]) for n in numbers]
        taken = [
            (name, thetas[n], folds[n])
            for (name, joint), n in ((k, groups[k][0]) for k in parts if k[1] == key[1] and parts[k] == key)
        ]
        out.append(_value(key, whole, taken, rows.signals.dt))
    return out


def _plain(m: Item) -> bool:
    """Are a member's coefficients all of its parameters?"""
    return m.always or m.shape is None or not movable(m.shape)


def _absorbed(members: Sequence[Item]) -> dict[Key, Key]:
    """Parts of effects with a shape, named as their whole: its key by theirs."""
    found: dict[Key, Key] = {}
    keys = {m.key for m in members}
    for m in members:
        if m.shape is not None and not m.shape.cls.linear:
            found |= {(name, m.key[1]): m.key for name, _ in m.shape.parts if (name, m.key[1]) in keys}
    return found


def _fitted(members: Sequence[Item], rows: Rows, score: Score) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Coefficients (P,) of each member, and (B, P) without one block each."""
    fresh = Score(rows, members, score.noise, score.effective, score.anchor)
    best = fresh.solve(members)
    x = physical_fits(fresh, best, rows)
    x = np.concatenate([best.x[None], best.folds]) if x is None else x
    return [x[0, best.of(m)] for m in members], [x[1:, best.of(m)] for m in members]


def _value(
    key: Key, whole: list[tuple[Item, np.ndarray, np.ndarray]], taken: list[tuple[str, np.ndarray, np.ndarray]], dt: float
) -> Value:
    """An effect of one or several items (a rotor and a body, say), with its parts' share put into its own parameters."""
    items = tuple(i for i, _, _ in whole)
    shape: Shape = items[0].shape

    def at(pick: int) -> Effect:
        total: dict[str, Any] = {}
        for i, theta, folds in whole:
            effect = effect_at(i.shape, theta if pick < 0 else folds[pick])
            inner = getattr(effect, "effect", effect)
            own = {n: np.asarray(getattr(inner, n), float) for n in shape.cls.parameters}
            total = {n: own[n] if n not in total else total[n] + own[n] for n in own}
        for name, theta, folds in taken:
            amplitudes = dict(shape.parts)[name] * float((theta if pick < 0 else folds[pick])[0])
            sizes = np.cumsum([np.size(shape.values[n]) for n in shape.free])[:-1]
            for n, part in zip(shape.free, np.split(amplitudes, sizes), strict=True):
                total[n] = total[n] + part.reshape(total[n].shape)
        return build(shape.cls, shape.joint, shape.joints, total, shape.options).settled()

    effect, others = at(-1), [at(k) for k in range(len(whole[0][2]))]
    fitted = {n for i in items for n in (*i.shape.free, *movable(i.shape))}
    hidden = shape.cls.internal  # settled into others, all of which are then shown
    names = [n for n in shape.cls.parameters if n not in hidden and (hidden or n in fitted)]
    read = lambda e, n: np.ravel(np.asarray(getattr(getattr(e, "effect", e), n), float))  # noqa: E731
    parameters = {}
    for n in names:
        stderr = jackknife(np.stack([read(e, n) for e in others]))
        least = dt / np.sqrt(12.0) if shape.cls.parameters[n].unit == "s" else 0.0
        parameters[n] = (read(effect, n), np.hypot(stderr, least))
    parameters = {n: (v, e) for n, (v, e) in parameters.items() if np.any(v != 0.0) or np.any(e != 0.0)} or parameters
    return Value(key, items, effect, parameters)
