"""The figure of an ablation: final error and feedback over the varied parameter."""

import textwrap
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxidl.jobs.statistics import geometric
from jaxidl.paper.ablation import axes as axes_of
from jaxidl.paper.ablation import chosen, final, panels_of
from jaxidl.paper.runs import DIMS
from jaxidl.plot.style import CONTROLLER_NAME, SOURCE_STYLE, house_style, save

WORDS = {
    "learner_gain": "learner's gain kp [N/m]",
    "applied_gain": "applied gain kp [N/m]",
    "alpha": "filter constant alpha [-]",
    "prior_mass": "modelled mass [kg]",
    "learning_rate": "learning rate [-]",
    "layers": "layers",
    "kept": "earlier executions kept",
    "epochs": "training epochs",
    "noise": "noise [m]",
    "train_on": "network inputs",
}
ROWS = (("q_error", "final position error [m]"), ("feedback_applied", "final applied feedback [N]"))


def ablation(data: xr.Dataset) -> Figure:
    """Plot error above and feedback below, a line for each source.

    There is one column for each combination of the other axes.
    """
    first, _ = axes_of(data)
    columns = panels_of(data)
    width = max(1.9, 0.5 * data.sizes[first] + 0.9)
    figure = Figure(figsize=(max(width * len(columns) + 0.7, 4.2), 4.9), layout="constrained")
    grid = figure.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
    seen: dict[str, list[np.ndarray]] = {variable: [] for variable, _ in ROWS}
    for column, where in enumerate(columns):
        part = chosen(data, where)
        for row, (variable, label) in enumerate(ROWS):
            seen[variable].append(_panel(grid[row, column], part, first, variable))
            if column == 0:
                grid[row, 0].set_ylabel(label)
        grid[0, column].set_title("\n".join(_words(dim, value) for dim, value in where.items()))
        grid[1, column].set_xlabel(WORDS.get(first, first))
    # as wide as the seeds: the interval of two seeds may be extremely wide
    for row, (variable, _) in enumerate(ROWS):
        known = np.concatenate([ends[np.isfinite(ends)] for ends in seen[variable]])
        if known.size:
            grid[row, 0].set_ylim(known.min() / 1.4, known.max() * 1.4)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    figure.supxlabel(
        textwrap.fill(_caption(data), int(figure.get_figwidth() * 17)), fontsize=7.5, color="0.35"
    )
    return figure


def _panel(axes: Axes, part: xr.Dataset, first: str, variable: str) -> np.ndarray:
    """Plot final values over the values of the varied parameter, and return all of them.

    Dots are seeds, a bar is the mean's interval.
    """
    values, sources, everything = part[first].values, part.source.values, []
    for number, source in enumerate(sources):
        style = SOURCE_STYLE[str(source)]
        ends = final(part.sel(source=source), variable).transpose(first, "seed").values
        x = np.arange(len(values)) + 0.14 * (number - (len(sources) - 1) / 2)
        everything.append(ends.ravel())
        means = [geometric(seeds) for seeds in ends]
        axes.plot(x, [m.value if m else np.nan for m in means], label=str(source), **style)
        for place, seeds, mean in zip(x, ends, means, strict=True):
            axes.plot(
                np.full(len(seeds), place),
                seeds,
                ".",
                color=style["color"],
                markersize=2.5,
                alpha=0.5,
            )
            if mean and mean.interval:
                axes.plot([place, place], mean.interval, color=style["color"], linewidth=1.0)
    axes.set_yscale("log")
    axes.set_xticks(
        range(len(values)),
        [_tick(value) for value in values],
        rotation=30 if values.dtype.kind in "UO" else 0,
    )
    axes.set_xlim(-0.5, len(values) - 0.5)
    return np.concatenate(everything)


def _tick(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value).replace("_", " ")


def _words(dim: str, value: object) -> str:
    if dim == "controller":
        return CONTROLLER_NAME[str(value)]
    if dim == "noise":
        return f"noise {float(str(value)) * 1e3:g} mm"
    if dim == "gain":
        return f"{value} gain"
    return f"{WORDS.get(dim, dim).split(' [')[0]} {_tick(value)}"


def _caption(data: xr.Dataset) -> str:
    """Return what is the same in all panels, and the number of seeds."""
    said = ("seed", "source", "iteration", *(["gain"] if "applied_gain" in data.dims else []))
    single = [dim for dim in DIMS if dim not in said and data.sizes[dim] == 1]
    words = ", ".join(_words(dim, data[dim].values[0]) for dim in single)
    seeds, diverged = data.sizes["seed"], int((~data["finite"]).sum())
    spread = (
        "line: geometric mean over seeds with its 95 % interval, dots: seeds"
        if seeds > 1
        else "one seed"
    )
    left = (
        f"; {diverged} diverged executions, their runs left out where they end" if diverged else ""
    )
    return (
        f"{words}; {data.sizes['iteration']} executions; {seeds} seed{'s' * (seeds != 1)};"
        f" {spread}{left}"
    )


def draw_ablation(data: xr.Dataset, folder: Path, name: str) -> list[Path]:
    """Draw the figure into ``folder`` as PNG and PDF; return the paths."""
    with house_style():
        return save(ablation(data), folder, name)
