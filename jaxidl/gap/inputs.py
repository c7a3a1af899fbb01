"""A log and a model that belong together, from files as robots give them."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax

from jaxidl.errors import ModelError
from jaxidl.logs.header import joint_called
from jaxidl.logs.log import Log, read
from jaxidl.logs.motor_side import motor_side
from jaxidl.systems.mjcf import Model, names_of, read_model


class Inputs(NamedTuple):
    """What :func:`jaxidl.gap.diagnose` takes."""

    log: Log
    model: Model


def read_inputs(
    logs: Sequence[Path],
    model: Path,
    *,
    joints: Sequence[str] = (),
    columns: Sequence[str] = (),
    motor: Path | None = None,
    torque_constant: Sequence[float] = (),
    gear_ratio: Sequence[float] = (),
    topic: str | None = None,
) -> Inputs:
    """Read a model and logs of the same joints.

    Args:
        logs: files as :func:`jaxidl.gap.read` takes them.
        model: MJCF or URDF.
        joints: names of the joints to look at, ``elbow`` for ``elbow_joint``; the others are locked
            where the log has them on average, or else as the model's file draws them. Default: all.
        columns: which column is which, as ``"q0=actual_q_0"`` or ``"q=actual_q_*"``.
        motor: YAML file that says how joints follow from motors, as
            :func:`jaxidl.logs.motor_side.motor_side` reads it.
        torque_constant: [Nm/A] of motors whose currents the log has; one for all or one for each
            joint.
        gear_ratio: of motors whose currents or torques the log has; one for all or one for each
            joint.
        topic: of a ROS bag.

    Raises:
        ModelError: if the model cannot be read.
        LogError: if a log or the description of motors cannot be used.
    """
    with jax.enable_x64(True):
        robot = names_of(model) if joints else ()
        places = {name: joint_called(name, robot) for name in joints}  # "elbow" for elbow_joint
        part = read_model(
            model, [name if (j := places[name]) is None else robot[j] for name in joints] or None
        )
        robot = robot or part.names
        side = motor_side(part.names, motor, torque_constant, gear_ratio)
        log = read(list(logs), part.names, robot=robot, columns=columns, motor=side, topic=topic)
        if not log.still or (side is not None and side.positions):
            return Inputs(log, part)
        try:
            return Inputs(log, read_model(model, part.names, dict(log.still)))
        except (
            ModelError
        ):  # not every joint can be locked anywhere; where it is instead, the model's notes say
            return Inputs(log, part)
