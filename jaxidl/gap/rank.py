"""Which effect is missing: every candidate is fitted beside what is there already and judged on blocks that took no part."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from jaxidl.effects import CoupledFriction, Effect
from jaxidl.gap.alignment import ALIGNMENT, alignments
from jaxidl.gap.candidates import TIMING, Candidate
from jaxidl.gap.data import Data, used
from jaxidl.gap.fit import Fit, fit, polished, updated
from jaxidl.gap.gains import FEW, NOISE_MARGIN, Errors, Gain, best_gain, errors_of, gain
from jaxidl.gap.members import Member, member
from jaxidl.gap.terms import parameters_of, trial_changes

HEAVY = 3.0  # times the median block's error: what is beyond counts less in fits
MANY = 20  # starting values of a hidden state beyond which they are simulated side by side at first,
PROMISING = 4  # and as many of them are fitted
STARTS = 3  # of one effect that are polished
SLIGHT = 0.1  # noise floors: a torque that changes by less is as before
STALE = 0.05  # of the residual on a joint: when others have changed it by so much, trials on it are made anew
WORTH = 0.02  # gain of the first linear fit from which polishing is worth its while


class Trial(NamedTuple):
    """A candidate fitted beside the present members."""

    candidate: Candidate
    fit: Fit  # of the joints concerned
    joints: tuple[int, ...]
    gain: Gain  # over the present model on the joints ``where`` it is judged,
    where: tuple[int, ...]
    overall: Gain  # ... and on all that it touches

    @property
    def which(self) -> int:
        """The candidate's place among the fit's members."""
        return next(i for i, m in enumerate(self.fit.members) if m.candidate is self.candidate)

    @property
    def theta(self) -> np.ndarray:
        """Its fitted parameters (P,)."""
        return self.fit.thetas[self.which]

    def order(self) -> float:
        """Key to sort by: the largest gain first, gains that are not finite last."""
        return -self.gain.value if np.isfinite(self.gain.value) else np.inf


class Ranking:
    """The present members, and how every candidate would do beside them.

    Trials are kept until something changes on their joints; where other joints' members reach them, until that amounts to much.
    """

    def __init__(self, data: Data, pool: Iterable[Candidate], min_gain: float):
        self.data, self.min_gain, self.margin = data, min_gain, NOISE_MARGIN
        self.pool = list(pool)
        self.groups: dict[tuple[str, int | None], list[Candidate]] = {}  # starting values and variants of one effect on one joint
        for candidate in self.pool:
            self.groups.setdefault((candidate.name, candidate.joint), []).append(candidate)
        self.members: tuple[Member, ...] = ()
        self.alignments = alignments(data)
        self.weight = np.ones(data.base.shape[1])
        self.fit = fit(data, self.all(), self.weight)
        self._weigh()
        self.fit = fit(data, self.all(), self.rows)
        self.columns: dict[Candidate, Member] = {}
        self.arrived = self.torque()  # (T, J) for which columns are made, to within ``SLIGHT``
        self.trials: dict[tuple[str, int | None], Trial] = {}
        self.drift = np.zeros(len(self.weight))  # of the residual since the trials on each joint were made, as a share of it
        self.simulated: dict[tuple[str, int | None], np.ndarray] = {}  # see ``promising``

    def _weigh(self) -> None:
        joints = range(self.data.base.shape[1])
        self.weight = np.array([1.0 / max(self.fit.rms(j), self.data.floor[j], 1e-12) for j in joints])
        rms = np.sqrt(self.fit.error / np.maximum(self.fit.counts, 1.0))
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
        tau = self.data.tau
        for m in self.members:
            tau = m.through(tau)
        return tau

    def closure(self, joints: Iterable[int]) -> tuple[tuple[int, ...], tuple[Member, ...]]:
        """The joints that must be fitted together, and the members on them."""
        reached, found = set(joints), set()
        while True:
            new = [m for m in self.members if m not in found and reached & set(m.joints)]
            if not new:
                return tuple(sorted(reached)), tuple(m for m in self.members if m in found)
            found.update(new)
            reached.update(*(m.joints for m in new))

    def around(self, joints: Iterable[int]) -> tuple[tuple[int, ...], tuple[Member, ...]]:
        """The joints that a trial on ``joints`` fits, and the members on them.

        In a mechanism of many joints what concerns one of them is tried there alone, while members that reach beyond it (a
        link's mass, a payload) are held; they move when it is taken.
        """
        own = tuple(sorted(set(joints)))
        reached, found = self.closure(own)
        if len(reached) <= FEW or len(own) > 1:
            return reached, found
        return own, tuple(m for m in found if set(m.joints) & set(own))

    def alike(self, one: Iterable[int], other: Iterable[int]) -> bool:
        """Do two effects, on these joints each, reach as far, so that one may take the other's place?"""
        one, other = set(one), set(other)
        return bool(one & other) and (len(self.weight) <= FEW or (len(one) > 1) == (len(other) > 1))

    def present(self, joints: tuple[int, ...]) -> Errors:
        """Weighted held-out errors of the present model."""
        return errors_of(self.fit, self.data, self.weight, margin=self.margin).of(list(joints))

    def judge(self, candidate: Candidate, found: Fit, joints: tuple[int, ...], own: tuple[int, ...]) -> Trial:
        after = errors_of(found, self.data, self.weight, joints, self.margin).of([joints.index(j) for j in own])
        best, overall, where = best_gain(self.present(own), after)
        return Trial(candidate, found, joints, best, tuple(own[k] for k in where), overall)

    def attempt(
        self, candidate: Candidate, polish: bool = False, without: tuple[Member, ...] = (), also: tuple[Candidate, ...] = ()
    ) -> Trial | None:
        """The candidate, and perhaps others, beside the members but those ``without``."""
        starts = [self.column(c) for c in (candidate, *also)]
        own = tuple(sorted({j for start in starts for j in start.joints}))
        if not own:
            return None
        joints, beside = self.around({*own, *(j for m in without for j in m.joints)})
        beside = tuple(m for m in beside if m not in without)
        found = self.fitted((*beside, *starts), joints)
        if polish and not all(start.effect.linear for start in starts):
            found = polished(self.data, found, self.rows, joints)
        return self.judge(candidate, found, joints, joints if without else own)

    # one round

    def rank(self, step: Callable[[], None] = lambda: None) -> list[Trial]:
        """The best trial of every effect on every joint, best first."""
        taken = {(m.candidate.name, m.candidate.joint) for m in self.members}
        taken |= {part for m in self.members for part in m.candidate.parts()}
        for key, group in self.groups.items():
            if key not in taken and key not in self.trials:
                trials = [t for t in map(self.attempt, self.promising(group)) if t is not None and t.fit.feasible]
                if trials:
                    self.trials[key] = self._refined(sorted(trials, key=Trial.order))
            step()
        return sorted((t for key, t in self.trials.items() if key not in taken), key=self.merit)

    def shortlist(self) -> list[Candidate]:
        """The pool, with few starting values of each hidden state, and without fine tables."""
        return [c for key in self.groups for c in self.coarse(self.variants(key))]

    def variants(self, key: tuple[str, int | None]) -> list[Candidate]:
        """Starting values and variants of one effect on one joint; of a hidden state those that were promising last."""
        group = self.groups[key]
        return [c for c in group if c in self.columns][-PROMISING:] if self._many(group) else group

    def coarse(self, group: list[Candidate]) -> list[Candidate]:
        """Of tables over each of many other joints those with the fewest knots: ``revise`` tries the finer ones afterwards."""
        if not group or group[0].name != CoupledFriction.name or len(self.weight) <= FEW:
            return group
        fewest = min(len(parameters_of(c.guess, c.free)) for c in group)
        return [c for c in group if len(parameters_of(c.guess, c.free)) == fewest]

    def _many(self, group: list[Candidate]) -> bool:
        first = group[0]
        return len(group) > MANY and first.joint is not None and type(first.guess).start is not Effect.start

    def promising(self, group: list[Candidate]) -> list[Candidate]:
        """Of many starting values of one hidden state those that leave the least as they are; others as they come."""
        j = group[0].joint
        if not self._many(group) or j is None:
            return self.coarse(group)
        key = group[0].name, j
        if key not in self.simulated:
            self.simulated[key] = trial_changes([c.guess for c in group], j, self.data.signals, self.torque())
        change = self.simulated[key]
        rows = (self.data.block >= 0) & used(self.data)[:, j]
        with np.errstate(over="ignore", invalid="ignore"):
            left = np.sum((self.fit.residual[rows, j, None] + change[rows]) ** 2, axis=0)
        order = np.argsort(np.nan_to_num(left, nan=np.inf))
        return [group[k] for k in order[:PROMISING]]

    def _refined(self, trials: list[Trial]) -> Trial:
        """Effects with shape parameters: the most promising starts are fitted to the end."""
        best = trials[0]
        if best.candidate.guess.linear or best.candidate.tried or trials[-1].candidate.tried:
            simplest = sorted((t for t in trials if not self._over(best, t).clear(0.02)), key=lambda t: t.candidate.cost)
            return simplest[0]
        if best.gain.value < WORTH:
            return best
        starts = 1 if len(best.joints) > 2 else STARTS  # what touches the whole mechanism takes its time
        ends = [self.attempt(t.candidate, polish=True) for t in trials[:starts]]
        return min((t for t in (*ends, best) if t is not None and t.fit.feasible), key=Trial.order)

    def _over(self, one: Trial, other: Trial) -> Gain:
        """Gain of one trial over another one on the same joints."""
        a, b = (errors_of(t.fit, self.data, self.weight, t.joints) for t in (one, other))
        return gain(b, a)

    def merit(self, trial: Trial) -> float:
        """What is left of the weighted error, over all joints."""
        own = self.column(trial.candidate).joints
        return ((1.0 - trial.overall.value) ** 2 - 1.0) * self.present(own).total()

    # changes

    def take(self, trial: Trial) -> None:
        """Add the trial's candidate; fit everything on its joints anew."""
        fitted = set(trial.joints)
        beside = tuple(m for m in self.closure(fitted)[1] if set(m.joints) <= fitted)
        kept = tuple(m for m in trial.fit.members if m.candidate.name != ALIGNMENT)
        parts = trial.candidate.parts()
        self.replace(beside, tuple(m for m in kept if (m.candidate.name, m.candidate.joint) not in parts))

    def replace(self, old: tuple[Member, ...], new: tuple[Member, ...]) -> None:
        """Put ``new`` members in the place of ``old`` ones, and fit them."""
        touched = {j for m in (*old, *new) for j in m.joints}
        self.members = tuple(m for m in self.members if m not in old)
        joints, beside = self.closure(touched)
        found = polished(self.data, self.fitted((*beside, *new), joints), self.rows, joints)
        fresh = tuple(m for m in updated(found, self.data) if m.candidate.name != ALIGNMENT)
        self.members = (*(m for m in self.members if m not in beside), *fresh)
        before, self.fit = self.fit.residual, fit(self.data, self.all(), self.rows)
        self._forget(touched, joints, self.fit.residual - before)
        torque = self.torque()
        changed = np.sqrt(np.mean((torque - self.arrived) ** 2, axis=0)) > SLIGHT * self.data.floor
        self.arrived = np.where(changed, torque, self.arrived)
        self.columns = {c: m for c, m in self.columns.items() if not changed[list(m.joints)].any()}
        self.simulated = {key: x for key, x in self.simulated.items() if not changed[key[1]]}
        self._weigh()

    def _forget(self, touched: set[int], joints: tuple[int, ...], change: np.ndarray) -> None:
        """Trials on joints that were ``touched``, or fitted with them, if the residual's ``change`` there is no longer slight."""
        rms = lambda x: np.sqrt(np.mean(x**2, axis=0))  # noqa: E731
        self.drift += rms(change) / np.maximum(rms(self.fit.residual), self.data.floor)
        local = len(joints) > FEW
        old = {j for j in joints if not local or j in touched or self.drift[j] > STALE}
        self.trials = {k: t for k, t in self.trials.items() if not set(t.joints) & old}
        self.drift[list(old)] = 0.0
