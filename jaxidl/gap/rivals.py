"""Other explanations of what was found: better ones, once their shapes are fitted, and such as are
as good.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from jaxidl.gap.confidence import FARTHER
from jaxidl.gap.gram import Group, Item
from jaxidl.gap.library import Library
from jaxidl.gap.score import Score, Solution
from jaxidl.gap.search import EPSILON, search, without
from jaxidl.gap.shape import movable
from jaxidl.gap.shapes import fitted

RIVALS = 2  # of each effect that is not common
ALIKE = 0.005  # of the error: explanations that differ by less are equally good,
EQUAL = 2.0  # or that differ by so much in the logarithm of the likelihood
FAR = 40.0  # a rival that promises so much less is not tried
UNFIT = 0.03  # of a promise: a shape that is not fitted may promise so much less


class Tie(NamedTuple):
    """Effects that explain a log equally well."""

    found: tuple[Group, ...]
    instead: tuple[Group, ...]  # each in the place of all that was found
    # how likely the likeliest of them was beforehand, relative to what was found; at most 1
    likely: float


def contested(
    score: Score, now: Solution, library: Library, predicted: np.ndarray
) -> list[Item] | None:
    """Return better members, or None: others with fitted shapes in the place of one, or one without
    its parts.

    A shape that has not been fitted loses against one that has; here both are.
    """
    rows, changed = library.rows, False
    for m in [m for m in now.members if not m.always]:
        if m not in now.members:
            continue
        rest = without(now, m)
        promise = score.promise(rest)
        others = [
            i
            for i in score.items
            if id(i) in promise and i is not m and set(i.joints) & set(m.joints)
        ]
        best = sorted(
            (i for i in others if i.group not in {r.group for r in rest}),
            key=lambda i: -promise[id(i)],
        )[:RIVALS]
        worth = promise[id(m)] - m.odds
        far = UNFIT * worth if m.common else FAR
        best = [i for i in best if promise[id(i)] - i.odds > worth - far]
        trials = [[*rest, i] for i in best]
        starts = (
            [m, *(i for i in score.items if i.group == m.group and i is not m)][: RIVALS + 1]
            if not m.common
            else []
        )
        # a simpler one
        trials += [[*rest, i] for i in starts if len(i.lower) < len(m.lower) and movable(i.shape)]
        trials += [
            [*bare, i]
            for i in (*starts, *best)
            if movable(i.shape) and len(bare := outside(rest, i)) < len(rest)
        ]
        for trial in trials:
            at = score.solve(trial)
            new = trial[-1]
            fresh = fitted(new, at, rows, predicted, score) if movable(new.shape) else new
            small = Score(
                rows, [*now.members, fresh], score.noise, score.effective, score.anchor, score
            )
            after = search(small, [*trial[:-1], fresh], swap=False)
            if after.value > small.solve(now.members).value + EPSILON:
                score, now, changed = small, after, True
                break
    return list(now.members) if changed else None


def outside(members: Iterable[Item], whole: Item) -> list[Item]:
    """Return the members that are no parts of an effect."""
    names = {(name, whole.key[1]) for name in whole.shape.cls.contains(whole.shape.free)}
    return [m for m in members if m.always or m.key not in names]


def tied(score: Score, now: Solution, library: Library, predicted: np.ndarray) -> list[Tie]:
    """Return sets of effects that predict the log as well in each other's place, whatever their
    prior; the one found first.

    An effect may take the place of several: what is not needed beside it goes.
    """
    sets: dict[tuple[Group, ...], dict[Group, float]] = {}
    for m in [m for m in now.members if not m.always]:
        rest = without(now, m)
        promise = score.promise(rest)
        likely = promise[id(m)] - m.odds - max(FAR / 2.0, UNFIT * (promise[id(m)] - m.odds))
        near = [
            i
            for i in score.items
            if promise.get(id(i), -np.inf) - i.odds > likely and not part(m, i)
        ]
        near = [
            i
            for i in near
            if set(i.joints) & set(m.joints) and i.key not in {n.key for n in now.members}
        ]
        close = max(EQUAL, ALIKE * float(score.effective[list(m.joints)].sum()))
        best: dict[Group, Item] = {}  # shape of each effect
        for i in sorted(near, key=lambda i: i.odds - promise[id(i)]):
            best.setdefault(i.group, i)
        for i in list(best.values())[: 2 * RIVALS]:
            fresh = (
                fitted(i, score.solve([*rest, i]), library.rows, predicted, score)
                if movable(i.shape)
                else i
            )
            small = Score(
                library.rows, [*rest, fresh], score.noise, score.effective, score.anchor, score
            )
            at = search(small, [*rest, fresh], swap=False)
            odds, least = (sum(o.odds for o in s.members) for s in (at, now))
            if (
                fresh in at.members
                and odds > least - FARTHER
                and at.value - odds > now.value - least - close
            ):
                gone = tuple(n.group for n in now.members if n not in at.members)
                sets.setdefault(gone, {})[i.group] = float(np.exp(min(odds - least, 0.0)))
    return [Tie(gone, tuple(instead), max(instead.values())) for gone, instead in sets.items()]


def part(m: Item, whole: Item) -> bool:
    """Has an effect another one as a part?"""
    return bool(
        {m.key[0], f"{m.key[0]}.{m.group[2]}"} & set(whole.shape.cls.contains(whole.shape.free))
    )
