"""The search for missing effects: one model, one score, one neighbourhood.

1. Compute for every effect the torques that it would add to the command along this log, as columns
   of a regression (:mod:`jaxidl.gap.fit.library`).
2. Score any set of effects by its error on left-out blocks. Gram matrices of the blocks give it in
   one small solve (:mod:`jaxidl.gap.fit.score`). Each effect costs its prior, and each of its
   parameters a factor of ten in probability.
3. Begin with the envelope: all common effects, on every joint. This is the model of conventional
   identification. Begin with nothing, too, and go on from the better end.
4. Improve the set while the score rises: drop an effect, or do what a quick fit to all blocks
   favours: add one, give one another shape, replace one by another, by all that it can imitate or
   by a part that it contains, a rare one by another and a common one that it imitated, or two by
   one or two.
5. Fit the shapes of the members (:mod:`jaxidl.gap.fit.shapes`). Give each effect of a motor the
   command that reaches it, and each effect that reads the torque the one that is now predicted
   behind the motor. Go to 4 until the set no longer changes.
6. Remove members (:mod:`jaxidl.gap.choice.objections`) that are on a bound, that their standard
   error does not distinguish from zero, that are not physical, that only make the encoder's noise
   smaller (:mod:`jaxidl.gap.evidence.noise`), or without which held-out blocks are predicted
   better, the weakest on each joint first, and go to 4. A part is judged with its whole. What fits
   better once others have gone comes back. Members that remove less than the required share of the
   error, or that the whole log does not confirm, are removed last, and nothing takes their place
   but what is common.
7. Repeat 4 on resampled blocks. The confidence of an effect is how often it is found again, times
   the probability that such a finding is right (:mod:`jaxidl.gap.result.calibration`). Effects that
   explain the log equally well in its place are reported with it.
"""

from collections.abc import Iterable

import numpy as np

from jaxidl.gap.choice import estimates
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.fit.score import Score, Solution

EPSILON = 1e-6  # least rise of the score
TRIED = 6  # most promising additions, or replacements of a member, that are tried for each joint
REPLACED = 4  # number of a member's replacements tried
NEAR = 5.0  # difference in score by which a quick estimate may fall short and still be tried
ENTANGLED = 0.4  # correlation of two coefficients from which they are entangled
PASSES = 40


def search(score: Score, start: Iterable[Item], swap: bool = True) -> Solution:
    """Return the best set that the neighbourhood reaches from ``start``."""
    now = score.solve(start)
    neighbourhoods = (single, replaced, pairs) if swap else (single,)
    for _ in range(PASSES):
        for moves in neighbourhoods:
            after = improved(score, now, moves(score, now))
            if after is not now:
                now = after
                break
        else:
            return now
    return now


Move = tuple[frozenset[Item], frozenset[Item]]  # out, in


def improved(score: Score, now: Solution, moves: Iterable[Move]) -> Solution:
    """Return the set after all moves that raise the score, best first, each beside the last."""
    ranked, least = [], score.quick(now.members) - NEAR
    for out, new in moves:
        then = after(now.members, out, new)
        if new and score.quick(then) < least:
            continue  # a member less may predict better what it was not fitted to
        value = score.solve(then).value
        if value > now.value + EPSILON:
            ranked.append((value, out, new))
    for _, out, new in sorted(ranked, key=lambda r: r[0], reverse=True):
        if out <= set(now.members) and not {n.group for n in new} & {
            m.group for m in now.members if m not in out
        }:
            then = score.solve(after(now.members, out, new))
            if then.value > now.value + EPSILON:
                now = then
    return now


def after(members: tuple[Item, ...], out: Iterable[Item], new: Iterable[Item]) -> tuple[Item, ...]:
    """Return the members after a move."""
    return (*(m for m in members if m not in out), *new)


def without(now: Solution, m: Item) -> list[Item]:
    """Return the other members."""
    return [o for o in now.members if o is not m]


def single(score: Score, now: Solution) -> list[Move]:
    """Return the moves that drop one, add one, or take another shape of one."""
    lost = estimates.lost(score, now)
    drops = [
        (frozenset([m]), frozenset()) for m in now.members if not m.always and lost[id(m)] < NEAR
    ]
    taken = {m.group: m for m in now.members}
    fresh = promising(score, now.members, now.value)
    adds = [
        (frozenset([taken[i.group]]) if i.group in taken else frozenset(), frozenset([i]))
        for i in fresh
    ]
    return [*drops, *adds]


def replaced(score: Score, now: Solution) -> list[Move]:
    """Return the moves of one for another on its joints.

    They are also those of one for several that it can imitate, of one for its part, of a rare one
    for all common ones, since one motor constant looks like the errors of several links, and of a
    rare one for another and a common one that it imitated.
    """
    moves = [
        (frozenset(alike), frozenset([i]))
        for i in score.items
        if len(alike := estimates.imitated(score, now.members, i)) > 1
    ]
    taken = {m.group for m in now.members}
    for m in filter(lambda m: not m.always, now.members):
        less = [i for i in score.items if len(i.lower) < len(m.lower) and i.group not in taken]
        moves += [(frozenset([m]), frozenset([i])) for i in estimates.imitated(score, less, m)]
        rest, on = after(now.members, [m], []), set(m.joints)
        if not m.common:
            common = [i for i in score.items if i.common and on & set(i.joints)]
            common = [i for i in common if i.group not in taken]
            moves += [(frozenset([m]), frozenset(common))]
            for first in (i for i in common if set(i.joints) <= on):
                second = promising(score, (*rest, first), now.value, on, [m])
                second = [i for i in second if set(i.joints) <= on][:TRIED]
                moves += [(frozenset([m]), frozenset([first, i])) for i in second]
        fresh = promising(score, rest, now.value, on, [m])
        moves += [(frozenset([m]), frozenset([i])) for i in fresh[:REPLACED]]
    return moves


def pairs(score: Score, now: Solution) -> list[Move]:
    """Return the moves of two members of one joint, the most entangled, for one or two others."""
    moves = []
    for a, b in entangled(now):
        rest, both = after(now.members, [a, b], []), set(a.joints) & set(b.joints)
        fresh = promising(score, rest, -np.inf, both, [a, b])
        good = set(promising(score, rest, now.value, both, [a, b]))
        moves += [(frozenset([a, b]), frozenset([i])) for i in fresh[:TRIED] if i in good]
        for first in fresh[:2]:
            second = promising(score, after(rest, [], [first]), now.value, both, [a, b])
            moves += [(frozenset([a, b]), frozenset([first, i])) for i in second[:2]]
    return moves


def promising(
    score: Score,
    members: Iterable[Item],
    value: float,
    joints: set[int] | None = None,
    out: Iterable[Item] = (),
) -> list[Item]:
    """Return the items that promise most beside ``members``, best first, a few for each joint.

    Args:
        value: the score that they have to come close to.
        joints: joints of which they have to affect one.
        out: items that must not come back; with ``joints``, neither do other shapes of the members.
    """
    members = tuple(members)
    promise = estimates.promise(score, members, joints)
    least = value - score.solve(members).value - NEAR
    taken = {m.group for m in members} if joints is not None else set()
    ranked = sorted(
        (i for i in score.items if promise.get(id(i), -np.inf) > least),
        key=lambda i: -promise[id(i)],
    )
    count: dict[tuple[int, ...], int] = {}
    found = []
    for i in ranked:
        if i in out or i.group in taken:
            continue
        place = i.joints if len(i.joints) == 1 else (-1,)
        count[place] = count.get(place, 0) + 1
        if count[place] <= TRIED:
            found.append(i)
    return found


def entangled(now: Solution) -> list[tuple[Item, Item]]:
    """Return pairs of members on one joint that may both be wrong.

    Of effects that are not common it is any two, of others those that the log determines badly
    beside each other.
    """
    found = []
    for n, a in enumerate(now.members):
        for b in now.members[n + 1 :]:
            if not set(a.joints) & set(b.joints) or a.always or b.always:
                continue
            if not (a.common or b.common):
                found.append((2.0, a, b))
                continue
            x, y = now.folds[:, now.of(a)], now.folds[:, now.of(b)]
            if x.shape[1] == y.shape[1] == 1 and np.std(x) > 0 and np.std(y) > 0:
                found.append((abs(float(np.corrcoef(x[:, 0], y[:, 0])[0, 1])), a, b))
    return [
        (a, b)
        for r, a, b in sorted(found, key=lambda f: f[0], reverse=True)[: 4 * TRIED]
        if r > ENTANGLED
    ]
