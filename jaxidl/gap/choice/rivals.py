"""Other explanations of what was found.

They are better ones, once their shapes are fitted, and equally good ones.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from jaxidl.gap.choice import estimates
from jaxidl.gap.choice.confidence import FARTHER
from jaxidl.gap.choice.objections import price
from jaxidl.gap.choice.search import EPSILON, search, without
from jaxidl.gap.evidence.gram import Group, Item
from jaxidl.gap.evidence.items import part
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import movable, on_bound, vector
from jaxidl.gap.fit.prior import compact
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.shapes import arriving, fitted, seen_from

RIVALS = 2  # rivals tried of each effect that is not common
ALIKE = 0.005  # share of the error: explanations that differ by less are equally good,
EQUAL = 2.0  # as are those that differ by less in the log likelihood
FAR = 40.0  # a rival that promises this much less is not tried
SAME = 0.01  # relative difference below which shapes are the same
UNFIT = 0.03  # share by which an unfitted shape may promise less

# members in whose place others were tried, each with all members on its joints
Contests = set[tuple[Group, frozenset[Group]]]


class Tie(NamedTuple):
    """Effects that explain a log equally well."""

    found: tuple[Group, ...]
    instead: tuple[Group, ...]  # each in place of all that was found
    # highest prior probability among them, relative to what was found; at most 1
    likely: float
    falls: float  # by how much the score falls with the best of them
    # by how much the coefficients of the other members are different beside the likeliest of them
    moves: Mapping[Group, np.ndarray]


def contested(
    score: Score, now: Solution, rows: Rows, predicted: np.ndarray, contests: Contests
) -> list[Item] | None:
    """Return better members, or None.

    They are others with fitted shapes in place of one, one without its parts, or one of two rare
    ones without the other. A shape that has not been fitted loses against one that has; here both
    are fitted. A fit begins where the last one of that shape ended, and shapes that ended alike are
    tried once. What is in ``contests`` is not tried again; what is tried is added.
    """
    changed, last = False, dict[Item, Item]()  # rivals as fitted last, beside other members
    for m in [m for m in now.members if not m.always]:
        near = [o for o in now.members if set(o.joints) & set(m.joints)]
        place = m.group, frozenset(o.group for o in near)
        if m not in now.members or place in contests:
            continue
        contests.add(place)
        rest = without(now, m)
        taken = {r.group for r in rest}
        promise = estimates.promise(score, rest, m.joints)
        others = [i for i in score.items if id(i) in promise and i is not m]
        others = [i for i in others if i.group not in taken]
        best = sorted(others, key=lambda i: -promise[id(i)])[:RIVALS]
        worth = promise[id(m)] - m.odds
        far = UNFIT * worth if m.common else FAR
        best = [i for i in best if promise[id(i)] - i.odds > worth - far]
        same = [] if m.common else [i for i in score.items if i.group == m.group and i is not m]
        shapes = [i for i in [m, *same][: RIVALS + 1] if not m.common and movable(i.shape)]
        # a load for the errors of links: it has many amplitudes until its mass is known
        trials = [
            [*(r for r in rest if r.always or not part(r, i)), i]
            for i in others
            if i.shape.cls.implied and part(m, i)
        ]
        trials += [[*rest, i] for i in best]
        # a simpler one
        trials += [[*rest, i] for i in shapes if len(i.lower) < len(m.lower)]
        trials += [
            [*bare, i]
            for i in (*shapes, *best)
            if movable(i.shape) and len(bare := outside(rest, i)) < len(rest)
        ]
        # another rare one may have kept it from its best shape
        rare = [o for o in near if not (o is m or o.always or o.common)]
        trials += [[*(r for r in rest if r is not o), i] for o in rare for i in shapes]
        tried = set[frozenset[Item]]()
        for trial in trials:
            beside, first = trial[:-1], trial[-1]
            new = last.get(first, first)
            if frozenset([*beside, new]) in tried:
                continue
            tried.add(frozenset([*beside, new]))
            known = score if new is first else score.having([*beside, new])
            fresh = fitted_beside(beside, new, known, rows, predicted)
            if movable(new.shape) and not on_bound(fresh[-1].shape, parameters(fresh[-1])):
                last[first] = alike(fresh[-1], last.values())
            small = score.having([*now.members, *(i for i in fresh if i not in now.members)])
            after = search(small, fresh, swap=False)
            if after.value > small.solve(now.members).value + EPSILON:
                new = [i for i in after.members if i not in score.items]
                score, now, changed = score.having([*score.items, *new]), after, True
                break
    return list(now.members) if changed else None


def alike(new: Item, others: Iterable[Item]) -> Item:
    """Return one of the fitted ``others`` with about the same shape, or the new one."""
    for o in others:
        if kind(o) == kind(new) and np.allclose(parameters(o), parameters(new), rtol=SAME):
            return o
    return new


def kind(i: Item) -> tuple[object, ...]:
    """Return what items have in common whose parameters mean the same: as many, of the same."""
    s = i.shape
    sizes = {name: np.size(value) for name, value in s.values.items()}
    return i.group, s.options, s.free, sizes, [name for name, _ in s.parts]


def parameters(i: Item) -> np.ndarray:
    """Return the parameters (P,) of an item's shape, each amplitude one."""
    return vector(i.shape, np.ones(len(i.lower)))


def fitted_beside(
    rest: Sequence[Item], new: Item, score: Score, rows: Rows, predicted: np.ndarray
) -> list[Item]:
    """Return a set and another item, its shape, if it has one, fitted beside it.

    What acts on the command behind the new item acts on what that delivers.
    """
    at = score.solve([*rest, new])
    there = arriving(new, rest, [at.x[at.of(m)] for m in rest], rows, predicted)
    if movable(new.shape):
        new = fitted(new, at, there, predicted, score)
    elif there is not rows:
        new = seen_from(new, new.shape, there, predicted)
    else:
        new = compact(new, at, rows, score, predicted) or new
    if not new.actuates:
        return [*rest, new]
    members = [*rest, new]
    at = score.having(members).solve(members)
    x = [at.x[at.of(m)] for m in members]
    moved = {
        id(m): seen_from(m, m.shape, arriving(m, members, x, rows, predicted), predicted)
        for m in rest
        if not m.always and arriving(m, [new], x[-1:], rows, predicted) is not rows
    }
    return [moved.get(id(m), m) for m in members]


def outside(members: Iterable[Item], whole: Item) -> list[Item]:
    """Return the members that are not parts of an effect on the same joint."""
    return [m for m in members if m.always or m.key[1] != whole.key[1] or not part(m, whole)]


def tied(score: Score, now: Solution, rows: Rows, predicted: np.ndarray) -> list[Tie]:
    """Return sets of effects that predict the log equally well in each other's place.

    Their priors do not matter, but each set has to be physical; the one found comes first. An
    effect may replace several: members that are not needed beside it are dropped. What another
    member contains is not looked for beside it, nor an effect in place of parts of it alone.
    """
    sets: dict[tuple[Group, ...], dict[Group, tuple[float, float, Solution]]] = {}
    known = now.value - price(score, now, rows)
    for m in [m for m in now.members if not m.always]:
        rest = without(now, m)
        worth = _worth(score, rest, m)
        likely = worth[id(m)] - max(FAR / 2.0, UNFIT * worth[id(m)])
        taken = {n.group for n in now.members}
        near = [
            i
            for i in score.items
            if worth.get(id(i), -np.inf) > likely
            and i.key != m.key
            and i.group not in taken
            and (not part(m, i) or any(part(o, i) for o in rest if not o.always))
            and not any(part(i, o) and set(i.joints) & set(o.joints) for o in rest if not o.always)
        ]
        close = max(EQUAL, ALIKE * float(score.effective[list(m.joints)].sum()))
        alone = estimates.promise(score, rest, m.joints)
        best: dict[Group, Item] = {}  # best shape of each effect
        for i in sorted(near, key=lambda i: -alone[id(i)]):
            best.setdefault(i.group, i)
        for i in sorted(best.values(), key=lambda i: -worth[id(i)])[: 2 * RIVALS]:
            fresh = fitted_beside(rest, i, score, rows, predicted)
            small = score.having(fresh)
            at = search(small, fresh, swap=False)
            odds, least = (sum(o.odds for o in s.members) for s in (at, now))
            reached = at.value - price(small, at, rows)
            if (
                fresh[-1] in at.members
                and odds > least - FARTHER
                and reached - odds > known - least - close
            ):
                there = {n.group for n in at.members}
                gone = tuple(n.group for n in now.members if n.group not in there)
                if not all(part(n, i) for n in now.members if n.group not in there):
                    likely = float(np.exp(min(odds - least, 0.0)))
                    sets.setdefault(gone, {})[i.group] = likely, known - reached, at
    return [_tie(now, gone, instead) for gone, instead in sets.items()]


def _worth(score: Score, rest: list[Item], m: Item) -> dict[int, float]:
    """Return by how much a member and items near it raise the likelihood beside ``rest``.

    What promises less than half as much as the member is not near. Other shapes that can be fitted
    are estimated, beside parts that fitting them may bring.
    """
    promise, before = estimates.promise(score, rest, m.joints), score.solve(rest).value
    likely = {id(i): promise[id(i)] - i.odds for i in score.items if id(i) in promise}
    exact = lambda *new: score.solve([*rest, *new]).value - before - sum(i.odds for i in new)
    found, others = {id(m): exact(m)}, defaultdict[int | None, list[Item]](list)
    for o in score.items:
        if not (o.always or o in (m, *rest)):
            others[o.key[1]].append(o)
    for i in score.items:
        if i is m or id(i) not in likely:
            continue
        fits = movable(i.shape)
        if fits and (missing := [o for o in others[i.key[1]] if part(o, i)]):
            likely[id(i)] = exact(i, *missing)
        if likely[id(i)] > 0.5 * likely[id(m)]:
            found[id(i)] = likely[id(i)] if fits else exact(i)
    return found


def _tie(
    now: Solution,
    gone: tuple[Group, ...],
    instead: Mapping[Group, tuple[float, float, Solution]],
) -> Tie:
    likely, _, at = max(instead.values(), key=lambda found: found[0])
    there = {m.group: at.x[at.of(m)] for m in at.members}
    moves = {m.group: there[m.group] - now.x[now.of(m)] for m in now.members if m.group in there}
    return Tie(gone, tuple(instead), likely, min(falls for _, falls, _ in instead.values()), moves)
