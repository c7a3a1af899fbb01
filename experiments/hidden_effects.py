"""A log to try ``jaxidl gap`` on: a pendulum whose bearing rubs and whose motor is late, unknown to
the model.

``python experiments/hidden_effects.py FOLDER`` writes ``log.csv`` and ``model.xml``. The data come
from the benchmark's engine: plain MuJoCo at a step ten times finer than the log's, with encoder
noise and quantisation.
"""

import sys
from pathlib import Path

import numpy as np

from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import run
from jaxidl.gap.benchmark.mechanisms import MECHANISMS

HIDDEN = [
    make("coulomb_friction", 0, {"level": 0.3}),
    make("actuator_delay", 0, {"delay": 0.016}),
]


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    columns = run(MECHANISMS["pendulum"], HIDDEN, 7).log()
    table = np.column_stack(list(columns.values()))
    np.savetxt(
        folder / "log.csv", table, fmt="%.8g", delimiter=",", header=",".join(columns), comments=""
    )
    (folder / "model.xml").write_text(MECHANISMS["pendulum"])
    print(f"wrote {folder / 'log.csv'} and {folder / 'model.xml'}; try")
    print(f"jaxidl gap {folder / 'log.csv'} --model {folder / 'model.xml'} --out report")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "demo"))
