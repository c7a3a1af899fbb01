"""The full grid on the GPUs of one host: seconds to compile and to run, memory, and how far results
depend on the device and on TF32.

    python experiments/bench/gpu_grid.py [--json FILE] [--per-device N] [--seeds 10] [--chunks 0]
    [--precision 1]

``--chunks 1`` stops after as many chunks; on a machine's CPU (``JAX_PLATFORMS=cpu``) one chunk is
enough to compare. Networks are computed in full single precision. Tensor cores would round
products' inputs to 10 bits (TF32) by default; the last rows compare a GPU in full precision
with itself in TF32 and with the CPU on the same runs: before training has amplified the difference
and after.
"""

import sys
import time
from typing import Any

import jax
import numpy as np
from common import arguments, machine, report

from jaxidl.backend import choose_devices
from jaxidl.jobs.points import points
from jaxidl.jobs.programs import Chunk, Job, Layout, chunks, layout, program, without_padding
from jaxidl.paper import runs
from jaxidl.paper.grid import Grid
from jaxidl.paper.study import PaperStudy

jax.config.update("jax_enable_x64", True)
# of one condition each
PAIRED = Grid(
    ("pid",), friction=(5.0,), stiction=(5.0,), epochs=(20,), seeds=(1,), sources=("joint",)
)


def whole_grid(job: Job, todo: list[Chunk], plan: Layout) -> tuple[list[float], list[float]]:
    """Seconds of each kind's compilation, and of each chunk's run with its inputs and results."""
    compiled: dict[Any, Any] = {}
    compiling, running = [], []
    for index, chunk in enumerate(todo):
        inputs, began = job.traced(chunk.padded()), time.perf_counter()
        if chunk.kind not in compiled:
            run = program(job.run, chunk.kind, plan.devices, plan.width)
            compiled[chunk.kind] = run.lower(inputs).compile()
            compiling.append(time.perf_counter() - began)
        began = time.perf_counter()
        without_padding(compiled[chunk.kind](job.traced(chunk.padded())), chunk)
        running.append(time.perf_counter() - began)
        print(
            f"chunk {index + 1}/{len(todo)}: {sum(compiling):.0f} s compiling, {sum(running):.0f} s"
            " running",
            file=sys.stderr,
        )
    return compiling, running


def precision_rows(study: PaperStudy) -> list[dict[str, Any]]:
    """The same eight runs on the GPU in full precision, in TF32, and on the CPU: relative
    difference of q_error at four executions.
    """
    at, job = list(points(PAIRED.dims())), runs.LearningRun(study, PAIRED.executions).job()
    chunk, rows = Chunk(job.kind(at[0]), at, len(at)), job.traced(at)

    def found(precision: str) -> np.ndarray:
        runs.MATMUL_PRECISION = precision
        program.cache_clear()
        run = program(job.run, chunk.kind, 1, len(at))
        return without_padding(run(rows), chunk)["q_error"]

    full, tf32 = found("float32"), found("tensorfloat32")
    runs.MATMUL_PRECISION = "float32"
    one = lambda row: job.run(**dict(chunk.kind), **row)["q_error"]
    with jax.default_device(jax.devices("cpu")[0]):
        cpu = np.asarray(jax.jit(lambda rows: jax.lax.map(one, rows))(rows))
    return [
        {
            "what": f"{name}, execution {k}: median relative change of q_error",
            "figure": float(np.median(abs(other / full - 1)[:, k])),
        }
        for name, other in (("TF32", tf32), ("the CPU", cpu))
        for k in (0, 1, 5, PAIRED.executions - 1)
    ]


def main() -> None:
    choose_devices(None)
    options = arguments(__doc__ or "", per_device=0, seeds=10, chunks=0, precision=1)
    study, grid = PaperStudy(), Grid(seeds=tuple(range(1, 1 + options.seeds)))
    plan = layout(None, options.per_device or None, None)
    job = runs.LearningRun(study, grid.executions).job()
    todo = list(chunks(list(points(grid.dims())), job, plan.devices, plan.per_device))
    todo = todo[: options.chunks or None]
    compiling, running = whole_grid(job, todo, plan)
    memory = (jax.devices()[0].memory_stats() or {}).get("peak_bytes_in_use", 0) / 2**30
    count = sum(len(chunk.points) for chunk in todo)
    table = [
        {"what": f"compilation of {len(compiling)} programs [s]", "figure": sum(compiling)},
        {"what": f"{count} learning runs in {len(todo)} chunks [s]", "figure": sum(running)},
        {"what": "peak memory of the first GPU [GiB]", "figure": memory},
    ]
    if options.precision and jax.default_backend() != "cpu":
        table += precision_rows(study)
    report(
        f"The grid on {plan.devices} device(s), {plan.per_device} runs on each, {plan.width} side"
        " by side",
        table,
        options.json,
        machine=machine(),
        compiling=compiling,
        running=running,
    )


if __name__ == "__main__":
    main()
