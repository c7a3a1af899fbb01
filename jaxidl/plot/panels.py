"""Single panels: each function draws one thing into the given axes."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from jaxidl.plot.style import SOURCE_STYLE


def seed_curves(axes: Axes, runs: xr.DataArray) -> None:
    """Draw the median over seeds for each source, and the range of all seeds as a band.

    ``runs`` has (seed, source, iteration).
    """
    for source in runs.source.values:
        curves, style = runs.sel(source=source), SOURCE_STYLE[str(source)]
        axes.plot(runs.iteration, curves.median("seed"), label=str(source), markevery=2, **style)
        if runs.sizes["seed"] > 1:
            low, high = curves.min("seed"), curves.max("seed")
            axes.fill_between(
                runs.iteration, low, high, color=style["color"], alpha=0.15, linewidth=0
            )
    _iterations(axes, runs)


def mean_and_spread(axes: Axes, runs: xr.DataArray) -> None:
    """Draw for each source the mean over all other dimensions.

    A thin line is the mean plus one standard deviation.
    """
    over = [dim for dim in runs.dims if dim not in ("source", "iteration")]
    for source in runs.source.values:
        curves, style = runs.sel(source=source), SOURCE_STYLE[str(source)]
        mean, spread = curves.mean(over), curves.std(over)
        axes.plot(runs.iteration, mean, label=str(source), markevery=2, **style)
        axes.plot(
            runs.iteration,
            mean + spread,
            color=style["color"],
            linestyle=style["linestyle"],
            linewidth=0.7,
            alpha=0.8,
        )
    _iterations(axes, runs)


def median_and_range(axes: Axes, runs: xr.DataArray) -> None:
    """Draw for each source the median over all other dimensions.

    The band is the range from the 10th to the 90th percentile.
    """
    over = [dim for dim in runs.dims if dim not in ("source", "iteration")]
    for source in runs.source.values:
        low, middle, high = runs.sel(source=source).quantile([0.1, 0.5, 0.9], over).values
        style = SOURCE_STYLE[str(source)]
        axes.plot(runs.iteration, middle, label=str(source), markevery=2, **style)
        axes.fill_between(runs.iteration, low, high, color=style["color"], alpha=0.15, linewidth=0)
    _iterations(axes, runs)


def _iterations(axes: Axes, runs: xr.DataArray) -> None:
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_xlim(-0.3, runs.sizes["iteration"] - 0.7)


def positions(axes: Axes, data: xr.Dataset, execution: int) -> None:
    """Draw both joints' positions of one execution against the frictionless reference."""
    for joint, color in zip(data.joint.values, ("#0072B2", "#D55E00"), strict=False):
        q = data["example_q"].isel(execution=execution).sel(joint=joint)
        axes.plot(data.time, q, color=color, label=f"joint {joint}")
    # the same for both joints: same start, same target
    reference = data["example_reference"].isel(joint=0)
    axes.plot(
        data.time,
        reference,
        color="black",
        linewidth=0.9,
        linestyle=":",
        label="frictionless reference",
    )


TORQUES = {
    "tau_inverse_desired": ("rigid-body model", "#56B4E9", "-"),
    "tau_feedback_applied": ("feedback", "#D55E00", "--"),
    "tau_feedforward": ("error model", "#009E73", "-"),
    "tau": ("total", "black", ":"),
}


def torque_split(
    axes: Axes, data: xr.Dataset, execution: int, joint: int, window: int = 10
) -> None:
    """Draw the parts of one joint's torque.

    They are averaged over ``window`` steps so that noise does not hide them.
    """
    for name, (label, color, line) in TORQUES.items():
        values = data[f"example_{name}"].isel(execution=execution).sel(joint=joint)
        smooth = values.rolling(time=window, center=True, min_periods=1).mean()
        axes.plot(data.time, smooth, color=color, linestyle=line, linewidth=1.1, label=label)


def heat(
    axes: Axes, table: np.ndarray, rows: list[str], columns: list[str], limits: tuple[float, float]
) -> AxesImage:
    """Draw a (rows, columns) table on a logarithmic colour scale.

    Cells without a number stay grey.
    """
    axes.set_facecolor("0.8")
    image = axes.imshow(
        table, norm=LogNorm(*limits), cmap="viridis", aspect="auto", interpolation="nearest"
    )
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xticks(range(len(columns)), columns, rotation=90)
    axes.grid(False)
    return image


def shared_legend(figure: Figure, axes: Axes) -> None:
    """Draw one legend above all panels."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
