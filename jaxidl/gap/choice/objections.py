"""Why a member of a set may not be named, and the set that is left without those.

What the whole log does not confirm is not named, either. The search fits to a part of the log.
Fitted to all of it, an effect's values must differ from zero, one by one or together, be off their
bounds, and be possible in a simulation. What only seems wrong since another effect has gone is
judged again once something else could take that one's place. Nothing takes the place of what may be
zero: it would be as little sure.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from jaxidl.effects import Effect, added_to
from jaxidl.errors import EffectError
from jaxidl.gap.choice.search import EPSILON, search, without
from jaxidl.gap.evidence.gram import Group, Item, Key
from jaxidl.gap.evidence.items import absorbed
from jaxidl.gap.evidence.noise import in_units_of_noise
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import gone, movable, on_bound, vector
from jaxidl.gap.fit.consistent import physical_fits
from jaxidl.gap.fit.held_out import covariance_of, gain, jackknife, wald, worse_aside
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.values import Value, values

BOUND = "its value is on a bound"
UNSURE = "the whole log does not confirm what a part of it suggests"
UNPHYSICAL = "it would require a link that cannot be built, or friction that feeds motion"
STRONG = 10.0  # contribution to the score: without such an effect the set is a different one
EXCLUDED = 2.0  # standard errors by which a value must differ from zero


def nameable(
    score: Score, now: Solution, rows: Rows, min_gain: float, before: Mapping[Group, str]
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
    score: Score, now: Solution, rows: Rows, before: Mapping[Group, str]
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
        gone = strong | weak
        score = every.narrowed([i for i in every.items if i.group not in gone])
        now = search(
            score,
            [m for m in now.members if id(m) not in out],
            swap=any(worth > STRONG for worth, _, _ in first),
        )


def readmitted(
    every: Score, score: Score, now: Solution, gone: Iterable[Group], rows: Rows
) -> tuple[Score, Solution, Group] | None:
    """Return score, set and effect if one fits better without what it was removed beside."""
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
    """Return the objections; of those to members that share a joint only the first."""
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
    found = [(m if why == BOUND else blamed(score, now, m), why) for m, why in found]
    return [(now.value - score.solve(without(now, m)).value, m, why) for m, why in found]


def blamed(score: Score, now: Solution, m: Item) -> Item:
    """Return the less probable of a member and the one that would take its place.

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
    likelihood = lambda x: score.likelihood(now.members, x)
    return 0.0 if x is None else likelihood(now.x) - likelihood(x[0])


def objection(score: Score, now: Solution, m: Item, min_gain: float, rows: Rows) -> str:
    """Return why a member may not be named; empty if it may."""
    if m.always:
        return ""
    at = now.of(m)
    x, folds = now.x[at], now.folds[:, at]
    together = wald(x, covariance_of(folds)) if len(x) > 1 else 0.0
    if not (np.any(np.abs(x) > EXCLUDED * jackknife(folds)) or together > EXCLUDED):
        return "its standard error does not exclude zero"
    if held(m, x) or on_bound(m.shape, vector(m.shape, x)) or beyond(m, x):
        return BOUND
    other = score.unshared(now).solve([*without(now, m), *plain(score, now, m)])
    pick = list(m.joints)
    if worse_aside(score, other, now, pick):
        return "held-out data are predicted better without it"
    left = (residual(rows, s)[:, pick] for s in (now, other))
    with_it, without_it = (in_units_of_noise(rows, x, pick) for x in left)
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
    """Return whether reported values leave the catalogue's bounds, as a far load's centre may."""
    if not m.shape.cls.internal:
        return False
    effect, known = m.shape.at(x).settled(), m.shape.cls.parameters
    each = ((np.asarray(getattr(effect, n), float), p) for n, p in known.items())
    return any(np.any((v < p.lower) | (v > p.upper)) for v, p in each)


def brief(now: Solution, m: Item, interval: float) -> bool:
    """Return whether an effect only delays, by hardly more than a sampling ``interval`` [s].

    When within it a torque acts is the logger's convention. What the alignment of the joint's
    torque cancels does not count.
    """
    return bool(late(now, m) - EXCLUDED * interval / np.sqrt(12.0) <= interval)


def late(now: Solution, m: Item) -> float:
    """Return the longest time [s] of an effect that only delays; infinite for other effects."""
    x = now.x[now.of(m)]
    if m.shape.free:
        return np.inf
    names = [n for n in movable(m.shape) for _ in range(np.size(m.shape.values[n]))]
    named = zip(names, vector(m.shape, x), strict=True)
    times = [v for n, v in named if m.shape.cls.parameters[n].unit == "s"]
    back = [float(now.x[now.of(o)][0]) for o in now.members if o.key == (ALIGNMENT, m.shape.joint)]
    return max(times) + min([0.0, *back]) if times else np.inf


def possible(effect: Effect, own: Sequence[Effect]) -> bool:
    """Return whether an effect, with what the model has of it already, is within its bounds.

    Values fitted to the whole log may leave them; a model with such an effect cannot be simulated.
    """
    try:
        added_to(own, effect).check()
    except EffectError:
        return False
    return True


def confirmed(
    score: Score, now: Solution, rows: Rows, predicted: np.ndarray
) -> tuple[Solution, list[Value], dict[Group, str]]:
    """Return a set without what the whole log does not confirm, its values, and what went and why.

    The values are fitted to the whole log. The weakest goes first, since the others were fitted
    beside it; nothing goes that was confirmed before.
    """
    dropped, doubted = dict[Group, str](), set[Key]()
    while True:
        fitted = values(score, now, rows.whole(), predicted)
        wrong = {v.key: why for v in fitted if (why := unconfirmed(v, rows.effects))}
        doubted = doubted or wrong.keys()
        if not (wrong := {key: why for key, why in wrong.items() if key in doubted}):
            return now, fitted, dropped
        less = {
            key: score.solve([m for m in now.members if m.always or m.key != key]) for key in wrong
        }
        weakest = max(less, key=lambda key: less[key].value)
        gone = (m.group for m in now.members if not m.always and m.key == weakest)
        dropped |= dict.fromkeys(gone, wrong[weakest])
        now = less[weakest]


def unconfirmed(value: Value, own: Sequence[Effect]) -> str:
    """Return why the values fitted to the whole log rule an effect out; empty if they do not."""
    known = any(np.any(np.abs(v) > EXCLUDED * e) for v, e in value.parameters.values())
    if not (known or value.together > EXCLUDED or value.share > 0.0):
        return UNSURE
    if value.on_bound:
        return BOUND
    return "" if possible(value.effect, own) else "its value is impossible"
