"""Why a member of a set may not be named, and the set that is left without those."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.choice.search import EPSILON, search, without
from jaxidl.gap.evidence.gram import Group, Item
from jaxidl.gap.evidence.items import absorbed
from jaxidl.gap.evidence.noise import in_units_of_noise
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import gone, movable, on_bound, vector
from jaxidl.gap.fit.consistent import physical_fits
from jaxidl.gap.fit.held_out import covariance_of, gain, jackknife, wald, worse_aside
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score, Solution

NOTHING: Mapping[Group, str] = MappingProxyType({})
BOUND = "its value is on a bound"
LATE = "it is hardly more than a sampling interval"
UNPHYSICAL = "it would require a link that cannot be built, or friction that feeds motion"


STRONG = 10.0  # contribution to the score: without such an effect the set is a different one


EXCLUDED = 2.0  # standard errors by which a value must differ from zero


def nameable(
    score: Score, now: Solution, rows: Rows, min_gain: float, before: Mapping[Group, str] = NOTHING
) -> tuple[Solution, Score, dict[Group, str], dict[Group, str]]:
    """Return the set without what may not be named, its score, and what was removed and why.

    There are two records of what was removed: members beside which the rest was judged, and others.
    Members that improve by less than the least improvement are removed last, and nothing takes
    their place but what is common: rare effects may have stood for friction.
    """
    now, score, strong, weak = supported(score, now, rows, before)
    while found := objections(score, now, min_gain, rows):
        _, worst, why = min(found, key=lambda o: o[0])
        weak[worst.group] = why
        common = [i for i in score.items if i.common or i in now.members]
        less = score.narrowed([i for i in common if i.group not in weak])
        now = search(less, without(now, worst), swap=False)
    return now, score, strong, weak


def supported(
    score: Score, now: Solution, rows: Rows, before: Mapping[Group, str] = NOTHING
) -> tuple[Solution, Score, dict[Group, str], dict[Group, str]]:
    """Return the set without what the log does not support, as :func:`nameable` does.

    Of members that share a joint what is on a bound goes first, since the others were judged beside
    it, and then the weakest. The rest is fitted and searched again each time. In the end each comes
    back, once, that fits better now, also of those removed ``before``: what it was judged beside
    may have gone.
    """
    every, strong, weak, tried = score, dict(before), dict[Group, str](), set[Group]()
    score = every.narrowed([i for i in every.items if i.group not in strong])
    while True:
        found = objections(score, now, 0.0, rows) or unphysical(score, now, rows)
        if not found:
            again = search(score, now.members) if strong or weak else now
            if again.value > now.value + EPSILON:
                now = again
                continue
            back = readmitted(every, score, now, [g for g in strong if g not in tried], rows)
            if back is None:
                return now, score, strong, weak
            score, now, group = back
            tried.add(group)
            del strong[group]
            continue
        first = apart(sorted(found, key=lambda o: (o[2] != BOUND, o[0])))
        # the others were judged in the presence of these
        alone = [o for o in first if o[0] > STRONG or o[2] in (BOUND, UNPHYSICAL)]
        if alone:
            strong |= {m.group: why for _, m, why in alone}
            first, weak = alone, {}
        else:
            weak |= {m.group: why for _, m, why in first}
        out = {id(m) for _, m, _ in first}
        score = every.narrowed(
            [i for i in every.items if i.group not in strong and i.group not in weak]
        )
        now = search(
            score,
            [m for m in now.members if id(m) not in out],
            swap=any(worth > STRONG for worth, _, _ in first),
        )


def readmitted(
    every: Score, score: Score, now: Solution, gone: Iterable[Group], rows: Rows
) -> tuple[Score, Solution, Group] | None:
    """Return a set with an effect that is better off without those beside which it was removed.

    Also return its score and the effect. None if there is no such effect.
    """
    for group in gone:
        fuller = every.narrowed([*score.items, *(i for i in every.items if i.group == group)])
        then = search(fuller, now.members)
        better = then.value > now.value + EPSILON and group in {m.group for m in then.members}
        if better and group not in {m.group for _, m, _ in objections(fuller, then, 0.0, rows)}:
            return fuller, then, group
    return None


# the member's contribution to the score, and why it may not be named
Objection = tuple[float, Item, str]


def apart(found: Iterable[Objection]) -> list[Objection]:
    """Return of objections to members that share a joint the first one."""
    out, joints = list[Objection](), set[int]()
    for o in found:
        if not joints & set(o[1].joints):
            out.append(o)
            joints |= set(o[1].joints)
    return out


def objections(score: Score, now: Solution, min_gain: float, rows: Rows) -> list[Objection]:
    """Return the members that may not be named; a part is judged with its whole."""
    parts = absorbed(now.members)
    judged = [m for m in now.members if m.key not in parts]
    found = [(m, why) for m in judged if (why := objection(score, now, m, min_gain, rows))]
    found = [(m if why in (BOUND, LATE) else blamed(score, now, m), why) for m, why in found]
    return [(now.value - score.solve(without(now, m)).value, m, why) for m, why in found]


def blamed(score: Score, now: Solution, m: Item) -> Item:
    """Return of a member and the one that would take its place the less probable one.

    A rotor may not be needed only because a rare change of a link stands for it. The other one is
    blamed if the set is better off without that.
    """
    then = score.solve(without(now, m))
    near = [n for n in then.members if not n.always and set(n.joints) & set(m.joints)]

    def moved(n: Item) -> float:
        shared = [k for k, j in enumerate(n.joints) if j in m.joints]
        change = then.x[then.of(n)] - now.x[now.of(n)]
        return float(np.sum(np.tensordot(change, n.columns[:, :, shared], 1) ** 2))

    other = max(near, key=moved, default=m)
    better = other.odds < m.odds and score.solve(without(now, other)).value >= then.value
    return other if better else m


def unphysical(score: Score, now: Solution, rows: Rows) -> list[Objection]:
    """Return the member without which a physical set explains the log better.

    In such a set all links could be built and all friction dissipates. The list is empty if there
    is no such member.
    """
    cost = price(score, now, rows)
    best, found = now.value - cost, list[Objection]()
    for m in now.members if cost > EPSILON else ():
        if not m.always and (m.shape.cls.friction or m.shape.cls.alter is not Effect.alter):
            then = score.solve(without(now, m))
            if (value := then.value - price(score, then, rows)) > best:
                best, found = value, [(now.value - then.value, m, UNPHYSICAL)]
    return found


def price(score: Score, now: Solution, rows: Rows) -> float:
    """Return how much the score falls if a set is kept physical."""
    x = physical_fits(score, now, rows, folds=False)
    return (
        0.0
        if x is None
        else score.likelihood(now.members, now.x) - score.likelihood(now.members, x[0])
    )


def objection(score: Score, now: Solution, m: Item, min_gain: float, rows: Rows) -> str:
    """Return why a member may not be named; empty if it may."""
    if m.always:
        return ""
    at = now.of(m)
    x, stderr = now.x[at], jackknife(now.folds[:, at])
    if not (np.any(np.abs(x) > EXCLUDED * stderr) or together(x, now.folds[:, at]) > EXCLUDED):
        return "its standard error does not exclude zero"
    if held(m, x) or on_bound(m.shape, vector(m.shape, x)) or beyond(m, x):
        return BOUND
    other = score.solve([*without(now, m), *plain(score, now, m)])
    interval = rows.signals.interval
    if late(now, m, x) - EXCLUDED * interval / np.sqrt(12.0) <= interval:
        return LATE
    pick = list(m.joints)
    if worse_aside(score, other, now, pick):
        return "held-out data are predicted better without it"
    without_it, with_it = (
        in_units_of_noise(rows, residual(rows, s, joints=pick), pick) for s in (other, now)
    )
    if np.all(with_it > without_it):
        return "it only makes the encoder's noise smaller"
    if gain(score, other, now)[pick].max() < min_gain:
        return f"it removes less than {min_gain:.0%} of the error"
    return ""


def plain(score: Score, now: Solution, m: Item) -> list[Item]:
    """Return the common friction on a member's joints that the set does without.

    Friction that is not common has to improve on it: two rare laws that bend opposite ways are a
    straight line, too.
    """
    if m.common or not m.shape.cls.friction:
        return []
    return [
        i
        for i in score.items
        if i.common and i.shape.cls.friction and {*i.joints} <= {*m.joints} and i not in now.members
    ]


def held(m: Item, x: np.ndarray) -> bool:
    """Return whether bounds hold all of a member's coefficients (P,) that are not zero."""
    at_bound = ((x <= m.lower) & ~gone(m.shape)) | (x >= m.upper)
    return bool(np.all(at_bound | (x == 0.0)))


def beyond(m: Item, x: np.ndarray) -> bool:
    """Return whether a member's reported values exceed the catalogue's bounds.

    An example is the centre of a load that is far away.
    """
    if not m.shape.cls.internal:
        return False
    effect = m.shape.at(x).settled()
    values = {n: np.asarray(getattr(effect, n), float) for n in m.shape.cls.parameters}
    return any(
        np.any((v < p.lower) | (v > p.upper))
        for v, p in ((values[n], m.shape.cls.parameters[n]) for n in values)
    )


def late(now: Solution, m: Item, x: np.ndarray) -> float:
    """Return the longest time [s] among the parameters of an effect that only delays.

    It is infinite for other effects. What the alignment of the joint's torque cancels does not
    count.
    """
    if m.shape.free:
        return np.inf
    names = [n for n in movable(m.shape) for _ in range(np.size(m.shape.values[n]))]
    times = [
        v
        for n, v in zip(names, vector(m.shape, x), strict=True)
        if m.shape.cls.parameters[n].unit == "s"
    ]
    back = [float(now.x[now.of(o)][0]) for o in now.members if o.key == (ALIGNMENT, m.shape.joint)]
    return max(times) + min([0.0, *back]) if times else np.inf


def together(x: np.ndarray, folds: np.ndarray) -> float:
    """Return the root mean square of coefficients (P,) in standard errors, jointly (Wald).

    ``folds`` are the coefficients fitted without one block each.
    """
    return wald(x, covariance_of(folds)) if len(x) > 1 else 0.0
