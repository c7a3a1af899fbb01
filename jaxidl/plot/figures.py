"""The figures of the simulation study, from stored results alone."""

import json
import textwrap
import warnings
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxidl.errors import StoreError
from jaxidl.paper.grid import AXES, Grid
from jaxidl.paper.runs import settings_of
from jaxidl.paper.study import PaperStudy
from jaxidl.paper.view import LAST
from jaxidl.plot import panels
from jaxidl.plot.style import CONTROLLER_NAME, house_style, save


def finite(data: xr.Dataset, variable: str) -> xr.DataArray:
    """Return a variable with diverged iterations as NaN, so that averages leave them out."""
    return data[variable].where(data["finite"])


def caption(data: xr.Dataset) -> str:
    """Return what the results cover, for the foot of every figure.

    That is the whole study, its quick form, or some part or variation.
    """
    seeds = data.sizes["seed"]
    text = (
        f"{seeds} seed{'s' * (seeds != 1)}, noise"
        f" {', '.join(f'{v * 1e3:g}' for v in data.noise.values)} mm"
    )
    diverged = int((~data["finite"]).sum())
    left = f"; {diverged} diverged iterations left out" if diverged else ""
    return f"{_coverage(data)}: {text}{left}"


def _coverage(data: xr.Dataset) -> str:
    axes = {
        name: set(data[dim].values.tolist()) for name, dim in zip(Grid().axes(), AXES, strict=True)
    }

    def is_grid(grid: Grid, but: str = "") -> bool:
        same = all(axes[name] == set(values) for name, values in grid.axes().items() if name != but)
        return same and data.sizes["iteration"] == grid.executions

    if json.loads(data.attrs["identity"])["study"] != settings_of(PaperStudy()):
        return "settings other than the paper's"
    if is_grid(Grid()):
        return "whole study"
    if is_grid(Grid(), but="seeds"):
        return "all settings"
    return "QUICK STUDY" if is_grid(Grid.quick()) else "part of the grid"


def illustration(data: xr.Dataset) -> Figure:
    """Plot the paper's Fig. 1: position error over iterations for the three sources.

    Shown are low gain, and lowest and highest noise.
    """
    setting = {
        "friction": data.friction.values[0],
        "stiction": data.stiction.values[0],
        "epochs": data.epochs.values[0],
    }
    runs = finite(data, "q_error").sel(gain=_low_gain(data), **setting)
    noises = [data.noise.values.min(), data.noise.values.max()]
    columns = [(who, noise) for who in data.controller.values for noise in dict.fromkeys(noises)]
    figure = Figure(figsize=(2.4 * len(columns) + 0.4, 2.7), layout="constrained")
    grid = figure.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    for axes, (who, noise) in zip(grid, columns, strict=True):
        panels.seed_curves(axes, runs.sel(controller=who, noise=noise))
        axes.set_title(f"{CONTROLLER_NAME[who]}, noise {noise * 1e3:g} mm")
        axes.set_xlabel("learning iteration")
    grid[0].set_ylabel("mean position error [m]")
    panels.shared_legend(figure, grid[0])
    band = "median and range of seeds" if data.sizes["seed"] > 1 else "one seed"
    about = (
        f"{_low_gain(data)} gain, friction {setting['friction']:g}, stiction"
        f" {setting['stiction']:g}, {setting['epochs']} epochs; {band}"
    )
    return _foot(figure, f"{about}; {caption(data)}")


def averages(data: xr.Dataset) -> Figure:
    """Plot the paper's Fig. 2: mean and mean + one standard deviation over all conditions.

    The error is above, the feedback below.
    """
    return _overview(
        data,
        panels.mean_and_spread,
        "thick: mean over all settings and seeds, thin: mean + one standard deviation",
    )


def typical(data: xr.Dataset) -> Figure:
    """Plot Fig. 2 for the typical run.

    A single diverging run can dominate a mean, but not a median.
    """
    return _overview(
        data,
        panels.median_and_range,
        "median over all settings and seeds, band: 10th to 90th percentile",
    )


def _overview(data: xr.Dataset, draw: Callable[[Axes, xr.DataArray], None], about: str) -> Figure:
    columns = [(who, gain) for who in data.controller.values for gain in data.gain.values]
    figure = Figure(figsize=(2.4 * len(columns) + 0.4, 4.6), layout="constrained")
    grid = figure.subplots(2, len(columns), sharex=True, sharey="row", squeeze=False)
    rows = (
        ("q_error", "mean position error [m]"),
        ("feedback_applied", "mean applied feedback [N]"),
    )
    for row, (variable, label) in zip(grid, rows, strict=True):
        for axes, (who, gain) in zip(row, columns, strict=True):
            draw(axes, finite(data, variable).sel(controller=who, gain=gain))
        row[0].set_ylabel(label)
    for axes, (who, gain) in zip(grid[0], columns, strict=True):
        axes.set_title(f"{CONTROLLER_NAME[who]}, {gain} gain")
    for axes in grid[1]:
        axes.set_xlabel("learning iteration")
    panels.shared_legend(figure, grid[0, 0])
    return _foot(figure, f"{about}; {caption(data)}")


def single_run(data: xr.Dataset) -> Figure:
    """Plot one learning run: positions and parts of the torque, first and last execution."""
    if "example_q" not in data:
        raise StoreError(
            "results with an example run",
            "none in this file",
            "run `jaxidl sweep` again with this version",
        )
    about = {name: data.attrs[f"example_{name}"] for name in AXES}
    figure = Figure(figsize=(7.2, 6.2), layout="constrained")
    grid = figure.subplots(3, data.sizes["execution"], sharex=True, sharey="row", squeeze=False)
    for column, execution in enumerate(data.execution.values):
        panels.positions(grid[0, column], data, column)
        for joint in (0, 1):
            panels.torque_split(grid[1 + joint, column], data, column, joint)
        when = "without error model" if execution == 0 else f"after {execution} learning iterations"
        grid[0, column].set_title(f"execution {execution}, {when}")
        grid[2, column].set_xlabel("time [s]")
    grid[0, 0].set_ylabel("position [m]")
    grid[1, 0].set_ylabel("torque, joint 0 [N]")
    grid[2, 0].set_ylabel("torque, joint 1 [N]")
    grid[0, 0].legend(frameon=False)
    panels.shared_legend(figure, grid[1, 0])
    text = (
        f"{CONTROLLER_NAME[about['controller']]}, {about['gain']} gain, {about['source']} data,"
        f" noise {about['noise'] * 1e3:g} mm, friction {about['friction']:g}, stiction"
        f" {about['stiction']:g}, {about['epochs']} epochs, seed {about['seed']}; torques averaged"
        f" over 10 ms; {caption(data)}"
    )
    return _foot(figure, text)


def conditions(data: xr.Dataset) -> Figure:
    """Plot the final position error of every condition.

    It is the mean over seeds and the last executions; a dot marks the best source.
    """
    final = finite(data, "q_error").isel(iteration=slice(-LAST, None)).mean(["iteration", "seed"])
    rows = ("controller", "gain", "source")
    columns = ("noise", "friction", "stiction", "epochs")
    table = final.stack(row=rows, column=columns)
    row_names = [f"{CONTROLLER_NAME[c]} {g}, {s}" for c, g, s in table.row.values]
    column_names = [f"{n * 1e3:g} mm, f {f:g}, s {s:g}, {e}" for n, f, s, e in table.column.values]
    values = table.transpose("row", "column").values
    figure = Figure(
        figsize=(3.2 + 0.2 * values.shape[1], 1.9 + 0.22 * values.shape[0]), layout="constrained"
    )
    axes = figure.subplots()
    known = values[np.isfinite(values)]
    limits = (known.min(), max(known.max(), known.min() * 1.01)) if known.size else (0.1, 1.0)
    image = panels.heat(axes, values, row_names, column_names, limits)
    sources = data.sizes["source"]
    for block in range(0, values.shape[0], sources):
        axes.axhline(block - 0.5, color="white", linewidth=1.5)
        if sources > 1:
            best = np.argmin(
                np.where(
                    np.isfinite(values[block : block + sources]),
                    values[block : block + sources],
                    np.inf,
                ),
                axis=0,
            )
            axes.plot(
                np.arange(values.shape[1]),
                block + best,
                "o",
                color="white",
                markeredgecolor="black",
                markersize=3.5,
            )
    per_noise = values.shape[1] // data.sizes["noise"]
    for edge in range(per_noise, values.shape[1], per_noise):
        axes.axvline(edge - 0.5, color="white", linewidth=1.5)
    axes.set_xlabel("noise, friction, stiction, epochs")
    figure.colorbar(image, ax=axes, label="final mean position error [m]", pad=0.01)
    return _foot(
        figure,
        f"mean over seeds and the last {LAST} executions, dot: best source of the three;"
        f" {caption(data)}",
    )


FIGURES: dict[str, Callable[[xr.Dataset], Figure]] = {
    "fig1_illustration": illustration,
    "fig2_averages": averages,
    "fig3_single_run": single_run,
    "fig4_conditions": conditions,
    "fig5_typical": typical,
}


def draw_all(data: xr.Dataset, folder: Path, names: Iterable[str] = tuple(FIGURES)) -> list[Path]:
    """Draw the named figures into ``folder`` as PNG and PDF; return the paths."""
    with house_style(), warnings.catch_warnings():
        # where every run diverged there is nothing to average
        warnings.simplefilter("ignore", RuntimeWarning)
        return [path for name in names for path in save(FIGURES[name](data), Path(folder), name)]


def _low_gain(data: xr.Dataset) -> str:
    return "low" if "low" in data.gain.values else str(data.gain.values[0])


def _foot(figure: Figure, text: str) -> Figure:
    width = int(figure.get_figwidth() * 17)  # number of characters of this size that fit
    figure.supxlabel(textwrap.fill(text, width), fontsize=7.5, color="0.35")
    return figure
