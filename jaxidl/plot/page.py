"""A diagnosis as one self-contained HTML page: no scripts, nothing fetched, for a screen, a phone or paper."""

import base64
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxidl.effects import CATALOGUE
from jaxidl.gap.diagnosis import Diagnosis, Finding, Row, sentence_of
from jaxidl.gap.localise import Place
from jaxidl.gap.network import SYSTEMATIC
from jaxidl.gap.table import gain, lengths, on_joint, parameter, percent, refined_rows, short, unit_of
from jaxidl.gap.words import readable
from jaxidl.plot.html import STYLE, Html, join, table, tag

BADGES = {"named": "Found", "nothing_missing": "Nothing missing", "ambiguous": "Ambiguous", "unexplained": "Unexplained"}
CAPTIONS = {
    "gap": "Above: root mean square torque error on the data kept aside, relative to the command; dashed: what encoder noise "
    "alone makes of it. Below: how far the simulation runs away from the measurement when it replays the logged torque.",
    "residual": "The residual is the commanded torque minus the one that the model needs for the measured motion. Its gaps are "
    "where a joint comes to rest or breaks away, which does not count.",
    "where": "A step at zero velocity is dry friction, a slope over velocity viscous friction, a slope over acceleration an "
    "inertia, a shape over position a spring, ripple or uneven friction. Bars: one standard deviation of the samples.",
    "spectrum": "What lies on the dashed line is noise of the encoders, differentiated twice; no model removes it.",
    "ranking": "Each effect was fitted on some blocks of the log and judged on others. Where a plainer effect is contained in a "
    "better one, the plainer goes first and the other has to earn what is left. A trifle beside the command is not added.",
    "parameters": "Bars and bands: two standard errors. Where an interval holds zero, this log does not determine the parameter.",
}
ADVICE = {
    "named": "Record a new log, with other motion than this one, and run the patched model on it: it should say that "
    "nothing is missing.",
    "nothing_missing": "To look further, record faster motion, reversals, rests and a known load.",
    "ambiguous": "Make the experiment named below and give its log together with this one.",
    "unexplained": "Record more motion where the remaining error is, and look for a cause outside the catalogue: contact, "
    "cables, temperature, a loose part.",
}
LISTED = 8  # rows of each round


def page(d: Diagnosis, figures: Mapping[str, bytes], record: Sequence[Mapping[str, Any]], folder: Path) -> str:
    """The page's text.

    Args:
        figures: PNG content by name, as :func:`jaxidl.plot.gap.draw` gives it.
        record: the effects of ``effects.json``, those found last.
        folder: where the patched model will be, for the instructions.
    """
    title = f"Gap report: {d.model.path.name}"
    pictures = {name: _figure(name, content) for name, content in figures.items()}
    sections = [
        _head(d, title),
        _section("The gap, before and after" if d.findings else "The gap", _gap_table(d), pictures.get("gap")),
        _section("Where the gap is", _places(d, d.where), *(pictures.get(n) for n in ("residual", "where", "spectrum"))),
        _section("What is missing", _missing(d, record), pictures.get("parameters")),
        _section("The parameters fitted to motion", _refined(d)) if d.refinement else None,
        _section("What this log cannot tell apart", _ambiguous(d)) if d.ambiguous else None,
        _section("How every effect did", pictures.get("ranking"), _rounds(d)),
        _section("What remains", _remains(d)),
        _section("What to do next", _next(d, record, folder)),
        _section("Data and method", _method(d)),
    ]
    meta = tag("meta", charset="utf-8"), tag("meta", name="viewport", content="width=device-width, initial-scale=1")
    head = tag("head", *meta, tag("title", title), tag("style", Html(STYLE)))
    return f"<!DOCTYPE html>\n{tag('html', head, tag('body', tag('main', sections)), lang='en')}\n"


def fragment(d: Diagnosis) -> str:
    """Verdict and tables for a notebook, without figures and style sheet."""
    verdict = tag("p", tag("strong", BADGES[d.verdict]), ": ", sentence(d))
    return tag("div", verdict, _missing(d, ()) if d.findings else None, _gap_table(d), _ambiguous(d) if d.ambiguous else None)


def sentence(d: Diagnosis) -> str:
    """The verdict in one sentence."""
    relative = d.gap.before.torque_relative
    j = int(np.argmax(np.nan_to_num(relative)))
    where = f" ({d.model.names[j]})" if len(relative) > 1 else ""
    before, after = percent(relative[j]), percent(d.gap.after.torque_relative[j])
    n = len(d.findings)
    effects = "one effect is" if n == 1 else f"{n} effects are"
    change = f"the torque error{where} falls from {before} to {after} of the command on data that took no part in fitting"
    if d.verdict == "nothing_missing":
        return f"No effect of the catalogue makes the model clearly better; its torque error{where} is {before} of the command."
    if d.verdict == "unexplained":
        known = f"; with what it does explain {change}" if n else f"; the torque error{where} is {before} of the command"
        return f"There is a systematic error left that no effect of the catalogue explains{known}."
    doubt = ", but this log does not fully determine which" if d.verdict == "ambiguous" else ""
    return f"{effects[0].upper()}{effects[1:]} missing{doubt}; with {'it' if n == 1 else 'them'} {change}."


def _head(d: Diagnosis, title: str) -> Html:
    joints = len(d.model.names)
    about = f"{joints} joint{'s' * (joints != 1)}: {', '.join(d.model.names)}"
    badge = tag("span", BADGES[d.verdict], class_="badge", style=f"background:var(--{d.verdict})")
    verdict = tag("div", badge, tag("span", sentence(d)), class_="verdict")
    return tag("header", tag("h1", title), tag("p", about, class_="soft"), verdict, tag("p", d.summary))


def _section(title: str, *content: Any) -> Html:
    return tag("section", tag("h2", title), *content)


def _figure(name: str, content: bytes) -> Html:
    source = "data:image/png;base64," + base64.b64encode(content).decode()
    return tag("figure", tag("div", tag("img", src=source, alt=CAPTIONS[name])), tag("figcaption", CAPTIONS[name]))


def _gap_table(d: Diagnosis) -> Html:
    """Errors of each joint on the data kept aside."""
    sides = (d.gap.before, d.gap.after)[: 1 + bool(d.findings)]
    horizons = [h for h in ("0.1", "0.5") if h in d.gap.before.rollout_rms] or list(d.gap.before.rollout_rms)[-2:]

    rows = []
    for j, name in enumerate(d.model.names):
        unit = d.model.units[j]
        torque = " → ".join(short(s.torque_rms[j]) for s in sides) + f" {unit}"
        relative = " → ".join(percent(s.torque_relative[j]) for s in sides)
        away = [lengths([s.rollout_rms[h][j] for s in sides], d.model.kinds[j]) for h in horizons]
        rows.append([name, torque, relative, f"{short(d.gap.noise_floor[j])} {unit}", *away])
    head = ["joint", "torque or force error", "of the command", "encoder noise alone"]
    head += [f"position error after {h} s" for h in horizons]
    note = "Root mean squares on the part of the log kept aside" + (", without → with what was found." if d.findings else ".")
    return join([table(head, rows, range(1, len(head))), tag("p", tag("small", note))])


def _places(d: Diagnosis, places: Sequence[Place]) -> Html:
    """The sentences by joint; a joint's name is its heading, if there are several."""
    out = []
    for j in dict.fromkeys(p.joint for p in places):
        told = [p.sentence.removeprefix(f"{d.model.names[j]}: ") for p in places if p.joint == j]
        out.append(tag("h3", d.model.names[j]) if len(d.model.names) > 1 else None)
        out.append(tag("ul", (tag("li", f"{text[0].upper()}{text[1:]}.") for text in told if text)))
    return join(out) if out else tag("p", "There is no residual to speak of.")


def _refined(d: Diagnosis) -> Html:
    """What fitting the parameters to trajectories did."""
    head, rows = refined_rows(d)
    note = "Before → after, on the part of the log kept aside; what is not kept is in no file." if rows else ""
    return join([tag("p", f"{head[0].upper()}{head[1:]}."), table(["", "before → after"], rows), tag("p", tag("small", note))])


def _missing(d: Diagnosis, record: Sequence[Mapping[str, Any]]) -> Html:
    if not d.findings:
        return tag("p", "No effect of the catalogue was added.")
    entries = [*([{}] * len(d.findings)), *record][-len(d.findings) :] if record else [{}] * len(d.findings)
    head = ["effect", "joint", "parameters", "held-out error", "gain"]
    rows = [_finding(d, f, entry) for f, entry in zip(d.findings, entries, strict=True)]
    about = (
        "In the order in which they were added. The error is that of held-out blocks without and with the effect, all others "
        "being there: what another effect contains has little left of its own."
    )
    return join([tag("p", about), table(head, rows, (3, 4))])


def _finding(d: Diagnosis, f: Finding, entry: Mapping[str, Any]) -> Iterator[Any]:
    place = None
    if entry:
        mjcf = entry.get("mjcf")
        beside = "in effects.json" + (f", for MuJoCo as {mjcf}" if mjcf else "")
        place = [tag("br"), tag("small", f"in model.xml as {mjcf}" if entry.get("in_mjcf") else beside)]
    yield [tag("strong", readable(f.name)), tag("br"), tag("small", sentence_of(f.name)), place]
    yield d.model.names[f.joint] if f.joint is not None else "all"
    known = CATALOGUE[f.name].parameters
    yield tag("ul", (_parameter(name, parameter(p), known[name].meaning) for name, p in f.parameters.items()))
    yield f"{short(f.held_out_before)} → {short(f.held_out_after)} {unit_of(d, f.joint)}"
    yield gain(f.gain, f.gain_stderr)


def _parameter(name: str, value: str, meaning: str) -> Html:
    return tag("li", f"{readable(name)} ", tag("strong", value), tag("br"), tag("small", meaning))


def _ambiguous(d: Diagnosis) -> Html:
    out = []
    for a in d.ambiguous:
        names = " or ".join(on_joint(d, *key) for key in a.candidates)
        about = ": they explain this log equally well, and the first of them is in the patched model. To tell: "
        out.append(tag("li", tag("strong", names), about, a.experiment, "."))
    return tag("ul", out)


def _rounds(d: Diagnosis) -> Html:
    """All rounds as tables, folded away: the figure shows most of it."""
    tables = []
    for number, rows in enumerate(d.rounds, 1):
        largest = max([row.gain for row in rows[:LISTED] if np.isfinite(row.gain)], default=0.0)
        body = tag("tbody", (_ranked(d, row, max(largest, 0.05)) for row in rows[:LISTED]))
        tables += [tag("h3", f"Round {number}"), tag("div", tag("table", body), class_="scroll")]
    return tag("details", tag("summary", "Every round as a table"), tables)


def _ranked(d: Diagnosis, row: Row, largest: float) -> Html:
    share = float(np.clip(np.nan_to_num(row.gain) / largest, 0.0, 1.0))
    bar = tag("span", class_="bar", style=f"width:{100.0 * share:.1f}%")
    name = on_joint(d, row.name, row.joint) + (" (added)" if row.chosen else "")
    number = tag("td", gain(row.gain, row.gain_stderr), class_="number")
    return tag("tr", tag("td", name), tag("td", bar, class_="wide"), number, class_="chosen" if row.chosen else None)


def _remains(d: Diagnosis) -> Html:
    told = []
    for name, (value, stderr) in zip(d.model.names, d.network, strict=False):
        if value <= 0.0 or value <= 2.0 * stderr:
            text = "cannot predict any of it, so nothing systematic is left"
        else:
            text = f"removes {gain(value, stderr)} of it: "
            text += "something systematic is left" if value > SYSTEMATIC else "too little to speak of something missing"
        told.append(tag("li", tag("strong", name), f": the network {text}."))
    check = (
        "A small neural network was trained to predict what is left from the motion, and then asked on other blocks of the log:"
    )
    return join([_places(d, d.remaining), tag("p", check), tag("ul", told)])


def _next(d: Diagnosis, record: Sequence[Mapping[str, Any]], folder: Path) -> Html:
    model = str(folder / "model.xml")
    command = f"jaxidl gap LOG --model {shlex.quote(model)}"
    python = f"from jaxidl.gap import read_model\n\nplant = read_model({model!r}).plant"
    whole = all(entry.get("in_mjcf") for entry in record)
    mujoco = "Keep effects.json beside model.xml: MuJoCo simulates only what model.xml has, jaxidl both."
    mujoco = ("All of it is in model.xml, so MuJoCo simulates it too." if record else None) if whole else mujoco
    steps = [ADVICE[d.verdict]]
    steps += [f"To tell {' from '.join(on_joint(d, *k) for k in a.candidates)}: {a.experiment}." for a in d.ambiguous]
    patched = "The patched model" if d.findings else "The model, unchanged,"
    use = tag("p", f"{patched} loads from the command line and in Python:"), tag("pre", command), tag("pre", python)
    return join([tag("ul", (tag("li", step) for step in steps)), *use, tag("p", mujoco) if mujoco else None])


def _method(d: Diagnosis) -> Html:
    rows, aside = len(d.traces.time), int(np.sum(d.traces.kept_aside))
    step = np.diff(d.traces.time)
    length = float(np.sum(step[(step > 0.0) & (step <= 3.0 * np.median(step))])) if rows > 1 else 0.0
    facts = [
        f"{short(length)} s of motion, compared at {rows} instants; {percent(aside / max(rows, 1))} of them, at the end, took no "
        "part in fitting and ranking.",
        f"Positions were smoothed and differentiated without phase shift; both sides of the comparison end at {d.band:.3g} Hz.",
        f"An effect is named if it wins by more than two standard errors on held-out blocks and removes at least "
        f"{percent(d.options.get('min_gain', 0.05))} of the remaining error.",
        f"Looked for: {', '.join(readable(str(name)) for name in d.options.get('effects', ())) or 'the whole catalogue'}.",
        *(f"{note[:1].upper()}{note[1:]}." for note in d.notes),
    ]
    return tag("ul", (tag("li", fact) for fact in facts))
