"""Round after round: rank, add the winner, fit everything anew, until nothing is left to name; then what is ambiguous."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from jaxidl.gap.candidates import CONTAINS, INSEPARABLE, Candidate
from jaxidl.gap.choose import SAME, winner
from jaxidl.gap.exchange import exchange_two, exchange_wide, instead, prune, revise, tidy, worth
from jaxidl.gap.gains import Gain, best_gain, errors_of
from jaxidl.gap.members import Member
from jaxidl.gap.rank import Ranking, Trial

MOST = 24  # effects at most,
PER_JOINT = 6  # or so many a joint
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
    chosen: list[tuple[str, int | None] | None] = field(default_factory=list)  # what each round added, if anything
    ambiguous: list[list[Candidate]] = field(default_factory=list)  # equally good explanations; the named one first


Watch = Callable[[str, float], None]  # what is being done, and the share of the present round


def search(ranking: Ranking, watch: Watch = lambda what, share: None) -> Outcome:
    """Add effects while one is clearly missing."""
    outcome = Outcome(ranking, ranking.fit.residual)
    keys = len(ranking.groups)
    seen: set[frozenset[tuple[str, int | None, str]]] = set()
    most = max(MOST, PER_JOINT * ranking.data.base.shape[1])
    for number in range(most):
        tried = iter(range(1, keys + 1))
        trials = ranking.rank(lambda n=number, t=tried: watch(f"round {n + 1}: ranking", next(t) / keys))
        outcome.rounds.append(trials)
        best = winner(ranking, trials)
        if best is None:
            outcome.chosen.append(None)
            watch(f"round {number + 1}: exchanging effects", 1.0)
            changed = number + 1 < most and (revise(ranking) or exchange_wide(ranking) or exchange_two(ranking))
            if changed and _news(ranking, seen):
                continue
            break
        watch(f"round {number + 1}: {best.candidate.name.replace('_', ' ')}", 1.0)
        outcome.chosen.append((best.candidate.name, best.candidate.joint))
        ranking.take(best)
        tidy(ranking)
        if not _news(ranking, seen):  # added and taken out again
            break
    prune(ranking, ranking.members)
    watch("looking for other explanations", 0.0)
    outcome.named = _credits(ranking)
    needed = [m for m in ranking.members if worth(ranking, m).value > ranking.min_gain / 2]
    ranking.margin = 1.0  # no more is needed to compare timings, and inertias compare within NEGLIGIBLE
    outcome.ambiguous = [found for m in needed if len(found := _equals(ranking, m)) > 1]
    return outcome


def _news(ranking: Ranking, seen: set[frozenset[tuple[str, int | None, str]]]) -> bool:
    """Is this set of members new? It is remembered."""
    state = frozenset(m.candidate.key for m in ranking.members)
    known = state in seen
    seen.add(state)
    return not known


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
        out.append(Named(m, best_gain(before, after)[0], *rms))
    return out


def _equals(ranking: Ranking, m: Member) -> list[Candidate]:
    """The member and the effects that would explain the log as well in its place."""
    found = [m.candidate]
    for trial in instead(ranking, m):
        other = trial.candidate
        if not {m.candidate.name, other.name} <= INSEPARABLE and (
            m.candidate.name in CONTAINS.get(other.name, ()) or other.cost > m.candidate.cost + 1.0
        ):
            continue
        if not other.guess.linear and trial.gain.value > -0.5:
            polished = ranking.attempt(other, polish=True, without=(m,))
            trial = max((t for t in (trial, polished) if t is not None), key=lambda t: t.gain.value)
        if trial.fit.feasible and trial.gain.value >= -max(min(SAME * trial.gain.stderr, UNSURE), NEGLIGIBLE):
            found.append(other)
    return found
