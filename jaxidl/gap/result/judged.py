"""What is said of a set of effects that was found: findings, errors on held-out data, simulations.

What hardly anything speaks for is left out. If some joint's motion is simulated worse than by the
model as it was, so is what is more likely wrong than right, and what is rare on that joint, if the
errors of all joints, their geometric mean, are less without. What is not sure does not take the
name of its parts: where a change of dry friction at low speed is doubtful, dry friction is named
beside it.

A confidence is halved in a log of a few seconds, on a joint that seems to be misread, of a delay of
hardly more than a sampling interval, and of what a factor common to all torques would replace:
links, and effects that the model has already (:mod:`jaxidl.gap.result.weight`). That of a change
is less if a reference log cannot tell that it was not there (:mod:`jaxidl.gap.result.reference`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jaxidl.effects import CATALOGUE, Effect
from jaxidl.gap.choice.find import Found, Watch
from jaxidl.gap.choice.objections import brief
from jaxidl.gap.evidence.conventions import WRONG, conventions, late_torques
from jaxidl.gap.evidence.items import absorbed
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.evidence.rows import instants_of, rms
from jaxidl.gap.evidence.shape import present
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.values import Value, values
from jaxidl.gap.result.diagnosis import LIKELY, SURE, Finding, Gap, Key, Side
from jaxidl.gap.result.findings import findings
from jaxidl.gap.result.network import check
from jaxidl.gap.result.reference import left_by, shared, since_then
from jaxidl.gap.result.weight import proportion, weight_of
from jaxidl.gap.result.words import LEAST
from jaxidl.logs.signals import Signals
from jaxidl.replay.rollout import rollout_errors
from jaxidl.systems import Plant
from jaxidl.systems.mjcf import Model

HARDLY = 0.1  # confidence below which an effect is not even suspected
UNLIKELY = "its confidence is below 10 %"
DOUBTED = 0.5  # share of a finding's confidence that is left
ASTRAY = "with it the simulation strays further from the measured motion"


class Reading(NamedTuple):
    """How a log of J joints reads."""

    said: list[str]  # sentences about it
    misread: np.ndarray  # (J,) which joints seem to be misread
    since: Mapping[Key, float]  # probability that effects were not there in a reference log


class Judged(NamedTuple):
    """What is said of a set; N rows of J joints."""

    found: Found
    odd: list[str]  # sentences about how the log reads
    after: np.ndarray  # (N, J) residual with the set [N or Nm]
    gap: np.ndarray  # (N, J) that of the model [N or Nm]
    network: tuple[tuple[float, float], ...]  # of each joint, as :func:`check` returns them
    named: tuple[Finding, ...]
    compared: Gap
    since: Mapping[Key, float]  # see :class:`Reading`
    common: tuple[Effect, ...]  # what two logs share, beside what was found


def judged(
    found: Found,
    signals: Signals,
    known: Model,
    common: Sequence[Effect],
    rollouts: bool,
    watch: Watch,
    reference: Found | None = None,
) -> Judged:
    """Return what is said of a set without what leads the simulation astray.

    The effects in ``common`` are those that this log of T instants and its reference share, in
    which the ``reference`` was found. Without ``rollouts`` nothing is simulated.
    """
    watch("checking the residual", 0.0)
    reading = read_as(found, reference, known.names)
    judge = lambda found: _judged(
        found, signals, known, common, rollouts, watch, reference, reading
    )
    first = judge(found)
    if unsure := {*absorbed(found.solution.members).values()} & _below(SURE, first):
        found = _without(replace(found, apart=frozenset(unsure)), {})
        odd, named = _named(found, known, first.network, reading, reference)
        first = first._replace(found=found, odd=odd, named=named)
    while hardly := _below(HARDLY, first):
        found = _without(found, dict.fromkeys(hardly, UNLIKELY))
        first = judge(found)
    far = _astray(first.compared)
    strays = set(np.flatnonzero(far > 1.0).tolist())
    rare = {(f.name, f.joint) for f in first.named if not CATALOGUE[f.name].common}
    leading = {key for key in rare if key[1] in strays} | _below(LIKELY, first)
    if not strays or not leading:
        return first
    second = judge(_without(found, dict.fromkeys(leading, ASTRAY)))
    mean = lambda ratio: float(np.mean(np.log(np.maximum(ratio, 1e-9))))
    return second if mean(_astray(second.compared)) < mean(far) else first


def _below(confidence: float, said: Judged) -> set[Key]:
    return {(f.name, f.joint) for f in said.named if f.confidence < confidence}


def _without(found: Found, reasons: Mapping[Key, str]) -> Found:
    """Return the set without some of its effects, the others fitted again, and the reasons why."""
    gone = {m.group: reasons[m.key] for m in found.named if m.key in reasons}
    now = found.score.solve([m for m in found.solution.members if m.group not in gone])
    fitted = values(found.score, now, found.library.rows.whole(), found.predicted, found.apart)
    return replace(found, solution=now, fitted=fitted, dropped=found.dropped | gone)


def fitted_to_training(found: Found) -> list[Effect]:
    """Return what was found with parameters fitted to the training rows alone."""
    rows = found.library.rows
    fitted = values(found.score, found.solution, rows, found.predicted, found.apart)
    return [v.effect for v in fitted]


def _judged(
    found: Found,
    signals: Signals,
    known: Model,
    common: Sequence[Effect],
    rollouts: bool,
    watch: Watch,
    reference: Found | None,
    reading: Reading,
) -> Judged:
    """Return what is said of a set, with both sides of the gap in the same held-out rows.

    The simulated parameters were fitted without these rows.
    """
    rows, members = found.library.rows, fitted_to_training(found)
    after = residual(rows, found.solution)
    # both sides have the log's torques as well aligned
    gap = residual(rows, found.score.solve(m for m in found.explaining if m.key[0] == ALIGNMENT))
    network = check(rows, after)
    there = ~rows.training[:, None] & rows.used
    command = rms(rows.command, there)
    kept_aside = instants_of(signals, ~rows.training & ~rows.strange)

    def side(left: np.ndarray, plant: Plant, motion: Signals) -> Side:
        watch("replaying the log", 0.5)
        size = rms(left, there)
        errors = rollout_errors(plant, motion, kept_aside) if rollouts else {}
        relative = np.where(command > 0.0, size / np.maximum(command, 1e-300), np.nan)
        return Side(size.tolist(), relative.tolist(), {h: e.tolist() for h, e in errors.items()})

    behind = signals.behind(members)
    model = Plant(known.plant.body, (*known.plant.effects, *common))
    before = later = side(gap, model, signals._replace(late=behind.late))
    if members:
        if reference is not None:
            ways = members, [v.effect for v in found.fitted]
            beside = [[*known.plant.effects, *changes] for changes in ways]
            common = shared(reference, found, common, beside)
        corrected = Plant(model.body, (*known.plant.effects, *common, *members))
        later = side(after, corrected, behind)
    compared = Gap(list(known.units), before, later, signals.noise_floor.tolist())
    odd, named = _named(found, known, network, reading, reference)
    return Judged(found, odd, after, gap, network, named, compared, reading.since, tuple(common))


def _named(
    found: Found,
    known: Model,
    network: Sequence[tuple[float, float]],
    reading: Reading,
    reference: Found | None,
) -> tuple[list[str], tuple[Finding, ...]]:
    """Return sentences about how the log reads, and the findings."""
    odd, trust = trust_of(found, reading)
    usual = None if reference is None else left_by(reference)
    return odd, findings(found, known, network, trust, usual)


def _astray(compared: Gap) -> np.ndarray:
    """Return the largest ratio of each joint's error in position after to that before, (J,)."""
    before, after = (
        np.atleast_2d([*s.rollout_rms.values()]) for s in (compared.before, compared.after)
    )
    diverges = np.where(np.isnan(before), 0.0, np.inf)
    ratio = np.where(np.isnan(after), diverges, after / np.maximum(before, 1e-300))
    return np.nan_to_num(ratio, nan=0.0, posinf=np.inf).max(0, initial=0.0)


def read_as(found: Found, reference: Found | None, names: Sequence[str]) -> Reading:
    """Return how a log of J joints called ``names`` reads.

    One that changes since the ``reference`` explain reads as that does.
    """
    rows = found.library.rows
    said, misread = list[str](), np.zeros(len(names), bool)
    if reference is None or np.any(left_by(found) > WRONG * rows.spread):
        said, misread = conventions(rows, names)
    late, which = late_torques(rows, found.explaining, names)
    since = {} if reference is None else since_then(found, reference)
    return Reading([*said, *late], misread | which, since)


def trust_of(found: Found, reading: Reading) -> tuple[list[str], Callable[[Value, int], float]]:
    """Return all that is said about how a log reads, and the trust in it.

    That is the share of an effect's confidence on a joint that is left.
    """
    rows = found.library.rows
    scaled, links = proportion(found, weight_of(found))
    few, own = rows.signals.duration < LEAST, present(rows.effects) if links else {}

    def trust(value: Value, joint: int) -> float:
        factor = value.key in own or any(m.group in links for m in value.items)
        short = any(brief(found.solution, m, rows.signals.interval) for m in value.items)
        doubted = DOUBTED if few or reading.misread[joint] or factor or short else 1.0
        return doubted * reading.since.get(value.key, 1.0)

    return [*reading.said, *scaled], trust
