"""Wall time and peak memory of the command `jaxidl sweep` as the number of configurations
doubles.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import arguments, machine, report

AXES = (
    "--controllers pid --gains low high --noise 5e-4 8e-4 --friction 5 --stiction 5 --epochs 20"
    " --sources indirect"
)


def sweep(folder: Path, seeds: int, executions: int) -> tuple[float, float]:
    """Seconds and peak memory [MB] of one command with 4 · seeds configurations."""
    words = [
        *AXES.split(),
        "--executions",
        str(executions),
        "--seeds",
        *map(str, range(1, seeds + 1)),
    ]
    command = [
        sys.executable,
        "-m",
        "jaxidl",
        "sweep",
        "--out",
        str(folder / f"{seeds}.nc"),
        *words,
    ]
    environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": str(folder / "programs")}
    began = time.perf_counter()
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit("the sweep failed")
    return time.perf_counter() - began, usage.ru_maxrss / 1024


def main() -> None:
    options = arguments(__doc__ or "", doublings=4, executions=6)
    table: list[dict] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sweep(folder, 2, options.executions)  # compiles
        (folder / "2.nc").unlink()
        for seeds in [2 * 2**k for k in range(1 + options.doublings)]:
            seconds, memory = sweep(folder, seeds, options.executions)
            before = table[-1]["seconds"] if table else None
            ratio = seconds / before if before else None
            table.append(
                {
                    "configurations": 4 * seeds,
                    "seconds": seconds,
                    "x half as many": ratio,
                    "peak memory [MB]": memory,
                }
            )
    title = (
        f"`jaxidl sweep`, start-up included, {options.executions} executions of each learning run"
    )
    report(title, table, options.json, machine=machine())


if __name__ == "__main__":
    main()
