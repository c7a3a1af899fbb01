"""The command ``jaxidl learn``."""

from pathlib import Path
from typing import Annotated, Any

import tyro
from tyro.conf import arg

from jaxidl.cli.arguments import Names, optional
from jaxidl.errors import ConfigurationError

Numbers = tuple[float, ...]


def learn(
    logs: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        arg(metavar="LOG ...", help_behavior_hint="(required)"),
    ],
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    model: Annotated[Path | None, optional("ROBOT.xml", "that of --continue")] = None,
    continued: Annotated[
        Path | None, arg(name="continue", metavar="DIR", help_behavior_hint="(optional)")
    ] = None,
    source: Annotated[
        str | None,
        optional(
            "indirect|direct|joint|weighted", "weighted if the smoothing is known, else joint"
        ),
    ] = None,
    guard: bool = False,
    smoothing: Annotated[float | None, optional("ALPHA", "that of --gains")] = None,
    gains: Annotated[Path | None, optional("FILE.yaml")] = None,
    torque_limit: Annotated[Numbers, optional("LIMIT ...")] = (),
    feedforward_limit: Annotated[Numbers, optional("LIMIT ...")] = (),
    kept: Annotated[int | None, optional("N", "0")] = None,
    motion: Annotated[str | None, optional("offline|finite_difference|filtered", "offline")] = None,
    epochs: Annotated[int | None, optional("N", "30")] = None,
    layers: Annotated[tuple[int, ...], optional("N ...", "200 100 50 1")] = (),
    seed: Annotated[int | None, optional("N", "0")] = None,
    joints: Annotated[Names, optional("NAME ...", "those of --continue, or all")] = (),
    columns: Annotated[tuple[str, ...], optional("KEY=TITLE ...")] = (),
    topic: Annotated[str | None, optional("NAME")] = None,
    tolerance: float = 0.05,
) -> None:
    """Learn from executions that were recorded on a robot; write the feedforward for the next one.

    Args:
        logs: CSV, NPZ, Parquet or ROS bags, one execution each, in the order of recording. One row
            for each control step with columns time, q0..., qdd_desired0..., tau0...,
            tau_feedback0..., tau_feedback_applied0..., tau_feedforward0...; optional: qd*, qdd*,
            q_desired*, qd_desired*. In a bag, interfaces of a DynamicJointState.
        out: folder for feedforward.json, weights.npz, feedforward.jaxexport, the model and
            report.md. There is no default, since a folder that jaxidl learn wrote is replaced.
        model: MJCF or URDF whose inverse dynamics the robot's controller uses.
        continued: folder of the last iteration; its weights, optimiser and settings are continued.
        source: data source to learn from.
        guard: keep the learned torque in the range of its data, and fade it out where the robot
            strays; needs q_desired*. With --continue it stays on.
        smoothing: weight of a new sample in the filter of the learning feedback, for weighted data:
            1 without a filter, dt / (T + dt) with a time constant T.
        gains: feedback law and gains, for logs without feedback torques.
        torque_limit: bound of each part of the command; one for all or one per joint.
        feedforward_limit: bound of the learned torque; one for all or one per joint.
        kept: number of earlier executions to learn from as well.
        motion: how to compute velocities and accelerations that were not logged.
        epochs: number of epochs of a training.
        layers: sizes of a new network's layers; the last one is 1.
        seed: seed of initial weights and batches.
        joints: joints to learn, for example those of an arm without its gripper; the others are
            locked.
        columns: which column is which: q0=actual_q_0, or 'q=actual_q_*' for all joints.
        topic: topic to read, if a ROS bag has several with joint states.
        tolerance: largest difference between a command and the sum of its parts, as a share of the
            joint's largest command.
    """
    if model is None and continued is None:
        raise ConfigurationError("--model ROBOT.xml", "none", "name the MJCF or URDF of the robot")
    import jax

    from jaxidl.jobs.progress import Bar
    from jaxidl.learning.guard import Guard
    from jaxidl.logs.joint_names import joints_called
    from jaxidl.report.learned import learned_report
    from jaxidl.robot import folder
    from jaxidl.robot.execution import read_execution
    from jaxidl.robot.gains import read_gains
    from jaxidl.robot.learn import learn_from, program
    from jaxidl.robot.settings import Wish, settled
    from jaxidl.systems.mjcf import names_of, read_model

    if not logs:
        raise ConfigurationError("at least one LOG", "none", "name the log of an execution")
    folder.check_folder(out)
    with jax.enable_x64(True), Bar("reading", total=4, transient=True) as bar:
        previous = None if continued is None else folder.load(continued)
        robot = previous and previous.model
        if model is not None:
            part = joints_called(joints, names_of(model)) if joints else robot and robot.part
            robot = read_model(model, part)
        assert robot is not None
        count = len(robot.names)
        law = None if gains is None else read_gains(gains, count)
        wish = Wish(
            source=source,
            kept=kept,
            seed=seed,
            guard=Guard() if guard else None,
            epochs=epochs,
            layers=layers or None,
            torque_limit=torque_limit or None,
            feedforward_limit=feedforward_limit or None,
            motion=motion,
            smoothing=_agreed(smoothing, law),
        )
        settings = settled(wish, previous, count)
        executions = [
            read_execution(
                log,
                robot,
                law=law,
                columns=columns,
                motion=settings.motion,
                torque_limit=settings.torque_limit,
                tolerance=tolerance,
                topic=topic,
            )
            for log in logs
        ]
        watch = lambda what: bar.advance(what=what)
        learned = learn_from(executions, robot, wish, previous, watch=watch)
        bar.advance(what="writing")
        files = {folder.PROGRAM: program(learned), **learned_report(learned, executions[-1])}
        folder.save(learned, out, files)
    last = learned.history[-1]
    for j, name in enumerate(robot.names):
        print(
            f"{name}: lacked {last['lacking'][j]:.3g} {robot.units[j]}, left {last['left'][j]:.3g};"
            f" on data kept aside {last['held_out_lacking'][j]:.3g} →"
            f" {last['held_out_left'][j]:.3g}"
        )
    print(f"iteration {learned.iteration} in {out}, report in {out / 'report.md'}")


def _agreed(smoothing: float | None, law: Any) -> float | None:
    """Return the smoothing of the learning feedback, as given or of the law."""
    if law is None:
        return smoothing
    if smoothing is not None and smoothing != law.smoothing:
        got = f"--smoothing {smoothing:g}"
        raise ConfigurationError(f"smoothing {law.smoothing:g} as in --gains", got, "correct one")
    return float(law.smoothing)
