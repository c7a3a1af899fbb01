"""The command ``jaxidl sweep``."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, arg

from jaxidl.cli.arguments import optional
from jaxidl.cli.options import Options
from jaxidl.errors import ConfigurationError
from jaxidl.paper.grid import NOISE_LEVELS, Axes, Grid


def sweep(
    axes: Annotated[Axes, OmitArgPrefixes],
    running: Annotated[Options, OmitArgPrefixes],
    *,
    out: Annotated[Path, arg(metavar="RESULTS.nc")] = Path("out/sweep.nc"),
    noise_levels: Annotated[str | None, optional("program|printed", "program")] = None,
    train_on: Annotated[str, arg(metavar="true_state|sensed_state")] = "true_state",
    guard: bool = False,
    schedule: bool = False,
) -> None:
    """Run a grid of learning runs; continue where an interrupted one stopped.

    Args:
        axes: values of the grid.
        running: how the sweep is run.
        out: file of the results; unfinished ones are kept in RESULTS.nc.parts beside it.
        noise_levels: use the four noise scales of the reference program, or those that the paper
            prints, instead of --noise.
        train_on: the state that the networks are trained on.
        guard: limit learned torques to the range of their data, and fade them out where the robot
            strays from the desired trajectory.
        schedule: let the applied gains fall, down to a quarter, while tracking stays close to that
            of the best execution, and raise them again where the robot strays.
    """
    from jaxidl.backend import choose_devices  # JAX: not for a help text
    from jaxidl.paper.runs import run_sweep
    from jaxidl.paper.study import PaperStudy

    if noise_levels is not None:
        if noise_levels not in NOISE_LEVELS:
            raise ConfigurationError(
                "--noise-levels program or printed", repr(noise_levels), "choose one of them"
            )
        if axes.noise is not Axes.noise:  # what was given may equal the default
            raise ConfigurationError("--noise or --noise-levels", "both", "leave out one of them")
        axes = replace(axes, noise=NOISE_LEVELS[noise_levels])
    grid = Grid(**vars(axes))
    study = PaperStudy(
        train_on=train_on, guard="on" if guard else "off", schedule="on" if schedule else "off"
    )
    choose_devices(running.devices)
    run_sweep(grid, out, study, **running.keywords())
    print(f"wrote {out}")
