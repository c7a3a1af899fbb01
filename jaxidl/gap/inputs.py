"""A matching log and model, read from files as robots provide them."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax

from jaxidl.effects import searchable, searched
from jaxidl.errors import ConfigurationError, ModelError, one_of
from jaxidl.logs.columns import PartOfRobotError
from jaxidl.logs.joint_names import joints_called
from jaxidl.logs.log import Log, read
from jaxidl.logs.motor_side import MotorSide, motor_side
from jaxidl.systems.mjcf import Model, names_of, read_model


class Inputs(NamedTuple):
    """The inputs of :func:`jaxidl.gap.diagnose`."""

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
    flange: str | None = None,
) -> Inputs:
    """Read a model and logs of the same joints.

    Args:
        logs: files as :func:`jaxidl.gap.read` takes them.
        model: MJCF or URDF file.
        joints: names of the joints to use, ``elbow`` for ``elbow_joint``; the others are locked at
            their mean position in the log, or else as in the model's file. Default: all, or those
            that the log names.
        columns: which column is which, as ``"q0=actual_q_0"`` or ``"q=actual_q_*"``.
        motor: YAML file that describes how joints follow from motors, as
            :func:`jaxidl.logs.motor_side.motor_side` reads it.
        torque_constant: [Nm/A] of motors whose currents the log has; one for all or one for each
            joint.
        gear_ratio: of motors whose currents or torques the log has; one for all or one for each
            joint.
        topic: topic of a ROS bag.
        flange: name of the body that carries a payload. Default: the last that moves.

    Raises:
        ModelError: if the model cannot be read.
        LogError: if a log or the description of motors cannot be used.
    """
    model_of = partial(read_model, model, flange=flange)
    with jax.enable_x64(True):
        robot = names_of(model)
        part = model_of(joints_called(joints, robot)) if joints else None

        def measured(names: tuple[str, ...]) -> tuple[Log, MotorSide | None]:
            side = motor_side(names, motor, torque_constant, gear_ratio)
            found = read(list(logs), names, robot=robot, columns=columns, motor=side, topic=topic)
            return found, side

        try:
            log, side = measured(part.names if part else robot)
        except PartOfRobotError as error:
            if part:
                raise
            part = model_of(error.joints)
            log, side = measured(part.names)
        part = part or model_of()
        given = {
            "joints": joints,
            "columns": columns,
            "torque_constant": torque_constant,
            "gear_ratio": gear_ratio,
            "motor": motor,
            "topic": topic,
            "flange": flange,
        }
        alone = lambda value: str(value) if isinstance(value, str | Path) else list(value)
        reading = {name: alone(value) for name, value in given.items() if value}
        log = replace(log, reading=reading)
        if not log.still or (side is not None and side.positions):
            return Inputs(log, part)
        try:
            # not every joint can be locked anywhere; the model's notes say where it is instead
            return Inputs(log, model_of(part.names, dict(log.still)))
        except ModelError:
            return Inputs(log, part)


def read_again(logs: Sequence[Path], model: Path, reading: Mapping[str, Any]) -> Inputs:
    """Return logs and model as :func:`read_inputs` with the options of an earlier ``reading``."""
    given = dict(reading)
    if "motor" in given:
        given["motor"] = Path(given["motor"])
    return read_inputs(logs, model, **given)


def words(reading: Mapping[str, Any]) -> str:
    """Return the options of a ``reading`` as they are written on the command line."""
    out = []
    for name, given in reading.items():
        values = [given] if isinstance(given, str) else given
        out += [f"--{name.replace('_', '-')}", *map(str, values)]
    return shlex.join(out)


def wanted(
    held_out: float, effects: Sequence[str] | None, exclude: Sequence[str], min_gain: float
) -> list[str]:
    """Return names of the effects to look for."""
    for name in (*(effects or ()), *exclude):
        if name not in searchable():
            raise one_of("an effect to look for", name, searchable())
    names = [name for name in (searched() if effects is None else effects) if name not in exclude]
    if not names:
        raise ConfigurationError(
            "at least one effect to look for", "none", f"choose among {', '.join(searchable())}"
        )
    if not 0.1 <= held_out <= 0.6:
        raise ConfigurationError(
            "a held-out share between 0.1 and 0.6",
            f"{held_out}",
            "hold out between a tenth and six tenths",
        )
    if not 0.0 < min_gain < 1.0:
        raise ConfigurationError(
            "a least improvement (min_gain) between 0 and 1", f"{min_gain}", "choose 0.05"
        )
    return names
