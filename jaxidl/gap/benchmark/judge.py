"""What one report is worth against the truth. A report is the workflow's ``report.json``, or None where it gave none."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

Record = Mapping[str, Any]
Key = tuple[str, int | None]

WHOLE = {"payload"}  # effects of the whole mechanism, on whatever joint a report puts them
TIED = {
    "slider": {"inertia_error", "torque_scale", "actuator_delay", "sensor_delay"},
    "pendulum": {"actuator_delay", "sensor_delay"},
    "two_link": set[str](),
}
"""Effects with a double that no log of the mechanism tells apart: a torque m·a/s is that of another mass or of another motor
constant, and with a single joint nobody knows on which side the time was lost. To say so is all one can do."""


def key(record: Record) -> Key:
    """The effect and joint of a hidden effect, a named effect or a candidate."""
    return record["effect"], None if record["effect"] in WHOLE else record["joint"]


def named(report: Record | None) -> list[Key]:
    """The effects that a report names, in the order in which they were added."""
    return [key(effect) for effect in report["effects"]] if report else []


def candidates(report: Record | None) -> list[set[Key]]:
    """The sets of effects that a report cannot tell apart."""
    return [{key(one) for one in entry["candidates"]} for entry in report.get("ambiguous", [])] if report else []


def single_credit(hidden: Record, report: Record | None) -> float:
    """1 where exactly the hidden effect is named, 1/2 where it is in an ambiguity set and nothing outside that set is named."""
    truth, names = key(hidden), named(report)
    for group in candidates(report):
        if truth in group:
            return 0.5 if set(names) <= group else 0.0
    return float(names == [truth])


def tied(truth: Record) -> bool:
    """Whether the only hidden effect of a case has a double that no log of this mechanism tells apart.

    On a pendulum a payload at the right place also scales inertia and weight alike, as a heavier body or a weaker motor does.
    """
    effect, parameters = truth["hidden"][0]["effect"], truth["hidden"][0]["parameters"]
    heavier = parameters.get("kind") == "mass" and parameters["extra"] > 0
    weaker = effect == "torque_scale" and parameters["scale"] < 1
    return effect in TIED[truth["mechanism"]] or (truth["mechanism"] == "pendulum" and (heavier or weaker))


def pair_credits(hidden: Iterable[Record], report: Record | None) -> list[float]:
    """For each hidden effect: 1 named, 1/2 in an ambiguity set, 0 neither."""
    unsure = set().union(*candidates(report))
    return [0.5 if key(h) in unsure else float(key(h) in named(report)) for h in hidden]


def column(truth: Record, report: Record | None) -> str:
    """The column of the confusion matrix: what the report says, in one word.

    That is the first effect named, since it is the strongest, unless the report is ``"ambiguous"``, ``"unexplained"`` with
    no effect, or names ``"none"``; ``"other joint"`` for the right effect on the wrong joint, ``"failed"`` without a report.
    """
    if report is None:
        return "failed"
    names = named(report)
    if report["verdict"] == "ambiguous" or (candidates(report) and not names):
        return "ambiguous"
    if not names:
        return "unexplained" if report["verdict"] == "unexplained" else "none"
    right = [key(hidden) for hidden in truth["hidden"]]
    if names[0] not in right and any(names[0][0] == effect for effect, _ in right):
        return "other joint"
    return names[0][0]


def parameter_errors(hidden: Record, effect: Record) -> dict[str, tuple[float, float | None]]:
    """Relative error of each parameter that truth and report share, and the same in standard errors, None without one.

    A scale is compared by its distance from 1, a phase, which has no relative error, in half turns.
    """
    errors = {}
    reported = effect.get("parameters", {})
    if hidden["parameters"].get("kind", "") == "mass" and "kind" not in reported:
        return {}  # a body's mass error has another unit than a rotor's inertia
    for name, true in hidden["parameters"].items():
        if name in ("kind", "other") or name not in reported:
            continue
        value, true = np.ravel(reported[name]["value"]), np.ravel(true)
        if len(true) == 1 and len(value) > 1:
            value = value[[hidden["joint"] or 0]]  # one value for each joint
        if len(value) != len(true):
            continue
        off = value - true
        if name == "phase":
            errors[name] = abs(math.remainder(float(off[0]), 2 * math.pi)) / math.pi, None
            continue
        scale = float(np.linalg.norm(true - 1 if name == "scale" else true))
        stderr = reported[name].get("stderr")
        deviation = float(abs(off[0])) / stderr if len(off) == 1 and isinstance(stderr, (int, float)) and stderr > 0 else None
        errors[name] = (float(np.linalg.norm(off)) / scale if scale else math.inf), deviation
    return errors


def removed(truth: Record, report: Record | None) -> float | None:
    """Share of the held-out torque error above the noise floor that is gone, on the joints with hidden effects.

    None where nothing is named, or where there was no error above the noise floor.
    """
    if not report or not report["effects"]:
        return None
    joints = [hidden["joint"] for hidden in truth["hidden"]]
    gap = report["gap"]
    rms = [np.asarray(x, float) for x in (gap["before"]["torque_rms"], gap["after"]["torque_rms"], gap["noise_floor"])]
    if None not in joints:
        rms = [x[sorted(set(joints))] for x in rms]
    before, after, floor = (float(np.sqrt((x**2).sum())) for x in rms)
    return (before - after) / (before - floor) if before > floor else None
