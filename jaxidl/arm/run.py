"""All experiments on the arm, one after the other; what is finished stays, and an interrupted run continues."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jaxidl.arm import hidden, limits, pick, study
from jaxidl.arm.real_time import latency
from jaxidl.arm.table import as_text, falls, ranking
from jaxidl.errors import StoreError
from jaxidl.files import write_bytes
from jaxidl.learning.arm import ArmStudy
from jaxidl.models import Training
from jaxidl.sweep.launch import wait
from jaxidl.sweep.parts import Arrays, Parts
from jaxidl.sweep.provenance import PRECISION, provenance, revision

FEEDFORWARD = "feedforward.jaxexport"
PICKED = ("joint", "direct")  # data that pick and place learns from: the paper's, and the ones that do best here
HEADLINE = ("causal", 1e-5)  # what a robot has: accelerations without the future, and a good encoder


@dataclass(frozen=True)
class ArmRun:
    """Everything that ``jaxidl arm`` computes."""

    arm: ArmStudy = field(default_factory=ArmStudy)
    grid: study.ArmGrid = field(default_factory=study.ArmGrid)
    task: pick.PickAndPlace = field(default_factory=pick.PickAndPlace)
    laps: limits.Ambiguity = field(default_factory=limits.Ambiguity)
    logged: hidden.Logged = field(default_factory=hidden.Logged)
    rounds: int = 20_000  # of the loop at 1 kHz

    def identity(self) -> dict[str, Any]:
        """All that determines a result of the study besides the labels of runs."""
        return {"arm": self.arm.to_dict(), "iterations": self.grid.iterations, "precision": PRECISION}


def quick(run: ArmRun) -> ArmRun:
    """The same in minutes: two seeds, one noise level, four executions, less training, a shorter log."""
    arm = replace(run.arm, training=Training(epochs=12, batch=256))
    logged = replace(run.logged, goals=16)
    return ArmRun(arm, study.QUICK, pick.quick(run.task), limits.quick(run.laps), logged, 3000)


def run_all(run: ArmRun, out: Path, quiet: bool = False) -> dict[str, Any]:
    """Compute what ``out`` does not hold yet; write ``arm.nc``, ``arm_conditions.nc`` and ``arm.json``, and return the latter.

    Raises:
        StoreError: when another process is at work there, or it cannot be written.
        KeyboardInterrupt: finished pieces are saved; the same call continues.
    """
    with jax.enable_x64(True), Parts(out / "parts", run.identity()) as parts, _progress(quiet) as bar:
        picking, lapping, finding = (
            parts.of(asdict(what) | {"precision": PRECISION}) for what in (run.task, run.laps, run.logged)
        )
        picks, laps = run.task.seeds, run.laps.seeds
        total = sum(1 for _ in run.grid.labels()) + 1 + len(PICKED) * len(picks) + 2 * len(laps) + 3
        task = bar.add_task("arm", total=total)
        step = lambda: bar.advance(task)  # noqa: E731

        def piece(parts: Parts, name: str, make: Callable[[], Arrays]) -> Arrays:
            found = parts.load(name)
            if found is None:
                parts.save(name, make())
                found = parts.load(name)
            if found is None:
                raise StoreError(f"to read back {name} in {parts.folder}", "something else", "run it again")
            step()
            return found

        bar.update(task, description="ten executions")
        study.run_study(run.arm, run.grid, parts, step, wait)
        data = study.assemble(run.arm, run.grid, parts)
        bar.update(task, description="pick and place")
        rates = piece(picking, "pick-rates", lambda: pick.lifting_rates(run.task))
        rate = pick.lowest(rates)
        picked = {
            x: [piece(picking, f"pick-{x}-{s}", lambda x=x, s=s: pick.pick_and_place(run.task, rate, x, s)) for s in picks]
            for x in PICKED
        }
        bar.update(task, description="with and without a load")
        lapped = {
            told: [piece(lapping, f"laps-{told}-{s}", lambda s=s, t=told: limits.two_laps(run.laps, t, s)) for s in laps]
            for told in (False, True)
        }
        bar.update(task, description="real time")
        trained = piece(parts, "trained", lambda: study.trained(run.arm, run.grid))
        write_bytes(out / FEEDFORWARD, study.deployed(run.arm, trained))
        loop = piece(parts, "latency", lambda: {"rows": np.array(json.dumps(latency(out / FEEDFORWARD, run.rounds)))})
        bar.update(task, description="gap workflow")
        report = piece(finding, "gap", lambda: {"report": np.array(json.dumps(hidden.find(run.logged, out / "gap")))})
    result = {
        "ranking": ranking(data),
        "falls": falls(data),
        "pick": {"rate": rate, "lifted": rates["lifted"].tolist(), "rates": rates["rates"].tolist()}
        | {
            name: {source: [p[name].tolist() for p in runs] for source, runs in picked.items()}
            for name in ("feedback_mse", "path_error", "path_peak")
        },
        "limits": {"told" if told else "untold": [x["feedback_mse"].tolist() for x in found] for told, found in lapped.items()},
        "latency": json.loads(str(loop["rows"])),
        "gap": json.loads(str(report["report"])),
        "about": provenance() | {"revision": revision(), "title": "The robot experiments on a simulated arm"},
    }
    _write(out, run, data, result)
    return result | {"data": data, "picked": picked, "lapped": lapped}


def _write(out: Path, run: ArmRun, data: xr.Dataset, result: dict[str, Any]) -> None:
    data.attrs |= result["about"] | {"study": json.dumps(run.arm.to_dict())}
    packed = {str(name): {"zlib": True, "shuffle": True} for name in data.data_vars}
    write_bytes(out / "arm_conditions.nc", bytes(data.to_netcdf(engine="h5netcdf", encoding=packed)))
    headline = headline_of(data)
    write_bytes(out / "arm.nc", bytes(headline.to_netcdf(engine="h5netcdf", encoding=packed)))
    write_bytes(out / "arm.json", json.dumps(result, indent=1).encode())
    write_bytes(out / "ranking.md", (as_text(result["ranking"]) + "\n").encode())


def headline_of(data: xr.Dataset) -> xr.Dataset:
    """One condition: causal accelerations where there are any, the noise nearest to a good encoder's; dims (source, seed, …)."""
    acceleration = HEADLINE[0] if HEADLINE[0] in data.acceleration.values else data.acceleration.values[0]
    return data.sel(acceleration=acceleration).sel(noise=HEADLINE[1], method="nearest")


def _progress(quiet: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), disable=quiet, speed_estimate_period=600)
