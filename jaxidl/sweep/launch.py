"""Run a grid from beginning to end: chunks, progress, interruption, resumption."""

import json
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jaxidl.errors import ConfigurationError
from jaxidl.learning.iterate import Metrics
from jaxidl.learning.paper import PaperStudy
from jaxidl.sweep.example import example
from jaxidl.sweep.grid import Grid, Label
from jaxidl.sweep.provenance import PRECISION, device, provenance, revision
from jaxidl.sweep.run import Kind, inputs_of, program
from jaxidl.sweep.store import Origin, Store, read

STOP = threading.Event()  # set by a signal handler: a KeyboardInterrupt raised inside JAX's callbacks can get lost
RUNS_PER_DEVICE = {"cpu": 4, "gpu": 320}  # of one chunk; a chunk is what an interruption can lose


class Chunk(NamedTuple):
    """Runs of one kind, computed by one call of one program."""

    kind: Kind
    labels: list[Label]
    size: int  # of the program; the rest is padding

    def padded(self) -> list[Label]:
        return [*self.labels, *[self.labels[-1]] * (self.size - len(self.labels))]


def run_sweep(
    grid: Grid,
    path: Path,
    study: PaperStudy | None = None,
    *,
    devices: int | None = None,
    per_device: int | None = None,
    width: int | None = None,
    overwrite: bool = False,
    quiet: bool = False,
) -> xr.Dataset:
    """Run every configuration of ``grid`` that ``path`` does not hold yet, write the results there and return them.

    Results do not depend on ``per_device``, the order or interruptions, bit for bit on one kind of hardware. With other
    ``devices`` the recorded averages may differ in the last bit (XLA sums them in another order). ``width``, the runs side by
    side in one device's program, may change the last bits of the runs, which training then amplifies; the file records it.

    Raises:
        StoreError: see :class:`jaxidl.sweep.store.Store`.
        KeyboardInterrupt: finished chunks are saved; the same call continues.
    """
    study, path = study or PaperStudy(), Path(path)
    with jax.enable_x64(True):
        devices, per_device, width = layout(devices, per_device, width)
        with Store(path, identity(study, grid), overwrite) as store:
            if store.holds(grid):
                return read(path)
            for part in store.damaged:
                print(f"jaxidl: {part} was damaged; its runs are computed again", file=sys.stderr)
            missing = store.missing(grid)
            if missing:
                with _progress(quiet) as bar:
                    _run_chunks(grid, study, store, missing, bar, devices, per_device, width)
            return store.finish(grid, provenance(), example(study, grid))


def layout(devices: int | None, per_device: int | None, width: int | None) -> tuple[int, int, int]:
    """How many devices, runs on each and runs side by side: as asked, else what suits the kind of device.

    A CPU core works on one run at a time, whose weights then stay in its cache; a GPU on as many as a chunk has.

    Raises:
        ConfigurationError: for a number below one or more devices than there are.
    """
    backend, present = jax.default_backend(), len(jax.devices())
    devices = present if devices is None else devices
    per_device = RUNS_PER_DEVICE.get(backend, 320) if per_device is None else per_device
    width = (1 if backend == "cpu" else per_device) if width is None else width
    for name, value, most in (
        ("devices", devices, present),
        ("runs-per-device", per_device, 10**6),
        ("width", width, per_device),
    ):
        if not 1 <= value <= most:
            raise ConfigurationError(f"--{name} between 1 and {most}", str(value), "mend it or leave it out")
    return devices, per_device, width


def _run_chunks(
    grid: Grid, study: PaperStudy, store: Store, missing: list[Label], bar: Progress, devices: int, per_device: int, width: int
) -> None:
    cost = {kind: _cost(study, kind, grid.iterations) for kind in {Kind.of(label) for label in grid.labels()}}
    left = sum(cost[Kind.of(label)] for label in missing)
    done, said = len(grid) - len(missing), time.monotonic()
    code, where = revision(), device(width)  # as they are now: the code on disk may change while this runs
    task = bar.add_task("learning runs", total=left, count=f"{done}/{len(grid)}")
    for chunk in chunks(missing, devices, per_device):
        began = time.monotonic()
        metrics = _wait(program(study, chunk.kind, devices, width)(inputs_of(chunk.padded(), study, grid.iterations)))
        store.add(chunk.labels, _first(metrics, len(chunk.labels)), Origin(code, where, time.monotonic() - began))
        done += len(chunk.labels)
        if not bar.console.is_terminal and not bar.disable and time.monotonic() > said + 60:  # a log file has no moving bar
            said = time.monotonic()
            print(f"{done}/{len(grid)} learning runs done", file=sys.stderr, flush=True)
        bar.update(task, advance=cost[chunk.kind] * len(chunk.labels), count=f"{done}/{len(grid)}")


def chunks(labels: Sequence[Label], devices: int, per_device: int) -> Iterator[Chunk]:
    """Runs of one kind together, in the order given; every chunk of a kind has the same size, so it compiles once."""
    totals = Counter(Kind.of(label) for label in labels)
    sizes = {kind: devices * min(per_device, -(-count // devices)) for kind, count in totals.items()}
    waiting: dict[Kind, list[Label]] = defaultdict(list)
    for label in labels:
        kind = Kind.of(label)
        waiting[kind].append(label)
        if len(waiting[kind]) == sizes[kind]:
            yield Chunk(kind, waiting.pop(kind), sizes[kind])
    for kind, rest in waiting.items():
        yield Chunk(kind, rest, sizes[kind])


def identity(study: PaperStudy, grid: Grid) -> dict:
    """Everything besides the axes that determines a result."""
    return {"study": settings_of(study), "iterations": grid.iterations, "precision": PRECISION}


def settings_of(study: PaperStudy) -> dict:
    """The study's settings as they stand in a results file."""
    settings = json.loads(json.dumps(study.to_dict()))
    del settings["training"]["epochs"]  # an axis
    return settings


def _cost(study: PaperStudy, kind: Kind, iterations: int) -> float:
    """Training steps of one run, and the executions in the same unit: for the progress bar only."""
    rows = {"indirect": study.steps, "direct": study.steps - 1, "joint": 2 * study.steps - 1}
    train_rows = study.training.train_mask(rows[kind.source]).sum()
    return iterations * (kind.epochs * (train_rows // study.training.batch) + 0.02 * study.steps)


def _first(metrics: Metrics, count: int) -> Metrics:
    """On the host, without the padding."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[:count], metrics)


def _wait(metrics: Metrics) -> Metrics:
    """Wait for a dispatched program in a way that Ctrl-C can end."""
    while not all(leaf.is_ready() for leaf in jax.tree.leaves(metrics)):
        if STOP.is_set():
            raise KeyboardInterrupt
        time.sleep(0.02)
    return metrics


def _progress(quiet: bool) -> Progress:
    columns = [TextColumn("{task.description} {task.fields[count]}"), BarColumn(), TextColumn("{task.percentage:>3.0f}%")]
    times = [TimeElapsedColumn(), TextColumn("elapsed,"), TimeRemainingColumn(), TextColumn("left")]
    return Progress(*columns, *times, console=Console(stderr=True), disable=quiet, speed_estimate_period=600)
