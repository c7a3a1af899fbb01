"""The full grid on the GPUs of one host: seconds to compile, seconds to run, memory, and what TF32 would change.

    python experiments/bench/gpu_grid.py [--json FILE] [--runs-per-device 320] [--seeds 10] [--profile 0]

Networks are computed in full single precision. Tensor cores would round products' inputs to 10 bits (TF32) unless told not
to; the last rows compare both on the same runs, before training has amplified the difference and after. ``--profile 1``
leaves a trace of one chunk in the folder ``gpu_profile``.
"""

import sys
import time

import jax
import numpy as np
from common import arguments, machine, report
from jaxidl.sweep import run as programs
from jaxidl.sweep.chunks import Chunk, chunks, layout, without_padding
from jaxidl.sweep.run import inputs_of, program

from jaxidl.paper.grid import Grid
from jaxidl.paper.study import PaperStudy

jax.config.update("jax_enable_x64", True)


def whole_grid(study: PaperStudy, grid: Grid, plan, profile: bool) -> tuple[float, float, int]:
    """Seconds of compilation, of everything else, and the number of chunks."""
    todo = list(chunks(list(grid.labels()), study, plan.devices, plan.per_device))
    began, compiled = time.perf_counter(), {}
    for chunk in todo:
        if chunk.kind not in compiled:
            run = program(study, chunk.kind, plan.devices, plan.width)
            compiled[chunk.kind] = run.lower(inputs_of(chunk.padded(), study, grid.iterations)).compile()
    compiling, began = time.perf_counter() - began, time.perf_counter()
    for index, chunk in enumerate(todo):
        inputs = inputs_of(chunk.padded(), study, grid.iterations)
        if profile and index == len(todo) // 2:
            with jax.profiler.trace("gpu_profile"):
                jax.block_until_ready(compiled[chunk.kind](inputs))
        else:
            without_padding(compiled[chunk.kind](inputs), chunk)
        print(f"\rchunk {index + 1}/{len(todo)}, {time.perf_counter() - began:.0f} s", end="", file=sys.stderr)
    print(file=sys.stderr)
    return compiling, time.perf_counter() - began, len(todo)


def precision_rows(study: PaperStudy, plan) -> list[dict]:
    """The same 32 runs in TF32 and in full single precision: relative difference of q_error at three executions."""
    grid = Grid(("pid",), friction=(5.0,), stiction=(5.0,), epochs=(20,), seeds=(1, 2, 3, 4), sources=("joint",))
    labels = list(grid.labels())
    chunk = Chunk(programs.Kind.of(labels[0], study), labels, len(labels))
    found = {}
    for precision in (programs.MATMUL_PRECISION, "tensorfloat32"):
        programs.MATMUL_PRECISION = precision
        program.cache_clear()
        run = program(study, chunk.kind, 1, len(labels))
        found[precision] = np.asarray(without_padding(run(inputs_of(labels, study, grid.iterations)), chunk).q_error)
    full, tf32 = found.values()
    return [
        {
            "what": f"TF32, execution {k}: median relative change of q_error",
            "figure": float(np.median(abs(tf32 / full - 1)[:, k])),
        }
        for k in (1, 5, grid.iterations - 1)
    ]


def main() -> int:
    options = arguments(__doc__ or "", runs_per_device=320, seeds=10, profile=0)
    if jax.default_backend() != "gpu":
        print(
            f"gpu_grid.py: expected a GPU; got {jax.default_backend()}; install jax[cuda] on a machine that has one",
            file=sys.stderr,
        )
        return 2
    study, grid = PaperStudy(), Grid(seeds=tuple(range(1, 1 + options.seeds)))
    plan = layout(None, options.runs_per_device, None)
    kinds = len({programs.Kind.of(label, study) for label in grid.labels()})
    compiling, running, count = whole_grid(study, grid, plan, bool(options.profile))
    memory = (jax.devices()[0].memory_stats() or {}).get("peak_bytes_in_use", 0) / 2**30
    table = [
        {
            "what": f"compilation of {kinds} programs [s]",
            "figure": compiling,
        },
        {"what": f"{len(grid)} learning runs in {count} chunks [s]", "figure": running},
        {"what": "peak memory of the first GPU [GiB]", "figure": memory},
        *precision_rows(study, plan),
    ]
    report(f"The grid on {plan.devices} GPU(s), {plan.per_device} runs on each", table, options.json, machine=machine())
    return 0


if __name__ == "__main__":
    sys.exit(main())
