"""What a guard on learned torques is worth: ``python experiments/guard.py FOLDER``.

The same learning runs with and without :mod:`jaxidl.learning.guard`, in conditions and with seeds
that were not used to make it: both controllers, both gains, noise of 0.15 and 0.6 mm, friction 6
and 7. FOLDER gets guard.md and guard.json, guard.png and guard.pdf; the sweeps themselves stay in
FOLDER/guard_off.nc and guard_on.nc (``--sweeps`` names another folder for these), and an
interrupted run continues.
"""

import argparse
import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from jaxidl.backend import choose_devices
from jaxidl.files import markdown, plain, write_bytes
from jaxidl.jobs.statistics import geometric
from jaxidl.learning.guard import Guard
from jaxidl.paper.grid import Grid
from jaxidl.paper.runs import run_sweep
from jaxidl.paper.study import PaperStudy
from jaxidl.plot.style import CONTROLLER_NAME, SOURCE_STYLE, house_style, save

GRID = Grid(
    noise=(1.5e-4, 6e-4),
    friction=(6.0, 7.0),
    stiction=(6.0,),
    epochs=(20,),
    seeds=(21, 22, 23, 24, 25),
)
LAST = 5  # executions of which the final error is the mean
Key = tuple[str, str, str]


def sweeps(folder: Path) -> dict[str, xr.Dataset]:
    """Return the results without and with a guard."""
    return {
        name: run_sweep(GRID, folder / f"guard_{name}.nc", PaperStudy(guard=name))
        for name in ("off", "on")
    }


def compared(data: dict[str, xr.Dataset]) -> dict[Key, dict[str, Any]]:
    """Return for each controller, gain and source: final errors, their ratio, the worst execution.

    The ratio is paired over conditions and seeds; its interval is that over seeds of the mean over
    conditions. The worst execution is that of all runs, over the first of the same run.
    """
    out = {}
    for at in itertools.product(GRID.controllers, GRID.gains, GRID.sources):
        row: dict[str, Any] = {}
        final = {}
        for name, whole in data.items():
            error = whole["q_error"].sel(
                dict(zip(("controller", "gain", "source"), at, strict=True))
            )
            error = error.squeeze(drop=True)
            last = error.isel(iteration=slice(-LAST, None)).mean("iteration")
            final[name] = np.log(last)
            row[f"median_{name}"] = float(last.median())
            row[f"mean_{name}"] = float(last.mean())
            later = error.isel(iteration=slice(1, None)) / error.isel(iteration=0)
            row[f"worst_{name}"] = float(later.max())
            row[f"above_3_{name}"] = int((later > 3.0).sum())
            row["executions"] = int(later.size)
        change = (final["on"] - final["off"]).mean([d for d in final["on"].dims if d != "seed"])
        row["ratio"] = geometric(np.exp(change.values))
        out[at] = row
    return out


def table(rows: dict[Key, dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    heads = [
        "controller, gain, source",
        "final error, unguarded → guarded: median [mm]",
        "mean [mm]",
        "guarded / unguarded, 95 % over seeds",
        "worst execution over the first",
        "executions above three times the first",
    ]
    pair = lambda row, name, scale=1.0: " → ".join(
        f"{scale * row[f'{name}_{side}']:.3g}" for side in ("off", "on")
    )
    return markdown(
        heads,
        (
            [
                f"{CONTROLLER_NAME[at[0]]}, {at[1]}, {at[2]}",
                pair(row, "median", 1e3),
                pair(row, "mean", 1e3),
                row["ratio"],
                pair(row, "worst"),
                f"{row['above_3_off']} → {row['above_3_on']} of {row['executions']}",
            ]
            for at, row in rows.items()
        ),
    )


def draw(data: dict[str, xr.Dataset], folder: Path) -> None:
    """Draw every run's largest error after the first execution against its final error."""
    with house_style():
        figure = Figure(figsize=(7.0, 5.2), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True, sharey=True)
        for panel, (controller, gain) in zip(
            axes.flat, itertools.product(GRID.controllers, GRID.gains), strict=True
        ):
            for source, (name, whole) in itertools.product(GRID.sources, data.items()):
                error = whole["q_error"].sel(controller=controller, gain=gain, source=source)
                last = error.isel(iteration=slice(-LAST, None)).mean("iteration")
                worst = error.isel(iteration=slice(1, None)).max("iteration")
                style = SOURCE_STYLE[source]
                panel.scatter(
                    1e3 * last.values.ravel(),
                    (worst / error.isel(iteration=0)).values.ravel(),
                    s=16,
                    marker=style["marker"],
                    edgecolors=style["color"],
                    facecolors=style["color"] if name == "on" else "none",
                    linewidths=0.9,
                    label=f"{source}, {'guarded' if name == 'on' else 'unguarded'}",
                )
            panel.axhline(1.0, color="0.5", linewidth=0.8, zorder=0)
            panel.set(
                xscale="log", yscale="log", title=f"{CONTROLLER_NAME[controller]}, {gain} gain"
            )
        for panel in axes[1]:
            panel.set_xlabel("final error [mm], mean of the last five executions")
        for panel in axes[:, 0]:
            panel.set_ylabel("worst later execution / first")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
        save(figure, folder, "guard")


def folders(about: str) -> argparse.Namespace:
    """Return the command's FOLDER and ``--sweeps``."""
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sweeps", type=Path)
    return parser.parse_args()


def keep(folder: Path, name: str, about: dict[str, Any], text: str) -> None:
    """Write a result's numbers and its table into the folder, and print the table."""
    write_bytes(folder / f"{name}.json", (json.dumps(plain(about), indent=1) + "\n").encode())
    write_bytes(folder / f"{name}.md", (text + "\n").encode())
    print(text)


def main() -> None:
    given = folders(__doc__ or "")
    choose_devices(None)
    data = sweeps(given.sweeps or given.folder)
    rows = compared(data)
    about = {
        "git_revision": data["on"].attrs["git_revision"],
        "guard": vars(Guard()),
        "rows": [
            dict(zip(("controller", "gain", "source"), at, strict=True))
            | row
            | {"ratio": [row["ratio"].value, *row["ratio"].interval]}
            for at, row in rows.items()
        ],
    }
    keep(given.folder, "guard", about, table(rows))
    draw(data, given.folder)


if __name__ == "__main__":
    main()
