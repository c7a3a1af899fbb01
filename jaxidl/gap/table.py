"""A diagnosis as a table for the terminal, and numbers as a person reads them."""

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np

from jaxidl.gap.diagnosis import Diagnosis, Estimate
from jaxidl.gap.refined import told_stderr
from jaxidl.gap.words import number, readable

COLUMNS = 100  # at most
TITLES = {
    "named": "{count} missing",
    "nothing_missing": "no effect of the catalogue makes the model clearly better",
    "ambiguous": "{count} missing, and this log does not fully determine which",
    "unexplained": "{count} missing, and something is left that the catalogue does not explain",
}
SENSELESS = 1e4  # times the command: of what is not moved by one


def as_table(d: Diagnosis) -> str:
    """The verdict, what was found with parameters ± standard error, errors before and after by joint, and what is ambiguous.

    Lines have at most ``COLUMNS`` characters; the text ends without a newline.
    """
    count = f"{len(d.findings) or 'no'} effect{'s' * (len(d.findings) != 1)}"
    lines = [f"{d.verdict.replace('_', ' ')}: {TITLES[d.verdict].format(count=count)}", *_found(d), *_errors(d), *_refined(d)]
    for ambiguity in d.ambiguous:
        names = " or ".join(on_joint(d, *key) for key in ambiguity.candidates)
        lines += ["", *_wrapped(f"not told apart: {names}"), *_wrapped(f"to tell: {ambiguity.experiment}", "  ")]
    if d.verdict == "unexplained" and d.remaining:
        lines += ["", *_wrapped(f"what is left: {d.remaining[0].sentence}")]
    return "\n".join(line[:COLUMNS].rstrip() for line in lines)


def _found(d: Diagnosis) -> list[str]:
    if not d.findings:
        return []
    rows = [("missing", "held-out error", "gain")]
    details = []
    for f in d.findings:
        error = f"{short(f.held_out_before)} → {short(f.held_out_after)} {unit_of(d, f.joint)}"
        rows.append((on_joint(d, f.name, f.joint), error, gain(f.gain, f.gain_stderr)))
        told = (f"{readable(name)} {parameter(p)}" for name, p in f.parameters.items())
        details.append([line for text in told for line in _wrapped(text, "    ")])
    head, *body = _aligned(rows)
    return ["", head, *(line for row, detail in zip(body, details, strict=True) for line in (row, *detail))]


def _errors(d: Diagnosis) -> list[str]:
    """Torque error and rollout error of each joint on the data kept aside."""
    horizon = longest(d)
    rows = [("joint", "torque error", "of the command", "encoder noise", f"position, {horizon} s" if horizon else "")]
    for j, name in enumerate(d.model.names):
        unit = d.model.units[j]
        sides = (d.gap.before, d.gap.after)[: 1 + bool(d.findings)]
        torque = " → ".join(f"{side.torque_rms[j]:.3g}" for side in sides) + f" {unit}"
        relative = " → ".join(percent(side.torque_relative[j]) for side in sides)
        away = lengths([side.rollout_rms[horizon][j] for side in sides], d.model.kinds[j]) if horizon else ""
        rows.append((cut(name), torque, relative, f"{d.gap.noise_floor[j]:.2g} {unit}", away))
    return ["", *_aligned(rows)]


def _refined(d: Diagnosis) -> list[str]:
    if d.refinement is None:
        return []
    head, rows = refined_rows(d)
    return ["", *_wrapped(head), *(f"  {line}" for line in _aligned(rows))]


def refined_rows(d: Diagnosis) -> tuple[str, list[tuple[str, str]]]:
    """What fitting the parameters to trajectories did: a sentence, and lines of what and before → after."""
    r = d.refinement
    assert r is not None
    head = f"fitted to motion, {r.windows[0]} windows of {r.window:g} s: {'kept' if r.accepted else 'not kept'}, {r.reason}"
    if r.before is None or r.after is None:
        return head, []
    rows = []
    for k, f in enumerate(d.findings):
        for name, value in r.given[k].items():
            after, stderr = (x.tolist() if len(x) > 1 else float(x[0]) for x in (r.refined[k][name], told_stderr(d, k, name)))
            told = parameter(Estimate(after, f.parameters[name].unit, stderr))
            rows.append((f"{on_joint(d, f.name, f.joint)}, {readable(name)}", f"{_bare(value)} → {told}"))
    horizon = longest(d, r.before.rollout_rms)
    for j, name in enumerate(d.model.names):
        torque = " → ".join(short(side.torque_rms[j]) for side in (r.before, r.after))
        rows.append((f"{cut(name)}, torque error", f"{torque} {d.model.units[j]}"))
        if horizon:
            away = [side.rollout_rms[horizon][j] for side in (r.before, r.after)]
            rows.append((f"{cut(name)}, position, {horizon} s", lengths(away, d.model.kinds[j])))
    return head, rows


def _bare(values: np.ndarray) -> str:
    """A parameter (n,) without unit and standard error."""
    if len(values) == 1:
        return f"{values[0]:.4g}"
    return f"{values.min():.4g} to {values.max():.4g}" if len(values) > 3 else f"({', '.join(f'{v:.3g}' for v in values)})"


def on_joint(d: Diagnosis, name: str, joint: int | None) -> str:
    """An effect and the joint it is on, for a person."""
    return readable(name) + (f" ({cut(d.model.names[joint])})" if joint is not None else "")


def unit_of(d: Diagnosis, joint: int | None) -> str:
    """Unit of a joint's torque; of the whole mechanism that of all joints, if they have the same."""
    if joint is not None:
        return d.model.units[joint]
    return " or ".join(dict.fromkeys(d.model.units))


def parameter(estimate: Estimate) -> str:
    """A parameter with unit and standard error; of three numbers (a place) each, of a table its range and mean standard error."""
    if not isinstance(estimate.value, list):
        return number(estimate)
    unit = "" if estimate.unit == "1" else f" {estimate.unit}"
    errors = np.broadcast_to(np.array(estimate.stderr, float), len(estimate.value))
    if len(estimate.value) <= 3:
        return "(" + ", ".join(f"{v:.3g} ± {e:.1g}" for v, e in zip(estimate.value, errors, strict=True)) + f"){unit}"
    return f"{number(estimate)}, each ± {np.mean(errors):.2g}{unit}"


def longest(d: Diagnosis, rollouts: Mapping[str, list[float]] | None = None) -> str | None:
    """The longest horizon of the rollouts, as it is written in the gap; None if the part kept aside was too short for any."""
    known = [h for h, errors in (rollouts or d.gap.before.rollout_rms).items() if np.isfinite(errors).all()]
    return max(known, key=float, default=None)


def lengths(values: Sequence[float], kind: str) -> str:
    """Position errors [m or rad] of a joint one after the other, in thousandths if they are small."""
    unit = "m" if kind == "slide" else "rad"
    if values[0] < 0.1:
        values, unit = [1e3 * value for value in values], f"m{unit}"
    return " → ".join(short(value) for value in values) + f" {unit}"


def percent(share: float) -> str:
    """A share as a percentage with two digits, or all it has before the point."""
    if not abs(share) < SENSELESS:
        return "-"
    return f"{100.0 * share:.0f} %" if abs(share) >= 0.0995 else f"{round(100.0 * share, 4):.2g} %".replace("-0 ", "0 ")


def gain(value: float, stderr: float) -> str:
    """A share with its standard error, as percentages to a tenth."""
    if not np.isfinite([value, stderr]).all():
        return percent(value)
    return f"{100.0 * value:.1f} ± {100.0 * stderr:.1f} %".replace("-0.0 ", "0.0 ")


def short(value: float) -> str:
    """Three digits, or a dash for what is not known."""
    return f"{value:.3g}" if np.isfinite(value) else "-"


def cut(name: str, most: int = 24) -> str:
    """A name on one line, of a long one both ends: joints are often numbered."""
    name = " ".join(name.split())
    return name if len(name) <= most else name[: most - 1 - most // 2] + "…" + name[-(most // 2) :]


def _wrapped(text: str, indent: str = "") -> list[str]:
    return textwrap.wrap(text, COLUMNS, initial_indent=indent, subsequent_indent=indent + "  ")


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
