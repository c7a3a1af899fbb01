"""Quick estimates of what items are worth, without fitting a set for each of them.

They follow from the Gram matrix of all training blocks together, as does which items imitate which.
The search tries the moves that promise most; their scores decide.
"""

from collections.abc import Iterable

import numpy as np

from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.fit.score import RIDGE, Score, Solution

ALIKE = 1e-6  # share of what columns add below which others imitate them


def promise(
    score: Score, members: Iterable[Item], joints: Iterable[int] | None = None
) -> dict[int, float]:
    """Return a quick estimate of how much each other item would raise the score.

    It is made from the fit on all blocks. With ``joints``, only items on one of those are there.
    """
    members, on = tuple(members), None if joints is None else frozenset(joints)
    known = frozenset(map(id, members)), on
    if known not in score.promised:
        score.promised[known] = _promise(score, members, on)
    return dict(score.promised[known])


def _promise(
    score: Score, members: Iterable[Item], joints: frozenset[int] | None
) -> dict[int, float]:
    now = score.solve(members)
    at = score.indices(now.members)
    gram, push = score.whole
    push = push - gram[:, at] @ (now.x * score.scale[at])
    inside = gram[np.ix_(at, at)] + np.diag(score.prior[at] + RIDGE * np.diagonal(gram)[at] + 1e-9)
    inverse, over = np.linalg.inv(inside), gram[at]
    left = np.maximum(score.weights @ now.error, 1e-9)
    out: dict[int, float] = {}
    for items, where, own, on in score.widths:  # all items with the same number of columns at once
        if joints is not None:
            near = np.flatnonzero(on[:, list(joints)].any(1))
            items, where, own, on = [items[n] for n in near], where[near], own[near], on[near]
        beside = over[:, where]
        schur = own - np.einsum("anp,anq->npq", beside, np.tensordot(inverse, beside, 1))
        right = push[where]
        step = np.linalg.solve(schur, right[..., None])[..., 0]
        if where.shape[1] == 1:
            step = np.clip(step, score.bounds[0][where], score.bounds[1][where])
        gain = 2 * np.sum(step * right, 1) - np.einsum("np,npq,nq->n", step, schur, step)
        rate = np.clip(gain / (on @ left), 0.0, 1.0 - 1e-6)
        odds = np.array([i.odds for i in items])
        worth = -0.5 * (on @ score.effective) * np.log(1.0 - rate) - 0.5 * where.shape[1] + odds
        out |= zip(map(id, items), worth.tolist(), strict=True)
    for m in now.members:
        out.pop(id(m), None)
    return out


def lost(score: Score, now: Solution) -> dict[int, float]:
    """Return a quick estimate of how much the score would fall without each member."""
    at, (gram, _) = score.indices(now.members), score.whole
    inside = gram[np.ix_(at, at)] + np.diag(score.prior[at] + 1e-6 * np.diagonal(gram)[at] + 1e-9)
    inverse, x = np.linalg.inv(inside), now.x * score.scale[at]
    left, out = np.maximum(score.weights @ now.error, 1e-9), {}
    for m in now.members:
        own, on = now.of(m), list(m.joints)
        cost = float(x[own] @ np.linalg.solve(inverse[own, own], x[own]))
        out[id(m)] = 0.5 * score.effective[on].sum() * np.log1p(cost / left[on].sum()) + m.odds
    return out


def imitated(score: Score, members: Iterable[Item], whole: Item) -> list[Item]:
    """Return those members that are combinations of an item's several columns."""
    if len(whole.lower) < 2 or whole.group in {m.group for m in members}:
        return []
    gram, _ = score.whole
    at, found = score.place[id(whole)], []
    inverse = np.linalg.pinv(gram[np.ix_(at, at)], rcond=RIDGE, hermitian=True)
    for m in members:
        if not m.always and set(m.joints) <= set(whole.joints):
            own = score.place[id(m)]
            left = gram[np.ix_(own, own)] - gram[np.ix_(own, at)] @ inverse @ gram[np.ix_(at, own)]
            if np.trace(left) < ALIKE * np.trace(gram[np.ix_(own, own)]):
                found.append(m)
    return found
