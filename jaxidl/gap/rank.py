"""Which effect is missing: every candidate is fitted beside what is there already and judged on blocks that took no part."""

from collections.abc import Callable, Iterable
from itertools import combinations
from typing import NamedTuple

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.alignment import ALIGNMENT, alignments
from jaxidl.gap.candidates import ABSORBS, ATOMS, CONTAINS, INSEPARABLE, TIMING, Candidate
from jaxidl.gap.fit import Data, Fit, Member, fit, member, updated, used
from jaxidl.gap.terms import trial_changes

SIGNIFICANT = 2.0  # standard errors by which an effect must win
SELDOM = 4.0  # times the least gain: what an effect must remove that acts in few blocks only,
FEWEST = 2.5  # and at as many moments at least (saturation in one fast stretch of a log, for one)
SAME = 1.0  # standard errors within which two are equally good
TRIFLE = 0.02  # of the command's spread: an effect smaller than this must remove five times as much of what is left
QUIET = 3.0  # noise floors: where no more than this is left, small effects stand out from what is not understood
REPLACES = 0.5  # see ``Ranking._imitation``
ROUNDS = 10  # of polishing
NOISE_MARGIN = 1.2  # below this multiple of the noise floor errors are not told apart: a changed inertia changes the floor
HEAVY = 3.0  # times the median block's error: what is beyond counts less in fits
MANY = 20  # starting values of a hidden state beyond which they are simulated side by side at first,
PROMISING = 4  # and as many of them are fitted
LOOKAHEAD = 10  # effects of which pairs are tried if none is clear alone
STARTS = 3  # of one effect that are polished
WORTH = 0.02  # gain of the first linear fit from which polishing is worth its while
LEAST_SIDE = 0.05  # of one direction's dry friction that the other has at least: else it is an offset as large as the friction
RATIO = 1.5  # directions whose dry friction differs less are Coulomb friction and an offset


class Gain(NamedTuple):
    """How much smaller a held-out error is: 1 − after/before, and its standard error."""

    value: float
    stderr: float
    few: bool = False  # is it made at few moments, perhaps, but at several, and hardly any lost at others?

    def clear(self, least: float) -> bool:
        """Two standard errors and the least gain; where an effect seldom acts, several times that gain and no loss elsewhere."""
        usual = self.value >= least and self.value > SIGNIFICANT * self.stderr
        return usual or (self.few and self.value >= SELDOM * least)


class Errors(NamedTuple):
    """Sums of squares (B, J) on blocks that took no part, and those of the noise floor; weighted alike. ``count`` (B, J) are the rows.

    A total is that of the mean of the blocks' root mean squares: one block with a huge error, of a motor in saturation say, would
    otherwise drown what all others have to tell.
    """

    error: np.ndarray
    noise: np.ndarray
    count: np.ndarray
    moments: np.ndarray  # (E, J) the error's, on shorter stretches

    def of(self, columns: list[int]) -> "Errors":
        return Errors(*(x[:, columns] for x in self))

    def total(self) -> float:
        return float(_total(*(np.sqrt(x * self.count).sum(0) for x in self[:2]), self.count.sum(0)))

    def square(self) -> float:
        """The plain sum of squares, not less than the noise's."""
        return float(np.maximum(self.error.sum(0), self.noise.sum(0)).sum())

    def without_each(self) -> np.ndarray:
        """Totals (B,) without one block each."""
        sums = [np.sqrt(x * self.count) for x in self[:2]]
        return _total(*(x.sum(0) - x for x in sums), self.count.sum(0) - self.count)


def _total(error: np.ndarray, noise: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.sum(np.maximum(error, noise) ** 2 / np.maximum(count, 1.0), axis=-1)


def errors_of(
    found: Fit, data: Data, weight: np.ndarray, joints: tuple[int, ...] | None = None, margin: float = NOISE_MARGIN
) -> Errors:
    """Errors of a fit of some joints, or all, with their weights (J,); none counts as less than ``margin`` noise floors."""
    pick = list(range(len(weight)) if joints is None else joints)
    square = weight[pick] ** 2
    return Errors(
        found.error * square, found.count * (margin * data.floor[pick]) ** 2 * square, found.count, found.moments * square
    )


def gain(before: Errors, after: Errors) -> Gain:
    """Gain of ``after`` over ``before`` on the same blocks; jackknife over blocks.

    No error counts as less than the noise's: an effect that filters what the encoder's noise makes explains nothing.
    """
    value = 1.0 - np.sqrt(after.total() / max(before.total(), 1e-300))
    parts = 1.0 - np.sqrt(after.without_each() / np.maximum(before.without_each(), 1e-300))
    n = len(parts)
    stderr = float(np.sqrt((n - 1) / n * np.sum((parts - parts.mean()) ** 2)))
    plain = 1.0 - np.sqrt(after.square() / max(before.square(), 1e-300))
    if plain > 0.0 and _seldom(before.moments, after.moments):
        return Gain(float(max(value, plain)), stderr, True)
    return Gain(float(value), stderr)


def _seldom(before: np.ndarray, after: np.ndarray) -> bool:
    """Is the gain made at several moments, and hardly any lost at others?"""
    change = (before - after).sum(1)
    better, worse = np.maximum(change, 0.0), np.maximum(-change, 0.0).sum()
    moments = better.sum() ** 2 / max(np.sum(better**2), 1e-300)  # as many of equal gain would have this sum and these squares
    return bool(moments > FEWEST and worse < 0.1 * better.sum())


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
        self.data, self.min_gain, self.margin = data, min_gain, NOISE_MARGIN
        self.pool = list(pool)
        self.members: tuple[Member, ...] = ()
        self.alignments = alignments(data)
        self.weight = np.ones(data.base.shape[1])
        self.fit = fit(data, self.all(), self.weight)
        self._weigh()
        self.fit = fit(data, self.all(), self.rows)
        self.columns: dict[Candidate, Member] = {}
        self.trials: dict[tuple[str, int | None], Trial] = {}

    def _weigh(self) -> None:
        joints = range(self.data.base.shape[1])
        self.weight = np.array([1.0 / max(self.fit.rms(j), self.data.floor[j], 1e-12) for j in joints])
        rms = np.sqrt(self.fit.error / np.maximum(self.fit.count, 1.0))
        share = np.minimum(1.0, HEAVY * np.median(rms, axis=0) / np.maximum(rms, 1e-300))
        self.rows = self.weight * share[np.maximum(self.data.block, 0)]  # (N, J) of fits

    def all(self, members: tuple[Member, ...] | None = None) -> tuple[Member, ...]:
        """Members and, on joints where none of them is about timing, the alignment of torque and position."""
        members = self.members if members is None else members
        timed = {m.candidate.joint for m in members if m.candidate.name in TIMING}
        return (*members, *(a for a in self.alignments if a.candidate.joint not in timed))

    def fitted(self, members: tuple[Member, ...], joints: tuple[int, ...]) -> Fit:
        """The fit of some joints with these members on them; alignments come last."""
        timing = self.all(members)[len(members) :]
        return fit(self.data, (*members, *(a for a in timing if a.candidate.joint in joints)), self.rows, joints)

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
            new = [m for m in self.members if m not in found and reached & set(m.joints)]
            if not new:
                return tuple(sorted(reached)), tuple(m for m in self.members if m in found)
            found.update(new)
            reached.update(*(m.joints for m in new))

    def present(self, joints: tuple[int, ...]) -> Errors:
        """Weighted held-out errors of the present model."""
        return errors_of(self.fit, self.data, self.weight, margin=self.margin).of(list(joints))

    def judge(self, candidate: Candidate, found: Fit, joints: tuple[int, ...], own: tuple[int, ...]) -> Trial:
        after = errors_of(found, self.data, self.weight, joints, self.margin).of([joints.index(j) for j in own])
        return Trial(candidate, found, joints, gain(self.present(own), after))

    def attempt(self, candidate: Candidate, polish: bool = False, without: Member | None = None) -> Trial | None:
        """The candidate beside the members (but one)."""
        start = self.column(candidate)
        own = start.joints
        if not own:
            return None
        joints, beside = self.closure(own if without is None else {*own, *without.joints})
        beside = tuple(m for m in beside if m is not without)
        found = self.fitted((*beside, start), joints)
        if polish and not start.effect.linear:
            found = polished(self.data, found, self.rows, joints)
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
                trials = [t for t in map(self.attempt, self.promising(group)) if t is not None and t.fit.feasible]
                if trials:
                    self.trials[key] = self._refined(sorted(trials, key=_error))
            step()
        return sorted((t for key, t in self.trials.items() if key not in taken), key=self._merit)

    def shortlist(self) -> list[Candidate]:
        """The pool, with few starting values of each hidden state: those that were promising last."""
        groups: dict[tuple[str, int | None], list[Candidate]] = {}
        for candidate in self.pool:
            groups.setdefault((candidate.name, candidate.joint), []).append(candidate)
        short = lambda group: [c for c in group if c in self.columns][-PROMISING:]  # noqa: E731
        return [c for group in groups.values() for c in (short(group) if self._many(group) else group)]

    def _many(self, group: list[Candidate]) -> bool:
        first = group[0]
        return len(group) > MANY and first.joint is not None and type(first.guess).start is not Effect.start

    def promising(self, group: list[Candidate]) -> list[Candidate]:
        """Of many starting values of one hidden state those that leave the least as they are; others as they come."""
        j = group[0].joint
        if not self._many(group) or j is None:
            return group
        change = trial_changes([c.guess for c in group], j, self.data.signals, self.torque())
        rows = (self.data.block >= 0) & used(self.data)[:, j]
        with np.errstate(over="ignore", invalid="ignore"):
            left = np.sum((self.fit.residual[rows, j, None] + change[rows]) ** 2, axis=0)
        order = np.argsort(np.nan_to_num(left, nan=np.inf))
        return [group[k] for k in order[:PROMISING]]

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
        own = self.column(trial.candidate).joints
        return ((1.0 - trial.gain.value) ** 2 - 1.0) * self.present(own).total()

    def winner(self, ranking: list[Trial]) -> tuple[Trial | None, list[Trial]]:
        """The effect to add, if any, and the trials that are as good."""
        clear = [t for t in ranking if self.matters(t)]
        if not clear:
            return self._pair(ranking), []
        best = clear[0]
        equal = [t for t in clear if self._same(best, t)]
        chosen = min(equal, key=lambda t: (t.candidate.cost, self._merit(t)))
        if chosen.candidate.name in CONTAINS and (atoms := self._imitation(chosen)) is not None:
            return atoms, [chosen]
        return chosen, [t for t in equal if t is not chosen]

    def _pair(self, ranking: list[Trial]) -> Trial | None:
        """The better of two effects of which neither is clear without the other, if together they are."""
        best: tuple[float, Trial] | None = None
        for one, other in combinations(ranking[:LOOKAHEAD], 2):
            if one.joints != other.joints:
                continue
            starts = [t.fit.members[t.which] for t in (one, other)]
            _, beside = self.closure(one.joints)
            together = self.fitted((*beside, *starts), one.joints)
            trial = one._replace(
                fit=together, gain=gain(self.present(one.joints), errors_of(together, self.data, self.weight, one.joints))
            )
            if together.feasible and trial.gain.clear(4.0 * self.min_gain) and (best is None or trial.gain.value > best[0]):
                best = trial.gain.value, trial
        return best[1] if best else None

    def matters(self, trial: Trial) -> bool:
        """Is it a clear gain, of something that is not a trifle beside the command?"""
        own = self.column(trial.candidate).joints
        rows = self.fit.count[:, list(own)].sum(0)
        removed = self.present(own).total() * (1.0 - (1.0 - trial.gain.value) ** 2)  # weighted sum of squares
        command = np.sum((self.data.command[list(own)] * self.weight[list(own)]) ** 2 * rows)
        noisy = all(self.fit.rms(j) < QUIET * self.data.floor[j] for j in own)
        small = removed < TRIFLE**2 * command and not noisy
        return trial.gain.clear(5.0 * self.min_gain if small else self.min_gain)

    def _same(self, best: Trial, other: Trial) -> bool:
        """Is ``other`` as good? A simpler effect that ``best`` contains must be clearly beaten."""
        if best is other:
            return True
        concerned = sorted({*best.joints, *other.joints})
        over = gain(self._errors(other).of(concerned), self._errors(best).of(concerned))
        if {best.candidate.name, other.candidate.name} <= INSEPARABLE:
            return over.value < 2.0 * self.min_gain
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
        atoms = [c for c in atoms if set(self.column(c).joints) <= set(compound.joints)]
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
                break
            singles = [t for t in map(self.attempt, best[1]) if t is not None and self.matters(t)]
            if singles:
                return min(singles, key=_error)
        return self._half(compound) if compound.candidate.variant == "both" else None

    def _half(self, both: Trial) -> Trial | None:
        """Friction that differs by direction in its dry part only, beside plain viscous friction; or the other way round."""
        joint = both.candidate.joint
        for variant, partner in (("dry", "viscous_friction"), ("viscous", "coulomb_friction")):
            half = next(c for c in self.pool if c.key == (both.candidate.name, joint, variant))
            atom = next((c for c in self.pool if c.name == partner and c.joint == joint), None)
            if atom is None or any(m.candidate.key == atom.key for m in self.members):
                continue
            _, beside = self.closure(both.joints)
            together = self.fitted((*beside, self.column(half), self.column(atom)), both.joints)
            if together.feasible and not gain(self._errors(both._replace(fit=together)), self._errors(both)).clear(self.min_gain):
                return self.attempt(half)
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
        _, beside = self.closure(self.column(trial.candidate).joints)
        kept = tuple(m for m in trial.fit.members if m.candidate.name != ALIGNMENT)
        parts = {ABSORBS.get((trial.candidate.name, name)) for name in trial.candidate.free}
        merged = lambda m: m.candidate.joint == trial.candidate.joint and m.candidate.name in parts  # noqa: E731
        self.replace(beside, tuple(m for m in kept if not merged(m)))

    def replace(self, old: tuple[Member, ...], new: tuple[Member, ...]) -> None:
        """Put ``new`` members in the place of ``old`` ones, and fit them."""
        touched = {j for m in (*old, *new) for j in m.joints}
        self.members = tuple(m for m in self.members if m not in old)
        joints, beside = self.closure(touched)
        found = polished(self.data, self.fitted((*beside, *new), joints), self.rows, joints)
        changed = any(m.delivered is not None for m in (*old, *new))
        fresh = tuple(m for m in updated(found, self.data) if m.candidate.name != ALIGNMENT)
        self.members = (*(m for m in self.members if m not in beside), *fresh)
        whole = fit(self.data, self.all(), self.rows)
        self.fit, self.trials = whole, {k: t for k, t in self.trials.items() if not set(t.joints) & set(joints)}
        if changed:
            self.columns = {c: m for c, m in self.columns.items() if not set(m.joints) & set(joints)}
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
    return low > LEAST_SIDE * high and high > RATIO * low
