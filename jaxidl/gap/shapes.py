"""Fits of the shapes of effects: speeds, periods, delays ... of those that a search chose.

Effects are fitted one after the other: what the other members can imitate is projected out of what
an effect adds and of its derivatives (variable projection, Golub and Pereyra 1973); bounded least
squares then change all of its free parameters.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from jaxidl.gap.additions import additions
from jaxidl.gap.gram import Item
from jaxidl.gap.items import columns_of, item
from jaxidl.gap.library import pushed
from jaxidl.gap.rows import Rows
from jaxidl.gap.score import Score, Solution
from jaxidl.gap.shape import Shape, amplitudes, at_parameters, effect_at, limits, on_bound, vector

EVALUATIONS = 20
CLEAR = 2.0  # rise of the log likelihood
PULLS = (30.0, 3.0)  # pulls towards the start of a fit, in units of one effective sample
SMALL = 1e-4  # relative step of a parameter for differences


class Tangent(NamedTuple):
    """The torque that an effect adds at parameters theta (P,), and its derivatives."""

    value: np.ndarray  # (N, J) [N or Nm]
    columns: np.ndarray  # (P, N, J)


def fitted(m: Item, found: Solution, rows: Rows, predicted: np.ndarray, score: Score) -> Item:
    """Return a member with its shape fitted beside the other members of a set."""
    noise = score.noise
    use = [rows.used[:, j] & rows.training for j in range(len(noise))]
    bases, left = {}, {}
    for j in m.joints:
        others = [
            o.columns[:, :, o.joints.index(j)][:, use[j]]
            for o in found.members
            if o is not m and j in o.joints
        ]
        bases[j] = basis(np.concatenate([np.zeros((0, int(use[j].sum()))), *others]).T / noise[j])
        left[j] = rows.gap[use[j], j] / noise[j]

    def projected(x: np.ndarray) -> np.ndarray:
        """Return stacked rows of (P, N, J) that the others cannot imitate (sum of N, P)."""
        parts = [x[:, use[j], j].T / noise[j] for j in m.joints]
        return np.concatenate(
            [p - bases[j] @ (bases[j].T @ p) for p, j in zip(parts, m.joints, strict=True)]
        )

    wanted = np.concatenate([left[j] - bases[j] @ (bases[j].T @ left[j]) for j in m.joints])
    shape, known = m.shape, {}

    def at(theta: np.ndarray) -> Tangent:
        if theta.tobytes() not in known:
            known[theta.tobytes()] = tangent(shape, theta, rows, predicted)
        return known[theta.tobytes()]

    lower, upper = limits(shape)
    start = np.clip(vector(shape, found.x[found.of(m)]), lower, upper)
    inside = 1e-6 * np.maximum(np.abs(start), 1e-6)
    begin = np.clip(start, lower + inside, upper - inside)

    def minimum(pull: np.ndarray) -> np.ndarray:
        """Return the best parameters with a ``pull`` (Q, P) back to where they began."""
        return least_squares(
            lambda theta: np.append(
                wanted - projected(at(theta).value[None])[:, 0], pull @ (theta - begin)
            ),
            begin,
            lambda theta: np.concatenate([-projected(at(theta).columns), pull]),  # pyright: ignore[reportArgumentType]
            (lower, upper),
            x_scale="jac",
            max_nfev=EVALUATIONS,
            ftol=1e-6,
            xtol=1e-6,
        ).x

    best = minimum(np.zeros((0, len(begin))))
    if on_bound(shape, best):  # what the log does not determine stays near its start
        square = lambda theta: float(np.sum((wanted - projected(at(theta).value[None])[:, 0]) ** 2))
        least = sum(use[j].sum() * score.floor[j] for j in m.joints)
        alike = max(score.effective[list(m.joints)].sum(), 1.0)
        good = max(square(best) * (1.0 + 2.0 * CLEAR / alike), least)
        free = np.arange(len(begin)) >= amplitudes(shape)
        unit = np.sqrt(good / alike) * np.diag(free / np.maximum(np.abs(begin), 1e-300))[free]
        pulled = (minimum(pull * unit) for pull in PULLS)
        best = next((theta for theta in pulled if square(theta) <= good), best)
    shape = at_parameters(shape, best)
    fresh = item(shape, *columns_of([shape], rows, predicted))
    # fitted like this it does nothing: it stays what it was, and the search will drop it
    if not fresh.joints:
        return m
    return pushed([fresh], rows, predicted)[0]


def tangent(shape: Shape, theta: np.ndarray, rows: Rows, predicted: np.ndarray) -> Tangent:
    """Return what an effect adds at its parameters, and the differences of that."""
    _, upper = limits(shape)
    size = np.maximum(SMALL * np.abs(theta), 1e-7 * np.max(np.abs(theta), initial=0.0) + 1e-12)
    step = np.where(theta + size <= upper, size, -size)
    every = [effect_at(shape, row) for row in (theta, *(theta + s for s in np.diag(step)))]
    added, _ = additions(every, rows.signals, rows.tau, predicted)
    return Tangent(added[0], (added[1:] - added[0]) / step[:, None, None])


def basis(x: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of columns (N, P)."""
    x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    u, s, _ = np.linalg.svd(x, full_matrices=False) if x.size else (x, np.zeros(0), None)
    return u[:, s > 1e-5 * s.max(initial=1e-300)]
