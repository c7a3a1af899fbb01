"""One whole configuration of the study, 20 executions with the trainings between them, for each of
the paper's data sources and for weighted data, on one core.

The paper's program needs 127 to 184 core-seconds for the three sources of one 20-epoch
configuration (measured once on a core of the same kind; its software no longer installs beside
ours, so this is the one figure here that is not from the same run).
"""

from common import arguments, in_turns, machine, pin_to_one_core, report

pin_to_one_core()

import time

import jax
import numpy as np

from jaxidl.jobs.points import points
from jaxidl.jobs.programs import program
from jaxidl.learning.sources import SOURCES
from jaxidl.paper.grid import Grid
from jaxidl.paper.runs import LearningRun
from jaxidl.paper.study import PaperStudy

jax.config.update("jax_enable_x64", True)
PAPERS_PROGRAM = (127.0, 184.0)  # [core-seconds]


def main() -> None:
    options = arguments(__doc__ or "", rounds=3, epochs=20)
    grid = Grid(
        ("pid",), ("low",), (5e-4,), (5.0,), (5.0,), (options.epochs,), (1,), sources=SOURCES
    )
    job, calls, compiling = LearningRun(PaperStudy(), grid.executions).job(), {}, {}
    for at in points(grid.dims()):
        inputs, run, source = job.traced([at]), program(job.run, job.kind(at)), dict(at)["source"]
        began = time.perf_counter()
        compiled = run.lower(inputs).compile()
        compiling[source] = time.perf_counter() - began
        calls[source] = lambda compiled=compiled, inputs=inputs: compiled(inputs)
    spent = in_turns(calls, options.rounds)
    seconds = {source: float(np.median(values)) for source, values in spent.items()}
    paper = [source for source in calls if source != "weighted"]
    table = [
        {
            "source": source,
            "core-seconds": seconds[source],
            "over joint, median": float(np.median(spent[source] / spent["joint"])),
            "compilation": compiling[source],
        }
        for source in calls
    ]
    total, made = (sum(each[source] for source in paper) for each in (seconds, compiling))
    whole = {"source": "the paper's three", "core-seconds": total}
    table.append(whole | {"over joint, median": None, "compilation": made})
    times = " to ".join(f"{figure / total:.0f}" for figure in PAPERS_PROGRAM)
    title = (
        f"One configuration, {grid.executions} executions, {options.epochs} epochs, medians of"
        f" {options.rounds} rounds"
    )
    about = {"times_the_papers_program": times} if options.epochs == 20 else {}
    report(title, table, options.json, machine=machine(), **about)


if __name__ == "__main__":
    main()
