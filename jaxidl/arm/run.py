"""All experiments on the arm, one after the other; what is finished stays, and an interrupted run continues."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
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
from jaxidl.errors import StoreError, one_of
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


class Job:
    """Pieces of a run: computed if they are not there, and counted."""

    def __init__(self, run: ArmRun, out: Path, parts: Parts, step: Callable[[], None]):
        self.run, self.out, self.parts, self.step = run, out, parts, step

    def piece(self, name: str, make: Callable[[], Arrays], of: Any = None) -> Arrays:
        """The piece ``name``, which the study determines, or else the settings ``of``."""
        parts = self.parts if of is None else self.parts.of(asdict(of) | {"precision": PRECISION})
        found = parts.load(name)
        if found is None:
            parts.save(name, make())
            found = parts.load(name)
        if found is None:
            raise StoreError(f"to read back {name} in {parts.folder}", "something else", "run it again")
        self.step()
        return found

    def study(self) -> dict[str, Any]:
        """Ten executions for every source, noise and kind of acceleration."""
        study.run_study(self.run.arm, self.run.grid, self.parts, self.step, wait)
        data = study.assemble(self.run.arm, self.run.grid, self.parts)
        return {"ranking": ranking(data), "falls": falls(data), "data": data}

    def pick(self) -> dict[str, Any]:
        """Pick and place at the lowest rate that lifts the tool."""
        task = self.run.task
        rates = self.piece("pick-rates", lambda: pick.lifting_rates(task), task)
        rate, found = pick.lowest(rates), {}
        for source in PICKED:
            make = lambda seed, source=source: pick.pick_and_place(task, rate, source, seed)  # noqa: E731
            found[source] = [self.piece(f"pick-{source}-{s}", partial(make, s), task) for s in task.seeds]
        numbers = {
            name: {source: [p[name].tolist() for p in runs] for source, runs in found.items()}
            for name in ("feedback_mse", "path_error", "path_peak")
        }
        return {"rate": rate, "lifted": rates["lifted"].tolist(), "rates": rates["rates"].tolist(), "runs": found} | numbers

    def limits(self) -> dict[str, Any]:
        """Two laps, with and without a load, for a network that is told and one that is not."""
        laps, found = self.run.laps, {}
        for told in (False, True):
            pieces = [self.piece(f"laps-{told}-{s}", partial(limits.two_laps, laps, told, s), laps) for s in laps.seeds]
            found["told" if told else "untold"] = [x["feedback_mse"].tolist() for x in pieces]
        return found

    def latency(self) -> list[dict[str, Any]]:
        """A trained feedforward as a file, and its time at 1 kHz."""
        of = f"{min(self.run.grid.noise):g}-{self.run.grid.seeds[0]}"
        weights = self.piece(f"trained-{of}", lambda: study.trained(self.run.arm, self.run.grid))
        file = self.out / FEEDFORWARD
        write_bytes(file, study.deployed(self.run.arm, weights))
        rows = self.piece(
            f"latency-{of}-{self.run.rounds}", lambda: {"rows": np.array(json.dumps(latency(file, self.run.rounds)))}
        )
        return json.loads(str(rows["rows"]))

    def gap(self) -> dict[str, Any]:
        """What the gap workflow finds of what is hidden."""
        logged = self.run.logged
        found = self.piece("gap", lambda: {"report": np.array(json.dumps(hidden.find(logged, self.out / "gap")))}, logged)
        return json.loads(str(found["report"]))


EXPERIMENTS = ("study", "pick", "limits", "latency", "gap")
USUAL = EXPERIMENTS[:-1]  # the gap workflow is slow on a log of so many effects


def run_all(run: ArmRun, out: Path, experiments: tuple[str, ...] = USUAL, quiet: bool = False) -> dict[str, Any]:
    """Compute what ``out`` does not hold yet, and write ``arm.nc``, ``arm_conditions.nc`` and ``arm.json``.

    Returns:
        What each of the ``experiments`` found, and ``about``: versions, command, revision.

    Raises:
        ConfigurationError: for an unknown experiment.
        StoreError: when another process is at work there, or it cannot be written.
        KeyboardInterrupt: finished pieces are saved; the same call continues.
    """
    for name in experiments:
        if name not in EXPERIMENTS:
            raise one_of("experiment", name, EXPERIMENTS)
    runs = sum(1 for _ in run.grid.labels())
    counts = {
        "study": runs,
        "pick": 1 + len(PICKED) * len(run.task.seeds),
        "limits": 2 * len(run.laps.seeds),
        "latency": 2,
        "gap": 1,
    }
    result: dict[str, Any] = {}
    with jax.enable_x64(True), Parts(out / "parts", run.identity()) as parts, _progress(quiet) as bar:
        task = bar.add_task("", total=sum(counts[name] for name in experiments))
        job = Job(run, out, parts, lambda: bar.advance(task))
        for name in dict.fromkeys(experiments):
            bar.update(task, description=name)
            result[name] = getattr(job, name)()
    result["about"] = provenance() | {"revision": revision(), "title": "The robot experiments on a simulated arm"}
    _write(out, run, result)
    return result


def _write(out: Path, run: ArmRun, result: dict[str, Any]) -> None:
    if "study" in result:
        data = result["study"]["data"]
        data.attrs |= result["about"] | {"study": json.dumps(run.arm.to_dict())}
        packed = {str(name): {"zlib": True, "shuffle": True} for name in data.data_vars}
        write_bytes(out / "arm_conditions.nc", bytes(data.to_netcdf(engine="h5netcdf", encoding=packed)))
        write_bytes(out / "arm.nc", bytes(headline_of(data).to_netcdf(engine="h5netcdf", encoding=packed)))
        write_bytes(out / "ranking.md", (as_text(result["study"]["ranking"]) + "\n").encode())
    bulky = {"data", "runs"}
    plain = {n: {k: v for k, v in x.items() if k not in bulky} if isinstance(x, dict) else x for n, x in result.items()}
    plain["settings"] = json.loads(json.dumps(run.identity()))
    write_bytes(out / "arm.json", json.dumps(_earlier(out, plain["settings"]) | plain, indent=1).encode())


def _earlier(out: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """What other experiments of the same settings have left in ``arm.json``."""
    try:
        found = json.loads((out / "arm.json").read_text())
        return found if found["settings"] == settings else {}
    except (OSError, ValueError, LookupError, TypeError):
        return {}


def headline_of(data: xr.Dataset) -> xr.Dataset:
    """One condition: causal accelerations where there are any, the noise nearest to a good encoder's; dims (source, seed, …)."""
    acceleration = HEADLINE[0] if HEADLINE[0] in data.acceleration.values else data.acceleration.values[0]
    return data.sel(acceleration=acceleration).sel(noise=HEADLINE[1], method="nearest")


def _progress(quiet: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), disable=quiet, speed_estimate_period=600)
