"""From a log and a model to a diagnosis."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np

from jaxidl import __version__
from jaxidl.effects import Effect
from jaxidl.errors import ConfigurationError
from jaxidl.gap.choice.find import Found, Watch, find, weighed
from jaxidl.gap.choice.objections import possible
from jaxidl.gap.evidence.items import absorbed
from jaxidl.gap.evidence.localise import localise
from jaxidl.gap.evidence.moments import moments, strange
from jaxidl.gap.evidence.rows import rms, rows_of
from jaxidl.gap.evidence.shape import present
from jaxidl.gap.fit.held_out import aside
from jaxidl.gap.fit.library import library
from jaxidl.gap.inputs import Inputs, read_inputs, wanted
from jaxidl.gap.result.diagnosis import Diagnosis, Envelope, Traces
from jaxidl.gap.result.judged import fitted_to_training, judged
from jaxidl.gap.result.notes import differing, notes_of, swings
from jaxidl.gap.result.reference import evidence_of, left_by, untold
from jaxidl.gap.result.verdict import doubts_of, rivals_of, unexplained_joints, verdict_of
from jaxidl.gap.result.weight import balanced
from jaxidl.gap.result.words import doubt_of
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
            before, _ = _search(old, known, (), names, 0.0, min_gain, watch)
            # each by itself: dry friction may become less where its rise at low speed does not
            whole = frozenset(absorbed(before.solution.members).values())
            kept = fitted_to_training(replace(before, apart=whole))
            common = tuple(e for e in kept if possible(e, known.plant.effects))
        found, signals = _search(
            measured, known, common, names, held_out, min_gain, watch, before=before
        )
        found = weighed(found, watch)
        said = judged(found, signals, known, common, rollouts, watch, before)
        found, named, gap, after = said.found, said.named, said.gap, said.after
        rows = found.library.rows
    doubts = doubts_of(found.ties, named)
    compared, left = (said.compared.after, after) if named else (said.compared.before, gap)
    common_left = [aside(rows, found.library.envelope, j) for j in range(len(known.names))]
    unexplained = unexplained_joints(
        compared.torque_rms,
        rms(left, rows.used).tolist(),
        said.network,
        common_left,
        rows.spread.tolist(),
        rows.floor.tolist(),
        None if before is None else left_by(before).tolist(),
    )
    verdict = verdict_of(named, doubts, unexplained)
    where, remaining = (tuple(localise(rows, r, known.names)) for r in (gap, after))
    doubt = doubt_of(said.odd, measured.stray, rows.signals.duration)
    notes = (
        *said.odd,
        *moments(rows, after, known.names, known.units),
        *differing(found, known.names),
        *balanced(found, known.names),
        *untold(said.since, named, known.names),
        *swings(rows, left, known.names),
        *measured.notes,
        *known.notes,
        *rows.signals.notes,
        *notes_of(rows, known),
    )
    s, at = rows.signals, rows.signals.rows
    time, kept_aside = measured.time[signals.rows], ~rows.training
    return Diagnosis(
        verdict=verdict,
        findings=named,
        ambiguous=doubts,
        where=where,
        remaining=remaining,
        gap=said.compared,
        envelope=Envelope(common_left, said.compared.relative(common_left)),
        unexplained=unexplained,
        rivals=rivals_of(found),
        network=said.network,
        model=known,
        traces=Traces(time, kept_aside, s.q[at], s.qd[at], rows.command, gap, after, rows.used),
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
        common=said.common,
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
        raise ConfigurationError(
            f"the model's {len(known.names)} joints in the log",
            f"{log.joints} in the log",
            "use a log and a model of the same mechanism",
        )
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
) -> tuple[Found, Signals]:
    """Prepare a log for the model with the ``common`` effects of two logs, and search.

    Also return the log as it was prepared; the search reads it at fewer instants.
    """
    watch("comparing with the model", 0.0)
    effects = (*known.plant.effects, *common)
    signals = prepare(log, known.plant.body, effects)
    rows = rows_of(signals.thinned(), effects, held_out)
    reference = None if before is None else evidence_of(before)
    while True:
        watch("computing what each effect would add", 0.0)
        found = find(library(rows, names, present(effects), reference), min_gain, watch)
        score = found.library.score
        out = strange(found.library.rows, found.explaining, score.noise, score.alike)
        if np.array_equal(out, rows.strange):
            return found, signals
        rows = rows.without(out)
