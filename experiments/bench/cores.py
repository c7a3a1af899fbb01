"""All cores against one on the same list of chunks: as devices of one process, and as one process
each.

Each way computes the same learning runs, compiled beforehand; the ways take turns. jaxidl uses the
first: one program for all devices is also what several accelerators need, and one process has one
progress bar, one lock and one compilation.
"""

import json
import os
import subprocess
import sys

from common import arguments, machine, report

CORES = (
    sorted(os.sched_getaffinity(0))
    if hasattr(os, "sched_getaffinity")
    else list(range(os.cpu_count() or 1))
)
ITERATIONS = 5


def child(devices: int, chunks: int) -> None:
    """Compile, say so, and at each line of the standard input compute the chunks and print the
    seconds taken.
    """
    import time

    import jax

    from jaxidl.backend import choose_devices
    from jaxidl.jobs.points import points
    from jaxidl.jobs.programs import Chunk, dispatch
    from jaxidl.paper.grid import Grid
    from jaxidl.paper.runs import LearningRun
    from jaxidl.paper.study import PaperStudy

    choose_devices(devices)
    jax.config.update("jax_enable_x64", True)
    grid = Grid(
        ("pid",),
        ("low", "high"),
        (5e-4, 8e-4),
        (5.0,),
        (5.0,),
        (20,),
        tuple(range(1, 1 + devices)),
        ("indirect",),
    )
    # 4 on each device
    at, job = list(points(grid.dims())), LearningRun(PaperStudy(), ITERATIONS).job()
    chunk = Chunk(job.kind(at[0]), at, len(at))
    run = lambda: jax.block_until_ready(dispatch(job, chunk, devices, 1))
    run()
    print("ready", flush=True)
    for _ in sys.stdin:
        began = time.perf_counter()
        for _ in range(chunks):
            run()
        print(time.perf_counter() - began, flush=True)


class Way:
    """Child processes that compute together, each on its own cores."""

    def __init__(self, groups: list[list[int]], chunks: int):
        self.children = []
        for cores in groups:
            code = (
                f"import os; os.sched_setaffinity(0, {cores}); import cores;"
                f" cores.child({len(cores)}, {chunks})"
            )
            folder = os.path.dirname(os.path.abspath(__file__))
            command = [sys.executable, "-c", code]
            self.children.append(
                subprocess.Popen(
                    command,
                    cwd=folder,
                    text=True,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    bufsize=1,
                )
            )
        for process in self.children:
            assert self._line(process) == "ready"

    def seconds(self) -> float:
        """One round: the time of the slowest."""
        for process in self.children:
            assert process.stdin is not None
            process.stdin.write("go\n")
        return max(json.loads(self._line(process)) for process in self.children)

    @staticmethod
    def _line(process: subprocess.Popen) -> str:
        assert process.stdout is not None
        return process.stdout.readline().strip()

    def close(self) -> None:
        for process in self.children:
            process.communicate()


def main() -> None:
    options = arguments(__doc__ or "", rounds=7, chunks=2)
    count = len(CORES)
    ways = {
        "one core": Way([CORES[:1]], options.chunks * count),
        f"{count} devices of one process": Way([CORES], options.chunks),
        f"{count} processes": Way([[core] for core in CORES], options.chunks),
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(options.rounds):
        for name, way in ways.items():
            seconds[name].append(way.seconds())
    for way in ways.values():
        way.close()
    table = []
    for name, values in seconds.items():
        ratios = sorted(a / b for a, b in zip(seconds["one core"], values, strict=True))
        middle = len(ratios) // 2
        table.append(
            {
                "way": name,
                "seconds": sorted(values)[middle],
                "x one core": ratios[middle],
                "least": ratios[0],
                "most": ratios[-1],
            }
        )
    runs = 4 * options.chunks * count
    title = f"{runs} learning runs of {ITERATIONS} executions, medians of {options.rounds} rounds"
    report(title, table, options.json, machine=machine())


if __name__ == "__main__":
    main()
