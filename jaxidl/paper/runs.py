"""The study's learning runs as a sweep: one run at a point of the grid, and the results file with
its meaning.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr
from jaxtyping import Array, Float

from jaxidl import jobs
from jaxidl.backend import MATMUL_PRECISION, PRECISION
from jaxidl.jobs import Variable
from jaxidl.jobs.programs import Job
from jaxidl.learning.iterate import Metrics, learn
from jaxidl.paper.example import example
from jaxidl.paper.grid import AXES, GAINS, Grid
from jaxidl.paper.study import GUARDS, SCHEDULES, Condition, PaperStudy, draw_noise
from jaxidl.paper.vary import check, traced, varied
from jaxidl.types import Trajectory

TITLE = "Task-specific inverse dynamics learning from indirect, direct and joint data"
DIMS = (*AXES, "iteration")  # of every file; an ablation's has more before the last
META = {
    "q_error": Variable(("iteration",), "m", "mean |position - frictionless reference|"),
    "feedback_applied": Variable(("iteration",), "N", "mean |applied feedback|"),
    "qdd_error": Variable(("iteration",), "m s-2", "mean |desired - actual acceleration|"),
    "torque": Variable(("iteration",), "N", "mean |commanded torque|"),
    "finite": Variable(
        ("iteration",),
        "1",
        "did execution and training stay finite? false: keep the iteration out of averages",
    ),
}
draws_of = lru_cache(64)(draw_noise)


@dataclass(frozen=True)
class LearningRun:
    """One learning run of ``executions`` at a point of the grid: what a sweep computes.

    The key is the seed's alone: runs of one seed share initial weights and batch order whatever
    their condition, so differences between conditions and sources are paired, and a run's result
    does not depend on the grid around it.
    """

    study: PaperStudy
    executions: int

    def inputs(self, at: Mapping[str, Any]) -> dict[str, Any]:
        """Return a gain's index, a seed for JAX, and the standard-normal draws (K, T, J) of every
        execution.
        """
        steps = int(at.get("steps", self.study.steps))
        draws = draws_of(int(at["seed"]), self.executions, steps)
        return {
            "gain": np.int32(GAINS.index(at["gain"])),
            "seed": np.uint32(at["seed"]),
            "draws": draws,
        }

    def static(self, names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the axes whose values make a program each; ``names`` are those that an ablation
        adds.
        """
        return (
            "controller",
            "source",
            "epochs",
            *(name for name in names if not traced(self.study, name)),
        )

    def job(self, vary: tuple[tuple[str, Any], ...] = ()) -> Job:
        """Return what a sweep computes, with the axes that an ablation adds."""
        return Job(self, frozenset(self.static(tuple(name for name, _ in vary))), self.inputs)

    def __call__(self, **at: Any) -> dict[str, Array]:
        """Return :class:`Metrics` (K,) by name."""
        return self.run(record=False, **at)[0]._asdict()

    def run(
        self,
        *,
        record: bool,
        controller: str,
        gain: Any,
        noise: Any,
        friction: Any,
        stiction: Any,
        epochs: int,
        seed: Any,
        source: str,
        draws: Float[Array, "K T J"],
        **more: Any,
    ) -> tuple[Metrics, Trajectory | None]:
        """Return metrics (K,) and, if they are to be kept, trajectories (K, T, J)."""
        study = varied(
            replace(self.study, training=replace(self.study.training, epochs=epochs)), more
        )
        with jax.default_matmul_precision(MATMUL_PRECISION):
            metrics, _, runs = learn(
                study.setting(controller, Condition(gain, noise, friction, stiction)),
                draws,
                jax.random.key(seed),
                source=source,
                error_model=study.error_model,
                training=study.training,
                train_on=study.train_on,
                record=record,
                kept=study.kept,
                guard=GUARDS[study.guard],
                schedule=SCHEDULES[study.schedule],
            )
        return metrics, runs

    def trace(
        self, at: Mapping[str, Any], draws: np.ndarray | None = None
    ) -> tuple[Metrics, Trajectory]:
        """Return one learning run with every execution kept: metrics (K,) and trajectories (K, T,
        J).

        ``draws`` (K, T, J) stand for those of its seed (default: these). Another program than a
        sweep's, so its rounding differs, and twenty trainings in float32 make that visible: the
        same run in kind, not digit by digit.
        """
        fixed = set(self.static(tuple(name for name in at if name not in AXES)))
        rest = {
            name: np.asarray(value) for name, value in at.items() if name not in fixed
        } | self.inputs(at)
        rest |= {} if draws is None else {"draws": draws}
        whole = jax.jit(partial(self.run, record=True, **{name: at[name] for name in fixed}))
        metrics, runs = whole(**rest)
        assert runs is not None
        return metrics, runs


def run_sweep(
    grid: Grid,
    path: Path,
    study: PaperStudy | None = None,
    **running: Any,
) -> xr.Dataset:
    """Run every configuration of ``grid`` that ``path`` does not hold yet, write the results there
    and return them.

    ``running``: devices, per_device, width, cluster, overwrite and quiet, as
    :func:`jaxidl.jobs.sweep` has them.

    Raises:
        ConfigurationError: for an impossible layout, no such cluster, or numbers to vary that
            cannot be.
        StoreError: see :class:`jaxidl.jobs.store.Store`.
        KeyboardInterrupt: finished chunks are saved; the same call continues.
    """
    study = study or PaperStudy()
    check(study, grid.vary)
    run = LearningRun(study, grid.executions)
    return jobs.sweep(
        run,
        grid.dims(),
        path,
        static=run.static(tuple(name for name, _ in grid.vary)),
        inputs=run.inputs,
        settings=identity(study, grid),
        variables=META,
        coords={
            "iteration": np.arange(grid.executions),
            "noise": ("noise", list(grid.noise), {"units": "m"}),
        },
        also=xr.Dataset if grid.vary else partial(example, run, grid),
        cost=partial(_cost, study, grid.executions),
        about={"title": TITLE, "precision": PRECISION},
        **running,
    )


def read_results(path: Path) -> xr.Dataset:
    """Return a finished results file of the study or of an ablation.

    Raises:
        StoreError: if there is none, it cannot be read, or it is not one of these.
    """
    return jobs.read(
        path, lambda data: [name for name in (*META, *DIMS) if name not in data.variables]
    )


def added(data: xr.Dataset) -> list[str]:
    """Return the axes that an ablation has added to those of every results file."""
    return [str(dim) for dim in data["q_error"].dims if dim not in DIMS]


def identity(study: PaperStudy, grid: Grid) -> dict[str, Any]:
    """Return everything besides the axes that determines a result."""
    return {"study": settings_of(study), "iterations": grid.executions, "precision": PRECISION}


def settings_of(study: PaperStudy) -> dict[str, Any]:
    """Return the study's settings as they stand in a results file."""
    settings = json.loads(json.dumps(study.to_dict()))
    del settings["training"]["epochs"]  # an axis
    return settings


def _cost(study: PaperStudy, executions: int, kind: Mapping[str, Any]) -> float:
    """Training steps of one run, and the executions in the same unit: for the progress bar only."""
    more = {name: value for name, value in kind.items() if name not in AXES}
    study = varied(study, more)
    rows = {"indirect": study.steps, "direct": study.steps - 1, "joint": 2 * study.steps - 1}
    rows["weighted"] = rows["joint"]
    train_rows = (1 + study.kept) * study.training.train_mask(rows[kind["source"]]).sum()
    return executions * (kind["epochs"] * (train_rows // study.training.batch) + 0.02 * study.steps)
