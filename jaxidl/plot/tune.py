"""The figure of ``jaxidl tune``: both searches against their cost, and their results."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxidl.plot.style import house_style, save

STYLE = {"as it is": ("#000000", "o"), "gradient": ("#0072B2", "^"), "random": ("#D55E00", "s")}
UNITS = {"point_mass": ("m", "N"), "arm": ("rad", "Nm")}


def figure(result: dict[str, Any]) -> Figure:
    """Plot best error so far over learning runs, and error against effort of the fresh runs.

    The first is on the left, the second on the right, with their means.
    """
    length, torque = UNITS[result["problem"]["plant"]]
    drawn = Figure(figsize=(7.6, 3.3), layout="constrained")
    left, right = drawn.subplots(1, 2)
    for way, course in result["course"].items():
        left.plot(
            course["runs"], course["error"], color=STYLE[way][0], drawstyle="steps-post", label=way
        )
    left.set_xscale("log")
    _scale(left, "y", [x for course in result["course"].values() for x in course["error"] if x])
    left.set_xlabel("cost [learning runs]")
    left.set_ylabel(f"best error within the bound [{length}]")
    left.set_title("search")
    left.legend(frameon=False)
    _fresh(right, result)
    right.set_xlabel(f"mean applied feedback [{torque}]")
    right.set_ylabel(f"position error after learning [{length}]")
    right.set_title("on fresh seeds")
    right.legend(frameon=False)
    search, problem = result["search"], result["problem"]
    plant = f"{problem['plant'].replace('_', ' ')}, {problem['controller'].upper()}"
    about = (
        f"{plant}: {len(result['numbers']['gradient'])} numbers; {problem['executions']}"
        " executions; "
    )
    about += (
        f"{search['runs']} runs judge a point, {search['test_runs']} fresh ones compare;"
        " large: geometric mean"
    )
    drawn.supxlabel(about, fontsize=7.5, color="0.35")
    return drawn


def _fresh(axes: Axes, result: dict[str, Any]) -> None:
    for way, runs in result["fresh"].items():
        color, marker = STYLE[way]
        error, effort = (np.array(runs[name], float) for name in ("error", "effort"))
        known = np.isfinite(error) & np.isfinite(effort)
        axes.plot(effort[known], error[known], marker, color=color, markersize=3, alpha=0.45)
        mean = [np.exp(np.log(x[known]).mean()) for x in (effort, error)]
        axes.plot(*mean, marker, color=color, markersize=8, markeredgecolor="white", label=way)
    axes.axvline(result["bound"], color="0.4", linestyle=":", linewidth=1.0, label="bound")
    for which in ("x", "y"):
        _scale(
            axes,
            which,
            [
                x
                for runs in result["fresh"].values()
                for x in runs["effort" if which == "x" else "error"]
                if x
            ],
        )


def _scale(axes: Axes, which: Literal["x", "y"], values: list[float]) -> None:
    """Use a logarithmic axis where values differ by more than a factor of three.

    Below that its labels are many and long.
    """
    known = np.array(values)[np.isfinite(values)]
    if known.size and known.max() > 3.0 * known.min():
        axes.set(**{f"{which}scale": "log"})
    else:
        axes.locator_params(axis=which, nbins=5)


def draw_tune(result: dict[str, Any], folder: Path) -> list[Path]:
    """Draw the figure into ``folder`` as PNG and PDF; return the paths."""
    with house_style():
        return save(figure(result), folder, "tune")
