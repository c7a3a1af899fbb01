"""The score of one report against the truth.

A report is the workflow's ``report.json``, or None if there is none.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from jaxidl.gap.benchmark.translate import errors, expected

Record = Mapping[str, Any]
Key = tuple[str, int | None]

COMPANIONS: Mapping[str, tuple[str, ...]] = {
    "sublinear_friction": ("coulomb_friction", "viscous_friction"),
    "com_error": ("inertia_error", "inertia_tensor_error"),
    "directional_load_friction": ("load_dependent_friction",),
}
"""Effects that may be named beside a hidden one.

The catalogue expresses some effects as a sum of several of its own: friction that bends, a centre
of mass that is off while the link's own inertia stays, and friction under load that differs by
direction.
"""

SUMS: Mapping[str, tuple[str, ...]] = {
    "asymmetric_friction": ("coulomb_friction", "constant_offset"),
    "directional_load_friction": ("load_dependent_friction", "torque_scale"),
}
"""Effects that are exactly several others together: either description is right."""

CONFIDENT = 0.8  # an effect reported with less is suspected, not named
# effects of the whole mechanism, whichever joint a report gives
WHOLE = {"payload", "base_tilt"}
TIED = {
    "slider": {
        "inertia_error",
        "torque_scale",
        "actuator_delay",
        "sensor_delay",
        "directional_load_friction",
    },
    "pendulum": {
        "actuator_delay",
        "sensor_delay",
        "payload",
        "directional_load_friction",
        "position_bias",
    },
    "two_link": {"payload", "directional_load_friction", "position_bias"},
}
"""Effects with an equivalent that no log of the mechanism can distinguish.

A torque m·a/s is that of a different mass or of a different motor constant; with a single joint it
is unknown on which side the time was lost; and a load on the last link is an error of that link.
Friction under load that differs by direction is friction under load with a different motor
constant. In a vertical plane a wrong zero of the first joint is a tilted base, and one of the last
joint is a turned centre of mass. A report can only say so.
"""


def key(record: Record) -> Key:
    """Return the effect and joint of a hidden effect, a named effect or a candidate."""
    return record["effect"], None if record["effect"] in WHOLE else record["joint"]


def confidence(effect: Record) -> float:
    """Return the reported confidence in [0, 1] that the effect is there.

    It is 1 if a report has none.
    """
    value = effect.get("confidence")
    return 1.0 if value is None else float(value)


def named(report: Record | None) -> list[Key]:
    """Return the effects that a report names with confidence.

    They are in the order in which they were added.
    """
    return (
        [key(effect) for effect in report["effects"] if confidence(effect) >= CONFIDENT]
        if report
        else []
    )


def misnamed(report: Record | None) -> bool:
    """Return whether a report names an effect with confidence without reservations.

    That is on a joint that it calls neither unexplained nor ambiguous. A report without
    ``unexplained_joints`` that is unexplained is so on every joint; so is an ambiguous one without
    candidates.
    """
    if report is None:
        return False
    groups = set().union(*candidates(report))
    joints = report.get("unexplained_joints")
    if (report["verdict"] == "unexplained" and joints is None) or (
        report["verdict"] == "ambiguous" and not groups
    ):
        return False
    unsure = {joint for _, joint in groups} | set(joints or ())
    return any(joint not in unsure and not (joint is None and unsure) for _, joint in named(report))


def candidates(report: Record | None) -> list[set[Key]]:
    """Return the sets of effects that a report cannot distinguish."""
    return (
        [{key(one) for one in entry["candidates"]} for entry in report.get("ambiguous", [])]
        if report
        else []
    )


def single_credit(hidden: Record, report: Record | None) -> float:
    """Return the credit for a single hidden effect.

    It is 1 if exactly the hidden effect is named, 1/2 if it is in an ambiguity set and nothing
    outside that set is named. What may be named beside it does not count.
    """
    truth, names = key(hidden), named(report)
    beside = {(name, truth[1]) for name in COMPANIONS.get(truth[0], ())}
    for group in candidates(report):
        if truth in group:
            return 0.5 if set(names) - beside <= group else 0.0
    return float(
        (truth in names and set(names) - beside == {truth})
        or (bool(names) and set(names) == sums(hidden))
    )


def sums(hidden: Record) -> set[Key]:
    """Return effects that are exactly the hidden one together; for most there are none."""
    return {(part, key(hidden)[1]) for part in SUMS.get(hidden["effect"], ())}


def tied(hidden: Record, mechanism: str) -> bool:
    """Return whether a hidden effect has an equivalent that no log of its mechanism distinguishes.

    On a pendulum a payload at the right place also scales inertia and weight alike, as a heavier
    body or a weaker motor does.
    """
    effect, parameters = hidden["effect"], hidden["parameters"]
    heavier = parameters.get("kind") == "mass" and parameters["extra"] > 0
    weaker = effect == "torque_scale" and parameters["scale"] < 1
    return effect in TIED[mechanism] or (mechanism == "pendulum" and (heavier or weaker))


def pair_credits(hidden: Iterable[Record], report: Record | None) -> list[float]:
    """Return the credit for each hidden effect.

    It is 1 if it, or those that are equal to it together, are named, 1/2 in an ambiguity set, 0
    otherwise.
    """
    unsure, names = set().union(*candidates(report)), set(named(report))
    return [
        0.5 if key(h) in unsure else float(key(h) in names or (bool(sums(h)) and sums(h) <= names))
        for h in hidden
    ]


def column(truth: Record, report: Record | None) -> str:
    """Return the column of the confusion matrix: the report's statement in one word.

    That is the first effect named, since it is the strongest, unless the report is ``"ambiguous"``,
    ``"unexplained"`` with no effect, or names ``"none"``; ``"other joint"`` for the right effect on
    the wrong joint, ``"failed"`` without a report.
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


def parameter_errors(
    hidden: Record, effect: Record, mechanism: str
) -> dict[str, tuple[float, list[float]]]:
    """Return the relative error of each parameter that truth and report share.

    Also return its components in standard errors.
    """
    return errors(expected(hidden, mechanism), effect.get("parameters", {}), hidden["joint"])


def removed(truth: Record, report: Record | None) -> float | None:
    """Return the share of the held-out torque error above the noise floor that is removed.

    It is taken over the joints with hidden effects. None if nothing is named, or if there was no
    error above the noise floor.
    """
    if not named(report) or report is None:
        return None
    joints = [
        h["parameters"]["other"] if h["effect"] == "motor_coupling" else h["joint"]
        for h in truth["hidden"]
    ]
    gap = report["gap"]
    rms = [
        np.asarray(x, float)
        for x in (gap["before"]["torque_rms"], gap["after"]["torque_rms"], gap["noise_floor"])
    ]
    if None not in joints:
        rms = [x[sorted(set(joints))] for x in rms]
    before, after, floor = (float(np.sqrt((x**2).sum())) for x in rms)
    return (before - after) / (before - floor) if before > floor else None
