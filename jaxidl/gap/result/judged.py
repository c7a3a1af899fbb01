"""What is said of a set of effects that was found: findings, errors on held-out data, simulations.

What hardly anything speaks for is left out. If some joint's motion is simulated worse than by the
model as it was, so is what is more likely wrong than right, and what is rare on that joint, if the
simulation is better without.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from jaxidl.effects import CATALOGUE, Effect
from jaxidl.gap.choice.find import Found, Watch
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.evidence.rows import instants_of, rms
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.values import Value, values
from jaxidl.gap.result.diagnosis import LIKELY, Finding, Gap, Key, Side
from jaxidl.gap.result.findings import findings
from jaxidl.gap.result.network import Gain, check
from jaxidl.gap.result.trust import trust_of
from jaxidl.logs.signals import Signals
from jaxidl.replay.rollout import rollout_errors
from jaxidl.systems import Plant
from jaxidl.systems.mjcf import Model

HARDLY = 0.1  # confidence below which an effect is not even suspected
UNLIKELY = "its confidence is below 10 %"
ASTRAY = "with it the simulation strays further from the measured motion"


class Judged(NamedTuple):
    """What is said of a set; N rows of J joints."""

    odd: list[str]  # sentences about how the log reads
    after: np.ndarray  # (N, J) residual with the set [N or Nm]
    gap: np.ndarray  # (N, J) that of the model [N or Nm]
    network: tuple[Gain, ...]  # of each joint
    named: tuple[Finding, ...]
    compared: Gap


def judged(
    found: Found,
    signals: Signals,
    known: Model,
    common: Sequence[Effect],
    rollouts: bool,
    watch: Watch,
) -> tuple[Found, Judged]:
    """Return what is said of a set, and the set without what leads the simulation astray.

    Args:
        found: the result of the search.
        signals: the log, T instants of J joints.
        known: the model.
        common: effects that this log and its reference have in common.
        rollouts: whether to simulate.
        watch: called with the current stage and the share of it that is done.
    """
    compare = lambda found, gap, after: _gap(
        found, signals, gap, after, known, common, rollouts, watch
    )
    watch("checking the residual", 0.0)
    first = _judged(found, known, compare)
    if hardly := _below(HARDLY, first):
        found = _without(found, hardly, UNLIKELY)
        first = _judged(found, known, compare)
    far = _astray(first.compared)
    strays = {j for j, ratio in enumerate(far) if ratio > 1.0}
    rare = {(f.name, f.joint) for f in first.named if not CATALOGUE[f.name].common}
    leading = {key for key in rare if key[1] in strays} | _below(LIKELY, first)
    if not strays or not leading:
        return found, first
    less = _without(found, leading, ASTRAY)
    second = _judged(less, known, compare)
    better = max(_astray(second.compared)) < max(far)
    return (less, second) if better else (found, first)


def _below(confidence: float, said: Judged) -> set[Key]:
    return {(f.name, f.joint) for f in said.named if f.confidence < confidence}


def _without(found: Found, keys: set[Key], why: str) -> Found:
    """Return the set without some of its effects, the others fitted again."""
    gone = {m.group: why for m in found.named if m.key in keys}
    now = found.score.solve([m for m in found.solution.members if m.group not in gone])
    fitted = values(found.score, now, found.library.rows.whole(), found.predicted)
    return replace(found, solution=now, fitted=fitted, dropped=found.dropped | gone)


def fitted_to_training(found: Found) -> list[Value]:
    """Return what was found with parameters fitted to the training rows alone."""
    return values(found.score, found.solution, found.library.rows, found.predicted)


def _judged(found: Found, known: Model, compare: Callable[..., Gap]) -> Judged:
    rows = found.library.rows
    after = residual(rows, found.solution)
    # where nothing is found, the model is judged with the log's torques as well aligned
    aligning = [m for m in found.solution.members if m.key[0] == ALIGNMENT]
    gap = rows.gap if found.named else residual(rows, found.solution, aligning)
    network = check(rows, after)
    odd, trust = trust_of(found, known.names)
    named = findings(found, found.fitted, known, [n.value for n in network], found.ties, trust)
    return Judged(odd, after, gap, network, named, compare(found, gap, after))


def _gap(
    found: Found,
    signals: Signals,
    gap: np.ndarray,
    after: np.ndarray,
    known: Model,
    common: Sequence[Effect],
    rollouts: bool,
    watch: Watch,
) -> Gap:
    """Return both sides on the held-out rows, and in the same windows of them.

    The parameters were fitted without these rows.
    """
    rows = found.library.rows
    members = [v.effect for v in fitted_to_training(found)]
    behind = signals.behind(members)
    there = ~rows.training[:, None] & rows.used
    command = rms(rows.command, there)
    kept_aside = instants_of(signals, ~rows.training & ~rows.strange)

    def side(left: np.ndarray, plant: Plant, motion: Any) -> Side:
        watch("replaying the log", 0.5)
        size = rms(left, there)
        errors = rollout_errors(plant, motion, kept_aside) if rollouts else {}
        relative = np.where(command > 0.0, size / np.maximum(command, 1e-300), np.nan)
        return Side(size.tolist(), relative.tolist(), {h: e.tolist() for h, e in errors.items()})

    model = Plant(known.plant.body, (*known.plant.effects, *common))
    before = side(gap, model, signals._replace(late=behind.late))
    later = (
        side(after, Plant(model.body, (*model.effects, *members)), behind) if members else before
    )
    return Gap(list(known.units), before, later, signals.noise_floor.tolist())


def _astray(compared: Gap) -> list[float]:
    """Return the largest ratio of each joint's error in position after to that before."""
    before, after = (
        np.atleast_2d([*s.rollout_rms.values()]) for s in (compared.before, compared.after)
    )
    diverges = np.where(np.isnan(before), 0.0, np.inf)
    ratio = np.where(np.isnan(after), diverges, after / np.maximum(before, 1e-300))
    return np.nan_to_num(ratio, nan=0.0, posinf=np.inf).max(0, initial=0.0).tolist()
