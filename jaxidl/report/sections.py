"""The sections of the page: tables and lists, each from a diagnosis to markup."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxidl.gap.evidence.localise import Place
from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.gap.result.network import SYSTEMATIC
from jaxidl.gap.result.verdict import designed, plugins
from jaxidl.report.html import Html, join, table, tag
from jaxidl.report.words import (
    compared,
    gain,
    lengths,
    listed,
    on_joint,
    oneline,
    percent,
    readable,
    refined_rows,
    short,
    silent,
)

ADVICE = {
    "named": (
        "Record a new log with different motion and diagnose the corrected model with it: nothing"
        " should be missing then."
    ),
    "nothing_missing": "To look further, record faster motion, reversals, rests and a known load.",
    "ambiguous": "Do the experiment named below and use its log together with this one.",
    "unexplained": (
        "Record more motion where the remaining error is, and look for a cause outside the"
        " catalogue: contact, cables, temperature, a loose part."
    ),
}


def errors(d: Diagnosis) -> Html:
    """Return the errors of each joint on held-out data.

    They are shown beside those of conventional identification.
    """
    sides, quiet = (d.gap.before, d.gap.after)[: 1 + bool(d.findings)], silent(d)
    horizons = [h for h in ("0.5",) if h in d.gap.before.rollout_rms] or list(
        d.gap.before.rollout_rms
    )[-1:]
    rows = []
    for j, name in enumerate(d.model.names):
        if j in quiet:
            continue
        unit = d.model.units[j]
        torque = " → ".join(short(s.torque_rms[j]) for s in sides) + f" {unit}"
        relative = " → ".join(percent(s.torque_relative[j]) for s in sides)
        away = [lengths([s.rollout_rms[h][j] for s in sides], d.model.kinds[j]) for h in horizons]
        envelope = (
            f"{short(d.envelope.torque_rms[j])} {unit}",
            percent(d.envelope.torque_relative[j]),
        )
        rows.append(
            [
                oneline(name),
                torque,
                relative,
                " = ".join(envelope),
                f"{short(d.gap.noise_floor[j])} {unit}",
                *away,
            ]
        )
    head = [
        "joint",
        "torque or force error",
        "of the command",
        "conventional identification",
        "encoder noise alone",
    ]
    head += [f"position error after {h} s" for h in horizons]
    note = "Root mean squares on the held-out part of the log" + (
        ", before → after." if d.findings else "."
    )
    note += (
        " Conventional identification fits friction, offset, rotor and link inertias on every joint"
        " at once, and nothing else."
    )
    about = [table(head, rows, range(1, len(head))), tag("p", tag("small", note))] if rows else []
    return join(
        [*about, tag("ul", (tag("li", f"{text}.") for text in quiet.values())) if quiet else None]
    )


def left(d: Diagnosis) -> Html:
    """Return joints with a large residual, and what is named nevertheless."""
    names = [oneline(d.model.names[j]) for j in d.unexplained]
    about = (
        f"On {listed(names)} the residual is larger than with conventional identification, or can"
        " still be predicted from the motion: a cause acts that the catalogue does not have,"
        " or that this log does not show clearly."
    )
    sure = [f for f in d.findings if f.sure]
    held = (
        f"Named nevertheless: {'; '.join(on_joint(d, (f.name, f.joint)) for f in sure)}."
        if sure
        else "Nothing is named."
    )
    return join(
        [
            tag("p", about),
            places(d, [p for p in d.remaining if p.joint in d.unexplained]),
            tag("p", held),
        ]
    )


def places(d: Diagnosis, where: Sequence[Place], folded: str = "") -> Html:
    """Return the sentences by joint, folded under the line ``folded`` if it is given."""
    out = []
    for j in dict.fromkeys(p.joint for p in where):
        lines = [p.sentence.removeprefix(f"{d.model.names[j]}: ") for p in where if p.joint == j]
        out.append(tag("h3", oneline(d.model.names[j])) if len(d.model.names) > 1 else None)
        out.append(
            tag("ul", (tag("li", f"{text[0].upper()}{text[1:]}.") for text in lines if text))
        )
    if not out:
        return tag("p", "There is no significant residual.")
    return tag("details", tag("summary", folded), out) if folded and len(out) > 2 else join(out)


def ambiguous(d: Diagnosis) -> Html:
    """Return sets of effects that can replace each other."""
    about = (
        ": they explain this log almost equally well, and the first of them is in the corrected"
        " model{}. To separate them: "
    )
    names = [" and ".join(on_joint(d, key) for key in a.candidates) for a in d.ambiguous]
    sure = {(f.name, f.joint) for f in d.findings if f.sure}
    likelier = [", named because it is likelier" * (a.candidates[0] in sure) for a in d.ambiguous]
    return tag(
        "ul",
        (
            tag("li", tag("strong", n), about.format(why), a.experiment, ".")
            for n, why, a in zip(names, likelier, d.ambiguous, strict=True)
        ),
    )


def refined(d: Diagnosis) -> Html:
    """Return the result of fitting the parameters to trajectories."""
    head, rows = refined_rows(d)
    note = (
        "Before → after, on the held-out part of the log; rejected values are in no file."
        if rows
        else ""
    )
    return join(
        [
            tag("p", f"{head[0].upper()}{head[1:]}."),
            table(["", "before → after"], rows),
            tag("p", tag("small", note)),
        ]
    )


def rivals(d: Diagnosis) -> Html:
    """Return effects that were considered and not chosen."""
    names = [oneline(d.model.names[r.joint]) if r.joint is not None else "all" for r in d.rivals]
    rows = [[readable(r.name), name, r.reason] for r, name in zip(d.rivals, names, strict=True)]
    return table(["effect", "joint", "why it was rejected"], rows)


def remains(d: Diagnosis) -> Html:
    """Return whether a network can still predict the residual, joint by joint."""
    rows, quiet = [], silent(d)
    for j, (value, stderr) in enumerate(d.network):
        if j in quiet:
            continue
        if not value > 2.0 * stderr or value <= 0.0:
            nothing = "nothing of it repeats from one part of the log to another"
            text = nothing if j in d.unexplained else "nothing of it: no systematic part remains"
        else:
            much = (
                "a systematic part remains"
                if value > SYSTEMATIC
                else "too little to indicate a missing effect"
            )
            text = f"{gain(value, stderr)} of it: {much}"
        rows.append([oneline(d.model.names[j]), text])
    check = (
        "A small neural network was trained to predict the residual from the motion, and tested on"
        " other blocks of the log."
    )
    return join(
        [
            tag("p", check),
            table(["joint", "the network predicts"], rows),
            places(d, d.remaining, "Where it is, joint by joint"),
        ]
    )


def next_steps(d: Diagnosis, record: Sequence[Mapping[str, Any]], folder: Path) -> Html:
    """Return advice, and how to use the corrected model."""
    model = str(folder / "model.xml")
    command = (
        f"jaxidl gap LOG --model {shlex.quote(model)}{plugins(entry['effect'] for entry in record)}"
    )
    python = f"from jaxidl.gap import read_model\n\nplant = read_model({model!r}).plant"
    beside = "Keep effects.json beside model.xml: MuJoCo simulates only model.xml, jaxidl both."
    inside = "All effects are in model.xml, so MuJoCo simulates them too." if record else None
    mujoco = inside if all(entry.get("in_mjcf") for entry in record) else beside
    steps: list[Any] = [ADVICE[d.verdict]]
    steps += [
        f"To separate {' from '.join(on_joint(d, k) for k in a.candidates)}: {a.experiment}."
        for a in d.ambiguous
    ]
    if d.doubtful:
        steps.append(
            join(
                [
                    "The motion that settles it best within limits is designed by ",
                    tag("code", designed(d.model.path, folder, d.questioned)),
                ]
            )
        )
    corrected = "The corrected model" if d.findings else "The model, unchanged,"
    use = (
        tag("p", f"{corrected} loads from the command line and in Python:"),
        tag("pre", command),
        tag("pre", python),
    )
    return join(
        [tag("ul", (tag("li", step) for step in steps)), *use, tag("p", mujoco) if mujoco else None]
    )


def method(d: Diagnosis) -> Html:
    """Return what was compared, and how."""
    rows, aside = len(d.traces.time), int(np.sum(d.traces.kept_aside))
    step = np.diff(d.traces.time)
    length = (
        float(np.sum(step[(step > 0.0) & (step <= 3.0 * np.median(step))])) if rows > 1 else 0.0
    )
    offered = ", ".join(readable(str(name)) for name in d.options.get("effects", ()))
    named = {
        "Log": d.options.get("log", ()),
        "Reference log": d.options.get("reference_log", ()),
        "Model": [d.options["model"]] if "model" in d.options else (),
    }
    facts = [
        *(f"{what}: {', '.join(map(oneline, files))}." for what, files in named.items() if files),
        (
            f"{short(length)} s of motion, compared at {rows} instants;"
            f" {percent(aside / max(rows, 1))} of them were not used for fitting and choosing."
        ),
        (
            "Positions were smoothed and differentiated without phase shift; both sides of the"
            f" comparison end at {d.band:.3g} Hz."
        ),
        (
            "An effect is named if held-out data are predicted better with it, its standard"
            " error excludes zero, it is not at a bound, and it removes at least"
            f" {percent(d.options.get('min_gain', 0.05))} of the remaining error. Its confidence"
            " depends on how often it is found again when the log's blocks are resampled, and on"
            " how often such findings are right."
        ),
        f"Looked for: {offered or 'the whole catalogue'}.",
        *(
            ["What both logs have in common was fitted to the reference log and is not a finding."]
            if compared(d)
            else []
        ),
        *(f"{note}." for note in d.notes),
        *([f"Made by jaxidl {d.options['version']}."] if "version" in d.options else []),
    ]
    return tag("ul", (tag("li", fact) for fact in facts))
