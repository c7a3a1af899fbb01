"""The picture of a designed motion: its course against its limits, and what it will tell."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxidl.excite.run import Result
from jaxidl.files import write_bytes
from jaxidl.plot.style import house_style

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
WIDTHS = ("-", "--", "-.", ":")


def figure(result: Result) -> Figure:
    """Draw positions and speeds, torques over their limits, and standard errors or separations."""
    drawn = Figure(figsize=(9.0, 5.8), layout="constrained")
    axes = drawn.subplots(2, 2)
    f, limits = result.found, result.limits
    half = 0.5 * (limits.upper - limits.lower)
    middle = 0.5 * (limits.upper + limits.lower)
    curves = (
        ("position, share of half the range", (f.q - middle) / half, limits.margin),
        ("speed over its limit", f.qd / limits.speed, limits.margin),
        ("torque over its limit", f.tau / limits.torque, limits.torque_margin),
    )
    for panel, (title, values, margin) in zip(axes.flat, curves, strict=False):
        if not np.any(values):
            values, title, margin = f.tau, "torque [N or Nm], no limit given", None
        _course(panel, result, values, margin)
        panel.set_title(title)
    (_apart if result.apart else _errors)(axes[1, 1], result)
    drawn.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=7)
    return drawn


def _course(axes: Axes, result: Result, values: np.ndarray, margin: float | None) -> None:
    for j, name in enumerate(result.model.names):
        style = WIDTHS[j // len(COLOURS) % len(WIDTHS)]
        axes.plot(
            result.found.time,
            values[:, j],
            style,
            color=COLOURS[j % len(COLOURS)],
            linewidth=1.0,
            label=name,
        )
    if margin is not None:
        for side in (-1.0, 1.0):
            axes.axhline(side, color="0.2", linewidth=1.0)
            axes.axhline(side * (1.0 - margin), color="0.5", linewidth=0.8, linestyle=":")
        axes.set_ylim(-1.08, 1.08)
    axes.set_xlabel("time [s]")


def _errors(axes: Axes, result: Result) -> None:
    rows = [r for r in result.rows if r["known"] and r["before"] > 0.0]
    size = dict(zip(result.made.labels, result.made.plan.size, strict=True))
    unit = [
        size.get(next(x for x in size if x[:3] == (r["effect"], r["joint"], r["name"])), 1.0)
        for r in rows
    ]
    before, after = (np.array([r[k] for r in rows]) / unit for k in ("before", "after"))
    order = np.argsort(before)
    axes.plot(before[order], "s", color="#D55E00", markersize=3, label=result.old)
    axes.plot(after[order], "^", color="#0072B2", markersize=3, label="this motion")
    axes.set_yscale("log")
    axes.set_xlabel("parameters, in order")
    axes.set_title("standard error over 5 % of the torque")
    axes.legend(frameon=False)


def _apart(axes: Axes, result: Result) -> None:
    places = np.arange(len(result.apart))
    for key, colour, shift in (("before", "#D55E00", -0.2), ("after", "#0072B2", 0.2)):
        values: list[Any] = [max(r[key], 0.1) for r in result.apart]
        name = result.old if key == "before" else "with this motion"
        axes.barh(places + shift, values, 0.36, color=colour, label=name)
    axes.set_yticks(places, [f"{r['true']}\nnot {r['fitted']}" for r in result.apart], fontsize=7)
    axes.set_xscale("log")
    axes.invert_yaxis()
    axes.set_title("expected difference of scores")
    axes.legend(frameon=False, fontsize=7)


def draw_excite(result: Result, path: Path) -> None:
    """Write the picture as PNG."""
    with house_style():
        drawn, buffer = figure(result), io.BytesIO()
        FigureCanvasAgg(drawn)
        drawn.savefig(buffer, format="png", bbox_inches="tight", metadata={"Software": None})
    write_bytes(path, buffer.getvalue())
