"""All experiments on the arm, one after the other; what is finished stays, and an interrupted run
continues.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr

from jaxidl.arm import EXPERIMENTS, hidden, limits, pick, study
from jaxidl.arm.found import as_text as gap_as_text
from jaxidl.arm.real_time import latency
from jaxidl.arm.setup import ArmStudy
from jaxidl.arm.table import as_text, falls, ranking
from jaxidl.backend import PRECISION
from jaxidl.errors import StoreError, needs_checkout, one_of
from jaxidl.files import as_json, write_bytes
from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.jobs import Pieces
from jaxidl.jobs.pieces import Arrays
from jaxidl.jobs.progress import Bar
from jaxidl.jobs.provenance import provenance, revision
from jaxidl.models import Training
from jaxidl.stop import STOP

FEEDFORWARD = "feedforward.jaxexport"
# data that pick and place learns from: the paper's, and the ones that do best here
PICKED = ("joint", "direct")
# what a robot has: accelerations without the future, and a good encoder
HEADLINE = ("causal", 1e-5)


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
        """Return all that determines a result of the study besides the labels of runs."""
        return {
            "arm": self.arm.to_dict(),
            "iterations": self.grid.executions,
            "precision": PRECISION,
        }

    def settings(self) -> dict[str, Any]:
        """Return the settings that determine each experiment's results, ready for JSON.

        Seeds and noise levels are left out: more of them may join later.
        """
        without = lambda settings: {k: v for k, v in asdict(settings).items() if k != "seeds"}
        study = self.identity()
        pick, laps, logged = without(self.task), without(self.laps), without(self.logged)
        found = {
            "study": study,
            "pick": pick,
            "limits": laps,
            "latency": study | {"rounds": self.rounds},
            "gap": logged,
        }
        return json.loads(json.dumps(found))


def quick(run: ArmRun) -> ArmRun:
    """Return the same run for minutes: two seeds, one noise level, less training, a shorter log."""
    arm = replace(run.arm, training=Training(epochs=12, batch=256))
    logged = replace(run.logged, goals=16)
    return ArmRun(arm, study.QUICK, pick.quick(run.task), limits.quick(run.laps), logged, 3000)


Keep = Callable[[Diagnosis, Path], object]


class Job:
    """Pieces of a run: computed if they are not there, and counted on a bar that says what is being
    done.
    """

    def __init__(self, run: ArmRun, out: Path, pieces: Pieces, bar: Bar, keep: Keep):
        self.run, self.out, self.pieces, self.bar, self.keep = run, out, pieces, bar, keep

    def piece(
        self, name: str, make: Callable[[], Arrays], of: Mapping[str, Any] | None = None
    ) -> Arrays:
        """Return the piece ``name``, computed if need be.

        It is determined by the study or, where given, by the settings ``of``.
        """
        pieces = self.pieces if of is None else self.pieces.of({**of, "precision": PRECISION})
        found = pieces.load(name)
        if found is None:
            if STOP.is_set():
                raise KeyboardInterrupt
            pieces.save(name, make())
            found = pieces.load(name)
        if found is None:
            raise StoreError(
                f"to read back {name} in {pieces.folder}", "something else", "run it again"
            )
        self.bar.advance()
        return found

    def pick(self) -> dict[str, Any]:
        """Pick and place at the lowest rate that lifts the tool."""
        task = self.run.task
        rates = self.piece("pick-rates", lambda: pick.lifting_rates(task), pick.identity(task, 1.0))
        rate, found = pick.lowest(rates), {}
        of = pick.identity(task, rate)
        for source in PICKED:
            make = lambda seed, source=source: pick.pick_and_place(task, rate, source, seed)
            found[source] = [
                self.piece(f"pick-{source}-{s}", partial(make, s), of) for s in task.seeds
            ]
        numbers = {
            name: {source: [p[name].tolist() for p in runs] for source, runs in found.items()}
            for name in ("feedback_mse", "path_error", "path_peak", "finite")
        }
        return {
            "rate": rate,
            "lifted": rates["lifted"].tolist(),
            "rates": rates["rates"].tolist(),
            "runs": found,
        } | numbers

    def limits(self) -> dict[str, Any]:
        """Learn two laps, with and without a load, with and without the load as an input."""
        laps, found, finite = self.run.laps, {}, {}
        of = limits.identity(laps)
        for informed in (False, True):
            name = "informed" if informed else "uninformed"
            pieces = [
                self.piece(f"laps-{informed}-{s}", partial(limits.two_laps, laps, informed, s), of)
                for s in laps.seeds
            ]
            found[name], finite[name] = (
                [x[key].tolist() for x in pieces] for key in ("feedback_mse", "finite")
            )
        return found | {"finite": finite}

    def latency(self) -> list[dict[str, Any]]:
        """Write a trained feedforward as a file, and time it at 1 kHz."""
        of = f"{min(self.run.grid.noise)!r}-{self.run.grid.seeds[0]}"
        weights = self.piece(f"trained-{of}", lambda: study.trained(self.run.arm, self.run.grid))
        file = self.out / FEEDFORWARD
        write_bytes(file, study.deployed(self.run.arm, weights))
        rows = self.piece(
            f"latency-{of}-{self.run.rounds}",
            lambda: {"rows": np.array(json.dumps(latency(file, self.run.rounds)))},
        )
        return json.loads(str(rows["rows"]))

    def gap(self) -> dict[str, Any]:
        """Run the gap workflow on a log of the arm, and compare with what is hidden."""
        logged = self.run.logged
        find = partial(
            hidden.find,
            logged,
            self.out / "gap",
            self.keep,
            lambda what, share: self.bar.advance(0.0, what=f"gap: {what}"),
        )
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
    """Compute what ``out`` does not hold yet, and write ``arm.nc``, ``arm_conditions.nc``,
    ``arm.json`` and tables.

    ``keep`` writes the report of a diagnosis into a folder: :func:`jaxidl.report.save`.

    Returns:
        What each of the ``experiments`` found, and ``about``: versions, command, revision.

    Raises:
        ConfigurationError: for an unknown experiment, or one that needs a checkout.
        StoreError: when another process is at work there, it cannot be written, or it holds results
            of other settings.
        KeyboardInterrupt: finished pieces are saved; the same call continues.
    """
    for name in experiments:
        if name not in EXPERIMENTS:
            raise one_of("experiment", name, EXPERIMENTS)
    if "gap" in experiments and find_spec("jaxidl.gap.benchmark") is None:
        raise needs_checkout("the benchmark's engine, which the experiment gap needs")
    earlier, settings = _earlier(out), run.settings()
    for name in experiments:
        if earlier["settings"].get(name, settings[name]) != settings[name]:
            raise StoreError(
                f"results of the same settings in {out}",
                f"others of {name}",
                "choose another --out",
            )
    counts = {
        "pick": 1 + len(PICKED) * len(run.task.seeds),
        "limits": 2 * len(run.laps.seeds),
        "latency": 2,
        "gap": 1,
    }
    result: dict[str, Any] = {}
    code = revision()  # as it is now: the code on disk may change while this runs
    with jax.enable_x64(True), Pieces(out / "parts", run.identity()) as pieces:
        if "study" in experiments:
            data = study.run_study(run.arm, run.grid, out / "study.nc", run.identity(), quiet)
            result["study"] = {
                "ranking": ranking(data),
                "falls": falls(data),
                "data": study.thinned(data),
            }
        others = [name for name in dict.fromkeys(experiments) if name != "study"]
        if others:
            with Bar("", sum(counts[name] for name in others), quiet=quiet) as bar:
                job = Job(run, out, pieces, bar, keep)
                for name in others:
                    bar.advance(0.0, what=name)
                    result[name] = getattr(job, name)()
    result["about"] = provenance() | {
        "precision": PRECISION,
        "revision": code,
        "title": "The robot experiments on a simulated arm",
    }
    _write(out, run, result)
    return result


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
            made[name] = (
                {k: v for k, v in found.items() if k not in bulky}
                if isinstance(found, dict)
                else found
            )
            made["settings"][name], made["about"][name] = (
                run.settings()[name],
                result.get("about", {}),
            )
    files["arm.json"] = as_json(made).encode()
    for name, content in files.items():
        write_bytes(out / name, content)


def _earlier(out: Path) -> dict[str, Any]:
    """What experiments have left in ``arm.json``, each with its own settings and what it was made
    by.
    """
    try:
        found = json.loads((out / "arm.json").read_text())
        if isinstance(found["settings"], dict) and isinstance(found["about"], dict):
            return found
    except (OSError, ValueError, LookupError, TypeError):
        pass
    return {"settings": {}, "about": {}}


def headline_of(data: xr.Dataset) -> xr.Dataset:
    """Select one condition: causal accelerations and a good encoder's noise, if there.

    Dims (source, seed, …).
    """
    acceleration = (
        HEADLINE[0] if HEADLINE[0] in data.acceleration.values else data.acceleration.values[0]
    )
    nearest = int(np.argmin(np.abs(data.noise.values - HEADLINE[1])))
    return data.sel(acceleration=acceleration).isel(noise=nearest)
