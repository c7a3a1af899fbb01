"""What weighted data are worth: ``python experiments/weighted.py FOLDER``.

Learning from weighted data (:func:`jaxidl.learning.sources.weighted`) against the best of the
paper's three sources, condition by condition: in the paper's whole grid, guarded, whose three
sources are in FOLDER/study.nc, and in the conditions of ``guard.py``, which no rule was made on,
with and without the guard. FOLDER gets weighted.md, .json, .png and .pdf; the sweeps stay in
``--sweeps`` (default: FOLDER), and an interrupted run continues.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import guard
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from jaxidl.backend import choose_devices
from jaxidl.files import markdown, plain, write_bytes
from jaxidl.jobs.statistics import geometric
from jaxidl.paper.grid import SOURCES, Grid
from jaxidl.paper.runs import run_sweep
from jaxidl.paper.study import PaperStudy
from jaxidl.plot.style import CONTROLLER_NAME, SOURCE_STYLE, house_style, save

PAPER, FRESH = "the paper's grid, guarded", "other conditions"
GUARDED = "other conditions, guarded"
ONLY = ("weighted",)
CONDITION = ("controller", "gain", "noise", "friction", "stiction", "epochs")


def errors(study: Path, folder: Path) -> dict[str, xr.DataArray]:
    """Return position errors (condition, seed, source, iteration) [m] of all four sources."""
    grid = replace(guard.GRID, sources=ONLY)
    three = run_sweep(guard.GRID, folder / "guard_off.nc", PaperStudy())
    paper = [
        run_sweep(
            Grid(sources=ONLY, epochs=(epochs,)),
            folder / f"weighted_paper_{epochs}.nc",
            PaperStudy(guard="on"),
        )
        for epochs in Grid().epochs
    ]
    data = {
        PAPER: (xr.load_dataset(study), xr.concat(paper, "epochs", data_vars="all")),
        FRESH: (three, run_sweep(grid, folder / "weighted_off.nc", PaperStudy())),
        GUARDED: (three, run_sweep(grid, folder / "weighted_on.nc", PaperStudy(guard="on"))),
    }
    joined = {
        name: xr.concat([part["q_error"] for part in parts], "source", coords="minimal")
        for name, parts in data.items()
    }
    return {
        name: error.stack(condition=CONDITION).transpose("condition", "seed", "source", "iteration")
        for name, error in joined.items()
    }


def final(error: xr.DataArray) -> xr.DataArray:
    """Return the logarithm of the mean over the last executions."""
    last = error.isel(iteration=slice(-guard.LAST, None)).mean("iteration")
    return last.copy(data=np.log(last.values))


def against_the_best(last: xr.DataArray, source: str) -> np.ndarray:
    """Return ``last`` of ``source`` less that of the best of the paper's three, (condition, seed).

    The best of a condition is the one with the least mean over seeds.
    """
    three = last.sel(source=list(SOURCES))
    best = three.isel(source=three.mean("seed").argmin("source"))
    return last.sel(source=source).values - best.values


def above(ratios: np.ndarray, limit: float = 1.1) -> bool:
    """Return true if the interval of a condition's ratios (seed,) lies above the limit."""
    mean = geometric(ratios)
    return mean is not None and mean.interval is not None and mean.interval[0] > limit


def row(error: xr.DataArray) -> dict[str, Any]:
    """Return what is said of one group of conditions."""
    last = final(error)
    ratio = against_the_best(last, "weighted")
    final_errors = last.copy(data=np.exp(last.values))
    by_mean, by_median = (
        over.sel(source="weighted") / over.sel(source=list(SOURCES)).min("source")
        for over in (final_errors.mean("seed"), final_errors.median("seed"))
    )
    later = error.isel(iteration=slice(1, None)) / error.isel(iteration=0)
    single = {s: float(np.exp(against_the_best(last, s).mean())) for s in SOURCES}
    least = min(single, key=lambda source: single[source])
    return {
        "conditions": len(ratio),
        "ratio": geometric(np.exp(ratio.mean(0))),
        "by_mean": float(np.exp(np.log(by_mean.values).mean())),
        "by_median": float(np.exp(np.log(by_median.values).mean())),
        "worst_condition": float(np.exp(ratio.mean(1).max())),
        "clearly_worse": sum(above(np.exp(seeds)) for seeds in ratio),
        "single": least,
        "single_ratio": single[least],
        "worst": float(later.sel(source="weighted").max()),
        "worst_of_three": float(later.sel(source=list(SOURCES)).max()),
        "executions": int(later.sel(source="weighted").size),
        "above_3": int((later.sel(source="weighted") > 3.0).sum()),
    }


def rows(data: dict[str, xr.DataArray]) -> list[dict[str, Any]]:
    """Return a row for each controller and gain, and each number of epochs, of each set of
    conditions, and one for each set.
    """
    out = []
    for name, error in data.items():
        whole = error.reset_index("condition")
        for controller in guard.GRID.controllers:
            for gain in guard.GRID.gains:
                chosen = (whole.controller == controller) & (whole.gain == gain)
                about = {"set": name, "of": f"{CONTROLLER_NAME[controller]}, {gain} gain"}
                out.append(about | row(error[chosen.values]))
        epochs = np.unique(whole.epochs)
        for number in epochs if len(epochs) > 1 else ():
            about = {"set": name, "of": f"{number} epochs"}
            out.append(about | row(error[(whole.epochs == number).values]))
        out.append({"set": name, "of": "all"} | row(error))
    return out


def table(found: list[dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    heads = [
        "conditions",
        "of",
        "number",
        "final error, weighted / best of three, 95 % over seeds",
        "the same by means, by medians over seeds",
        "in the worst condition",
        "clearly worse by more than 10 %",
        "best single source",
        "worst execution over the first, weighted (of the three)",
        "executions above three times the first",
    ]
    return markdown(
        heads,
        (
            [
                r["set"],
                r["of"],
                r["conditions"],
                r["ratio"],
                f"{r['by_mean']:.2g}, {r['by_median']:.2g}",
                f"{r['worst_condition']:.2g}",
                f"{r['clearly_worse']} of {r['conditions']}",
                f"{r['single']}, {r['single_ratio']:.2g}",
                f"{r['worst']:.2g} ({r['worst_of_three']:.3g})",
                f"{r['above_3']} of {r['executions']}",
            ]
            for r in found
        ),
    )


def draw(data: dict[str, xr.DataArray], folder: Path) -> None:
    """Draw every condition, the error over iterations, and how often each source is best."""
    error = data[PAPER]
    middle = final(error).mean("seed")
    middle = middle.copy(data=1e3 * np.exp(middle.values))
    best = middle.sel(source=list(SOURCES)).min("source")
    where = middle.reset_index("condition")
    with house_style():
        figure = Figure(figsize=(7.0, 2.7), layout="constrained")
        each, along, share = figure.subplots(1, 3, width_ratios=(1.25, 1.25, 0.9))
        for controller, marker in zip(guard.GRID.controllers, "os", strict=True):
            for gain, color in zip(guard.GRID.gains, ("#E69F00", "#56B4E9"), strict=True):
                chosen = ((where.controller == controller) & (where.gain == gain)).values
                label = f"{CONTROLLER_NAME[controller]}, {gain}"
                x, y = best.values[chosen], middle.sel(source="weighted").values[chosen]
                each.scatter(
                    x, y, s=14, marker=marker, color=color, edgecolors="0.2", lw=0.4, label=label
                )
        ends = float(middle.sel(source="weighted").min()) / 1.5, float(best.max()) * 1.5
        each.plot(ends, ends, color="0.5", linewidth=0.8, zorder=0)
        each.set(
            xscale="log",
            yscale="log",
            xlabel="best of the paper's three [mm]",
            ylabel="weighted [mm]",
            title="final error, a dot a condition",
        )
        each.legend(fontsize=6.5, handletextpad=0.1, borderpad=0.3)
        for source in (*SOURCES, "weighted"):
            curve = error.sel(source=source).median(["condition", "seed"]) * 1e3
            along.plot(curve.iteration, curve, label=source, markevery=2, **SOURCE_STYLE[source])
        along.set(yscale="log", xlabel="iteration", title="median error [mm]")
        along.legend(fontsize=6.5)
        names = [*SOURCES, "weighted"]
        won = [100 * float((middle.argmin("source") == k).mean()) for k in range(len(names))]
        order = [str(s) for s in error.source.values]
        won = [won[order.index(name)] for name in names]
        share.bar(names, won, color=[SOURCE_STYLE[name]["color"] for name in names])
        share.set(title="best in … % of conditions", ylim=(0, 100))
        share.tick_params(axis="x", rotation=45)
        save(figure, folder, "weighted")


def main() -> None:
    given = guard.folders(__doc__ or "")
    choose_devices(None)
    sweeps = given.sweeps or given.folder
    data = errors(given.folder / "study.nc", sweeps)
    found = rows(data)
    revision = xr.load_dataset(sweeps / "weighted_on.nc").attrs["git_revision"]
    listed = [r | {"ratio": [r["ratio"].value, *(r["ratio"].interval or ())]} for r in found]
    write_bytes(
        given.folder / "weighted.json",
        (json.dumps(plain({"git_revision": revision, "rows": listed}), indent=1) + "\n").encode(),
    )
    write_bytes(given.folder / "weighted.md", (table(found) + "\n").encode())
    draw(data, given.folder)
    print(table(found))


if __name__ == "__main__":
    main()
