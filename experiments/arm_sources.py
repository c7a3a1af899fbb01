"""Which source is best on the arm, by three measures: ``python experiments/arm_sources.py FOLDER``.

The arm's study of the paper's three sources lies in FOLDER/arm_conditions.nc (``jaxidl arm``);
weighted data are run here under the same noise, seeds and accelerations, into
``--sweeps``/arm_weighted.nc (default: FOLDER); an interrupted run continues. FOLDER gets
arm_sources.md and arm_sources.json: feedback, path error and true model error over all executions
after the first, and how many of these touch the bound of the learned torque; arm_sources_pick.md:
pick and place (FOLDER/arm.json), execution by execution.
"""

import json
from typing import Any

import guard
import jax
import numpy as np
import xarray as xr

from jaxidl.arm.pick import PickAndPlace, pick_and_place
from jaxidl.arm.run import ArmRun
from jaxidl.arm.study import ArmGrid, run_study
from jaxidl.arm.table import interval
from jaxidl.backend import choose_devices
from jaxidl.files import markdown, plain, write_bytes

MEASURES = {
    "feedback": "mean squared feedback [Nm²]",
    "path": "path error [mrad]",
    "lack": "what the model lacks and was not learned [Nm]",
}


def measured(data: xr.Dataset, limit: float) -> dict[str, xr.DataArray]:
    """Return each measure by seed, geometric means over the executions after the first."""
    later = data.isel(iteration=slice(1, None))
    lack = later["unpredicted_rms"]
    each = {
        "feedback": later["feedback_mse"],
        "path": 1e3 * later["path_error"],
        "lack": (lack**2).mean("joint") ** 0.5,
    }
    means = {
        name: values.copy(data=np.log(values.values)).mean("iteration")
        for name, values in each.items()
    }
    touched = (later["feedforward_peak"] >= 0.999 * limit).mean(["iteration", "seed"])
    return {
        **{name: values.copy(data=np.exp(values.values)) for name, values in means.items()},
        "touched": touched,
    }


def rows(parts: list[xr.Dataset], limit: float) -> list[dict[str, Any]]:
    """Return a row for each acceleration, noise and source: every measure with its interval."""
    out = []
    sets = [(part, measured(part, limit)) for part in parts]
    for acceleration in sets[0][0].acceleration.values.tolist():
        for noise in sets[0][0].noise.values.tolist():
            at = {"acceleration": acceleration, "noise": noise}
            block = []
            for part, found in sets:
                for source in part.source.values.tolist():
                    here = {k: v.sel(**at, source=source) for k, v in found.items()}
                    block.append(
                        {**at, "source": source, "touched": float(here.pop("touched"))}
                        | {name: interval(values.values) for name, values in here.items()}
                    )
            for name in MEASURES:
                best = min(block, key=lambda row, name=name: row[name][0])
                for row in block:
                    row[f"best_{name}"] = row is best
            out += block
    return out


def table(found: list[dict[str, Any]]) -> str:
    """Return the rows as Markdown; the best of each condition is set in bold."""
    heads = [
        "accelerations",
        "encoder noise",
        "source",
        *MEASURES.values(),
        "executions at the bound",
    ]
    bold = lambda row, name: "**" if row[f"best_{name}"] else ""
    return markdown(
        heads,
        (
            [
                row["acceleration"].replace("_", "-"),
                f"{row['noise']:g} rad",
                row["source"],
                *(
                    bold(row, name) + "{:.3g} [{:.3g}, {:.3g}]".format(*row[name]) + bold(row, name)
                    for name in MEASURES
                ),
                f"{row['touched']:.0%}",
            ]
            for row in found
        ),
    )


def pick(about: dict[str, Any]) -> dict[str, Any]:
    """Return path error [m] and feedback [Nm²] of pick and place, (seeds, executions) by source."""
    task = PickAndPlace()
    with jax.enable_x64(True):
        runs = [pick_and_place(task, about["rate"], "weighted", seed) for seed in task.seeds]
    return {
        name: {**about[name], "weighted": [np.asarray(run[name]).tolist() for run in runs]}
        for name in ("path_error", "feedback_mse")
    }


def pick_table(found: dict[str, Any]) -> str:
    """Return medians over seeds, execution by execution, as Markdown."""
    along = lambda values: " → ".join(f"{x:.3g}" for x in np.median(values, 0))
    return markdown(
        ["source", "path error [mm]", "mean squared feedback [Nm²]"],
        (
            [source, along(1e3 * np.array(errors)), along(found["feedback_mse"][source])]
            for source, errors in found["path_error"].items()
        ),
    )


def main() -> None:
    given = guard.folders(__doc__ or "")
    choose_devices(None)
    run = ArmRun(grid=ArmGrid(sources=("weighted",)))
    file = (given.sweeps or given.folder) / "arm_weighted.nc"
    weighted = run_study(run.arm, run.grid, file, run.identity())
    three = xr.load_dataset(given.folder / "arm_conditions.nc")
    about: dict[str, Any] = {"git_revision": weighted.attrs["git_revision"]}
    picked = pick(json.loads((given.folder / "arm.json").read_text())["pick"])
    found = rows([three, weighted], run.arm.feedforward_limit)
    about |= {"rows": found, "pick": picked}
    write_bytes(
        given.folder / "arm_sources.json",
        (json.dumps(plain(about), indent=1) + "\n").encode(),
    )
    write_bytes(given.folder / "arm_sources_pick.md", (pick_table(picked) + "\n").encode())
    write_bytes(given.folder / "arm_sources.md", (table(found) + "\n").encode())
    print(table(found), pick_table(picked), sep="\n\n")


if __name__ == "__main__":
    main()
