"""Round after round: rank, add the winner, fit everything anew, until nothing is left to name; then what is ambiguous."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from jaxidl.gap.candidates import ATOMS, CONTAINS, INSEPARABLE, Candidate
from jaxidl.gap.choose import SAME, imitators, winner
from jaxidl.gap.gains import Gain, errors_of, gain
from jaxidl.gap.members import Member
from jaxidl.gap.rank import Ranking, Trial

MOST = 24  # effects at most
REDUNDANT = 0.7  # an effect that is worth less than this share of the least gain is taken out again
EXCHANGE = 4.0  # times the least gain: an effect is exchanged for another one only if that is much better
UNSURE = 0.1  # ... and never if it loses more than this share, however unsure
NEGLIGIBLE = 0.02  # explanations that differ by less than this share of the error are equally good


@dataclass(frozen=True)
class Named:
    """An effect that was added: what it did when it was."""

    member: Member
    gain: Gain
    before: float  # held-out root mean square error on its joints [N or Nm]
    after: float


@dataclass
class Outcome:
    """What the search found."""

    ranking: Ranking
    before: np.ndarray  # (N, J) residual of the model as it was
    named: list[Named] = field(default_factory=list)  # in the order added
    rounds: list[list[Trial]] = field(default_factory=list)  # the ranking of each round, best first
    chosen: list[tuple[str, int | None]] = field(default_factory=list)  # what each round but the last added
    ambiguous: list[list[Candidate]] = field(default_factory=list)  # equally good explanations; the named one first


Watch = Callable[[str, float], None]  # what is being done, and the share of the present round


def search(ranking: Ranking, watch: Watch = lambda what, share: None) -> Outcome:
    """Add effects while one is clearly missing."""
    outcome = Outcome(ranking, ranking.fit.residual)
    keys = len(ranking.groups)
    seen: set[frozenset[tuple[str, int | None]]] = set()
    for number in range(MOST):
        tried = iter(range(1, keys + 1))
        trials = ranking.rank(lambda n=number, t=tried: watch(f"round {n + 1}: ranking", next(t) / keys))
        outcome.rounds.append(trials)
        best = winner(ranking, trials)
        if best is None:
            break
        watch(f"round {number + 1}: {best.candidate.name.replace('_', ' ')}", 1.0)
        outcome.chosen.append((best.candidate.name, best.candidate.joint))
        ranking.take(best)
        _tidy(ranking)
        state = frozenset((m.candidate.name, m.candidate.joint) for m in ranking.members)
        if state in seen:  # added and taken out again
            break
        seen.add(state)
    _prune(ranking, ranking.members)
    watch("looking for other explanations", 0.0)
    outcome.named = _credits(ranking)
    needed = [m for m in ranking.members if _worth(ranking, m).value > ranking.min_gain / 2]
    ranking.margin = 1.0  # no more is needed to compare timings, and inertias compare within NEGLIGIBLE
    outcome.ambiguous = [found for m in needed if len(found := _equals(ranking, m)) > 1]
    return outcome


def _tidy(ranking: Ranking) -> None:
    """Take out what has become superfluous; exchange what another effect does clearly better."""
    newest = ranking.members[-1]
    _prune(ranking, tuple(m for m in ranking.members[:-1] if set(m.joints) & set(newest.joints)))
    for m in ranking.members[:-1]:
        if not set(m.joints) & set(ranking.members[-1].joints):
            continue
        better = (t for t in _instead(ranking, m) if t.fit.feasible and t.gain.clear(EXCHANGE * ranking.min_gain))
        others = [t for t in better if not _flexible(t.candidate, m.candidate)]
        if others:
            best = max(others, key=lambda t: t.gain.value)
            _, beside = ranking.closure(best.joints)
            simple = imitators(ranking, best, tuple(x for x in beside if x is not m)) if best.candidate.name in CONTAINS else ()
            ranking.replace((m,), tuple(map(ranking.column, next(iter(simple), (best.candidate,)))))
            return


def _flexible(one: Candidate, other: Candidate) -> bool:
    """Does the first imitate the second by being more flexible?"""
    return one.name != "payload" and other.name in CONTAINS.get(one.name, ())


def _prune(ranking: Ranking, suspects: tuple[Member, ...]) -> None:
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
    worth = _worth(ranking, m)
    return worth.value < REDUNDANT * ranking.min_gain or worth.value < worth.stderr


def _worth(ranking: Ranking, m: Member) -> Gain:
    """How much a member improves the error beside all others."""
    joints, beside = ranking.closure(m.joints)
    without = ranking.fitted(tuple(x for x in beside if x is not m), joints)
    return gain(errors_of(without, ranking.data, ranking.weight, joints), ranking.present(joints))


def _credits(ranking: Ranking) -> list[Named]:
    """What each member does when it is added to those before it."""
    out = []
    for number, m in enumerate(ranking.members):
        own = m.joints
        joints, _ = ranking.closure(own)
        pick = list(own)
        where = [joints.index(j) for j in own]
        touching = lambda x, joints=joints: bool(set(x.joints) & set(joints))  # noqa: E731
        sides = [ranking.fitted(tuple(filter(touching, ranking.members[:n])), joints) for n in (number, number + 1)]
        count = max(ranking.fit.counts[:, pick].sum(), 1.0)
        rms = [float((side.error[:, where].sum() / count) ** 0.5) for side in sides]
        before, after = (errors_of(side, ranking.data, ranking.weight, joints).of(where) for side in sides)
        out.append(Named(m, gain(before, after), *rms))
    return out


def _instead(ranking: Ranking, m: Member) -> list[Trial]:
    """Every other effect in the place of a member, on any of its joints; the best start of each."""
    taken = {(x.candidate.name, x.candidate.joint) for x in ranking.members}
    best: dict[tuple[str, int | None], Trial] = {}
    for candidate in ranking.shortlist():
        key = candidate.name, candidate.joint
        near = candidate.joint is None or candidate.joint in m.joints
        if key in taken or not near or (m.candidate.joint is not None and candidate.joint not in (None, m.candidate.joint)):
            continue
        trial = ranking.attempt(candidate, without=m)
        if trial is not None and (key not in best or trial.gain.value > best[key].gain.value):
            best[key] = trial
    return list(best.values())


def _equals(ranking: Ranking, m: Member) -> list[Candidate]:
    """The member and the effects that would explain the log as well in its place."""
    found = [m.candidate]
    for trial in _instead(ranking, m):
        other = trial.candidate
        if not {m.candidate.name, other.name} <= INSEPARABLE and (
            m.candidate.name in CONTAINS.get(other.name, ()) or other.cost > m.candidate.cost + 1.0
        ):
            continue
        if not other.guess.linear and trial.gain.value > -0.5:
            polished = ranking.attempt(other, polish=True, without=m)
            trial = max((t for t in (trial, polished) if t is not None), key=lambda t: t.gain.value)
        if trial.fit.feasible and trial.gain.value >= -max(min(SAME * trial.gain.stderr, UNSURE), NEGLIGIBLE):
            found.append(other)
    return found
