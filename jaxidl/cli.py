"""The command line: ``jaxidl simulate | sweep | figures | claims | reproduce | ablate | tune | arm | gap | …``.

Anything a user can get wrong ends in one line on the standard error and status 2; Ctrl-C in one line and status 130.
"""

import contextlib
import functools
import io
import itertools
import os
import re
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NoReturn

import tyro
from tyro.conf import arg

from jaxidl import __version__
from jaxidl.backend import choose_devices, keep_programs
from jaxidl.bench import run_benchmarks
from jaxidl.cli_ablate import ablate
from jaxidl.cli_arm import arm
from jaxidl.cli_gap import gap, gap_benchmark
from jaxidl.cli_tune import tune
from jaxidl.errors import ConfigurationError, JaxidlError
from jaxidl.files import write_bytes
from jaxidl.learning.paper import CONTROLLERS, GAINS, PaperStudy
from jaxidl.learning.sources import SOURCES
from jaxidl.sweep.grid import NOISE_LEVELS, QUICK, Grid
from jaxidl.sweep.launch import STOP, run_sweep
from jaxidl.sweep.results import added, read
from jaxidl.sweep.simulate import Request
from jaxidl.sweep.simulate import simulate as run_simulation
from jaxidl.sweep.verdicts import as_json, as_markdown, as_table, check_claims

Names = tuple[str, ...]
Floats = tuple[float, ...]
Integers = tuple[int, ...]


def simulate(
    *,
    out: Annotated[Path, arg(metavar="TRACE.npz")],
    controller: Annotated[str, arg(metavar="pid|doomed")],
    gain: Annotated[str, arg(metavar="low|high")],
    friction: float = 5.0,
    stiction: float = 5.0,
    noise: float = 5e-4,
    seed: int = 1,
    standard_normal: Annotated[Path | None, arg(metavar="Z.npy")] = None,
    source: Annotated[str | None, arg(metavar="indirect|direct|joint")] = None,
    iterations: int | None = None,
    epochs: int = 20,
) -> None:
    """One execution of the paper's point mass in float64, or one whole learning run when --source is given.

    Args:
        out: where the trace goes: arrays (1000, 2) named q, qd, q_sensing, qd_sensing, qdd_desired, qdd_actual, tau,
            tau_inverse_desired, tau_inverse_actual, tau_feedback, tau_feedback_applied, tau_feedforward; of a learning run as
            (iterations, 1000, 2), and q_error, feedback_applied, qdd_error, torque, finite as (iterations,).
        controller: feedback law, pid or doomed.
        gain: low or high.
        friction: friction level f; the paper has 5 and 8.
        stiction: stiction level s; the paper has 5 and 8.
        noise: sensing noise scale [m].
        seed: run seed; its noise is the reference program's own stream.
        standard_normal: file of (1000, 2) or (iterations, 1000, 2) draws to use instead of the seed's.
        source: data source to learn from: indirect, direct or joint.
        iterations: executions of the learning run (default: 20).
        epochs: training epochs of each iteration.
    """
    run_simulation(
        Request(controller, gain, friction, stiction, noise, seed, standard_normal, source, iterations, epochs),
        out,
    )
    print(f"wrote {out}")


def sweep(
    *,
    out: Annotated[Path, arg(metavar="RESULTS.nc")],
    controllers: Annotated[Names, arg(metavar="pid|doomed ...")] = CONTROLLERS,
    gains: Annotated[Names, arg(metavar="low|high ...")] = GAINS,
    noise: Annotated[Floats | None, arg(metavar="SIGMA ...")] = None,
    noise_levels: Annotated[str, arg(metavar="program|printed")] = "program",
    friction: Annotated[Floats, arg(metavar="F ...")] = (5.0, 8.0),
    stiction: Annotated[Floats, arg(metavar="S ...")] = (5.0, 8.0),
    epochs: Annotated[Integers, arg(metavar="N ...")] = (20, 50),
    seeds: Annotated[Integers, arg(metavar="N ...")] = tuple(range(1, 11)),
    sources: Annotated[Names, arg(metavar="indirect|direct|joint ...")] = tuple(SOURCES),
    iterations: int = 20,
    train_on: Annotated[str, arg(metavar="true_state|sensed_state")] = "true_state",
    devices: int | None = None,
    runs_per_device: int | None = None,
    width: int | None = None,
    cluster: Annotated[str | None, arg(metavar="ADDRESS|local")] = None,
    overwrite: bool = False,
) -> None:
    """Run a grid of learning runs; continue where an interrupted one stopped.

    Args:
        out: where the results go; unfinished ones wait in RESULTS.nc.parts beside it.
        controllers: feedback laws.
        gains: gain settings.
        noise: sensing noise scales [m].
        noise_levels: the four noise scales of the reference program, or those printed in the paper; --noise overrides.
        friction: friction levels.
        stiction: stiction levels.
        epochs: training epochs of each iteration.
        seeds: run seeds.
        sources: data sources.
        iterations: executions of each learning run.
        train_on: the state that the networks are trained on.
        devices: how many CPU cores or accelerators to use (default: all).
        runs_per_device: runs of one chunk on each, a chunk being what an interruption can lose; 4 on a CPU, 320 on a GPU.
        width: runs side by side in a device's program (default: 1 on a CPU, a whole chunk on a GPU).
        cluster: a Ray cluster to run on (needs `pip install 'jaxidl[cluster]'`); --out must lie in a folder that it shares.
        overwrite: begin anew; what lies at --out is kept as RESULTS.nc.old.
    """
    if noise_levels not in NOISE_LEVELS:
        raise ConfigurationError("--noise-levels program or printed", repr(noise_levels), "choose one of them")
    levels = NOISE_LEVELS[noise_levels] if noise is None else noise
    grid = Grid(controllers, gains, levels, friction, stiction, epochs, seeds, sources, iterations)
    study = PaperStudy(train_on=train_on)
    choose_devices(devices)
    run_sweep(grid, out, study, devices=devices, per_device=runs_per_device, width=width, cluster=cluster, overwrite=overwrite)
    print(f"wrote {out}")


def figures(results: Annotated[Path, tyro.conf.Positional], /, *, out: Annotated[Path, arg(metavar="DIR")]) -> None:
    """Draw the study's figures, or an ablation's, from stored results.

    Args:
        results: a results file of `jaxidl sweep` or `jaxidl ablate`.
        out: folder for the PNG and PDF files.
    """
    from jaxidl.plot.ablation import draw_ablation  # matplotlib: slow to import, and only needed here
    from jaxidl.plot.figures import draw_all

    data = read(results)
    for path in draw_ablation(data, out, results.stem) if added(data) else draw_all(data, out):
        print(f"wrote {path}")


def claims(results: Annotated[Path, tyro.conf.Positional], /, *, json: bool = False, markdown: bool = False) -> None:
    """Check the paper's statements against stored results.

    Args:
        results: a results file of `jaxidl sweep`.
        json: print JSON instead of a table.
        markdown: print a Markdown table.
    """
    rows = check_claims(read(results))
    print(as_json(rows) if json else as_markdown(rows) if markdown else as_table(rows))


def reproduce(*, quick: bool = False, out: Path = Path("out"), devices: int | None = None, overwrite: bool = False) -> None:
    """The paper's whole simulation study: sweep, then figures and claims.

    Args:
        quick: one seed of the lowest and highest noise: minutes instead of hours.
        out: folder; results, figures and claims go into its subfolder "study", or "quick".
        devices: how many CPU cores or accelerators to use (default: all).
        overwrite: begin anew; the old results are kept beside the new ones.
    """
    choose_devices(devices)
    folder = out / ("quick" if quick else "study")
    run_sweep(QUICK if quick else Grid(), folder / "study.nc", devices=devices, overwrite=overwrite)
    report(folder / "study.nc", folder)


def bench(
    names: Annotated[Names, tyro.conf.Positional, arg(metavar="NAME ...")] = (), /, *, out: Path = Path("out/bench")
) -> None:
    """Measure this machine: training step, control step, cores, growth, compilation, gradients, gap finding, reliability.

    Args:
        names: which benchmarks (default: all): training_step, control_step, configuration, cores, growth, compilation,
            gradients, gap, arm, real_time, reliability.
        out: folder for one JSON file of each.
    """
    run_benchmarks(names, out)


def report(results: Path, out: Path) -> None:
    """Figures, claims.json and the table of claims from a results file into ``out``."""
    from jaxidl.plot.figures import draw_all

    data = read(results)
    paths = draw_all(data, out)
    rows = check_claims(data)
    write_bytes(out / "claims.json", (as_json(rows) + "\n").encode())
    print(as_table(rows))
    print(f"results in {results}, {len(paths)} figures and claims.json in {out}")


COMMANDS = {
    "simulate": simulate,
    "sweep": sweep,
    "figures": figures,
    "claims": claims,
    "reproduce": reproduce,
    "ablate": ablate,
    "tune": tune,
    "arm": arm,
    "gap": gap,
    "gap-benchmark": gap_benchmark,
    "bench": bench,
}


def main(arguments: list[str] | None = None) -> int:
    """Run one command; return its exit status."""
    STOP.clear()
    if isinstance(sys.stdout, io.TextIOWrapper):  # a file name that the terminal cannot show is no reason to fail
        sys.stdout.reconfigure(errors="backslashreplace")
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    keep_programs()
    try:
        run = _parse(sys.argv[1:] if arguments is None else arguments)
        if run is not None:
            run()
            sys.stdout.flush()
    except JaxidlError as error:
        print(f"jaxidl: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # the reader, `head` for one, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except BaseException:
        if not STOP.is_set():
            raise
        _leave()
    return 0


def _stop(*_: object) -> None:
    """Signal handler: the first signal ends the command at the next safe place, the second one at once."""
    if STOP.is_set():
        _leave()
    STOP.set()
    raise KeyboardInterrupt


def _leave() -> NoReturn:
    print(
        "jaxidl: interrupted; what is finished of a sweep or benchmark is saved, and the same command continues", file=sys.stderr
    )
    sys.stderr.flush()
    sys.stdout.flush()
    os._exit(130)  # without waiting for the chunk in flight


def _parse(arguments: list[str]) -> Callable[[], None] | None:
    """The command to run with its values, or None where help was asked for."""
    if arguments == ["--version"]:
        return lambda: print(f"jaxidl {__version__}")

    def later(command: Callable[..., None]) -> Callable[..., Callable[[], None]]:
        @functools.wraps(command)
        def bound(*args: Any, **values: Any) -> Callable[[], None]:
            return functools.partial(command, *args, **values)

        return bound

    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            return tyro.extras.subcommand_cli_from_dict(
                {name: later(command) for name, command in COMMANDS.items()},
                prog="jaxidl",
                description="Learn inverse dynamics; reproduce the study of the two data sources; "
                "find what a simulation is missing.",
                args=arguments,
            )
    except SystemExit as stop:
        if not stop.code:
            return None
        raise _unboxed(complaint.getvalue(), arguments) from None


def _unboxed(box: str, arguments: list[str]) -> ConfigurationError:
    """tyro explains in a framed box of several lines; ours is one line: what stands between the title and the next ruler.

    Where the terminal's encoding has no frames, a ruler stands below the title, too.
    """
    lines = [line.strip("│| \t") for line in box.splitlines()[1:]]
    ruler = re.compile(r"[─+-]*").fullmatch
    message = itertools.takewhile(lambda line: not ruler(line), itertools.dropwhile(ruler, lines))
    known = arguments[0] if arguments and arguments[0] in COMMANDS else ""
    remedy = f"see `jaxidl {known} --help`".replace("  ", " ")
    return ConfigurationError("a command line that can be understood", " ".join(message), remedy)


if __name__ == "__main__":
    sys.exit(main())
