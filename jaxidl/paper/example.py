"""One learning run of a grid in full, kept beside its averages so that figures need nothing but the
file.
"""

from typing import Any

import numpy as np
import xarray as xr

from jaxidl.paper.grid import Grid

FIELDS = {
    "q": ("m", "true position"),
    "tau_inverse_desired": ("N", "modelled rigid body at the desired acceleration"),
    "tau_feedforward": ("N", "error model"),
    "tau_feedback_applied": ("N", "applied feedback"),
    "tau": ("N", "commanded torque"),
}


def example_point(grid: Grid) -> dict[str, Any]:
    """Return the run to show: where the grid has it, low-gain PID in the least noise, learning from
    both sources.
    """

    def prefer(values: tuple[Any, ...], wanted: object) -> object:
        return wanted if wanted in values else values[0]

    return {
        "controller": str(prefer(grid.controllers, "pid")),
        "gain": str(prefer(grid.gains, "low")),
        "noise": min(grid.noise),
        "friction": grid.friction[0],
        "stiction": grid.stiction[0],
        "epochs": grid.epochs[0],
        "seed": grid.seeds[0],
        "source": str(prefer(grid.sources, "joint")),
    }


def example(run: Any, grid: Grid) -> xr.Dataset:
    """Return the first and the last execution of the example run: ``example_*`` with dims
    (execution, time, joint).

    ``run`` is the grid's :class:`jaxidl.paper.runs.LearningRun`.
    """
    at, study = example_point(grid), run.study
    _, runs = run.trace(at)
    dims = ("execution", "time", "joint")
    shown = sorted({0, grid.executions - 1})
    variables: dict[str, tuple[Any, ...]] = {
        f"example_{name}": (
            dims,
            np.asarray(getattr(runs, name))[shown],
            {"units": unit, "long_name": text},
        )
        for name, (unit, text) in FIELDS.items()
    }
    variables["example_reference"] = (
        ("time", "joint"),
        np.asarray(study.reference()),
        {"units": "m"},
    )
    time = ("time", study.dt * np.arange(study.steps), {"units": "s"})
    attrs = {f"example_{key}": value for key, value in at.items()}
    return xr.Dataset(variables, {"execution": shown, "time": time, "joint": [0, 1]}, attrs)
