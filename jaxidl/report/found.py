"""Figures of the findings: the improvement by each effect, and the parameters."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxidl.gap.result.diagnosis import Diagnosis, Estimate, Finding
from jaxidl.plot.style import house_style
from jaxidl.report.common import AFTER, WIDTH, length_unit, name_of
from jaxidl.report.matrix import axes_of
from jaxidl.report.words import confidence, percent, readable, squared

MOST = 40  # most bars, and rows of parameters
CURVES = 8  # most tables over position


@house_style()
def plot_improvement(d: Diagnosis) -> Figure | None:
    """Plot the share of the held-out error that returns without each effect, sorted.

    Returns None if nothing was found.
    """
    if not d.findings:
        return None
    order = sorted(d.findings, key=lambda f: -np.nan_to_num(f.gain))[:MOST]
    figure = Figure(figsize=(WIDTH, 0.9 + 0.24 * max(len(order), 3)), layout="constrained")
    axes = figure.subplots()
    gains, errors = (
        100.0 * np.nan_to_num([getattr(f, name) for f in order]) for name in ("gain", "gain_stderr")
    )
    shown = np.clip(gains, -10.0, 100.0)
    colors = [AFTER if f.sure else "white" for f in order]
    axes.barh(
        range(len(order)),
        shown,
        color=colors,
        edgecolor=["none" if f.sure else "0.4" for f in order],
        height=0.7,
    )
    axes.errorbar(
        shown,
        range(len(order)),
        xerr=np.stack([2.0 * errors, np.clip(2.0 * errors, 0.0, np.maximum(104.0 - shown, 0.0))]),
        fmt="none",
        color="0.15",
        elinewidth=0.9,
        capsize=2,
    )
    axes.axvline(0.0, color="0.2", linewidth=0.8)
    axes.set_yticks(range(len(order)), [label_of(d, f) for f in order])
    axes.set_ylim(max(len(order), 3) - 0.4, -1.4)
    axes.set_xlim(min(-2.0, 1.2 * shown.min()), 150.0)
    axes.set_xticks(range(0, 101, 20))
    axes.set_xlabel("share of the error that returns without the effect [%]")
    axes.grid(axis="y", visible=False)
    for k, title in enumerate(("explains of\nthe command", "confidence")):
        axes.text(116 + 24 * k, -0.95, title, ha="center", fontsize=7.5, color="0.3")
    for k, f in enumerate(order):
        text = (percent(f.share), confidence(f) if f.sure else f"({confidence(f)})")
        for n, word in enumerate(text):
            axes.text(116 + 24 * n, k, word, ha="center", va="center", fontsize=8)
    left = f" (the first {MOST} of {len(d.findings)})" if len(d.findings) > MOST else ""
    figure.suptitle("Improvement by each effect on held-out data" + left, fontsize=10)
    return figure


def label_of(d: Diagnosis, f: Finding) -> str:
    """Return an effect and, if there are several joints, the one it is on."""
    return readable(f.name) + (
        f", {name_of(d, f.joint)}" if f.joint is not None and len(d.model.names) > 1 else ""
    )


class _Scalar(NamedTuple):
    label: str  # the joint, and the axis of a vector
    value: float
    stderr: float
    sure: bool


@house_style()
def plot_parameters(d: Diagnosis) -> Figure | None:
    """Plot each parameter found, ± two standard errors, and tables over position.

    Parameters are shown relative to zero; the same parameter of several joints shares a panel.
    Returns None if nothing was found.
    """
    panels, curves = _split(d)
    if not panels and not curves:
        return None
    rows = [max(len(part) for _, part in panels[k : k + 2]) for k in range(0, len(panels), 2)]
    heights = [0.55 + 0.2 * n for n in rows] + [1.7] * len(curves)
    figure = Figure(figsize=(WIDTH, 0.6 + sum(heights)), layout="constrained")
    grid = figure.add_gridspec(len(heights), 2, height_ratios=heights)
    for k, (title, part) in enumerate(panels):
        alone = k == len(panels) - 1 and k % 2 == 0
        _forest(
            figure.add_subplot(grid[k // 2, :] if alone else grid[k // 2, k % 2]),
            title,
            part,
            max(rows[k // 2], 1),
        )
    for k, (finding, name, estimate) in enumerate(curves):
        _curve(figure.add_subplot(grid[len(rows) + k, :]), d, finding, name, estimate)
    figure.suptitle("Parameters found, ± two standard errors; hollow: suspected only", fontsize=10)
    return figure


def _split(
    d: Diagnosis,
) -> tuple[list[tuple[str, list[_Scalar]]], list[tuple[Finding, str, Estimate]]]:
    """Return numbers by parameter, and tables over position."""
    groups: dict[str, list[_Scalar]] = {}
    curves: list[tuple[Finding, str, Estimate]] = []
    for f, (name, p) in (
        (found, item) for found in d.findings for item in found.parameters.items()
    ):
        if isinstance(p.value, list) and _ends(f):
            curves.append((f, name, p))
            continue
        values = p.value if isinstance(p.value, list) else [p.value]
        errors = np.broadcast_to(np.array(p.stderr, float), len(values)).tolist()
        axes = (
            axes_of(p.unit, len(values)) or tuple(str(k) for k in range(len(values)))
            if len(values) > 1
            else ("",)
        )
        unit = "" if p.unit == "1" else f" [{squared(p.unit)}]"
        part = groups.setdefault(f"{readable(f.name)}: {readable(name)}{unit}", [])
        joint = name_of(d, f.joint)
        part += [
            _Scalar(f"{joint} {a}".strip(), v, e, f.sure)
            for a, v, e in zip(axes, values, errors, strict=True)
        ]
    order = {name: k for k, name in enumerate(d.model.names)}
    panels, total = [], 0
    for title, part in sorted(groups.items(), key=lambda item: -len(item[1])):
        if (total := total + len(part)) <= 3 * MOST:
            panels.append((title, sorted(part, key=lambda s: order.get(s.label, -1))))
    return panels, curves[:CURVES]


def _ends(finding: Finding) -> tuple[float, float] | None:
    """Return the positions of a table's first and last value."""
    effect: Any = getattr(finding.effect, "effect", finding.effect)
    if not hasattr(effect, "lower"):
        return None
    return float(np.ravel(effect.lower)[0]), float(np.ravel(effect.upper)[0])


def _forest(axes: Axes, title: str, part: list[_Scalar], rows: int) -> None:
    for k, s in enumerate(part):
        error = 2.0 * s.stderr if np.isfinite(s.stderr) else 0.0
        face = AFTER if s.sure else "white"
        axes.errorbar(
            [s.value],
            [k],
            xerr=error,
            fmt="o",
            color=AFTER,
            markerfacecolor=face,
            capsize=2.5,
            markersize=4,
        )
    axes.axvline(0.0, color="0.2", linewidth=0.8)
    axes.set_yticks(range(len(part)), [s.label for s in part], fontsize=7.5)
    axes.set_ylim(rows - 0.4, -0.6)
    axes.margins(x=0.08)
    axes.tick_params(axis="x", labelsize=7, pad=1.5, length=2)
    axes.grid(axis="y", visible=False)
    axes.set_title(title, loc="left", fontsize=8.5)


def _curve(axes: Axes, d: Diagnosis, finding: Finding, name: str, estimate: Estimate) -> None:
    values = np.array(estimate.value, float)
    error = 2.0 * np.nan_to_num(np.broadcast_to(np.array(estimate.stderr, float), values.shape))
    q = np.linspace(*(_ends(finding) or (0.0, 1.0)), len(values))
    other = getattr(finding.effect, "other", finding.joint)
    axes.fill_between(q, values - error, values + error, color=AFTER, alpha=0.2, linewidth=0)
    axes.plot(q, values, color=AFTER, marker="o", markersize=3)
    axes.axhline(0.0, color="0.2", linewidth=0.8)
    axes.set_title(f"{label_of(d, finding)}: {readable(name)}", loc="left")
    where = "" if other is None else f" of {name_of(d, other)} [{length_unit(d, other)}]"
    axes.set_xlabel(f"position{where}")
    axes.set_ylabel(f"[{squared(estimate.unit)}]")
