"""From a log and a model to a diagnosis."""

from collections.abc import Sequence
from pathlib import Path

import jax
import numpy as np

from jaxidl import __version__
from jaxidl.effects import Effect
from jaxidl.errors import ConfigurationError
from jaxidl.gap.choice.confirm import possible
from jaxidl.gap.choice.find import Found, Watch, find
from jaxidl.gap.evidence.clock import late_torques
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.localise import localise
from jaxidl.gap.evidence.moments import moments, strange
from jaxidl.gap.evidence.rows import Rows, rms, rows_of
from jaxidl.gap.evidence.shape import present
from jaxidl.gap.fit.held_out import aside
from jaxidl.gap.fit.library import Library, library
from jaxidl.gap.inputs import Inputs, read_inputs, wanted
from jaxidl.gap.reference import left_by, reference_of
from jaxidl.gap.result.diagnosis import (
    Diagnosis,
    Envelope,
    Gap,
    Traces,
)
from jaxidl.gap.result.judged import fitted_to_training, judged
from jaxidl.gap.result.notes import notes_of
from jaxidl.gap.result.parts import differing
from jaxidl.gap.result.swings import swings
from jaxidl.gap.result.verdict import doubts_of, rivals_of, unexplained_joints, verdict_of
from jaxidl.gap.result.words import doubt_of, summarise
from jaxidl.logs.log import Log, read
from jaxidl.logs.signals import Signals, prepare
from jaxidl.systems.mjcf import Model, read_model

MIN_GAIN = 0.05

Source = Log | str | Path | Sequence[str | Path]


def diagnose(
    log: Source,
    model: Model | str | Path,
    *,
    reference: Source | None = None,
    held_out: float = 0.3,
    effects: Sequence[str] | None = None,
    exclude: Sequence[str] = (),
    min_gain: float = MIN_GAIN,
    rollouts: bool = True,
    watch: Watch = lambda what, share: None,
) -> Diagnosis:
    """Find where a log and a model disagree, and which effects are missing.

    The diagnosis also says by how much the gap shrinks with them.

    Args:
        log: a :class:`jaxidl.logs.log.Log`, or files as :func:`jaxidl.logs.log.read` takes them.
        model: a model as :func:`jaxidl.systems.mjcf.read_model` returns it, or its file. If log and
            model are files, joints that the log does not name are locked.
        reference: an earlier log of the same machine. What both have in common is no finding; only
            changes are.
        held_out: share of the log, at the end of each run, that is not used for fitting and
            searching.
        effects: names in the catalogue to look for. Default: all that are searched for, including
            those that the user registered.
        exclude: names not to look for.
        min_gain: share of the remaining held-out error that an effect must remove to be named.
        rollouts: also replay the torques and compare positions; compiling that takes some seconds.
        watch: called with the current stage and the share of it that is done.

    Raises:
        LogError: if a log cannot be used.
        ModelError: if the model cannot be read.
        ConfigurationError: for an unknown effect, a share out of its bounds, or a log with a
            different number of joints.
    """
    names = wanted(held_out, effects, exclude, min_gain)
    with jax.enable_x64(True):
        watch("reading", 0.0)
        measured, known = _inputs(log, model)
        old = None if reference is None else _matching(_inputs(reference, model).log, known)
        before: Found | None = None
        common: tuple[Effect, ...] = ()
        if old is not None:
            watch("searching the reference", 0.0)
            before, _ = _search(old, known, (), names, 0.0, min_gain, watch, resample=False)
            kept = (v.effect for v in fitted_to_training(before))
            common = tuple(e for e in kept if possible(e, known.plant.effects))
        found, signals = _search(
            measured, known, common, names, held_out, min_gain, watch, before=before
        )
        found, (odd, after, gap, network, named, compared) = judged(
            found, signals, known, common, rollouts, watch
        )
        rows = found.library.rows
    still = tuple((n.value, n.stderr) for n in network)
    doubts = doubts_of(found.ties, named)
    handed = compared.after if named else compared.before
    envelope = _envelope(found.library, compared)
    unexplained = unexplained_joints(
        handed.torque_rms,
        rms(after if named else gap, rows.used).tolist(),
        still,
        envelope.torque_rms,
        rows.spread.tolist(),
        rows.floor.tolist(),
        None if before is None else left_by(before),
    )
    verdict = verdict_of(named, doubts, unexplained)
    where, remaining = (tuple(localise(rows, r, known.names)) for r in (gap, after))
    late = late_torques(rows, _explaining(found), known.names)
    odd = [*odd, *late]
    doubt = doubt_of(odd, measured.stray, rows.signals.duration)
    swinging = swings(rows, after if named else gap, known.names)
    more = (*known.notes, *rows.signals.notes, *notes_of(rows, known))
    struck = moments(rows, after, known.names, known.units)
    notes = (*odd, *struck, *differing(found, known.names), *swinging, *measured.notes, *more)
    return Diagnosis(
        verdict=verdict,
        summary=summarise(
            verdict, named, doubts, compared, unexplained, known, reference is not None, doubt
        ),
        findings=named,
        ambiguous=doubts,
        where=where,
        remaining=remaining,
        gap=compared,
        envelope=envelope,
        unexplained=unexplained,
        rivals=rivals_of(found),
        network=still,
        model=known,
        traces=_traces(measured.time[signals.rows], rows, gap, after),
        band=rows.signals.band,
        notes=notes,
        options={
            "held_out": held_out,
            "effects": names,
            "min_gain": min_gain,
            "reference": reference is not None,
            "log": measured.files,
            "reading": dict(measured.reading),
            "reference_log": () if old is None else old.files,
            "model": str(known.path),
            "version": __version__,
        },
        common=common,
        doubt=doubt,
        signals=signals,
    )


def _inputs(log: Source, model: Model | str | Path) -> Inputs:
    """Return a log and a model; if both are files, joints are matched by their names."""
    if not isinstance(log, Log) and not isinstance(model, Model):
        files = [log] if isinstance(log, str | Path) else log
        return read_inputs([Path(file) for file in files], Path(model))
    known = model if isinstance(model, Model) else read_model(model)
    measured = log if isinstance(log, Log) else read(log, known.names)
    return Inputs(_matching(measured, known), known)


def _matching(log: Log, known: Model) -> Log:
    if log.joints != len(known.names):
        expected, remedy = (
            f"the model's {len(known.names)} joints in the log",
            "use a log and a model of the same mechanism",
        )
        raise ConfigurationError(expected, f"{log.joints} in the log", remedy)
    return log


def _search(
    log: Log,
    known: Model,
    common: tuple[Effect, ...],
    names: Sequence[str],
    held_out: float,
    min_gain: float,
    watch: Watch,
    before: Found | None = None,
    resample: bool = True,
) -> tuple[Found, Signals]:
    """Prepare a log for the model with the ``common`` effects of two logs, and search.

    Also return the log as it was prepared; the search reads it at fewer instants.
    """
    watch("comparing with the model", 0.0)
    effects = (*known.plant.effects, *common)
    signals = prepare(log, known.plant.body, effects)
    rows = rows_of(signals.thinned(), effects, held_out)
    reference = None if before is None else reference_of(before)
    while True:
        watch("computing what each effect would add", 0.0)
        found = find(library(rows, names, present(effects), reference), min_gain, watch, resample)
        score = found.library.score
        out = strange(found.library.rows, _explaining(found), score.noise, score.alike)
        if np.array_equal(out, rows.strange):
            return found, signals
        rows = rows.without(out)


def _explaining(found: Found) -> list[Item]:
    """Return what was found, all other common effects and what every set has."""
    named = {m.group for m in found.named}
    usual = [i for i in found.library.score.items if i.common or i.always]
    return [*(i for i in usual if i.group not in named), *found.named]


def _envelope(made: Library, compared: Gap) -> Envelope:
    joints = range(len(compared.before.torque_rms))
    left = np.array([aside(made.rows, made.envelope, j) for j in joints])
    command = np.array(compared.before.torque_rms) / np.maximum(
        compared.before.torque_relative, 1e-300
    )
    return Envelope(left.tolist(), (left / np.maximum(command, 1e-300)).tolist())


def _traces(time: np.ndarray, rows: Rows, before: np.ndarray, after: np.ndarray) -> Traces:
    s, at = rows.signals, rows.signals.rows
    return Traces(time, ~rows.training, s.q[at], s.qd[at], rows.command, before, after, rows.used)
