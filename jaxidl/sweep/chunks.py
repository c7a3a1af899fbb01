"""A grid's runs in chunks: the unit of computing, of saving, and of what an interruption can lose."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import jax
import numpy as np

from jaxidl.errors import ConfigurationError
from jaxidl.learning.iterate import Metrics
from jaxidl.learning.paper import PaperStudy
from jaxidl.sweep.grid import Label
from jaxidl.sweep.run import Kind, inputs_of, program

RUNS_PER_DEVICE = {"cpu": 4, "gpu": 320}  # of one chunk


class Layout(NamedTuple):
    """How a chunk is spread: over devices, runs on each, and runs side by side in each one's program."""

    devices: int
    per_device: int
    width: int


class Chunk(NamedTuple):
    """Runs of one kind, computed by one call of one program."""

    kind: Kind
    labels: list[Label]
    size: int  # of the program; the rest is padding
    last: bool = False  # of its kind

    def padded(self) -> list[Label]:
        return [*self.labels, *[self.labels[-1]] * (self.size - len(self.labels))]


def layout(
    devices: int | None, per_device: int | None, width: int | None, kind: str | None = None, present: int | None = None
) -> Layout:
    """As asked, else what suits devices of this ``kind`` ("cpu", "gpu", …), of which ``present`` are there.

    A CPU core works on one run at a time, whose weights then stay in its cache; a GPU on as many as a chunk has.

    Args:
        kind, present: those of this process unless given.

    Raises:
        ConfigurationError: for a number below one or more devices than there are.
    """
    kind, present = kind or jax.default_backend(), present or len(jax.devices())
    devices = present if devices is None else devices
    per_device = RUNS_PER_DEVICE.get(kind, 320) if per_device is None else per_device
    width = (1 if kind == "cpu" else per_device) if width is None else width
    for name, value, most in (
        ("devices", devices, present),
        ("runs-per-device", per_device, 10**6),
        ("width", width, per_device),
    ):
        if not 1 <= value <= most:
            raise ConfigurationError(f"--{name} between 1 and {most}", str(value), "correct it or leave it out")
    return Layout(devices, per_device, width)


def chunks(labels: Sequence[Label], study: PaperStudy, devices: int, per_device: int) -> Iterator[Chunk]:
    """Runs of one kind together, in the order given; every chunk of a kind has the same size, so it compiles once."""
    totals = Counter(Kind.of(label, study) for label in labels)
    sizes = {kind: devices * min(per_device, -(-count // devices)) for kind, count in totals.items()}
    waiting: dict[Kind, list[Label]] = defaultdict(list)
    for label in labels:
        kind = Kind.of(label, study)
        waiting[kind].append(label)
        totals[kind] -= 1
        if len(waiting[kind]) == sizes[kind] or totals[kind] == 0:
            yield Chunk(kind, waiting.pop(kind), sizes[kind], last=totals[kind] == 0)


def dispatch(study: PaperStudy, chunk: Chunk, iterations: int, devices: int, width: int) -> Metrics:
    """Start computing a chunk on this process's devices: metrics with leaves (size, K), perhaps not ready yet."""
    return program(study, chunk.kind, devices, width)(inputs_of(chunk.padded(), study, iterations))


def without_padding(metrics: Metrics, chunk: Chunk) -> Metrics:
    """On the host: metrics with leaves (R, K)."""
    return jax.tree.map(lambda leaf: np.asarray(leaf)[: len(chunk.labels)], metrics)
