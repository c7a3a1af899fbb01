"""All experiments on the arm, one after the other; what is finished stays, and an interrupted run continues."""

import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jaxidl.arm import EXPERIMENTS, hidden, limits, pick, study
from jaxidl.arm.found import as_text as gap_as_text
from jaxidl.arm.real_time import latency
from jaxidl.arm.table import as_text, falls, ranking
from jaxidl.errors import StoreError, one_of
from jaxidl.files import as_json, write_bytes
from jaxidl.gap.diagnosis import Diagnosis
from jaxidl.learning.arm import ArmStudy
from jaxidl.models import Training
from jaxidl.sweep.launch import STOP
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

    def settings(self) -> dict[str, Any]:
        """What each experiment's results are results of, ready for JSON; more seeds or noise levels may join them later."""
        without = lambda settings: {k: v for k, v in asdict(settings).items() if k != "seeds"}  # noqa: E731
        study = self.identity()
        pick, laps, logged = without(self.task), without(self.laps), without(self.logged)
        found = {"study": study, "pick": pick, "limits": laps, "latency": study | {"rounds": self.rounds}, "gap": logged}
        return json.loads(json.dumps(found))


def quick(run: ArmRun) -> ArmRun:
    """The same in minutes: two seeds, one noise level, four executions, less training, a shorter log."""
    arm = replace(run.arm, training=Training(epochs=12, batch=256))
    logged = replace(run.logged, goals=16)
    return ArmRun(arm, study.QUICK, pick.quick(run.task), limits.quick(run.laps), logged, 3000)


Keep = Callable[[Diagnosis, Path], object]


class Job:
    """Pieces of a run: computed if they are not there, and counted; ``say`` is told what is being done."""

    def __init__(self, run: ArmRun, out: Path, parts: Parts, step: Callable[[], None], say: Callable[[str], None], keep: Keep):
        self.run, self.out, self.parts, self.step, self.say, self.keep = run, out, parts, step, say, keep

    def piece(self, name: str, make: Callable[[], Arrays], of: Mapping[str, Any] | None = None) -> Arrays:
        """The piece ``name``, which the study determines, or else the settings ``of``."""
        parts = self.parts if of is None else self.parts.of({**of, "precision": PRECISION})
        found = parts.load(name)
        if found is None:
            if STOP.is_set():
                raise KeyboardInterrupt
            parts.save(name, make())
            found = parts.load(name)
        if found is None:
            raise StoreError(f"to read back {name} in {parts.folder}", "something else", "run it again")
        self.step()
        return found

    def study(self) -> dict[str, Any]:
        """Ten executions for every source, noise and kind of acceleration."""
        study.run_study(self.run.arm, self.run.grid, self.parts, self.step)
        data = study.assemble(self.run.arm, self.run.grid, self.parts)
        return {"ranking": ranking(data), "falls": falls(data), "data": data}

    def pick(self) -> dict[str, Any]:
        """Pick and place at the lowest rate that lifts the tool."""
        task = self.run.task
        rates = self.piece("pick-rates", lambda: pick.lifting_rates(task), pick.identity(task, 1.0))
        rate, found = pick.lowest(rates), {}
        of = pick.identity(task, rate)
        for source in PICKED:
            make = lambda seed, source=source: pick.pick_and_place(task, rate, source, seed)  # noqa: E731
            found[source] = [self.piece(f"pick-{source}-{s}", partial(make, s), of) for s in task.seeds]
        numbers = {
            name: {source: [p[name].tolist() for p in runs] for source, runs in found.items()}
            for name in ("feedback_mse", "path_error", "path_peak", "finite")
        }
        return {"rate": rate, "lifted": rates["lifted"].tolist(), "rates": rates["rates"].tolist(), "runs": found} | numbers

    def limits(self) -> dict[str, Any]:
        """Two laps, with and without a load, for a network that is told and one that is not."""
        laps, found, finite = self.run.laps, {}, {}
        of = limits.identity(laps)
        for told in (False, True):
            name = "told" if told else "untold"
            pieces = [self.piece(f"laps-{told}-{s}", partial(limits.two_laps, laps, told, s), of) for s in laps.seeds]
            found[name], finite[name] = ([x[key].tolist() for x in pieces] for key in ("feedback_mse", "finite"))
        return found | {"finite": finite}

    def latency(self) -> list[dict[str, Any]]:
        """A trained feedforward as a file, and its time at 1 kHz."""
        of = f"{min(self.run.grid.noise)!r}-{self.run.grid.seeds[0]}"
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
        find = partial(hidden.find, logged, self.out / "gap", self.keep, lambda what, share: self.say(f"gap: {what}"))
        of = {"logged": asdict(logged), "arm": logged.study().to_dict()}
        found = self.piece("gap", lambda: {"report": np.array(json.dumps(find()))}, of)
        return json.loads(str(found["report"]))


def run_all(
    run: ArmRun,
    out: Path,
    experiments: tuple[str, ...] = EXPERIMENTS,
    quiet: bool = False,
    keep: Keep = lambda found, folder: None,
) -> dict[str, Any]:
    """Compute what ``out`` does not hold yet, and write ``arm.nc``, ``arm_conditions.nc``, ``arm.json`` and tables.

    ``keep`` writes the report of a diagnosis into a folder: :func:`jaxidl.report.save`.

    Returns:
        What each of the ``experiments`` found, and ``about``: versions, command, revision.

    Raises:
        ConfigurationError: for an unknown experiment.
        StoreError: when another process is at work there, it cannot be written, or it holds results of other settings.
        KeyboardInterrupt: finished pieces are saved; the same call continues.
    """
    for name in experiments:
        if name not in EXPERIMENTS:
            raise one_of("experiment", name, EXPERIMENTS)
    earlier, settings = _earlier(out), run.settings()
    for name in experiments:
        if earlier["settings"].get(name, settings[name]) != settings[name]:
            raise StoreError(f"results of the same settings in {out}", f"others of {name}", "choose another --out")
    runs = sum(1 for _ in run.grid.labels())
    counts = {
        "study": runs,
        "pick": 1 + len(PICKED) * len(run.task.seeds),
        "limits": 2 * len(run.laps.seeds),
        "latency": 2,
        "gap": 1,
    }
    result: dict[str, Any] = {}
    code = revision()  # as it is now: the code on disk may change while this runs
    with jax.enable_x64(True), Parts(out / "parts", run.identity()) as parts, _progress(quiet) as bar:
        task = bar.add_task("", total=sum(counts[name] for name in experiments))
        say = lambda what: bar.update(task, description=what)  # noqa: E731
        job = Job(run, out, parts, partial(_step, bar, task, quiet), say, keep)
        for name in dict.fromkeys(experiments):
            say(name)
            result[name] = getattr(job, name)()
    result["about"] = provenance() | {"revision": code, "title": "The robot experiments on a simulated arm"}
    _write(out, run, result)
    return result


def _step(bar: Progress, task: TaskID, quiet: bool) -> None:
    """One piece more; a log file, which has no moving bar, is told as a line."""
    bar.advance(task)
    if not (bar.console.is_terminal or quiet):
        now = bar.tasks[0]
        print(f"{now.completed:.0f}/{now.total:.0f} pieces done ({now.description})", file=sys.stderr, flush=True)


def _write(out: Path, run: ArmRun, result: dict[str, Any]) -> None:
    files: dict[str, bytes] = {}
    if "study" in result:
        data = result["study"]["data"]
        data.attrs |= result["about"] | {"study": json.dumps(run.arm.to_dict())}
        packed = {str(name): {"zlib": True, "shuffle": True} for name in data.data_vars}
        files["arm_conditions.nc"] = bytes(data.to_netcdf(engine="h5netcdf", encoding=packed))
        files["arm.nc"] = bytes(headline_of(data).to_netcdf(engine="h5netcdf", encoding=packed))
        files["ranking.md"] = (as_text(result["study"]["ranking"]) + "\n").encode()
    if "gap" in result:
        files["gap.md"] = (gap_as_text(result["gap"]) + "\n").encode()
    bulky, made = {"data", "runs"}, _earlier(out)
    for name in EXPERIMENTS:
        if name in result:
            found = result[name]
            made[name] = {k: v for k, v in found.items() if k not in bulky} if isinstance(found, dict) else found
            made["settings"][name], made["about"][name] = run.settings()[name], result.get("about", {})
    files["arm.json"] = as_json(made).encode()
    for name, content in files.items():
        write_bytes(out / name, content)


def _earlier(out: Path) -> dict[str, Any]:
    """What experiments have left in ``arm.json``, each with its own settings and what it was made by."""
    try:
        found = json.loads((out / "arm.json").read_text())
        if isinstance(found["settings"], dict) and isinstance(found["about"], dict):
            return found
    except (OSError, ValueError, LookupError, TypeError):
        pass
    return {"settings": {}, "about": {}}


def headline_of(data: xr.Dataset) -> xr.Dataset:
    """One condition: causal accelerations where there are any, the noise nearest to a good encoder's; dims (source, seed, …)."""
    acceleration = HEADLINE[0] if HEADLINE[0] in data.acceleration.values else data.acceleration.values[0]
    nearest = int(np.argmin(np.abs(data.noise.values - HEADLINE[1])))
    return data.sel(acceleration=acceleration).isel(noise=nearest)


def _progress(quiet: bool) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    return Progress(*columns, console=Console(stderr=True), disable=quiet, speed_estimate_period=600)
