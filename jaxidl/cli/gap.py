"""The commands ``jaxidl gap`` and ``jaxidl gap-benchmark``."""

import importlib.util
import os
from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import arg

from jaxidl.cli.arguments import Names, optional
from jaxidl.cli.plugins import load
from jaxidl.errors import ConfigurationError, needs_checkout

_FAMILIES = ("single", "none", "pair", "outside", "robot", "worn")


def gap(
    logs: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        arg(metavar="LOG ...", help_behavior_hint="(required)"),
    ],
    /,
    *,
    model: Annotated[Path, arg(metavar="ROBOT.xml")],
    out: Annotated[Path, arg(metavar="DIR")] = Path("gap"),
    held_out: float = 0.3,
    min_gain: float = 0.05,
    reference: Annotated[tuple[Path, ...], optional("OLD ...")] = (),
    effects: Annotated[Names, optional("NAME ...", "all of the catalogue")] = (),
    exclude: Annotated[Names, optional("NAME ...")] = (),
    plugin: Annotated[Names, optional("FILE.py ...")] = (),
    refine: bool = False,
    joints: Annotated[Names, optional("NAME ...", "those that the log names, or all")] = (),
    columns: Annotated[Names, optional("KEY=TITLE ...")] = (),
    motor: Annotated[Path | None, optional("FILE.yaml")] = None,
    torque_constant: Annotated[tuple[float, ...], optional("NM/A ...")] = (),
    gear_ratio: Annotated[tuple[float, ...], optional("RATIO ...")] = (),
    topic: Annotated[str | None, optional("NAME")] = None,
    flange: Annotated[str | None, optional("BODY", "the last that moves")] = None,
) -> None:
    """Find what a simulation is missing: compare a log with a model, name the missing effects, and
    show how much they improve the model.

    Args:
        logs: CSV, NPZ or Parquet with columns time, q0..., tau0...; optional qd*, qdd*, run. Other
            titles are understood if they can mean one thing only. ROS bags with joint states if
            rosbags is installed. Several files are several runs.
        model: MJCF or URDF, with its joints in the order of the log's columns, unless these have
            the joints' names. The effects.json beside it is read, too, if it belongs to this model.
        out: folder for report.html, report.json, figures, and the corrected model.xml with its
            effects.json.
        held_out: share of each run, at its end, that takes no part in fitting and searching.
        min_gain: share of the remaining error that an effect must remove to be reported.
        reference: an earlier log of the same robot. Only what has changed since is reported, not
            what both logs have in common.
        effects: look for these effects only.
        exclude: do not look for these effects.
        plugin: Python files or modules with effects of your own, under @jaxidl.effects.register.
        refine: also fit the parameters to trajectories, and keep them if the simulation then
            follows motion kept aside more closely.
        joints: diagnose only these joints of the model; the others are locked.
        columns: which column is which: q0=actual_q_0, or 'q=actual_q_*' for all joints; KEY is
            time, run, q, qd, qdd, tau or i.
        motor: YAML file that describes how joints follow from motors: torque_constant, gear_ratio,
            coupling, offset, motor_positions.
        torque_constant: torque per current of the motors, if the log has their currents (columns
            i0...) instead of torques; one for all or one per joint.
        gear_ratio: ratio of the gears, if the log has currents or torques of motors; one for all or
            one per joint.
        topic: topic to read, if a ROS bag has several with joint states.
        flange: body of the model on which to look for a payload.
    """
    from jaxidl.gap.inputs import read_inputs
    from jaxidl.gap.result.verdict import designed
    from jaxidl.gap.workflow import diagnose  # mujoco: slow to import, and only needed here
    from jaxidl.jobs.progress import Bar
    from jaxidl.report import check_folder, save, table

    if refine and reference:
        raise ConfigurationError(
            "--refine or --reference",
            "both",
            "find what changed first, then refine the corrected model",
        )
    for name in plugin:
        load(name)
    check_folder(out, model)
    given: dict[str, Any] = {
        "joints": joints,
        "columns": columns,
        "motor": motor,
        "torque_constant": torque_constant,
        "gear_ratio": gear_ratio,
        "topic": topic,
        "flange": flange,
    }
    with Bar("reading", transient=True) as bar:
        log, robot = read_inputs(logs, model, **given)
        old = read_inputs(reference, model, **given).log if reference else None
        found = diagnose(
            log,
            robot,
            reference=old,
            held_out=held_out,
            effects=effects or None,
            exclude=exclude,
            min_gain=min_gain,
            watch=lambda what, share: bar.at(share, what),
        )
        if refine:
            bar.at(0.0, "fitting to motion")
            found = found.refined()
        bar.at(1.0, "writing the report")
        page = save(found, out)
    print(table(found))
    if found.doubtful:
        print(f"the motion that would settle it: {designed(model, out, found.questioned)}")
    print(f"report in {page}")


def gap_benchmark(
    *,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out/gap-benchmark"),
    families: Annotated[Names, arg(metavar="single|none|pair|outside|robot ...")] = _FAMILIES,
    severities: Annotated[Names, arg(metavar="weak|medium|clear ...")] = (
        "weak",
        "medium",
        "clear",
    ),
    every: int = 1,
    every_robot: Annotated[int | None, optional("N", "as --every")] = None,
    root: int = 2026,
    processes: Annotated[int | None, optional("N", "one per core")] = None,
    overwrite: bool = False,
) -> None:
    """Hide effects in simulated mechanisms and robots, diagnose them, and score the answers. The
    same command continues an interrupted run.

    Args:
        out: folder for the cases, their reports, benchmark.json, the confusion matrix and the
            reliability diagram.
        families: kinds of cases: one hidden effect, none, two, one that the catalogue lacks, whole
            robots, worn robots.
        severities: how strong single effects are.
        every: take only each n-th case of each kind.
        every_robot: the same for whole robots, which take much longer.
        root: number from which all cases follow. The workflow is developed with 2026 and with some
            others that the documentation names.
        processes: number of cases that are computed at a time.
        overwrite: start again; existing results at --out are kept as DIR.old.
    """
    if importlib.util.find_spec("jaxidl.gap.benchmark") is None:
        raise needs_checkout("the benchmark's engine")
    from jaxidl.gap.benchmark.run import run_benchmark
    from jaxidl.jobs.pieces import set_aside
    from jaxidl.plot.confusion import write_confusion
    from jaxidl.plot.reliability import write_reliability

    if overwrite:
        set_aside(out, ("root.json",))
    count = processes or os.cpu_count() or 1
    score = run_benchmark(out, families, severities, every, count, root, every_robot)
    for path in (*write_confusion(score, out), *write_reliability(score, out)):
        print(f"wrote {path}")
