"""Which effect is missing: every candidate is fitted beside what is there already and judged on blocks that took no part."""

from collections.abc import Callable, Iterable
from itertools import combinations
from typing import NamedTuple

import numpy as np

from jaxidl.gap.alignment import ALIGNMENT, alignments
from jaxidl.gap.candidates import ABSORBS, ATOMS, CONTAINS, TIMING, Candidate
from jaxidl.gap.fit import Data, Fit, Member, fit, member, updated

SIGNIFICANT = 2.0  # standard errors by which an effect must win
SAME = 1.0  # standard errors within which two are equally good
TRIFLE = 0.02  # of the command's spread: an effect smaller than this must remove five times as much of what is left
REPLACES = 0.5  # see ``Ranking._imitation``
ROUNDS = 6  # of polishing
NOISE_MARGIN = 1.2  # below this multiple of the noise floor errors are not told apart: a changed inertia changes the floor
STARTS = 2  # of one effect that are polished
WORTH = 0.02  # gain of the first linear fit from which polishing is worth its while
RATIO = 1.5  # directions whose dry friction differs less are Coulomb friction and an offset


class Gain(NamedTuple):
    """How much smaller a held-out error is: 1 − after/before, and its standard error."""

    value: float
    stderr: float

    def clear(self, least: float) -> bool:
        return self.value >= least and self.value > SIGNIFICANT * self.stderr


class Errors(NamedTuple):
    """Sums of squares (B, J) on blocks that took no part, and those of the noise floor; weighted alike."""

    error: np.ndarray
    noise: np.ndarray

    def of(self, columns: list[int]) -> "Errors":
        return Errors(self.error[:, columns], self.noise[:, columns])

    def total(self) -> float:
        return float(np.maximum(self.error.sum(0), self.noise.sum(0)).sum())

    def without_each(self) -> np.ndarray:
        """Totals (B,) without one block each."""
        left = [x.sum(0) - x for x in self]
        return np.maximum(*left).sum(1)


def errors_of(found: Fit, data: Data, weight: np.ndarray, joints: tuple[int, ...] | None = None) -> Errors:
    """Errors of a fit of some joints, or all, with their weights (J,)."""
    pick = list(range(len(weight)) if joints is None else joints)
    square = weight[pick] ** 2
    return Errors(found.error * square, found.count * (NOISE_MARGIN * data.floor[pick]) ** 2 * square)


def gain(before: Errors, after: Errors) -> Gain:
    """Gain of ``after`` over ``before`` on the same blocks; jackknife over blocks.

    No error counts as less than the noise's: an effect that filters what the encoder's noise makes explains nothing.
    """
    value = 1.0 - np.sqrt(after.total() / max(before.total(), 1e-300))
    parts = 1.0 - np.sqrt(after.without_each() / np.maximum(before.without_each(), 1e-300))
    n = len(parts)
    return Gain(float(value), float(np.sqrt((n - 1) / n * np.sum((parts - parts.mean()) ** 2))))


class Trial(NamedTuple):
    """A candidate fitted beside the present members."""

    candidate: Candidate
    fit: Fit  # of the joints concerned
    joints: tuple[int, ...]
    gain: Gain  # over the present model on these joints

    @property
    def which(self) -> int:
        """The candidate's place among the fit's members."""
        return next(i for i, m in enumerate(self.fit.members) if m.candidate is self.candidate)

    @property
    def theta(self) -> np.ndarray:
        """Its fitted parameters."""
        return self.fit.thetas[self.which]


class Ranking:
    """The present members, and how every candidate would do beside them.

    Trials are kept until something changes on their joints.
    """

    def __init__(self, data: Data, pool: Iterable[Candidate], min_gain: float):
        self.data, self.min_gain = data, min_gain
        self.pool = list(pool)
        self.members: tuple[Member, ...] = ()
        self.alignments = alignments(data)
        self.weight = np.ones(data.base.shape[1])
        self.fit = fit(data, self.all(), self.weight)
        self._weigh()
        self.fit = fit(data, self.all(), self.weight)
        self.columns: dict[Candidate, Member] = {}
        self.trials: dict[tuple[str, int | None], Trial] = {}

    def _weigh(self) -> None:
        joints = range(self.data.base.shape[1])
        self.weight = np.array([1.0 / max(self.fit.rms(j), self.data.floor[j], 1e-12) for j in joints])

    def all(self, members: tuple[Member, ...] | None = None) -> tuple[Member, ...]:
        """Members and, on joints where none of them is about timing, the alignment of torque and position."""
        members = self.members if members is None else members
        timed = {m.candidate.joint for m in members if m.candidate.name in TIMING}
        return (*members, *(a for a in self.alignments if a.candidate.joint not in timed))

    def fitted(self, members: tuple[Member, ...], joints: tuple[int, ...]) -> Fit:
        """The fit of some joints with these members on them; alignments come last."""
        timing = self.all(members)[len(members) :]
        return fit(self.data, (*members, *(a for a in timing if a.candidate.joint in joints)), self.weight, joints)

    # what a set of members would do

    def column(self, candidate: Candidate) -> Member:
        """The candidate at its guess."""
        if candidate not in self.columns:
            tau = self.torque()
            self.columns[candidate] = member(candidate, candidate.guess, self.data.signals, tau)
        return self.columns[candidate]

    def torque(self) -> np.ndarray:
        """Torque (T, J) after all members."""
        delivered = [m.delivered for m in self.members if m.delivered is not None]
        return delivered[-1] if delivered else self.data.tau

    def closure(self, joints: Iterable[int]) -> tuple[tuple[int, ...], tuple[Member, ...]]:
        """The joints that must be fitted together, and the members on them."""
        reached, found = set(joints), set()
        while True:
            new = [m for m in self.members if m not in found and reached & set(m.joints())]
            if not new:
                return tuple(sorted(reached)), tuple(m for m in self.members if m in found)
            found.update(new)
            reached.update(*(m.joints() for m in new))

    def present(self, joints: tuple[int, ...]) -> Errors:
        """Weighted held-out errors of the present model."""
        return errors_of(self.fit, self.data, self.weight).of(list(joints))

    def judge(self, candidate: Candidate, found: Fit, joints: tuple[int, ...], own: tuple[int, ...]) -> Trial:
        after = errors_of(found, self.data, self.weight, joints).of([joints.index(j) for j in own])
        return Trial(candidate, found, joints, gain(self.present(own), after))

    def attempt(self, candidate: Candidate, polish: bool = False, without: Member | None = None) -> Trial | None:
        """The candidate beside the members (but one)."""
        start = self.column(candidate)
        own = start.joints()
        if not own:
            return None
        joints, beside = self.closure(own if without is None else {*own, *without.joints()})
        beside = tuple(m for m in beside if m is not without)
        found = self.fitted((*beside, start), joints)
        if polish and not start.effect.linear:
            found = polished(self.data, found, self.weight, joints)
        return self.judge(candidate, found, joints, joints if without is not None else own)

    # one round

    def rank(self, step: Callable[[], None] = lambda: None) -> list[Trial]:
        """The best trial of every effect on every joint, best first."""
        groups: dict[tuple[str, int | None], list[Candidate]] = {}
        for candidate in self.pool:
            groups.setdefault((candidate.name, candidate.joint), []).append(candidate)
        taken = {(m.candidate.name, m.candidate.joint) for m in self.members}
        for key, group in groups.items():
            if key not in taken and key not in self.trials:
                trials = [t for t in map(self.attempt, group) if t is not None and t.fit.feasible]
                if trials:
                    self.trials[key] = self._refined(sorted(trials, key=_error))
            step()
        return sorted((t for key, t in self.trials.items() if key not in taken), key=self._merit)

    def _refined(self, trials: list[Trial]) -> Trial:
        """Effects with shape parameters: the most promising starts are fitted to the end."""
        best = trials[0]
        if best.candidate.guess.linear:
            simplest = sorted((t for t in trials if not self._over(best, t).clear(0.02)), key=lambda t: t.candidate.cost)
            return simplest[0]
        if best.gain.value < WORTH:
            return best
        ends = [self.attempt(t.candidate, polish=True) for t in trials[:STARTS]]
        return min((t for t in (*ends, best) if t is not None and t.fit.feasible), key=_error)

    def _over(self, one: Trial, other: Trial) -> Gain:
        """Gain of one trial over another one on the same joints."""
        a, b = (errors_of(t.fit, self.data, self.weight, t.joints) for t in (one, other))
        return gain(b, a)

    def _merit(self, trial: Trial) -> float:
        """What is left of the weighted error, over all joints."""
        own = self.column(trial.candidate).joints()
        return ((1.0 - trial.gain.value) ** 2 - 1.0) * self.present(own).total()

    def winner(self, ranking: list[Trial]) -> tuple[Trial | None, list[Trial]]:
        """The effect to add, if any, and the trials that are as good."""
        clear = [t for t in ranking if self.matters(t)]
        if not clear:
            return None, []
        best = clear[0]
        equal = [t for t in clear if self._same(best, t)]
        chosen = min(equal, key=lambda t: (t.candidate.cost, self._merit(t)))
        if chosen.candidate.name in CONTAINS and (atoms := self._imitation(chosen)) is not None:
            return atoms, [chosen]
        return chosen, [t for t in equal if t is not chosen]

    def matters(self, trial: Trial) -> bool:
        """Is it a clear gain, of something that is not a trifle beside the command?"""
        own = self.column(trial.candidate).joints()
        rows = self.fit.count[:, list(own)].sum(0)
        removed = self.present(own).total() * (1.0 - (1.0 - trial.gain.value) ** 2)  # weighted sum of squares
        command = np.sum((self.data.command[list(own)] * self.weight[list(own)]) ** 2 * rows)
        small = removed < TRIFLE**2 * command
        return trial.gain.clear(5.0 * self.min_gain if small else self.min_gain)

    def _same(self, best: Trial, other: Trial) -> bool:
        """Is ``other`` as good? A simpler effect that ``best`` contains must be clearly beaten."""
        if best is other:
            return True
        a, b = self._errors(best), self._errors(other)
        over = gain(b, a)
        if other.candidate.name in CONTAINS.get(best.candidate.name, ()):
            return not over.clear(self.min_gain)
        return over.value <= SAME * over.stderr or over.value < 0.5 * self.min_gain

    def _errors(self, trial: Trial) -> Errors:
        """Weighted errors of the whole model if the trial were taken."""
        whole = errors_of(self.fit, self.data, self.weight)
        whole.error[:, list(trial.joints)] = errors_of(trial.fit, self.data, self.weight, trial.joints).error
        return whole

    def _imitation(self, compound: Trial) -> Trial | None:
        """The first of up to three simple effects that together do nearly what one complex effect does, if there are such.

        One complex cause in the place of several simple ones must leave less than ``REPLACES`` of what they leave.
        """
        joint = compound.candidate.joint
        taken = {(m.candidate.name, m.candidate.joint) for m in self.members}
        atoms = [c for c in self.pool if c.name in ATOMS and c.joint == joint and (c.name, joint) not in taken]
        atoms = [c for c in atoms if set(self.column(c).joints()) <= set(compound.joints)]
        left = self._excess(compound)
        for size in (1, 2, 3):
            best: tuple[float, tuple[Candidate, ...]] | None = None
            for group in combinations(atoms, size):
                if len({c.name for c in group}) < size:
                    continue
                _, beside = self.closure(compound.joints)
                together = self.fitted((*beside, *map(self.column, group)), compound.joints)
                trial = Trial(compound.candidate, together, compound.joints, compound.gain)
                if together.feasible and (best is None or self._excess(trial) < best[0]):
                    best = self._excess(trial), group
            if best is None or left < REPLACES * best[0]:
                continue
            if compound.candidate.name == "asymmetric_friction" and size > 1 and _directional(compound):
                return None
            singles = [t for t in map(self.attempt, best[1]) if t is not None and self.matters(t)]
            if singles:
                return min(singles, key=_error)
        return None

    def _excess(self, trial: Trial) -> float:
        """Root mean square error on the trial's joints, weighted, beyond the noise floor."""
        pick = list(trial.joints)
        rows = trial.fit.count.sum(0)
        square = (trial.fit.error.sum(0) - rows * self.data.floor[pick] ** 2) * self.weight[pick] ** 2
        return float(np.sqrt(max(square.sum() / max(rows.sum(), 1), 1e-12)))

    # changes

    def take(self, trial: Trial) -> None:
        """Add the trial's candidate; fit everything on its joints anew."""
        _, beside = self.closure(self.column(trial.candidate).joints())
        kept = tuple(m for m in trial.fit.members if m.candidate.name != ALIGNMENT)
        parts = {ABSORBS.get((trial.candidate.name, name)) for name in trial.candidate.free}
        merged = lambda m: m.candidate.joint == trial.candidate.joint and m.candidate.name in parts  # noqa: E731
        self.replace(beside, tuple(m for m in kept if not merged(m)))

    def replace(self, old: tuple[Member, ...], new: tuple[Member, ...]) -> None:
        """Put ``new`` members in the place of ``old`` ones, and fit them."""
        touched = {j for m in (*old, *new) for j in m.joints()}
        self.members = tuple(m for m in self.members if m not in old)
        joints, beside = self.closure(touched)
        found = polished(self.data, self.fitted((*beside, *new), joints), self.weight, joints)
        changed = any(m.delivered is not None for m in (*old, *new))
        fresh = tuple(m for m in updated(found, self.data) if m.candidate.name != ALIGNMENT)
        self.members = (*(m for m in self.members if m not in beside), *fresh)
        whole = fit(self.data, self.all(), self.weight)
        self.fit, self.trials = whole, {k: t for k, t in self.trials.items() if not set(t.joints) & set(joints)}
        if changed:
            self.columns = {c: m for c, m in self.columns.items() if not set(m.joints()) & set(joints)}
        self._weigh()


def polished(data: Data, found: Fit, weight: np.ndarray, joints: tuple[int, ...]) -> Fit:
    """Linearise anew where the last fit ended, until it no longer gets better."""
    if all(m.effect.linear and m.delivered is None for m in found.members):
        return found
    best = found
    for _ in range(ROUNDS):
        after = fit(data, updated(best, data), weight, joints)
        if not np.isfinite(after.error).all() or not after.error.sum() < 0.999 * best.error.sum():
            return after if np.isfinite(after.error).all() and after.error.sum() <= best.error.sum() else best
        best = after
    return best


def _error(trial: Trial) -> float:
    return -trial.gain.value if np.isfinite(trial.gain.value) else np.inf


def _directional(trial: Trial) -> bool:
    """Does dry friction differ so much between directions that an offset is not the likelier reason?"""
    theta = dict(zip(trial.candidate.free, trial.theta, strict=False))
    low, high = sorted((theta.get("positive", 0.0), theta.get("negative", 0.0)))
    return low > 0.0 and high > RATIO * low
