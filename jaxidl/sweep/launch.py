"""Run a grid from beginning to end: chunks, progress, interruption, resumption."""

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import jax
import xarray as xr
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jaxidl.errors import ConfigurationError
from jaxidl.learning.paper import PaperStudy
from jaxidl.learning.vary import check
from jaxidl.sweep.chunks import Chunk, Layout, chunks, dispatch, layout, without_padding
from jaxidl.sweep.cluster import Cluster
from jaxidl.sweep.example import example
from jaxidl.sweep.grid import Grid, Label
from jaxidl.sweep.provenance import PRECISION, device, provenance, revision
from jaxidl.sweep.results import Origin, read
from jaxidl.sweep.run import Kind, program
from jaxidl.sweep.store import Store

T = TypeVar("T")
KINDS_AT_ONCE = 24  # whose programs stay in memory; with some 90 of them LLVM runs out of memory maps


class Flag:
    """Set by a signal handler; without a lock, on which a handler that interrupts another one would wait forever."""

    def __init__(self) -> None:
        self._on = False

    def set(self) -> None:
        self._on = True

    def clear(self) -> None:
        self._on = False

    def is_set(self) -> bool:
        return self._on


STOP = Flag()  # a KeyboardInterrupt raised inside JAX's callbacks can get lost


def run_sweep(
    grid: Grid,
    path: Path,
    study: PaperStudy | None = None,
    *,
    devices: int | None = None,
    per_device: int | None = None,
    width: int | None = None,
    cluster: str | None = None,
    overwrite: bool = False,
    quiet: bool = False,
) -> xr.Dataset:
    """Run every configuration of ``grid`` that ``path`` does not hold yet, write the results there and return them.

    Results do not depend on ``per_device``, the order or interruptions, bit for bit on one kind of hardware. With other
    ``devices`` the recorded averages may differ in the last bit (XLA sums them in another order). ``width``, the runs side by
    side in one device's program, may change the last bits of the runs, which training then amplifies; the file records it.

    With ``cluster``, the address of a Ray cluster or "local", each of its cores or GPUs works on chunks of its own, and
    ``path`` must lie in a folder that all its machines share.

    Raises:
        ConfigurationError: for an impossible layout, no such cluster, or numbers to vary that cannot be.
        StoreError: see :class:`jaxidl.sweep.store.Store`.
        KeyboardInterrupt: finished chunks are saved; the same call continues.
    """
    study, path = study or PaperStudy(), Path(path)
    check(study, grid.vary)
    if cluster is not None and devices is not None:
        raise ConfigurationError("--devices or --cluster", "both", "leave --devices out: the cluster says what it has")
    with jax.enable_x64(True):
        plan = layout(devices, per_device, width) if cluster is None else None
        with Store(path, identity(study, grid), overwrite) as store:
            if store.holds(grid):
                return read(path)
            for part in store.damaged:
                print(f"jaxidl: {part} was damaged; its runs are computed again", file=sys.stderr)
            missing = store.missing(grid)
            if missing and plan is not None:
                _watch(grid, study, missing, quiet, _here(grid, study, store, missing, plan))
            elif missing:
                with Cluster(str(cluster)) as there:
                    plan = layout(1, per_device, width, there.kind(), 1)
                    _watch(grid, study, missing, quiet, _there(grid, study, store, missing, plan, there))
            kinds = {Kind.of(label, study) for label in grid.labels()}
            about = provenance() | {"programs": str(len(kinds))}  # each of them compiled once
            return store.finish(grid, about, xr.Dataset() if grid.vary else example(study, grid))


def _here(grid: Grid, study: PaperStudy, store: Store, missing: list[Label], plan: Layout) -> Iterator[Chunk]:
    """Compute chunks on this process's devices; yield each when it is saved."""
    code, where = revision(), device(plan.width)  # as they are now: the code on disk may change while this runs
    many = len({Kind.of(label, study) for label in missing}) > KINDS_AT_ONCE
    if many:  # one kind after the other, and none is kept
        missing = sorted(missing, key=lambda label: str(Kind.of(label, study)))
    for chunk in chunks(missing, study, plan.devices, plan.per_device):
        began = time.monotonic()
        metrics = wait(dispatch(study, chunk, grid.iterations, plan.devices, plan.width))
        store.add(chunk.labels, without_padding(metrics, chunk), Origin(code, where, time.monotonic() - began))
        if many and chunk.last:
            program(study, chunk.kind, plan.devices, plan.width).clear_cache()
        yield chunk


def _there(grid: Grid, study: PaperStudy, store: Store, missing: list[Label], plan: Layout, cluster: Cluster) -> Iterator[Chunk]:
    """Compute chunks on a cluster, whose tasks save them; yield each when its part is taken in."""
    for finished in cluster.run(study, missing, grid.iterations, plan, store.parts, store.identity):
        if STOP.is_set():
            raise KeyboardInterrupt
        if finished is not None:
            chunk, part = finished
            store.adopt(part)
            yield chunk


def _watch(grid: Grid, study: PaperStudy, missing: list[Label], quiet: bool, finished: Iterator[Chunk]) -> None:
    """Draw chunks from ``finished`` to its end, and show how far it is."""
    kinds = {label: Kind.of(label, study) for label in missing}
    cost = {kind: _cost(study, kind, grid.iterations) for kind in set(kinds.values())}
    left = sum(cost[kind] for kind in kinds.values())
    done, said = len(grid) - len(missing), time.monotonic()
    with progress_bar(quiet) as bar:
        task = bar.add_task("learning runs", total=left, count=f"{done}/{len(grid)}")
        for chunk in finished:
            done += len(chunk.labels)
            if not bar.console.is_terminal and not quiet and time.monotonic() > said + 60:  # a log file has no moving bar
                said = time.monotonic()
                print(f"{done}/{len(grid)} learning runs done", file=sys.stderr, flush=True)
            bar.update(task, advance=cost[chunk.kind] * len(chunk.labels), count=f"{done}/{len(grid)}")


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
    study = kind.study(study)
    rows = {"indirect": study.steps, "direct": study.steps - 1, "joint": 2 * study.steps - 1}
    train_rows = (1 + study.kept) * study.training.train_mask(rows[kind.source]).sum()
    return iterations * (kind.epochs * (train_rows // study.training.batch) + 0.02 * study.steps)


def wait(arrays: T) -> T:
    """Wait for what a dispatched program returns in a way that Ctrl-C can end."""
    while not all(leaf.is_ready() for leaf in jax.tree.leaves(arrays)):
        if STOP.is_set():
            raise KeyboardInterrupt
        time.sleep(0.02)
    return arrays


def progress_bar(quiet: bool) -> Progress:
    """A bar with the time left on the standard error; its tasks say in ``count`` what is done."""
    columns = [TextColumn("{task.description} {task.fields[count]}"), BarColumn(), TextColumn("{task.percentage:>3.0f}%")]
    times = [TimeElapsedColumn(), TextColumn("elapsed,"), TimeRemainingColumn(), TextColumn("left")]
    return Progress(*columns, *times, console=Console(stderr=True), disable=quiet, speed_estimate_period=600)
