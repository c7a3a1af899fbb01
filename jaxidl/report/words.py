"""One vocabulary for terminal, page and figures: names, numbers and statements on joints."""

from collections.abc import Mapping, Sequence

import numpy as np

from jaxidl.gap.result.diagnosis import Diagnosis, Estimate, Finding, Key
from jaxidl.gap.result.refined import reported_stderr
from jaxidl.gap.result.words import (
    headline,
    judged,
    large,
    listed,
    number,
    percent,
    readable,
    squared,
    undecided,
)

BADGES = {
    "named": "Found",
    "nothing_missing": "Nothing missing",
    "ambiguous": "Ambiguous",
    "unexplained": "Unexplained",
}
# since a reference log
CHANGES = {"named": "Changed", "nothing_missing": "Nothing changed"}


def badge(d: Diagnosis) -> str:
    """Return the verdict in one or two words."""
    return (CHANGES if compared(d) else {}).get(d.verdict, BADGES[d.verdict])


def compared(d: Diagnosis) -> bool:
    """Return whether the log was compared with an earlier one, so that findings are changes."""
    return bool(d.options.get("reference"))


def excess(d: Diagnosis) -> str:
    """Return what a negative value means where only a change can be negative; else nothing."""
    if not any(f.less for f in d.findings):
        return ""
    return f"below zero: less than {'before' if compared(d) else 'the model has'}"


def verdict(d: Diagnosis) -> str:
    """Return the verdict in one or two sentences, after a doubt about the log as a whole."""
    names = [d.model.names[j] for j in d.unexplained]
    left = large(d.gap, d.model.names)
    said = headline(d.verdict, d.findings, names, left, compared(d), bool(d.ambiguous))
    return d.doubt + said


def silent(d: Diagnosis) -> dict[int, str]:
    """Return one sentence for each joint about which this log contains no information."""
    out, what = {}, "has changed" if compared(d) else "is missing"
    for j, name in enumerate(d.model.names):
        if judged(d.gap.before.torque_relative[j]):
            continue
        if not np.any(d.traces.command[:, j]):
            known = any(f.joint == j for f in d.findings)
            lacks = (
                "no error relative to it can be given"
                if known
                else f"this log cannot show what {what} there"
            )
            out[j] = f"{name}: no torque was commanded, so {lacks}"
        elif not d.traces.counted[:, j].any():
            out[j] = f"{name}: the joint hardly moved, so this log cannot show what {what} there"
        else:
            out[j] = (
                f"{name}: hardly any torque was commanded in the held-out data, so no error can be"
                " given"
            )
    return out


def on_joint(d: Diagnosis, key: Key) -> str:
    """Return an effect and the joint it is on."""
    name, joint = key
    return readable(name) + (f" ({oneline(d.model.names[joint])})" if joint is not None else "")


def oneline(name: str) -> str:
    """Return a name without line breaks."""
    return " ".join(name.split())


def error_unit(d: Diagnosis, f: Finding) -> str:
    """Return the unit of a finding's errors.

    It is that of the torque of the joint where they were measured.
    """
    return d.model.units[f.where]


def frame(d: Diagnosis, f: Finding) -> str:
    """Return the frame in which a finding's positions are given.

    Only effects of the whole mechanism with a length have one; it is empty for others.
    """
    place = d.frame(f)
    return "" if place is None else f"in the frame of {place or 'the last body'}"


def confidence(f: Finding) -> str:
    """Return a finding's confidence, rounded down: what is not sure never looks so."""
    return f"{np.floor(100.0 * f.confidence + 1e-9):.0f} %"


def gain(value: float, stderr: float) -> str:
    """Return a share with its standard error, as percentages to a tenth."""
    if not np.isfinite([value, stderr]).all():
        return percent(value)
    return f"{100.0 * value:.1f} ± {100.0 * stderr:.1f} %".replace("-0.0 ", "0.0 ")


def short(value: float) -> str:
    """Return three digits, or a dash for an unknown number."""
    return f"{value:.3g}" if np.isfinite(value) else "-"


def longest(d: Diagnosis, rollouts: Mapping[str, list[float]] | None = None) -> str | None:
    """Return the longest horizon of the rollouts, as the gap has it.

    None if the held-out part was too short for any.
    """
    known = [
        h
        for h, errors in (rollouts or d.gap.before.rollout_rms).items()
        if np.isfinite(errors).any()
    ]
    return max(known, key=float, default=None)


def lengths(values: Sequence[float], kind: str) -> str:
    """Return position errors [m or rad] of a joint one after the other.

    They are in thousandths if the first is small.
    """
    unit = "m" if kind == "slide" else "rad"
    if not np.isfinite(values).any():
        return "-"
    if values[0] < 0.1:
        values, unit = [1e3 * value for value in values], f"m{unit}"
    return " → ".join(short(value) for value in values) + f" {unit}"


def cut(name: str, most: int = 24) -> str:
    """Return a name on one line, for figures only.

    Of a long one both ends are kept: joints are often numbered.
    """
    name = oneline(name)
    return name if len(name) <= most else name[: most - 1 - most // 2] + "…" + name[-(most // 2) :]


def refined_rows(d: Diagnosis) -> tuple[str, list[tuple[str, str]]]:
    """Return the result of fitting the parameters to trajectories.

    It is a sentence, and lines of names with before → after.
    """
    r = d.refinement
    assert r is not None
    head = (
        f"fitted to motion, {r.windows[0]} windows of {r.window:g} s:"
        f" {'accepted' if r.accepted else 'rejected'}, {r.reason}"
    )
    if r.before is None or r.after is None:
        return head, []
    rows = []
    for k, f in enumerate(d.findings):
        for name, value in r.given[k].items():
            after, stderr = (
                x.tolist() if len(x) > 1 else float(x[0])
                for x in (r.refined[k][name], reported_stderr(d, k, name))
            )
            now = number(Estimate(after, f.parameters[name].unit, stderr))
            rows.append(
                (f"{on_joint(d, (f.name, f.joint))}, {readable(name)}", f"{_bare(value)} → {now}")
            )
    horizon = longest(d, r.before.rollout_rms)
    for j, name in enumerate(d.model.names):
        torque = " → ".join(short(side.torque_rms[j]) for side in (r.before, r.after))
        rows.append((f"{oneline(name)}, torque error", f"{torque} {d.model.units[j]}"))
        if horizon:
            away = [side.rollout_rms[horizon][j] for side in (r.before, r.after)]
            rows.append(
                (f"{oneline(name)}, position after {horizon} s", lengths(away, d.model.kinds[j]))
            )
    return head, rows


def _bare(values: np.ndarray) -> str:
    """Return a parameter (n,) without unit and standard error."""
    if len(values) == 1:
        return f"{values[0]:.4g}"
    return (
        f"{values.min():.4g} to {values.max():.4g}"
        if len(values) > 3
        else f"({', '.join(f'{v:.3g}' for v in values)})"
    )


__all__ = [
    "badge",
    "compared",
    "confidence",
    "cut",
    "error_unit",
    "frame",
    "gain",
    "judged",
    "lengths",
    "listed",
    "longest",
    "number",
    "on_joint",
    "oneline",
    "percent",
    "readable",
    "refined_rows",
    "short",
    "silent",
    "squared",
    "undecided",
    "verdict",
]
