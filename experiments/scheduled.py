"""What gains that fall with trust cost: ``python experiments/scheduled.py FOLDER``.

Learning from weighted data with the guard, with and without
:class:`jaxidl.learning.schedule.Schedule`, in the conditions of ``guard.py``, which no rule was
made on. FOLDER gets scheduled.md, .json, .png and .pdf; the sweeps stay in ``--sweeps`` (default:
FOLDER), and an interrupted run continues.
"""

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import guard
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from jaxidl.backend import choose_devices
from jaxidl.files import markdown
from jaxidl.jobs.statistics import geometric
from jaxidl.paper.runs import run_sweep
from jaxidl.paper.study import PaperStudy
from jaxidl.plot.style import CONTROLLER_NAME, house_style, save

GRID = replace(guard.GRID, sources=("weighted",))
OVER_SEEDS = ("noise", "friction", "stiction", "epochs", "source")
LABELS = {"off": "fixed gains", "on": "scheduled gains"}


def sweeps(folder: Path) -> dict[str, xr.Dataset]:
    """Return the results without and with a schedule; the former are those of ``weighted.py``."""
    studies = {"off": PaperStudy(guard="on"), "on": PaperStudy(guard="on", schedule="on")}
    files = {"off": "weighted_on.nc", "on": "scheduled_on.nc"}
    return {name: run_sweep(GRID, folder / files[name], study) for name, study in studies.items()}


def compared(data: dict[str, xr.Dataset]) -> list[dict[str, Any]]:
    """Return a row for each controller and gain.

    Ratios are paired over conditions and seeds; their intervals are those over seeds of the mean
    over conditions.
    """
    rows = []
    for controller, gain in itertools.product(GRID.controllers, GRID.gains):
        of = {name: whole.sel(controller=controller, gain=gain) for name, whole in data.items()}
        row: dict[str, Any] = {"of": f"{CONTROLLER_NAME[controller]}, {gain} gain"}
        for name, measure in (("error", "q_error"), ("feedback", "feedback_applied")):
            last = {
                k: v[measure].isel(iteration=slice(-guard.LAST, None)).mean("iteration")
                for k, v in of.items()
            }
            ratio = np.log(last["on"] / last["off"]).mean(OVER_SEEDS)
            row[name] = geometric(np.exp(ratio.values))
            row |= {f"{name}_{k}": float(v.median()) for k, v in last.items()}
        for k, v in of.items():
            later = v["q_error"].isel(iteration=slice(1, None)) / v["q_error"].isel(iteration=0)
            row[f"worst_{k}"] = float(later.max())
        rows.append(row)
    return rows


def table(rows: list[dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    heads = [
        "controller, gain",
        "final error, scheduled / fixed, 95 % over seeds",
        "median [mm], fixed → scheduled",
        "applied feedback, scheduled / fixed, 95 % over seeds",
        "median [N], fixed → scheduled",
        "worst execution over the first",
    ]
    pair = lambda row, name, scale=1.0: " → ".join(
        f"{scale * row[f'{name}_{side}']:.3g}" for side in LABELS
    )
    return markdown(
        heads,
        (
            [
                row["of"],
                row["error"],
                pair(row, "error", 1e3),
                row["feedback"],
                pair(row, "feedback"),
                pair(row, "worst"),
            ]
            for row in rows
        ),
    )


def draw(data: dict[str, xr.Dataset], folder: Path) -> None:
    """Draw error and applied feedback over iterations: median, and middle half of the runs."""
    with house_style():
        figure = Figure(figsize=(7.0, 3.6), layout="constrained")
        axes = figure.subplots(2, 4, sharex=True, sharey="row")
        for column, (controller, gain) in enumerate(
            itertools.product(GRID.controllers, GRID.gains)
        ):
            for name, line, color in (("off", "--", "#D55E00"), ("on", "-", "#0072B2")):
                of = data[name].sel(controller=controller, gain=gain)
                for panel, measure, scale in (
                    (axes[0, column], "q_error", 1e3),
                    (axes[1, column], "feedback_applied", 1.0),
                ):
                    runs = (
                        of[measure].stack(run=(*OVER_SEEDS, "seed")).transpose("iteration", "run")
                    )
                    low, middle, high = scale * np.quantile(runs.values, (0.25, 0.5, 0.75), axis=1)
                    at = 1 + np.arange(len(middle))
                    panel.fill_between(at, low, high, color=color, alpha=0.15, linewidth=0)
                    panel.plot(at, middle, color=color, linestyle=line, label=LABELS[name])
                    panel.set_yscale("log")
            axes[0, column].set_title(f"{CONTROLLER_NAME[controller]}, {gain} gain")
            axes[1, column].set_xlabel("execution")
            axes[1, column].set_xticks([1, 5, 10, 15, 20])
        axes[0, 0].set_ylabel("position error [mm]")
        axes[1, 0].set_ylabel("applied feedback [N]")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        save(figure, folder, "scheduled")


def main() -> None:
    given = guard.folders(__doc__ or "")
    choose_devices(None)
    data = sweeps(given.sweeps or given.folder)
    rows = compared(data)
    listed = [
        row | {k: [row[k].value, *(row[k].interval or ())] for k in ("error", "feedback")}
        for row in rows
    ]
    about = {"git_revision": data["on"].attrs["git_revision"], "rows": listed}
    guard.keep(given.folder, "scheduled", about, table(rows))
    draw(data, given.folder)


if __name__ == "__main__":
    main()
