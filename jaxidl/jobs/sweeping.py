"""A sweep: a function of its point on labelled axes, run at all of them, from beginning to end and
in spite of interruptions.
"""

import functools
import inspect
import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import xarray as xr

from jaxidl.errors import ConfigurationError
from jaxidl.files import plain
from jaxidl.jobs.cluster import Cluster
from jaxidl.jobs.points import Point, Value, axes_of, point, points
from jaxidl.jobs.programs import (
    Chunk,
    Job,
    Kind,
    Layout,
    chunks,
    dispatch,
    layout,
    program,
    wait,
    without_padding,
)
from jaxidl.jobs.progress import Bar
from jaxidl.jobs.provenance import device, provenance, revision
from jaxidl.jobs.results import Origin, Variable, assemble, read
from jaxidl.jobs.store import Store
from jaxidl.stop import STOP

# whose programs stay in memory; with some 90 of them LLVM runs out of memory maps
KINDS_AT_ONCE = 24
RESERVED = ("identity", "points", "origin", "digest")  # names of what a part holds beside the runs


def sweep(
    run_one: Callable[..., Mapping[str, Any]],
    axes: Mapping[str, Sequence[Value]],
    out: Path | str,
    *,
    static: Sequence[str] = (),
    inputs: Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None,
    settings: Mapping[str, Any] | None = None,
    variables: Mapping[str, Variable] | None = None,
    coords: Mapping[str, Any] | None = None,
    also: Callable[[], xr.Dataset] = xr.Dataset,
    alike: Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None,
    cost: Callable[[Mapping[str, Any]], float] = lambda kind: 1.0,
    about: Mapping[str, str] | None = None,
    devices: int | None = None,
    per_device: int | None = None,
    width: int | None = None,
    cluster: str | None = None,
    overwrite: bool = False,
    quiet: bool = False,
) -> xr.Dataset:
    """Run ``run_one`` at every combination of values that ``out`` does not hold yet; write the
    results there and return them.

    Finished chunks are safe at once: after an interruption the same call continues, and a later
    call with more values on an axis computes these only. Results do not depend on ``per_device``,
    the order or interruptions, bit for bit on one kind of hardware. With other ``devices`` recorded
    averages may differ in the last bit (XLA sums them in another order). ``width``, the runs side
    by side in one device's program, may change last bits, too; the file records it. Everything runs
    in 64-bit mode.

    Args:
        run_one: a pure JAX function with one keyword argument for each axis (and for what
            ``inputs`` adds) that returns a mapping of names to arrays, of the same shapes at all
            points. Equal ones, such as frozen dataclasses, share programs.
        axes: values by name. An axis ``seed`` is the slowest.
        out: results file, ``.nc``; unfinished runs wait in ``out.parts`` beside it.
        static: axes whose values choose a program instead of being traced: sizes, and numbers that
            Python branches on. Axes of text are static unless ``inputs`` makes arrays of them.
        inputs: makes arrays on the host of a point's values by name: draws, indices. A name of an
            axis replaces its value.
        settings: all else that determines a result, ready for JSON; results of other settings are
            refused, not mixed.
        variables: names of each array's own dims, units and descriptions (default: found from a
            trial of shapes).
        coords: of the dims that variables have of their own.
        also: makes variables that are written into the same file, when all runs are done.
        alike: values by name of the point whose run stands for another one's as well, which is not
            computed.
        cost: relative time of a run with these static values, for the progress bar.
        about: attributes of the file, such as its title.
        devices: how many of this process's devices to use (default: all).
        per_device: runs of a chunk on each (default: 4 on a CPU, 320 on a GPU).
        width: of these, how many side by side (default: 1 on a CPU, all on a GPU).
        cluster: address of a Ray cluster, or "local": each of its cores or GPUs works on chunks of
            its own, and ``out`` must lie in a folder that all its machines share.
        overwrite: start again; existing results at ``out`` are kept as ``out.old``.
        quiet: show no progress.

    Returns:
        Dataset with dims (the axes in their order, then each variable's own).

    Raises:
        ConfigurationError: for axes that do not fit ``run_one``, an impossible layout, or no such
            cluster.
        StoreError: see :class:`jaxidl.jobs.store.Store`.
        KeyboardInterrupt: finished chunks are saved; the same call continues.
    """
    axes, out = axes_of(axes), Path(out)
    if cluster is not None and devices is not None:
        raise ConfigurationError(
            "--devices or --cluster", "both", "leave --devices out: the cluster's devices are used"
        )
    texts = {
        name for name, values in axes.items() if any(isinstance(value, str) for value in values)
    }
    with jax.enable_x64(True):
        job = Job(run_one, frozenset(static), inputs)
        first = next(points(axes))
        given = set() if inputs is None else set(inputs(dict(first)))
        job = job._replace(static=frozenset({*static, *(texts - given)}))
        _check(run_one, job, {*axes, *given}, axes)
        variables = variables or _shapes(job, first)
        for name in {*variables, *axes}.intersection(RESERVED):
            raise ConfigurationError(
                "names for axes and variables", name, "choose another name; the file needs this one"
            )
        stands = (
            (lambda at: at) if alike is None else functools.cache(lambda at: point(alike(dict(at))))
        )
        wanted = list(dict.fromkeys(map(stands, points(axes))))
        plan = layout(devices, per_device, width) if cluster is None else None
        identity = json.loads(json.dumps(plain(dict(settings or {}))))
        with Store(out, identity, variables, overwrite, stands) as store:
            if store.holds(wanted):
                return read(out)
            for part in store.damaged:
                print(f"jaxidl: {part} was damaged; its runs are computed again", file=sys.stderr)
            missing = [at for at in wanted if at not in store.runs]
            task = _Task(job, store, missing, len(wanted), cost, quiet)
            if missing and plan is not None:
                task.watch(task.here(plan))
            elif missing:
                with Cluster(str(cluster)) as there:
                    plan = layout(1, per_device, width, there.kind(), 1)
                    task.watch(task.there(plan, there))
            data = assemble(axes, variables, store.runs, stands).assign_coords(dict(coords or {}))
            data = data.merge(also(), combine_attrs="no_conflicts")
            # each of them compiled once
            programs = {"programs": str(len(set(map(job.kind, wanted))))}
            return store.finish(data, wanted, {**provenance(), **programs, **(about or {})})


class _Task(NamedTuple):
    """What is left to do of a sweep."""

    job: Job
    store: Store
    missing: list[Point]
    total: int
    cost: Callable[[Mapping[str, Any]], float]
    quiet: bool

    def here(self, plan: Layout) -> Iterator[Chunk]:
        """Compute chunks on this process's devices; yield each when it is saved."""
        # as they are now: the code on disk may change while this runs
        code, where = revision(), device(plan.width)
        job, missing = self.job, self.missing
        many = len(set(map(job.kind, missing))) > KINDS_AT_ONCE
        if many:  # one kind after the other, and none is kept
            missing = sorted(missing, key=lambda at: str(job.kind(at)))
        for chunk in chunks(missing, job, plan.devices, plan.per_device):
            began = time.monotonic()
            found = wait(dispatch(job, chunk, plan.devices, plan.width))
            self.store.add(
                chunk.points,
                without_padding(found, chunk),
                Origin(code, where, time.monotonic() - began),
            )
            if many and chunk.last:
                program(job.run, chunk.kind, plan.devices, plan.width).clear_cache()
            yield chunk

    def there(self, plan: Layout, cluster: Cluster) -> Iterator[Chunk]:
        """Compute chunks on a cluster, whose tasks save them; yield each when its part is taken
        in.
        """
        for finished in cluster.run(
            self.job, self.missing, plan, self.store.parts, self.store.identity
        ):
            if STOP.is_set():
                raise KeyboardInterrupt
            if finished is not None:
                chunk, part = finished
                self.store.adopt(part)
                yield chunk

    def watch(self, finished: Iterator[Chunk]) -> None:
        """Draw chunks from ``finished`` to its end, and show how far it is."""
        kinds = list(map(self.job.kind, self.missing))
        cost: dict[Kind, float] = {kind: self.cost(dict(kind)) for kind in set(kinds)}
        done = self.total - len(self.missing)
        with Bar("runs", sum(cost[kind] for kind in kinds), quiet=self.quiet) as bar:
            bar.advance(0.0, f"{done}/{self.total}")
            for chunk in finished:
                done += len(chunk.points)
                bar.advance(cost[chunk.kind] * len(chunk.points), f"{done}/{self.total}")


def _check(
    run_one: Callable[..., Any], job: Job, given: set[str], axes: Mapping[str, Sequence[Value]]
) -> None:
    """Refuse axes that are no arguments of the function, and arguments without a value."""
    for name in sorted(job.static - set(axes)):
        raise ConfigurationError(
            "static axes among the axes", name, "name an axis, or leave it out"
        )
    takes = inspect.signature(run_one).parameters.values()
    if not any(p.kind is p.VAR_KEYWORD for p in takes):
        for name in sorted(given - {p.name for p in takes}):
            raise ConfigurationError(
                "axes that are arguments of the function",
                name,
                "add the argument, or drop the axis",
            )
    for p in takes:
        if (
            p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)
            and p.default is p.empty
            and p.name not in given
        ):
            raise ConfigurationError(
                f"an axis for the argument {p.name}", "none", "give it values, or a default"
            )


def _shapes(job: Job, first: Point) -> dict[str, Variable]:
    """Return the variables that a run returns; their own dims are numbered."""
    traced = {
        name: jax.ShapeDtypeStruct(x.shape[1:], x.dtype) for name, x in job.traced([first]).items()
    }
    found = jax.eval_shape(lambda traced: job.run(**dict(job.kind(first)), **traced), traced)
    if not isinstance(found, Mapping) or not all(hasattr(x, "shape") for x in found.values()):
        raise ConfigurationError(
            "a run that returns a mapping of names to arrays",
            f"a {type(found).__name__}",
            'return {"name": array}',
        )
    return {
        name: Variable(tuple(f"{name}_{k}" for k in range(len(leaf.shape))))
        for name, leaf in found.items()
    }
