"""Figures of the arm's tasks: pick and place, a changing load, and the gap workflow."""

from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from jaxidl.arm.found import STATES, judge
from jaxidl.arm.pick import LIFTED
from jaxidl.effects import CATALOGUE
from jaxidl.plot.style import SOURCE_STYLE
from jaxidl.systems.free import unit_of

BEFORE, AFTER = "#D55E00", "#009E73"


def pick_and_place(result: dict[str, Any]) -> Figure:
    """Plot how compliant the arm can be and still lift, and the improvement by learning.

    Shown are medians over seeds and their range.
    """
    figure = Figure(figsize=(8.6, 2.6), layout="constrained")
    lift, path, feedback = figure.subplots(1, 3)
    lift.semilogx(
        result["rates"], 100 * np.asarray(result["lifted"]), "o-", color="#0072B2", base=2
    )
    lift.axhline(100 * LIFTED, color="0.4", linestyle=":", linewidth=0.9)
    lift.axvline(result["rate"], color=BEFORE, linestyle="--", linewidth=0.9)
    words = f"lowest that lifts: {result['rate']:.3g}"
    lift.annotate(
        words,
        (result["rate"], 0.05),
        (4, 0),
        ("data", "axes fraction"),
        "offset points",
        color=BEFORE,
    )
    lift.set_xlabel("learning rate of DOOMED [1/s]")
    lift.set_ylabel("way up, without learning [%]")
    for panel, name, scale, label in (
        (path, "path_error", 1e3, "mean path error of the flange [mm]"),
        (feedback, "feedback_mse", 1.0, "mean squared feedback [Nm²]"),
    ):
        most = 0.0
        for source, runs in result[name].items():
            values = scale * np.asarray(runs)
            middle, style = np.median(values, 0), SOURCE_STYLE[source]
            executions = range(1, len(middle) + 1)
            panel.plot(executions, middle, label=f"{source} data", **style)
            panel.fill_between(
                executions,
                values.min(0),
                values.max(0),
                color=style["color"],
                alpha=0.15,
                linewidth=0,
            )
            most = max(most, float(values.max()))
        panel.set_ylim(0.0, 1.08 * most)
        panel.set_xlabel("execution")
        panel.set_ylabel(label)
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    feedback.legend(frameon=False)
    return figure


def strip(films: list[np.ndarray], seconds: list[float], titles: list[str]) -> Figure:
    """Return rows of pictures (N, H, W, 3), one film per row, with the time above each."""
    figure = Figure(figsize=(1.75 * len(seconds), 1.95 * len(films)), layout="constrained")
    axes = figure.subplots(len(films), len(seconds), squeeze=False)
    for row, film, title in zip(axes, films, titles, strict=True):
        for panel, picture in zip(row, film, strict=True):
            panel.imshow(picture)
            panel.set_xticks([])
            panel.set_yticks([])
            panel.grid(False)
            for side in panel.spines.values():
                side.set_visible(False)
        row[0].set_ylabel(title)
    for panel, at in zip(axes[0], seconds, strict=True):
        panel.set_title(f"{at:.1f} s")
    return figure


def with_and_without_load(result: dict[str, Any]) -> Figure:
    """Plot feedback of each execution on the laps with and without the load.

    There is one panel for a network with the load as an input and one for a network without; lines
    are medians over seeds, with their range.
    """
    figure = Figure(figsize=(6.4, 2.7), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for panel, name, title in zip(
        axes,
        ("uninformed", "informed"),
        ("inputs as in the paper", "load as one more input"),
        strict=True,
    ):
        laps = np.asarray(result[name])
        for lap, label, color, line in (
            (0, "with the load", BEFORE, "-"),
            (1, "without", AFTER, "--"),
        ):
            executions = range(1, laps.shape[1] + 1)
            panel.plot(
                executions,
                np.median(laps[:, :, lap], 0),
                "o",
                color=color,
                linestyle=line,
                label=label,
            )
            panel.fill_between(
                executions,
                laps[:, :, lap].min(0),
                laps[:, :, lap].max(0),
                color=color,
                alpha=0.15,
                linewidth=0,
            )
        panel.set_yscale("log")
        panel.set_title(title)
        panel.set_xlabel("execution")
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes[0].set_ylabel("mean squared feedback [Nm²]")
    axes[0].legend(frameon=False)
    return figure


COLORS = dict(
    zip(
        STATES,
        (
            "#f2f2f2",
            "#9fd8c0",
            "#b9d7e8",
            "#f5dc8c",
            "#d9d9e3",
            "#dcecc4",
            "#f0a58a",
            "#e6d5e8",
            "#c9a3cc",
        ),
        strict=True,
    )
)


def _unit(effect: str) -> str:
    """Return the unit of the number that describes the effect, on a hinge."""
    parameters = CATALOGUE[effect].parameters
    unit = unit_of(
        parameters["mass" if "mass" in parameters else next(iter(parameters))].unit, "hinge"
    )
    return {"1": "-", "kg m^2": "kg"}.get(unit, unit)


def gap_on_the_arm(report: dict[str, Any], joints: int = 7) -> Figure:
    """Plot hidden effects by joint and whether they are named: hidden size → found size."""
    judged = judge(report)
    rows = list(dict.fromkeys(row.effect for row in judged))
    state = np.zeros((len(rows), joints + 1), int)
    figure = Figure(figsize=(8.6, 0.5 * len(rows) + 1.3), layout="constrained")
    axes = figure.subplots()
    for one in judged:
        i, k = rows.index(one.effect), joints if one.joint is None else one.joint
        state[i, k] = list(STATES).index(one.state)
        words = [
            "" if one.hidden is None else f"{one.hidden:g}",
            "" if one.found is None else f"→ {one.found:.3g}",
        ]
        axes.text(k, i, "\n".join(filter(None, words)), ha="center", va="center", fontsize=7)
    axes.imshow(
        state,
        cmap=ListedColormap(list(COLORS.values())),
        vmin=0,
        vmax=len(COLORS) - 1,
        aspect="auto",
    )
    axes.set_yticks(
        range(len(rows)), [f"{name.replace('_', ' ')} [{_unit(name)}]" for name in rows]
    )
    axes.set_xticks(range(joints + 1), [*(f"joint {j + 1}" for j in range(joints)), "whole arm"])
    axes.grid(False)
    axes.tick_params(length=0)
    patches = [
        axes.scatter([], [], marker="s", s=60, color=COLORS[name], label=STATES[name])
        for name in STATES
    ]
    figure.legend(handles=patches, loc="outside lower center", ncols=3, frameon=False)
    return figure
