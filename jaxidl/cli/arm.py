"""The command ``jaxidl arm``."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from jaxidl.arm import EXPERIMENTS
from jaxidl.cli.arguments import optional


def arm(
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out/arm"),
    quick: bool = False,
    overwrite: bool = False,
    seeds: Annotated[tuple[int, ...] | None, optional("N ...", "1 to 5")] = None,
    noise: Annotated[tuple[float, ...] | None, optional("SIGMA ...", "1e-6 1e-5 1e-4")] = None,
    executions: Annotated[int | None, optional("N", "10")] = None,
    experiments: Annotated[
        tuple[str, ...], arg(metavar="study|pick|limits|latency|gap ...")
    ] = EXPERIMENTS,
) -> None:
    """Run the paper's robot experiments on a simulated seven-joint arm.

    The same command continues an interrupted run.

    Args:
        out: folder for arm.nc, arm_conditions.nc, arm.json, ranking.md, gap.md, the feedforward for
            a robot, and the figures.
        quick: two seeds, one noise level, four executions and less training: takes minutes.
        overwrite: start again; existing results at --out are kept as DIR.old.
        seeds: run seeds of the study.
        noise: encoder noise scales of the study [rad].
        executions: number of executions of each learning run of the study.
        experiments: experiments to run; the others can be added to the same folder later.
    """
    from jaxidl.arm import run as arms  # mujoco: slow to import, and only needed here
    from jaxidl.arm.table import as_text
    from jaxidl.backend import choose_devices
    from jaxidl.jobs.pieces import set_aside
    from jaxidl.plot.arm_report import write_arm_figures
    from jaxidl.report import save

    choose_devices(None)
    if overwrite:
        set_aside(out, ("arm.json", "parts", "study.nc.parts"))
    run = arms.quick(arms.ArmRun()) if quick else arms.ArmRun()
    given = {"seeds": seeds, "noise": noise, "executions": executions}
    run = replace(
        run,
        grid=replace(
            run.grid, **{name: value for name, value in given.items() if value is not None}
        ),
    )
    result = arms.run_all(run, out, experiments, keep=save)
    for path in write_arm_figures(run, result, out):
        print(f"wrote {path}")
    if "study" in result:
        print(as_text(result["study"]["ranking"]))
