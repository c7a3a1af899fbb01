"""The full grid on the GPUs of one host: seconds to compile, seconds to run, memory, and what TF32
would change.

    python experiments/bench/gpu_grid.py [--json FILE] [--per-device 320] [--seeds 10]
    [--profile 0]

Networks are computed in full single precision. Tensor cores would round products' inputs to 10 bits
(TF32) unless told not to; the last rows compare both on the same runs, before training has
amplified the difference and after. ``--profile 1`` leaves a trace of one chunk in the folder
``gpu_profile``.
"""

import sys
import time

import jax
import numpy as np
from common import arguments, machine, report

from jaxidl.jobs.points import points
from jaxidl.jobs.programs import Chunk, Job, chunks, layout, program, without_padding
from jaxidl.paper import runs
from jaxidl.paper.grid import Grid
from jaxidl.paper.study import PaperStudy

jax.config.update("jax_enable_x64", True)


def whole_grid(job: Job, grid: Grid, plan, profile: bool) -> tuple[float, float, int]:
    """Seconds of compilation, of everything else, and the number of chunks."""
    todo = list(chunks(list(points(grid.dims())), job, plan.devices, plan.per_device))
    began, compiled = time.perf_counter(), {}
    for chunk in todo:
        if chunk.kind not in compiled:
            run = program(job.run, chunk.kind, plan.devices, plan.width)
            compiled[chunk.kind] = run.lower(job.traced(chunk.padded())).compile()
    compiling, began = time.perf_counter() - began, time.perf_counter()
    for index, chunk in enumerate(todo):
        inputs = job.traced(chunk.padded())
        if profile and index == len(todo) // 2:
            with jax.profiler.trace("gpu_profile"):
                jax.block_until_ready(compiled[chunk.kind](inputs))
        else:
            without_padding(compiled[chunk.kind](inputs), chunk)
        print(
            f"\rchunk {index + 1}/{len(todo)}, {time.perf_counter() - began:.0f} s",
            end="",
            file=sys.stderr,
        )
    print(file=sys.stderr)
    return compiling, time.perf_counter() - began, len(todo)


def precision_rows(study: PaperStudy) -> list[dict]:
    """The same 32 runs in TF32 and in full single precision: relative difference of q_error at
    three executions.
    """
    grid = Grid(
        ("pid",),
        friction=(5.0,),
        stiction=(5.0,),
        epochs=(20,),
        seeds=(1, 2, 3, 4),
        sources=("joint",),
    )
    at, job = list(points(grid.dims())), runs.LearningRun(study, grid.executions).job()
    chunk = Chunk(job.kind(at[0]), at, len(at))
    found = {}
    for precision in (runs.MATMUL_PRECISION, "tensorfloat32"):
        runs.MATMUL_PRECISION = precision
        program.cache_clear()
        run = program(job.run, chunk.kind, 1, len(at))
        found[precision] = without_padding(run(job.traced(at)), chunk)["q_error"]
    full, tf32 = found.values()
    return [
        {
            "what": f"TF32, execution {k}: median relative change of q_error",
            "figure": float(np.median(abs(tf32 / full - 1)[:, k])),
        }
        for k in (1, 5, grid.executions - 1)
    ]


def main() -> int:
    options = arguments(__doc__ or "", per_device=320, seeds=10, profile=0)
    if jax.default_backend() != "gpu":
        print(
            f"gpu_grid.py: expected a GPU; got {jax.default_backend()}; install jax[cuda] on a"
            " machine that has one",
            file=sys.stderr,
        )
        return 2
    study, grid = PaperStudy(), Grid(seeds=tuple(range(1, 1 + options.seeds)))
    plan = layout(None, options.per_device, None)
    job = runs.LearningRun(study, grid.executions).job()
    kinds = len(set(map(job.kind, points(grid.dims()))))
    compiling, running, count = whole_grid(job, grid, plan, bool(options.profile))
    memory = (jax.devices()[0].memory_stats() or {}).get("peak_bytes_in_use", 0) / 2**30
    table = [
        {
            "what": f"compilation of {kinds} programs [s]",
            "figure": compiling,
        },
        {"what": f"{len(grid)} learning runs in {count} chunks [s]", "figure": running},
        {"what": "peak memory of the first GPU [GiB]", "figure": memory},
        *precision_rows(study),
    ]
    report(
        f"The grid on {plan.devices} GPU(s), {plan.per_device} runs on each",
        table,
        options.json,
        machine=machine(),
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
