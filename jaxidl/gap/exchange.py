"""Members in each other's place: out with what is idle, one for another one, two for one or two."""

from itertools import combinations

from jaxidl.gap.candidates import ATOMS, CONTAINS, Candidate
from jaxidl.gap.choose import QUIET, imitators
from jaxidl.gap.gains import FEW, Gain, best_gain, errors_of
from jaxidl.gap.members import Member
from jaxidl.gap.rank import Ranking, Trial

REDUNDANT = 0.7  # an effect that is worth less than this share of the least gain is taken out again
EXCHANGE = 4.0  # times the least gain: an effect is exchanged for another one only if that is much better
OTHERS = 3  # effects in the place of each of two members that are tried together
LOUD = (1.1, 6.0)  # noise floors: with less left there is no reason to exchange two, with more no hope to explain all
LOUDER = 2.0  # the first of these in a mechanism of many joints, where it takes its time
DEARER = 1.0  # than two members together: the complexity that one effect in the place of both may have


def tidy(ranking: Ranking) -> None:
    """Take out what has become superfluous; exchange what another effect does clearly better."""
    newest = ranking.members[-1]
    prune(ranking, tuple(m for m in ranking.members[:-1] if set(m.joints) & set(newest.joints)))
    exchange_one(ranking, [m for m in ranking.members[:-1] if ranking.alike(m.joints, ranking.members[-1].joints)])


def exchange_wide(ranking: Ranking) -> bool:
    """Exchange one of those that reach many joints, of which few could be tried beside each newcomer; say whether."""
    if not exchange_one(ranking, [m for m in ranking.members if len(m.joints) > FEW]):
        return False
    prune(ranking, ranking.members)
    return True


def exchange_one(ranking: Ranking, members: list[Member]) -> bool:
    """Exchange the first of some members that another effect replaces clearly better; say whether."""
    for m in members:
        better = (t for t in instead(ranking, m) if t.fit.feasible and t.gain.clear(EXCHANGE * ranking.min_gain))
        others = [t for t in better if not _flexible(t.candidate, m.candidate)]
        if others:
            best = max(others, key=lambda t: t.gain.value)
            _, beside = ranking.around(best.joints)
            simple = imitators(ranking, best, tuple(x for x in beside if x is not m)) if best.candidate.name in CONTAINS else ()
            ranking.replace((m,), tuple(map(ranking.column, next(iter(simple), (best.candidate,)))))
            return True
    return False


def _flexible(one: Candidate, other: Candidate) -> bool:
    """Does the first imitate the second by being more flexible?"""
    return one.name != "payload" and other.name in CONTAINS.get(one.name, ())


def prune(ranking: Ranking, suspects: tuple[Member, ...]) -> None:
    """Take out what is worth nothing beside the others; a simple effect is not given up for a complex one that can imitate it."""
    for key in [m.candidate.key for m in suspects]:
        m = next((m for m in ranking.members if m.candidate.key == key), None)
        if m is None:
            continue
        later = ranking.members[ranking.members.index(m) + 1 :]
        beside = [x.candidate.name for x in later if x.candidate.joint == m.candidate.joint]
        imitable = any(m.candidate.name in CONTAINS.get(name, ()) for name in beside)
        if not (imitable and m.candidate.name in ATOMS) and _idle(ranking, m):
            ranking.replace((m,), ())


def _idle(ranking: Ranking, m: Member) -> bool:
    value, stderr, _ = worth(ranking, m)
    return value < REDUNDANT * ranking.min_gain or value < stderr


def worth(ranking: Ranking, m: Member) -> Gain:
    """How much a member improves the error beside all others."""
    joints, beside = ranking.closure(m.joints)
    without = ranking.fitted(tuple(x for x in beside if x is not m), joints)
    return best_gain(errors_of(without, ranking.data, ranking.weight, joints), ranking.present(joints))[0]


def revise(ranking: Ranking) -> bool:
    """Put another variant in a member's place (a border, a table's knots), if that is better; say whether.

    What it was chosen beside may have hidden the difference.
    """
    best: Trial | None = None
    old: Member | None = None
    for m in ranking.members:
        for candidate in ranking.variants((m.candidate.name, m.candidate.joint)):
            if candidate is m.candidate:
                continue
            trial = ranking.attempt(candidate, without=(m,))
            better = trial is not None and trial.fit.feasible and trial.gain.clear(ranking.min_gain)
            if trial is not None and better and (best is None or trial.gain.value > best.gain.value):
                best, old = trial, m
    if best is None or old is None:
        return False
    ranking.replace((old,), (ranking.column(best.candidate),))
    return True


def exchange_two(ranking: Ranking) -> bool:
    """Put one or two effects in the place of two members, if that leaves hardly more than noise; say whether.

    Two wrong effects may support each other: the one looks right as long as the other is there. Where much is left that nobody
    understands, as on most machines, something or other will always look better in pairs; there nothing is exchanged, and neither
    is what reaches many joints.
    """
    left = [ranking.fit.rms(j) / ranking.data.floor[j] for j in range(len(ranking.weight))]
    least = LOUD[0] if len(left) <= FEW else LOUDER
    loud = {j for j, rms in enumerate(left) if least < rms < LOUD[1]}
    suspects = [m for m in ranking.members if loud & set(m.joints) and len(m.joints) <= FEW]
    options = {m: [t.candidate for t in sorted(instead(ranking, m), key=Trial.order)[:OTHERS]] for m in suspects}
    best: tuple[float, tuple[Member, ...], tuple[Candidate, ...]] | None = None
    margin, ranking.margin = ranking.margin, 1.0  # what is left between one and ``NOISE_MARGIN`` noise floors counts here
    for a, b in combinations(suspects, 2):
        if not set(a.joints) & set(b.joints):
            continue
        most = a.candidate.cost + b.candidate.cost + DEARER
        one = [((c,), 1.0) for c in dict.fromkeys((*options[a], *options[b])) if c.cost <= most]
        two = [((c, d), EXCHANGE) for c in options[a] for d in options[b] if (c.name, c.joint) != (d.name, d.joint)]
        for (first, *rest), factor in (*one, *two):
            trial = ranking.attempt(first, polish=True, without=(a, b), also=tuple(rest))
            if trial is None or not trial.fit.feasible or not trial.gain.clear(factor * ranking.min_gain):
                continue
            if any(trial.fit.rms(k) > QUIET * ranking.data.floor[j] for k, j in enumerate(trial.joints)):
                continue
            if best is None or trial.gain.value > best[0]:
                best = trial.gain.value, (a, b), (first, *rest)
    ranking.margin = margin
    if best is None:
        return False
    ranking.replace(best[1], tuple(map(ranking.column, best[2])))
    return True


def instead(ranking: Ranking, m: Member) -> list[Trial]:
    """Every other effect in the place of a member, on any of its joints; the best start of each."""
    taken = {(x.candidate.name, x.candidate.joint) for x in ranking.members}
    best: dict[tuple[str, int | None], Trial] = {}
    for candidate in ranking.shortlist():
        key = candidate.name, candidate.joint
        there = candidate.joint in m.joints and m.candidate.joint in (None, candidate.joint)
        if key in taken or not (candidate.joint is None or there):
            continue
        if not ranking.alike(ranking.column(candidate).joints, m.joints):
            continue
        trial = ranking.attempt(candidate, without=(m,), polish=len(m.joints) > FEW and candidate.loose)
        if trial is not None and (key not in best or trial.gain.value > best[key].gain.value):
            best[key] = trial
    return list(best.values())
