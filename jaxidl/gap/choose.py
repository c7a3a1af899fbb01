"""Which of the ranked effects to add: the clearest, unless a simpler one, several simple ones or a pair explain as much."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from jaxidl.gap.candidates import ATOMS, CONTAINS, INSEPARABLE, Candidate
from jaxidl.gap.gains import Errors, errors_of, gain
from jaxidl.gap.members import Member
from jaxidl.gap.rank import Ranking, Trial

SAME = 1.0  # standard errors within which two are equally good
TRIFLE = 0.02  # of the command's spread: an effect smaller than this must remove five times as much of what is left
QUIET = 3.0  # noise floors: where no more than this is left, small effects stand out from what is not understood
REPLACES = 0.5  # see ``imitators``
LOOKAHEAD = 10  # effects of which pairs are tried if none is clear alone
LEAST_SIDE = 0.05  # of one direction's dry friction that the other has at least: else it is an offset as large as the friction
RATIO = 1.5  # directions whose dry friction differs less are Coulomb friction and an offset


def winner(ranking: Ranking, trials: list[Trial]) -> Trial | None:
    """The effect to add, if any."""
    clear = [t for t in trials if matters(ranking, t)]
    if not clear:
        return _pair(ranking, trials)
    best = clear[0]
    equal = [t for t in clear if _same(ranking, best, t)]
    chosen = min(equal, key=lambda t: (t.candidate.cost, ranking.merit(t)))
    if chosen.candidate.name in CONTAINS and (atoms := _imitation(ranking, chosen)) is not None:
        return atoms
    return chosen


def _pair(ranking: Ranking, trials: list[Trial]) -> Trial | None:
    """The better of two effects of which neither is clear without the other, if together they are."""
    best: tuple[float, Trial] | None = None
    for one, other in combinations(trials[:LOOKAHEAD], 2):
        if one.joints != other.joints:
            continue
        starts = [t.fit.members[t.which] for t in (one, other)]
        _, beside = ranking.around(one.joints)
        together = ranking.fitted((*beside, *starts), one.joints)
        both = gain(ranking.present(one.joints), errors_of(together, ranking.data, ranking.weight, one.joints))
        trial = one._replace(fit=together, gain=both, where=one.joints, overall=both)
        if together.feasible and trial.gain.clear(4.0 * ranking.min_gain) and (best is None or trial.gain.value > best[0]):
            best = trial.gain.value, trial
    return best[1] if best else None


def matters(ranking: Ranking, trial: Trial) -> bool:
    """Is it a clear gain, of something that is not a trifle beside the command?"""
    own = trial.where
    rows = ranking.fit.counts[:, list(own)].sum(0)
    removed = ranking.present(own).total() * (1.0 - (1.0 - trial.gain.value) ** 2)  # weighted sum of squares
    command = np.sum((ranking.data.command[list(own)] * ranking.weight[list(own)]) ** 2 * rows)
    noisy = all(ranking.fit.rms(j) < QUIET * ranking.data.floor[j] for j in own)
    small = removed < TRIFLE**2 * command and not noisy
    return trial.gain.clear(5.0 * ranking.min_gain if small else ranking.min_gain)


def _same(ranking: Ranking, best: Trial, other: Trial) -> bool:
    """Is ``other`` as good? A simpler effect that ``best`` contains must be clearly beaten."""
    if best is other:
        return True
    concerned = sorted({*best.joints, *other.joints})
    over = gain(_errors(ranking, other).of(concerned), _errors(ranking, best).of(concerned))
    if {best.candidate.name, other.candidate.name} <= INSEPARABLE:
        return over.value < 2.0 * ranking.min_gain
    if other.candidate.name in CONTAINS.get(best.candidate.name, ()):
        return not over.clear(ranking.min_gain)
    return over.value <= SAME * over.stderr or over.value < 0.5 * ranking.min_gain


def _errors(ranking: Ranking, trial: Trial) -> Errors:
    """Weighted errors of the whole model if the trial were taken."""
    whole = errors_of(ranking.fit, ranking.data, ranking.weight)
    whole.error[:, list(trial.joints)] = errors_of(trial.fit, ranking.data, ranking.weight, trial.joints).error
    return whole


def _imitation(ranking: Ranking, compound: Trial) -> Trial | None:
    """The first of several simple effects that together do nearly what one complex effect does, if there are such."""
    _, beside = ranking.around(compound.joints)
    for group in imitators(ranking, compound, beside):
        singles = [t for t in map(ranking.attempt, group) if t is not None and matters(ranking, t)]
        if singles:
            return min(singles, key=Trial.order)
    return _half(ranking, compound) if compound.candidate.variant == "both" else None


def imitators(ranking: Ranking, compound: Trial, beside: tuple[Member, ...]) -> Iterator[tuple[Candidate, ...]]:
    """Groups of up to three simple effects that with those ``beside`` do nearly what one complex effect does with them.

    One complex cause in the place of several simple ones must leave less than ``REPLACES`` of what they leave.
    """
    joint = compound.candidate.joint
    taken = {(m.candidate.name, m.candidate.joint) for m in beside}
    atoms = [c for c in ranking.pool if c.name in ATOMS and c.joint == joint and (c.name, joint) not in taken]
    atoms = [c for c in atoms if set(ranking.column(c).joints) <= set(compound.joints)]
    left = _excess(ranking, compound)
    for size in (1, 2, 3):
        best: tuple[float, tuple[Candidate, ...]] | None = None
        for group in combinations(atoms, size):
            if len({c.name for c in group}) < size:
                continue
            together = ranking.fitted((*beside, *map(ranking.column, group)), compound.joints)
            excess = _excess(ranking, compound._replace(fit=together))
            if together.feasible and (best is None or excess < best[0]):
                best = excess, group
        if best is None or left < REPLACES * best[0]:
            continue
        if compound.candidate.name == "asymmetric_friction" and size > 1 and _directional(compound):
            return
        yield best[1]


def _half(ranking: Ranking, both: Trial) -> Trial | None:
    """Friction that differs by direction in its dry part only, beside plain viscous friction; or the other way round."""
    joint = both.candidate.joint
    for variant, partner in (("dry", "viscous_friction"), ("viscous", "coulomb_friction")):
        half = next(c for c in ranking.pool if c.key == (both.candidate.name, joint, variant))
        atom = next((c for c in ranking.pool if c.name == partner and c.joint == joint), None)
        if atom is None or any(m.candidate.key == atom.key for m in ranking.members):
            continue
        _, beside = ranking.around(both.joints)
        together = ranking.fitted((*beside, ranking.column(half), ranking.column(atom)), both.joints)
        lost = gain(_errors(ranking, both._replace(fit=together)), _errors(ranking, both))
        if together.feasible and not lost.clear(ranking.min_gain):
            return ranking.attempt(half)
    return None


def _excess(ranking: Ranking, trial: Trial) -> float:
    """Root mean square error on the trial's joints, weighted, beyond the noise floor."""
    pick = list(trial.joints)
    rows = trial.fit.counts.sum(0)
    square = (trial.fit.error.sum(0) - rows * ranking.data.floor[pick] ** 2) * ranking.weight[pick] ** 2
    return float(np.sqrt(max(square.sum() / max(rows.sum(), 1), 1e-12)))


def _directional(trial: Trial) -> bool:
    """Does dry friction differ so much between directions that an offset is not the likelier reason?"""
    theta = dict(zip(trial.candidate.free, trial.theta, strict=False))
    low, high = sorted((theta.get("positive", 0.0), theta.get("negative", 0.0)))
    return bool(low > LEAST_SIDE * high and high > RATIO * low)
