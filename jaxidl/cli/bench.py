"""``jaxidl bench``: the benchmarks of ``experiments/bench``, each in a process of its own."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import tyro
from tyro.conf import arg

from jaxidl.errors import JaxidlError, needs_checkout, one_of

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "bench"
BENCHMARKS = (
    "training_step",
    "control_step",
    "configuration",
    "cores",
    "growth",
    "compilation",
    "gradients",
    "gap",
    "excite",
    "arm",
    "real_time",
    "c_step",
    "reliability",
)


class BenchmarkError(JaxidlError):
    """A benchmark did not come to its end."""


def bench(
    names: Annotated[
        tuple[str, ...],
        tyro.conf.Positional,
        arg(metavar="NAME ...", help_behavior_hint="(default: all)"),
    ] = (),
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out/bench"),
) -> None:
    """Measure speed and reliability on this machine: training step, control step, cores, growth,
    compilation, gradients, gap finding, …

    Args:
        names: benchmarks to run: training_step, control_step, configuration, cores,
            growth, compilation, gradients, gap, excite, arm, real_time, c_step, reliability.
        out: folder for one JSON file for each benchmark.
    """
    run_benchmarks(names, out)


def run_benchmarks(names: tuple[str, ...], out: Path) -> None:
    """Run the named benchmarks, or all if none is named, one after the other: tables on the
    terminal, NAME.json in ``out``.

    Raises:
        ConfigurationError: for an unknown name, or where the package is installed without its
            ``experiments``.
        BenchmarkError: if one fails.
    """
    for name in names:
        if name not in BENCHMARKS:
            raise one_of("benchmark", name, BENCHMARKS)
    if not FOLDER.is_dir():
        raise needs_checkout("the folder experiments/bench")
    for name in names or BENCHMARKS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        done = subprocess.run(
            [sys.executable, FOLDER / f"{name}.py", "--json", out.resolve() / f"{name}.json"],
            check=False,
        )
        if done.returncode:
            got = f"exit status {done.returncode}"
            raise BenchmarkError(
                f"benchmark {name} to succeed",
                got,
                f"see its output, or run {FOLDER.name}/{name}.py alone",
            )
