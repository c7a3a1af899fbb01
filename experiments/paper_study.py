"""The paper's simulation study from Python, in its quick form: declare the grid, run it, draw,
check.

What ``jaxidl reproduce --quick`` does. Change an axis, or any number of ``PaperStudy``, to ask a
question of your own: ``python experiments/paper_study.py FOLDER``.
"""

import os
import sys
from pathlib import Path

import jax

from jaxidl import Grid, PaperStudy, check_claims, run_sweep
from jaxidl.paper.verdicts import as_table
from jaxidl.plot.figures import draw_all


def main(folder: Path) -> None:
    results = run_sweep(Grid.quick(), folder / "quick.nc", PaperStudy())
    draw_all(results, folder)
    print(as_table(check_claims(results)))


if __name__ == "__main__":
    # one device a core, before the first computation
    jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out"))
