"""Many runs in one program: ``lax.map`` over runs, ``vmap`` inside it, shards over devices outside;
and runs in chunks.

A chunk is the unit of computing, of saving, and of what an interruption can lose.
"""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np
from jax.sharding import Mesh, PartitionSpec

from jaxidl.backend import compiler_options
from jaxidl.errors import ConfigurationError
from jaxidl.jobs.points import Point, Value
from jaxidl.stop import STOP

RUNS_PER_DEVICE = {"cpu": 4, "gpu": 320}  # of one chunk
# what one program is compiled for: the values on the static axes
Kind = tuple[tuple[str, Value], ...]
Arrays = dict[str, np.ndarray]
T = TypeVar("T")


class Job(NamedTuple):
    """What is computed at each point.

    ``run`` is a pure JAX function of one keyword argument for each axis, and of what ``inputs``
    makes on the host of a point's values; it returns a mapping of names to arrays, of the same
    shapes at all points. It must be hashable; runs that are equal share programs. A program is
    compiled for each combination of values on the axes ``static``, which arrive as they are; all
    others arrive as arrays.
    """

    run: Callable[..., Mapping[str, Any]]
    static: frozenset[str] = frozenset()
    inputs: Callable[[Mapping[str, Any]], Mapping[str, Any]] | None = None

    def kind(self, point: Point) -> Kind:
        """Return the static half of a point."""
        return tuple((name, value) for name, value in point if name in self.static)

    def traced(self, points: Sequence[Point]) -> Arrays:
        """Return the traced half of R points, leaves (R, ...); what ``inputs`` returns counts, and
        hides an axis of its name.
        """
        rows = [
            {name: np.asarray(value) for name, value in at if name not in self.static}
            | (
                {}
                if self.inputs is None
                else {name: np.asarray(value) for name, value in self.inputs(dict(at)).items()}
            )
            for at in points
        ]
        return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


class Layout(NamedTuple):
    """How a chunk is spread: over devices, runs on each, and runs side by side in each one's
    program.
    """

    devices: int
    per_device: int
    width: int


class Chunk(NamedTuple):
    """Runs of one kind, computed by one call of one program."""

    kind: Kind
    points: list[Point]
    size: int  # of the program; the rest is padding
    last: bool = False  # of its kind

    def padded(self) -> list[Point]:
        return [*self.points, *[self.points[-1]] * (self.size - len(self.points))]


def layout(
    devices: int | None,
    per_device: int | None,
    width: int | None,
    kind: str | None = None,
    present: int | None = None,
) -> Layout:
    """Return the layout as asked, else what suits devices of this ``kind`` ("cpu", "gpu", …), of
    which ``present`` are there.

    A CPU core works on one run at a time, whose weights then stay in its cache; a GPU on as many as
    a chunk has.

    Args:
        devices: how many to use.
        per_device: runs of a chunk on each.
        width: of these, how many side by side.
        kind, present: (default: those of this process).

    Raises:
        ConfigurationError: for a number below one or more devices than there are.
    """
    kind, present = kind or jax.default_backend(), present or len(jax.devices())
    devices = present if devices is None else devices
    per_device = RUNS_PER_DEVICE.get(kind, 320) if per_device is None else per_device
    width = (1 if kind == "cpu" else per_device) if width is None else width
    for name, value, most in (
        ("devices", devices, present),
        ("per-device", per_device, 10**6),
        ("width", width, per_device),
    ):
        if not 1 <= value <= most:
            raise ConfigurationError(
                f"--{name} between 1 and {most}", str(value), "correct it or leave it out"
            )
    return Layout(devices, per_device, width)


def chunks(points: Sequence[Point], job: Job, devices: int, per_device: int) -> Iterator[Chunk]:
    """Yield runs of one kind together, in the order given; every chunk of a kind has the same size,
    so it compiles once.
    """
    totals = Counter(map(job.kind, points))
    sizes = {
        kind: devices * min(per_device, -(-count // devices)) for kind, count in totals.items()
    }
    waiting: dict[Kind, list[Point]] = defaultdict(list)
    for at in points:
        kind = job.kind(at)
        waiting[kind].append(at)
        totals[kind] -= 1
        if len(waiting[kind]) == sizes[kind] or totals[kind] == 0:
            yield Chunk(kind, waiting.pop(kind), sizes[kind], last=totals[kind] == 0)


@cache
def program(
    run: Callable[..., Mapping[str, Any]], kind: Kind, devices: int = 1, width: int = 1
) -> Any:
    """Return the compiled-on-first-use program of one kind: traced halves of R points -> arrays
    with leaves (R, ...).

    R is a multiple of ``devices``. Each device maps over its share, ``width`` runs at a time side
    by side: 1 keeps a run's numbers in a core's cache, a GPU wants as many as fit. With the same
    ``width`` results are the same bit for bit on one kind of device whatever the share, since the
    compiled loop body is the same.
    """
    return mapped(lambda one: dict(run(**dict(kind), **one)), devices, width)


def mapped(one: Callable[[Any], Any], devices: int, width: int = 1) -> Any:
    """Return the compiled-on-first-use program that maps ``one`` over R rows, a multiple of
    ``devices``, each a share.
    """
    mesh = Mesh(np.array(jax.devices()[:devices]), ("runs",))
    split = PartitionSpec("runs")

    def share(rows: Any) -> Any:
        return jax.lax.map(one, rows, batch_size=None if width == 1 else width)

    shards = jax.shard_map(share, mesh=mesh, in_specs=split, out_specs=split, check_vma=False)
    return jax.jit(shards, compiler_options=compiler_options())


def dispatch(job: Job, chunk: Chunk, devices: int, width: int) -> dict[str, Any]:
    """Start computing a chunk on this process's devices: arrays with leaves (size, ...), perhaps
    not ready yet.
    """
    return program(job.run, chunk.kind, devices, width)(job.traced(chunk.padded()))


def without_padding(found: Mapping[str, Any], chunk: Chunk) -> Arrays:
    """Return arrays on the host, leaves (R, ...)."""
    return {name: np.asarray(leaf)[: len(chunk.points)] for name, leaf in found.items()}


def wait(arrays: T) -> T:
    """Wait for what a dispatched program returns in a way that Ctrl-C can end."""
    while not all(leaf.is_ready() for leaf in jax.tree.leaves(arrays)):
        if STOP.is_set():
            raise KeyboardInterrupt
        time.sleep(0.02)
    return arrays
