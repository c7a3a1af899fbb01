"""From a log and a model to a diagnosis: the rounds of the workflow in their order."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxidl.effects import CATALOGUE, Effect, OnJoint, searchable, searched
from jaxidl.errors import ConfigurationError, one_of
from jaxidl.gap.candidates import Candidate, candidates
from jaxidl.gap.choose import TRIFLE
from jaxidl.gap.data import Data, data_of, instants_of, used
from jaxidl.gap.diagnosis import Ambiguity, Diagnosis, Estimate, Finding, Gap, Row, Side, Traces, sentence_of
from jaxidl.gap.experiments import experiment
from jaxidl.gap.gains import NOISE_MARGIN
from jaxidl.gap.gauge import Told, settled
from jaxidl.gap.localise import localise
from jaxidl.gap.log import Log, read
from jaxidl.gap.network import SYSTEMATIC, check
from jaxidl.gap.rank import Ranking
from jaxidl.gap.rollout import rollout_errors
from jaxidl.gap.search import Outcome, search
from jaxidl.gap.signals import Signals, prepare
from jaxidl.gap.words import summarise
from jaxidl.systems import Plant
from jaxidl.systems.mjcf import Model, read_model

MIN_GAIN = 0.05
LARGE = 0.04  # of the command's spread: a residual of this size is worth a word even if nothing predicts it,
MUCH = 0.5  # if it is this share of what was there before
NARROWER = 0.7  # share of the band in which parameters are fitted once more, for their standard errors
SHOWN = 12  # rows of each round's ranking that are kept

Watch = Callable[[str, float], None]


def diagnose(
    log: Log | str | Path | Sequence[str | Path],
    model: Model | str | Path,
    *,
    held_out: float = 0.3,
    effects: Sequence[str] | None = None,
    min_gain: float = MIN_GAIN,
    rollouts: bool = True,
    watch: Watch = lambda what, share: None,
) -> Diagnosis:
    """Say where a log and a model disagree, which effect is missing, and by how much the gap shrinks with it.

    Args:
        log: a :class:`jaxidl.gap.log.Log`, or files as :func:`jaxidl.gap.log.read` takes them.
        model: a model as :func:`jaxidl.systems.mjcf.read_model` returns it, or its file.
        held_out: share of the log, at its end, that takes no part in fitting and ranking.
        effects: names of the catalogue to look for; None: all of it that is searched, with what the user registered.
        min_gain: share of the remaining held-out error that an effect must remove to be named.
        rollouts: replay the torques and compare positions, too; compiling that takes some seconds.
        watch: called with what is being done and the share done of it.

    Raises:
        LogError: if the log cannot be used.
        ModelError: if the model cannot be read.
        ConfigurationError: for an unknown effect or a share out of its bounds.
    """
    effects = searched() if effects is None else effects
    _check(held_out, effects, min_gain)
    with jax.enable_x64(True):
        watch("reading", 0.0)
        known = model if isinstance(model, Model) else read_model(model)
        measured = log if isinstance(log, Log) else read(log, joints=len(known.names))
        if measured.joints != len(known.names):
            got = f"{measured.joints} in the log"
            raise ConfigurationError(
                f"the model's {len(known.names)} joints in the log", got, "give the log and the model of one mechanism"
            )
        watch("comparing with the model", 0.0)
        signals = prepare(measured, known.plant.body, known.plant.effects)
        data = data_of(signals, known.plant.effects, held_out)
        pool = candidates(signals, _rms(data.base, used(data)), effects)
        outcome = search(Ranking(data, pool, min_gain), watch)
        before = outcome.before
        watch("looking for what no effect explains", 0.0)
        network = check(data, outcome.ranking.fit.residual)
        narrow = prepare(measured, known.plant.body, known.plant.effects, narrower=NARROWER) if outcome.named else signals
        wholes = [data_of(s, known.plant.effects, 0.0) for s in (signals, narrow)]
        findings = _findings(settled(outcome, *wholes), outcome, known)
        patched = Plant(known.plant.body, (*known.plant.effects, *(f.effect for f in findings)))
        watch("replaying the log", 0.0)
        gap = _gap(data, before, outcome.ranking.fit.residual, known, patched, findings, rollouts)
    after = outcome.ranking.fit.residual
    remaining = tuple(localise(data, after, known.names))
    gains = tuple((g.value, g.stderr) for g in network.gains)
    ambiguous = tuple(
        Ambiguity(tuple((c.name, c.joint) for c in s), experiment([(c.name, c.joint) for c in s])) for s in outcome.ambiguous
    )
    verdict = _verdict(data, before, after, gains, findings, ambiguous)
    where = tuple(localise(data, before, known.names))
    return Diagnosis(
        verdict=verdict,
        summary=summarise(verdict, findings, ambiguous, gap, where, remaining, known),
        findings=findings,
        ambiguous=ambiguous,
        where=where,
        remaining=remaining,
        gap=gap,
        rounds=_rounds(outcome),
        network=gains,
        model=known,
        traces=_traces(measured, data, before, after),
        band=signals.band,
        notes=(*measured.notes, *known.notes, *_warnings(data, known)),
        options={"held_out": held_out, "effects": list(effects), "min_gain": min_gain},
        signals=signals,
    )


def _check(held_out: float, effects: Sequence[str], min_gain: float) -> None:
    for name in effects:
        if name not in searchable():
            raise one_of("an effect to look for", name, searchable())
    if not effects:
        raise ConfigurationError("at least one effect to look for", "none", f"choose among {', '.join(searchable())}")
    if not 0.1 <= held_out <= 0.6:
        raise ConfigurationError("a held-out share between 0.1 and 0.6", f"{held_out}", "keep a tenth to six tenths aside")
    if not 0.0 < min_gain < 1.0:
        raise ConfigurationError("a least gain between 0 and 1", f"{min_gain}", "choose 0.05, say")


def _rms(residual: np.ndarray, counted: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(residual**2 * counted, 0) / np.maximum(counted.sum(0), 1))


def _findings(parameters_of: Sequence[tuple[Effect, Told]], outcome: Outcome, model: Model) -> tuple[Finding, ...]:
    found = []
    for named, (effect, estimates) in zip(outcome.named, parameters_of, strict=True):
        candidate = named.member.candidate
        joint = candidate.joint
        single = joint is not None and candidate.name != "coupled_friction"
        ready: Effect = OnJoint(effect, joint, len(model.names)) if single and joint is not None else effect
        kind = model.kinds[joint] if joint is not None else "hinge"
        parameters = {
            name: Estimate(value, unit_of(CATALOGUE[candidate.name].parameters[name].unit, kind), stderr)
            for name, (value, stderr) in estimates.items()
        }
        where = f" (joint {joint}, {model.names[joint]})" if joint is not None else ""
        gain = named.gain.value, named.gain.stderr
        found.append(
            Finding(
                candidate.name,
                joint,
                ready,
                sentence_of(candidate.name) + where,
                parameters,
                named.before,
                named.after,
                *gain,
                _bounds(candidate),
            )
        )
    return tuple(found)


def _bounds(candidate: Candidate) -> dict[str, tuple[float, float]]:
    """Lower and upper bound of each parameter that was fitted."""
    sizes = [np.size(getattr(candidate.guess, name)) for name in candidate.free]
    places = np.cumsum([0, *sizes])[:-1]
    lower, upper = candidate.bounds()
    return {name: (float(lower[at]), float(upper[at])) for name, at in zip(candidate.free, places, strict=True)}


def unit_of(unit: str, kind: str) -> str:
    """A parameter's unit on a slide or a hinge, from the catalogue's, which is that of a slide."""
    fixed = {"mass": "kg", "length": "m"}
    if unit in fixed or kind == "slide":
        return fixed.get(unit, unit)
    hinge = {
        "N": "Nm", "m": "rad", "kg": "kg m^2", "m/s": "rad/s", "N/m": "Nm/rad", "N s/m": "Nm s/rad", "N s^2/m^2": "Nm s^2/rad^2",
    }  # fmt: skip
    return hinge.get(unit, unit)


def _gap(
    data: Data, base: np.ndarray, after: np.ndarray, model: Model, patched: Plant, findings: Sequence[Finding], rollouts: bool
) -> Gap:
    """Both sides on the rows kept aside, and in the same windows of them."""
    signals = data.signals
    behind = signals.behind([f.effect for f in findings])
    aside = (data.block < 0)[:, None] & used(data)
    command = _rms(signals.command(signals.tau)[signals.rows], aside)
    kept_aside = instants_of(signals, data.block < 0)

    def side(residual: np.ndarray, plant: Plant, motion: Signals) -> Side:
        rms = _rms(residual, aside)
        errors = rollout_errors(plant, motion, kept_aside) if rollouts else {}
        return Side(rms.tolist(), (rms / np.maximum(command, 1e-300)).tolist(), {h: e.tolist() for h, e in errors.items()})

    before = side(base, model.plant, signals._replace(late=behind.late))
    later = side(after, patched, behind) if findings else before
    return Gap(list(model.units), before, later, data.floor.tolist())


def _verdict(
    data: Data, before: np.ndarray, after: np.ndarray, network: Any, findings: Sequence[Finding], ambiguous: Sequence[Ambiguity]
) -> str:
    if any(_unexplained(data, before, after, j, *gain) for j, gain in enumerate(network)):
        return "unexplained"
    if ambiguous:
        return "ambiguous"
    return "named" if findings else "nothing_missing"


def _unexplained(data: Data, before: np.ndarray, after: np.ndarray, j: int, gain: float, stderr: float) -> bool:
    """Is what is left on joint j too much to be called explained?

    A network still predicts a good part of it, or most of what was there at first is left, and it is neither noise nor a trifle.
    """
    rows = used(data)[:, j]
    was, left = (np.sqrt(max(np.mean(x[rows, j] ** 2) - (NOISE_MARGIN * data.floor[j]) ** 2, 0.0)) for x in (before, after))
    removed = np.sqrt(np.mean(after[rows, j] ** 2) * (1.0 - (1.0 - gain) ** 2)) if gain > 0.0 else 0.0
    systematic = gain > SYSTEMATIC and gain > 2.0 * stderr and removed > TRIFLE * data.command[j]
    return bool(systematic or (left > MUCH * was and left > LARGE * data.command[j]))


def _rounds(outcome: Outcome) -> tuple[tuple[Row, ...], ...]:
    rounds = []
    for trials, chosen in zip(outcome.rounds, [*outcome.chosen, None], strict=False):
        named = [(t.candidate.name, t.candidate.joint, t.gain) for t in trials[:SHOWN]]
        rounds.append(tuple(Row(name, joint, g.value, g.stderr, (name, joint) == chosen) for name, joint, g in named))
    return tuple(rounds)


def _traces(log: Log, data: Data, before: np.ndarray, after: np.ndarray) -> Traces:
    signals, rows = data.signals, data.signals.rows
    command = signals.command(signals.tau)[rows]
    return Traces(log.time[rows], data.block < 0, signals.q[rows], signals.qd[rows], command, before, after, used(data))


def _warnings(data: Data, model: Model) -> list[str]:
    signals, notes = data.signals, []
    if np.count_nonzero(np.diff(data.block < 0)) > 1:
        notes.append("several parts of the log are kept aside: its end holds motion that the rest does not")
    still = [model.names[j] for j in range(len(model.names)) if not np.any(signals.moving[:, j])]
    if still:
        notes.append(f"{', '.join(still)} hardly moved: nothing can be said of friction there")
    return notes
