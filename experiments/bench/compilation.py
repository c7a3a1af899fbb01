"""Programs and seconds of compilation for the whole grid, and how long a command takes cold and
with programs kept.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import arguments, machine, report

SWEEP = (
    "--controllers pid --gains low --noise 5e-4 --friction 5 --stiction 5 --epochs 1 --seeds 1"
    " --executions 2"
)


def child() -> None:
    """Compile every program that the whole grid needs; print how many compilations XLA made of
    them, and the seconds.
    """
    import jax

    from jaxidl.backend import choose_devices
    from jaxidl.jobs.points import points
    from jaxidl.jobs.programs import chunks, layout, program
    from jaxidl.paper.grid import Grid
    from jaxidl.paper.runs import LearningRun
    from jaxidl.paper.study import PaperStudy

    choose_devices(None)
    jax.config.update("jax_enable_x64", True)
    compiled: list[str] = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, _, **about: (
            compiled.append(str(about)) if event.endswith("backend_compile_duration") else None
        )
    )
    grid, plan = Grid(), layout(None, None, None)
    job = LearningRun(PaperStudy(), grid.executions).job()
    first = {
        chunk.kind: chunk
        for chunk in chunks(list(points(grid.dims())), job, plan.devices, plan.per_device)
    }
    began = time.perf_counter()
    for kind, chunk in first.items():
        program(job.run, kind, plan.devices, plan.width).lower(job.traced(chunk.padded())).compile()
    seconds = time.perf_counter() - began
    print(json.dumps([len(first), sum("share" in name for name in compiled), seconds, len(grid)]))


def compile_all(cache: Path) -> tuple[int, int, float, int]:
    folder = os.path.dirname(os.path.abspath(__file__))
    environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(cache)}
    code = [sys.executable, "-c", "import compilation; compilation.child()"]
    return json.loads(
        subprocess.run(
            code, cwd=folder, env=environment, capture_output=True, text=True, check=True
        ).stdout
    )


def command(out: Path, cache: Path) -> float:
    """Wall time of a tiny `jaxidl sweep` of all three sources: start-up, three programs and the
    example's.
    """
    environment = os.environ | {
        "JAX_COMPILATION_CACHE_DIR": str(cache),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.3",
    }
    words = [sys.executable, "-m", "jaxidl", "sweep", "--out", str(out), *SWEEP.split()]
    began = time.perf_counter()
    subprocess.run(words, env=environment, capture_output=True, check=True)
    return time.perf_counter() - began


def main() -> None:
    options = arguments(__doc__ or "", rounds=3)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kinds, count, cold, runs = compile_all(folder / "all")
        _, _, warm, _ = compile_all(folder / "all")
        pairs = [
            (
                command(folder / f"{k}-cold.nc", folder / f"{k}"),
                command(folder / f"{k}-warm.nc", folder / f"{k}"),
            )
            for k in range(options.rounds)
        ]
    start = [sorted(column)[len(pairs) // 2] for column in zip(*pairs, strict=True)]
    table = [
        {
            "what": f"all {kinds} programs of the grid, tracing included",
            "cold [s]": cold,
            "kept [s]": warm,
            "x": cold / warm,
        },
        {
            "what": "a tiny sweep, from the prompt to the file",
            "cold [s]": start[0],
            "kept [s]": start[1],
            "x": start[0] / start[1],
        },
    ]
    title = f"{runs} learning runs need {count} compilations"
    report(
        title, table, options.json, machine=machine(), compilations=count, seconds_each=cold / kinds
    )


if __name__ == "__main__":
    main()
