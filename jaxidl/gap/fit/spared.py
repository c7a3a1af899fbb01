"""Shapes that the encoder's noise would bias, fitted to all of a log without it.

Each is fitted beside the other members (:mod:`jaxidl.gap.fit.shapes`); least squares of all
parameters together, which do not know of noise, then say how well they are known.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.noise import accelerates
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import movable
from jaxidl.gap.fit.held_out import jackknife
from jaxidl.gap.fit.motors import arriving
from jaxidl.gap.fit.score import Score
from jaxidl.gap.fit.shapes import fitted


class Spared(NamedTuple):
    """A set with such shapes fitted."""

    members: Sequence[Item]
    x: Sequence[np.ndarray]  # coefficients of each member
    # least share of an effect that is there, by two standard errors and its member's number, where
    # no parameter says so: a drive without stiffness is not one without a spring
    share: dict[int, float]


def noisy(m: Item) -> bool:
    """Return whether the encoder's noise would bias a member's parameters."""
    return not m.always and accelerates(m.shape) and bool(movable(m.shape))


def spared(
    members: Sequence[Item],
    x: Sequence[np.ndarray],
    rows: Rows,
    score: Score,
    predicted: np.ndarray,
) -> Spared:
    """Return a set with its noisy shapes fitted to all training rows.

    Arguments are those of :func:`jaxidl.gap.fit.values.values`.
    """
    if not any(map(noisy, members)):
        return Spared(members, x, {})
    solve = lambda every: Score(rows, every, score.noise, score.effective, score.anchor).solve(
        every
    )
    before = solve(members)
    known = [before.x[before.of(m)] for m in members]
    fresh = [
        fitted(m, before, arriving(m, members, known, rows, predicted), predicted, score)
        if noisy(m)
        else m
        for m in members
    ]
    best, share = solve(fresh), {}
    for n, m in enumerate(fresh):
        if noisy(m) and not m.shape.free:
            at = best.of(m)
            share[n] = float(best.x[at][0] - 2.0 * jackknife(best.folds[:, at])[0])
    return Spared(fresh, [best.x[best.of(m)] for m in fresh], share)
