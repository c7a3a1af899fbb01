"""Limits of a motion, with margins: from the model, a file, or the range of an earlier log.

The margins are for execution: a controller deviates from the motion, and a real joint needs more
torque than its model.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxidl.errors import ConfigurationError, one_of
from jaxidl.files import LARGEST_BY_HAND
from jaxidl.systems.bounds import Bounds

KEYS = ("position", "speed", "acceleration", "torque")
SHARES = ("margin", "torque_margin")
OTHERS = (*SHARES, "clearance", "start", "joints")


@dataclass(frozen=True)
class Limits:
    """Limits of J joints, and what a plan leaves of them."""

    names: tuple[str, ...]
    lower: Float[np.ndarray, " J"]  # [m or rad]
    upper: Float[np.ndarray, " J"]
    speed: Float[np.ndarray, " J"]  # [m/s or rad/s]
    acceleration: Float[np.ndarray, " J"]  # [m/s^2 or rad/s^2]
    torque: Float[np.ndarray, " J"]  # [N or Nm]; infinite: none
    start: Float[np.ndarray, " J"]  # posture at both ends [m or rad]
    margin: float = 0.1  # share of positions, speeds and accelerations that a plan leaves unused
    torque_margin: float = 0.2
    clearance: float = 0.03  # between shapes [m]

    def planned(self, part: float = 1.0) -> "Limits":
        """Return the limits of the plan: these less their margins, or less a ``part`` of these."""
        room = 0.5 * part * self.margin * (self.upper - self.lower)
        share = 1.0 - part * self.margin
        return replace(
            self,
            lower=self.lower + room,
            upper=self.upper - room,
            speed=share * self.speed,
            acceleration=share * self.acceleration,
            torque=(1.0 - part * self.torque_margin) * self.torque,
        )

    def checked(self, noise: Float[np.ndarray, " J"]) -> "Limits":
        """Return these limits if a motion can keep them.

        ``noise`` (J,) is the encoders' [m or rad].

        Raises:
            ConfigurationError: if a range is empty or narrower than noise, or the start is not
                within the plan's limits.
        """
        plan = self.planned()
        for j, name in enumerate(self.names):
            wide = self.upper[j] - self.lower[j]
            if not wide > 20.0 * noise[j]:
                raise ConfigurationError(
                    f"a range of {name} wider than 20 times its encoder's noise ({noise[j]:.2g})",
                    f"{self.lower[j]:g} to {self.upper[j]:g}",
                    "widen its position limits",
                )
            if not plan.lower[j] < self.start[j] < plan.upper[j]:
                raise ConfigurationError(
                    f"a start of {name} between {plan.lower[j]:.4g} and {plan.upper[j]:.4g}, its"
                    " limits less their margin",
                    f"{self.start[j]:.4g}",
                    "give another --start, or other position limits",
                )
        return self


def limits_of(
    names: tuple[str, ...],
    file: Bounds,
    path: Path | None = None,
    reached: Mapping[str, Any] | None = None,
    start: tuple[float, ...] = (),
) -> Limits:
    """Return the limits of J joints.

    Each limit is the file's at ``path`` or else the model's, or else what the log reached.

    Args:
        names: of the joints.
        file: limits in the model's file.
        path: YAML file with position [lower, upper], speed, acceleration and torque, of all joints
            or by name under ``joints``; margin, torque_margin, clearance [m] and start.
        reached: ``lower``, ``upper``, ``speed``, ``acceleration``, ``torque`` and ``start`` (J,)
            of an earlier log.
        start: posture at both ends [m or rad]; default: the file's, the log's first, or the
            middle of the range.

    Raises:
        ConfigurationError: naming what is wrong or missing.
    """
    said = {} if path is None else _read(path, names)
    known = reached or {}
    values: dict[str, np.ndarray] = {}
    models = {"speed": file.speed, "torque": file.torque, "acceleration": None}
    for key, own in models.items():
        given = _filled(said.get(key, {}), names, own)
        values[key] = np.where(np.isfinite(given), given, known.get(key, np.inf))
    pairs = [said.get("position", {}).get(name, (np.nan, np.nan)) for name in names]
    for n, (side, own) in enumerate((("lower", file.lower), ("upper", file.upper))):
        given = np.array([pair[n] for pair in pairs], float)
        given = np.where(np.isnan(given), own, given)
        values[side] = np.where(np.isfinite(given), given, known.get(side, given))
    for key in ("lower", "upper", "speed", "acceleration"):
        for name, value in zip(names, values[key], strict=True):
            if not np.isfinite(value):
                what = "position" if key in ("lower", "upper") else key
                raise ConfigurationError(
                    f"a limit of the {what} of {name}",
                    "none in the model" + (f" or {path}" if path else ""),
                    f"give --limits FILE with `{what}: "
                    + ("[-1.0, 1.0]`" if what == "position" else "2.0`"),
                )
    shares = {key: said[key] for key in (*SHARES, "clearance") if key in said}
    middle = 0.5 * (values["lower"] + values["upper"])
    posture = start or said.get("start") or known.get("start", middle)
    if len(posture) != len(names):
        raise ConfigurationError(
            f"a start of {len(names)} numbers", f"{len(posture)}", "give one for each joint"
        )
    return Limits(names, **values, start=np.array(posture, float), **shares)


def _filled(given: Mapping[str, float], names: tuple[str, ...], own: Any) -> np.ndarray:
    other = np.full(len(names), np.inf) if own is None else own
    return np.array([given.get(name, other[j]) for j, name in enumerate(names)], float)


def _read(path: Path, names: tuple[str, ...]) -> dict[str, Any]:
    """Return a file's limits by key and joint, checked."""
    import yaml  # needed only if there is such a file

    try:
        if path.stat().st_size > LARGEST_BY_HAND:
            raise ValueError("a file of more than a megabyte")
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeError, yaml.YAMLError, ValueError, RecursionError) as error:
        reason = (getattr(error, "strerror", None) or "").lower() or " ".join(str(error).split())[
            :120
        ]
        raise ConfigurationError(f"a YAML file at {path}", reason, "correct it") from None
    if not isinstance(content, dict):
        raise ConfigurationError(
            f"keys and values in {path}", type(content).__name__, "write `speed: 2.0`, for one"
        )
    out: dict[str, Any] = {key: {} for key in KEYS}
    for key, value in content.items():
        if key not in (*KEYS, *OTHERS):
            raise one_of(f"a key of {path}", key, (*KEYS, *OTHERS))
        if key in KEYS:
            out[key] = dict.fromkeys(names, _limit(key, value, path))
        elif key == "start":
            out[key] = [_number("start", x, path) for x in _sequence(value, path)]
        elif key != "joints":
            out[key] = _number(key, value, path)
            if not 0.0 <= out[key] < 1.0:
                raise ConfigurationError(
                    f"{key} in {path} from 0 to below 1", f"{value}", "correct it"
                )
    own = content.get("joints", {})
    if not isinstance(own, dict):
        raise ConfigurationError(
            f"limits by joint under joints in {path}", repr(own)[:40], "write `elbow: {speed: 1}`"
        )
    for name, entries in own.items():
        if name not in names:
            raise one_of(f"a joint in {path}", name, names)
        for key, value in entries.items() if isinstance(entries, dict) else ((entries, None),):
            if key not in KEYS:
                raise one_of(f"a limit of {name} in {path}", key, KEYS)
            out[key][name] = _limit(key, value, path)
    return out


def _sequence(value: Any, path: Path) -> list[Any]:
    if not isinstance(value, list):
        raise ConfigurationError(f"a list for start in {path}", repr(value)[:40], "write [0, 0]")
    return value


def _limit(key: str, value: Any, path: Path) -> Any:
    if key != "position":
        number = _number(key, value, path)
        if not number > 0.0:
            raise ConfigurationError(f"{key} in {path} above zero", f"{number:g}", "correct it")
        return number
    pair = [_number(key, x, path) for x in value] if isinstance(value, list) else []
    if len(pair) != 2 or not pair[0] < pair[1]:
        raise ConfigurationError(
            f"position in {path} as [lower, upper]", repr(value)[:40], "give two numbers that rise"
        )
    return tuple(pair)


def _number(key: str, value: Any, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ConfigurationError(f"a number for {key} in {path}", repr(value)[:40], "correct it")
    return float(value)
