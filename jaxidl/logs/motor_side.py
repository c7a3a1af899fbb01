"""Data of motors instead of joints.

These are currents, positions before the gear, and joints that two motors drive together. With the
coupling C (J, J), joints follow motors as q = C (q_motor / ratio) + offset; equal power on both
sides gives the joints' torques C^-T (ratio · torque_constant · current).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from jaxidl.errors import LogError
from jaxidl.files import LARGEST_BY_HAND
from jaxidl.logs.families import shortened
from jaxidl.logs.joint_names import joint_called
from jaxidl.logs.words import CURRENT

KEYS = ("torque_constant", "gear_ratio", "coupling", "offset", "motor_positions", "joints")
WORST = 1e6  # largest condition number of a coupling


@dataclass(frozen=True)
class MotorSide:
    """How joints follow from motors; J joints in the order of the log."""

    # [Nm/A] of the motor, before the gear; None: torques were logged
    torque_constant: Float64[np.ndarray, " J"] | None
    gear_ratio: Float64[np.ndarray, " J"]  # motor motion per joint motion; for a slide in rad/m
    coupling: Float64[np.ndarray, "J J"] | None = None
    offset: Float64[np.ndarray, " J"] | None = None  # [rad or m] of joints where motors are at zero
    positions: bool = False  # true if positions, speeds and accelerations are those of the motors

    def joint_side(self, signals: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return signals (T, J) of the joints from those of the motors.

        They are ``q``, ``tau`` and so on; ``i`` [A] becomes ``tau``.
        """
        found = dict(signals)
        if self.torque_constant is not None:
            found["tau"] = found.pop(CURRENT) * self.torque_constant
        coupling = np.eye(len(self.gear_ratio)) if self.coupling is None else self.coupling
        found["tau"] = np.linalg.solve(coupling.T, (found["tau"] * self.gear_ratio).T).T
        for kind in ("q", "qd", "qdd") if self.positions else ():
            if kind in found:
                found[kind] = (found[kind] / self.gear_ratio) @ coupling.T
        if self.positions and self.offset is not None:
            found["q"] = found["q"] + self.offset
        return found

    def note(self) -> str:
        """Return a note on what was computed."""
        what = "motor torque" if self.torque_constant is None else "current * torque constant"
        moved = ", positions from the motors'" if self.positions else ""
        return (
            f"joint torque computed as {what} * gear"
            f" ratio{' through the coupling' * (self.coupling is not None)}{moved}"
        )


def motor_side(
    names: Sequence[str],
    path: Path | None = None,
    torque_constant: Sequence[float] = (),
    gear_ratio: Sequence[float] = (),
) -> MotorSide | None:
    """Return the description of the motors of the joints ``names`` (J,); None if there is none.

    It comes from a YAML file or from numbers. The file has ``torque_constant`` [Nm/A],
    ``gear_ratio``, ``offset`` [rad or m]: each one number for all joints, a list (J,), or numbers
    by joint; or all values of a joint under ``joints``, by its name. It may also have ``coupling``
    (J, J) and ``motor_positions: true``.

    Args:
        torque_constant: one for all, or one for each joint; so is ``gear_ratio``. These cannot be
            combined with the file.

    Raises:
        LogError: if the file cannot be read, or its numbers do not fit.
    """
    numbers = {"torque_constant": list(torque_constant), "gear_ratio": list(gear_ratio)}
    said: dict[str, Any] = {key: value for key, value in numbers.items() if value}
    where = "the command"
    if path is not None:
        if said:
            raise LogError(
                "--motor FILE, or --torque-constant and --gear-ratio",
                "both",
                "put all of it into the file",
            )
        said, where = _read(path), str(path)
    if not said:
        return None
    said = {
        key: value[0] if key in numbers and isinstance(value, list) and len(value) == 1 else value
        for key, value in said.items()
    }
    said = _by_joint(said, where)
    constant = _per_joint(said, "torque_constant", names, where)
    ratio = _per_joint(said, "gear_ratio", names, where)
    offset = _per_joint(said, "offset", names, where)
    positions = said.get("motor_positions", False)
    if not isinstance(positions, bool):
        raise LogError(
            f"motor_positions in {where} to be true or false",
            repr(positions)[:40],
            "write motor_positions: true",
        )
    if constant is None and ratio is None and "coupling" not in said:
        raise LogError(
            f"torque_constant or gear_ratio in {where}",
            "neither",
            "give Nm/A, and the motor's turns per joint's turn",
        )
    if offset is not None and not positions:
        raise LogError(
            f"offset in {where} beside motor_positions: true",
            "positions of joints",
            "remove offset, or add motor_positions: true",
        )
    for key, value in (("torque_constant", constant), ("gear_ratio", ratio)):
        if value is not None and not value.all():
            raise LogError(
                f"{key} in {where} other than zero",
                f"0 for {names[int(np.argmin(np.abs(value)))]}",
                "correct it",
            )
    ones = np.ones(len(names))
    return MotorSide(
        constant,
        ones if ratio is None else ratio,
        _coupling(said, len(names), where),
        offset,
        positions,
    )


def _read(path: Path) -> dict[str, Any]:
    import yaml  # needed only if there is such a file

    try:
        if path.stat().st_size > LARGEST_BY_HAND:
            raise LogError(
                f"a description of motors in {path}",
                "a file of more than 1 MiB",
                "name the YAML file",
            )
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise LogError(f"a YAML file at {path}", "no such file", "correct the path") from None
    except (OSError, UnicodeError, yaml.YAMLError, ValueError, RecursionError) as error:
        got = shortened(" ".join(str(error).split()), 200)
        raise LogError(
            f"readable YAML in {path}",
            got,
            "write torque_constant: [0.1, ...] and gear_ratio: [100, ...]",
        ) from None
    if not isinstance(content, dict):
        got, remedy = (
            f"a {type(content).__name__}",
            "write torque_constant: [0.1, ...] and gear_ratio: [100, ...]",
        )
        raise LogError(f"names and values in {path}", got, remedy)
    for key in content:
        if key not in KEYS:
            raise LogError(
                f"{', '.join(KEYS)} in {path}", shortened(repr(key)), "correct or remove it"
            )
    return content


def _by_joint(said: dict[str, Any], where: str) -> dict[str, Any]:
    """Turn ``joints: {elbow: {gear_ratio: 100}}`` into ``gear_ratio: {elbow: 100}``."""
    joints = said.get("joints")
    if joints is None:
        return said
    rest: dict[str, Any] = {key: value for key, value in said.items() if key != "joints"}
    if not isinstance(joints, dict) or not all(
        isinstance(entry, dict) for entry in joints.values()
    ):
        raise LogError(
            f"joints in {where} by name",
            shortened(repr(joints)),
            "write joints: {elbow: {gear_ratio: 100}}",
        )
    for name, entry in joints.items():
        for key, value in entry.items():
            if key not in ("torque_constant", "gear_ratio", "offset") or key in said:
                remedy = "give torque_constant, gear_ratio and offset once, there or for all joints"
                raise LogError(f"numbers of joint {name} in {where}", shortened(repr(key)), remedy)
            rest.setdefault(key, {})[name] = value
    return rest


def _per_joint(
    said: Mapping[str, Any], key: str, names: Sequence[str], where: str
) -> np.ndarray | None:
    """Return numbers (J,) that are given as one, as a list or by joint."""
    if key not in said:
        return None
    value, count = said[key], len(names)
    if isinstance(value, dict):
        by_place = {joint_called(str(name), names): entry for name, entry in value.items()}
        missing = [name for j, name in enumerate(names) if j not in by_place]
        if missing:
            got = ", ".join(shortened(str(name)) for name in list(value)[:8]) or "none"
            raise LogError(
                f"{key} of joint {missing[0]} in {where}",
                got,
                "give one for each joint that is used",
            )
        value = [by_place[j] for j in range(count)]
    entries = value if isinstance(value, list) else [value] * count
    if not all(_is_number(entry) for entry in entries) or len(entries) != count:
        remedy = "give one number for all joints, or one for each in the model's order"
        raise LogError(
            f"{count} finite numbers as {key} in {where}", shortened(repr(value), 60), remedy
        )
    return np.array(entries, float)


def _coupling(said: Mapping[str, Any], count: int, where: str) -> np.ndarray | None:
    rows = said.get("coupling")
    if rows is None:
        return None
    square = (
        isinstance(rows, list)
        and len(rows) == count
        and all(isinstance(r, list) and len(r) == count for r in rows)
    )
    if not square or not all(_is_number(entry) for row in rows for entry in row):
        remedy = (
            f"write {count} lists of {count}: row j gives the motion of joint j per motion of each"
            " motor behind its gear"
        )
        raise LogError(
            f"a coupling of {count} x {count} finite numbers in {where}",
            shortened(repr(rows), 60),
            remedy,
        )
    matrix = np.array(rows, float)
    if np.linalg.cond(matrix) > WORST:
        raise LogError(
            f"a coupling in {where} that can be inverted", shortened(repr(rows), 60), "correct it"
        )
    return matrix


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e12
