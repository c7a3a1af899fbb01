"""A fit that stays physical.

Parameters stay within bounds, friction dissipates wherever the log went, and links could be built.
Least squares under linear and linear matrix inequalities is a small conic program, solved by an
interior-point method (Goulart and Chen, Clarabel, 2024).
"""

# Clarabel's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from collections.abc import Sequence

import clarabel
import numpy as np
from scipy import sparse

from jaxidl.effects import Effect
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.links import Links, change_of, links_of, physical, pseudo_inertia
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.fit.prior import changes, changes_links
from jaxidl.gap.fit.score import Score, Solution

PLACES = 80  # number of a joint's rows at which its friction must dissipate
# bounds this many times beyond what the data ask for are left out: solvers stall on them
FAR_BOUND = 1e3
FAST = 3.0  # times the rest speed: closer to a reversal the filter blurs the direction


def consistent(
    gram: np.ndarray,
    right: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    unequal: np.ndarray,
    least: np.ndarray,
    cones: Sequence[tuple[np.ndarray, np.ndarray]],
) -> np.ndarray | None:
    """Return the minimum (P,) of x·gram·x/2 − right·x, or None if there is none.

    Args:
        gram: (P, P); right: (P,).
        lower, upper: (P,) bounds.
        unequal: (M, P); least: (M,): unequal @ x >= least.
        cones: pairs of a matrix (4, 4) and its derivatives (P, 4, 4): their sum is to be positive
            semidefinite.
    """
    size = np.sqrt(np.diag(gram))
    size = np.where(size > 1e-12 * size.max(initial=0.0), size, 1.0)
    # in units in which the solution is about one
    size = size / (np.abs(right / size).max(initial=0.0) or 1.0)
    gram, right = gram / size / size[:, None], right / size
    eye = np.eye(len(right))
    low, high = lower * size > -FAR_BOUND, upper * size < FAR_BOUND
    rows = [-eye[low], eye[high], -unequal]
    sides = [-lower[low], upper[high], -least]
    kinds: list[object] = [clarabel.NonnegativeConeT(sum(len(r) for r in rows))]
    i, j = np.array([(i, j) for j in range(4) for i in range(j + 1)]).T
    weight = np.where(i == j, 1.0, np.sqrt(2.0))
    for base, slopes in cones:
        scale = 1.0 / max(np.abs(base).max(), 1e-9)
        rows.append(-scale * (slopes[:, i, j] * weight).T)
        sides.append(scale * base[i, j] * weight)
        kinds.append(clarabel.PSDTriangleConeT(4))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    a = sparse.csc_matrix(np.concatenate(rows) / size)
    p = sparse.csc_matrix(np.triu(gram))
    found = clarabel.DefaultSolver(p, -right, a, np.concatenate(sides), kinds, settings).solve()
    if str(found.status) not in ("Solved", "AlmostSolved"):
        return None
    return np.clip(np.asarray(found.x) / size, lower, upper)


def physical_fits(
    score: Score, found: Solution, rows: Rows, folds: bool = True
) -> np.ndarray | None:
    """Return physical coefficients (1 + B, P) of a set fitted to all blocks and without each of B.

    None if its own coefficients are physical already.
    """
    members = found.members
    cones = buildable(members, links_of(rows.signals.body), rows.effects)
    unequal, least = dissipating(members, rows)
    physical = all(
        np.linalg.eigvalsh(base + np.tensordot(found.x, s, 1))[0] >= 0.0 for base, s in cones
    )
    if physical and not np.any(unequal @ found.x < least - 1e-9):
        return None
    gram, right, known, pull = score.normal(members)
    pull = pull + score.dilution(found)
    at = score.indices(members)
    lower, upper = (bound[at] / score.scale[at] for bound in score.bounds)
    whole = gram.sum(0), right.sum(0)
    x = np.concatenate([found.x[None], found.folds]) if folds else found.x[None].copy()
    for k in range(len(x)):
        g, h = whole if k == 0 else (whole[0] - gram[k - 1], whole[1] - right[k - 1])
        ridge = np.diag(1e-9 * np.diag(g) + 1e-12)
        best = consistent(g + known + ridge, h + pull, lower, upper, unequal, least, cones)
        x[k] = x[k] if best is None else best
    return x


def dissipating(members: Sequence[Item], rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (M, P): friction of a joint against its motion, by the members' coefficients.

    There is one row for each of a number of places of the log, but for those where an effect that
    dissipates with any coefficient seems to feed motion: there the filter blurs it. Also return the
    least values (M,) of their products with the coefficients: the model's own friction may be less,
    not reversed.
    """
    signals, count = rows.signals, sum(len(m.lower) for m in members)
    out, least = [np.zeros((0, count))], [np.zeros(0)]
    rubs = [m.shape is not None and m.shape.cls.friction for m in members]
    for j in range(rows.gap.shape[1]):
        here = [friction and m.joints == (j,) for m, friction in zip(members, rubs, strict=True)]
        speed = signals.qd[signals.rows, j]
        fast = np.flatnonzero(rows.used[:, j] & (np.abs(speed) > FAST * signals.rest_speed[j]))
        if not any(here) or not len(fast):
            continue
        picked = fast[np.argsort(np.abs(speed[fast]))][
            np.linspace(0, len(fast) - 1, min(PLACES, len(fast))).astype(int)
        ]
        way, clear, parts = np.sign(speed[picked]), np.ones(len(picked), bool), []
        for m, on in zip(members, here, strict=True):
            part = m.columns[:, picked, 0] * way if on else np.zeros((len(m.lower), len(picked)))
            if on and np.all(m.lower >= 0.0):
                clear &= np.all(part >= 0.0, axis=0)
            parts.append(part)
        against = np.concatenate(parts).T
        size = max(np.abs(against).max(), 1e-300)
        out.append(against[clear] / size)
        least.append(-np.maximum((rows.friction[picked, j] * way)[clear], 0.0) / size)
    return np.concatenate(out), np.concatenate(least)


def buildable(
    members: Sequence[Item], links: Links | None, own: Sequence[Effect]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the pseudo-inertia of each link that the members change, and its derivatives.

    The derivatives are by the members' coefficients. The model's ``own`` effects are included.
    """
    if links is None:
        return []
    none = lambda m: np.zeros((len(m.lower), *links.nominal.shape))
    slopes = np.concatenate(
        [
            np.zeros((0, *links.nominal.shape)),
            *(changes(m, links) if changes_links(m) else none(m) for m in members),
        ]
    )
    nominal = links.nominal + sum((change_of(e, links) for e in own), np.zeros(()))
    if links.same:  # a load is then part of the last link
        slopes[:, -2] += slopes[:, -1]
        nominal[-2] += nominal[-1] - links.nominal[-1]
        slopes, nominal = slopes[:, :-1], nominal[:-1]
    found = []
    for link, numbers in enumerate(nominal):
        if not np.any(slopes[:, link]) or not physical(numbers):
            continue
        base, change = pseudo_inertia(numbers), pseudo_inertia(slopes[:, link])
        # if the tensor is not free, at least the mass is
        alone = np.all(slopes[:, link, :4] == 0.0, axis=1)
        if not np.any(slopes[alone, link, 4:]):
            base, change = base[3, 3] * np.eye(4), change[:, 3, 3, None, None] * np.eye(4)
        found.append((base, change))
    return found
