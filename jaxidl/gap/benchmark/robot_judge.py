"""The score of a report on a whole robot.

It says which names are right, which effects are found, and how far off the parameters are.
"""

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np

from jaxidl.gap.benchmark import judge
from jaxidl.gap.benchmark.judge import Key, Record
from jaxidl.gap.benchmark.links import INERTIAL, Links
from jaxidl.gap.benchmark.reference import Array
from jaxidl.gap.benchmark.translate import True_, errors, expected

WORTH = 0.03  # share of a joint's command from which a workflow has to find an effect
# share of the joints' commands by which a link's effect has to explain the true torque for its
# name to be right
MATTERS = 0.01
# 1; a named torque scale further from the true one is wrong, because every true one differs a
# little from 1
SCALE_OFF = 0.02

CONTAINS: Mapping[str, tuple[str, ...]] = {
    "asymmetric_friction": ("coulomb_friction", "constant_offset", "viscous_friction"),
    "stribeck_friction": ("coulomb_friction",),
    "stiction": ("coulomb_friction",),
    "position_dependent_friction": ("coulomb_friction", "viscous_friction"),
    "coupled_friction": ("coulomb_friction", "viscous_friction"),
    "thermal_friction": ("viscous_friction",),
    "directional_load_friction": ("load_dependent_friction",),
    "spring": ("constant_offset",),
}
"""Effects that contain others by their formulas.

Naming the first also finds the second on that joint.
"""

TORQUES = {
    *(
        "level",
        "excess",
        "positive",
        "negative",
        "coefficient",
        "extra",
        "offset",
        "stiffness",
        "sine",
        "cosine",
    ),
    *("warm", "damping", "motor_inertia"),
}
"""Parameters in proportion to the joint's torque.

A log whose torque scale is off shows them larger by that factor.
"""


def names_of(record: Record) -> list[Key]:
    """Return effect and joint of a hidden or reported effect.

    A coupling of two joints has both.
    """
    effect, joint = judge.key(record)
    other = record.get(
        "other", record.get("options", {}).get("other", record["parameters"].get("other"))
    )
    other = other.get("value") if isinstance(other, Mapping) else other
    if effect in ("coupled_joint_friction", "motor_coupling") and other is not None:
        return [(effect, joint), (effect, int(np.ravel(other)[0]))]
    return [(effect, joint)]


def right(truth: Record, report: Record, effect: Record) -> bool:
    """Return whether ``effect`` of the report is right.

    It is if it is hidden on that joint, or equivalent to what is.
    """
    hidden = {name: h for h in truth["hidden"] for name in names_of(h)}
    for name in names_of(effect):
        if name == judge.key(effect) and name[0] == "torque_scale":
            value = np.ravel(
                np.asarray(effect["parameters"].get("scale", {}).get("value", 1.0), float)
            )
            true = hidden[name]["parameters"]["scale"] if name in hidden else 1.0
            return bool(
                abs(value[0 if len(value) == 1 else name[1] or 0] - true)
                <= SCALE_OFF + 0.2 * abs(true - 1)
            )
        if name in hidden:
            return True
        if any(
            (whole, name[1]) in hidden and name[0] in parts for whole, parts in judge.SUMS.items()
        ):
            return True
        if name[0] in judge.SUMS and all((part, name[1]) in hidden for part in judge.SUMS[name[0]]):
            return True
        if name[0] in INERTIAL:
            links = _links(truth)
            others = [n for n in _inertial(judge.named(report)) if n != name]
            with_it, without = (
                links.left(links.error, [*others, name]),
                links.left(links.error, others),
            )
            after, change = _left(truth, report), links.vector(effect)
            better = links.energy(after) < links.energy(after + change)
            return better and without**2 - with_it**2 >= MATTERS**2
    return False


def found(truth: Record, report: Record | None, hidden: Record) -> bool:
    """Return whether the action of ``hidden`` is named.

    That is by the effect itself, one that contains it, or links' effects that are equivalent.
    """
    names = set(judge.named(report)) if report else set()
    for effect, joint in names_of(hidden):
        if (effect, joint) in names or any(
            (whole, joint) in names for whole, parts in CONTAINS.items() if effect in parts
        ):
            return True
        if effect in judge.SUMS and all((part, joint) in names for part in judge.SUMS[effect]):
            return True
    if hidden["effect"] in INERTIAL:
        links = _links(truth)
        return links.left(links.vector(hidden), _inertial(sorted(names, key=str))) < WORTH
    return False


def worth(hidden: Record) -> float:
    """Return the largest share of a joint's command that a hidden effect has."""
    return max(hidden["worth"])


def parameter_errors(
    truth: Record, report: Record, effect: Record
) -> dict[str, tuple[float, list[float]]]:
    """Return relative errors and errors in standard errors of the parameters of ``effect``.

    They are as in :func:`.translate.errors`. The truth is the result of a perfect fit of what the
    report gives: a Coulomb friction within a named Stribeck curve belongs to its level; a rotor
    includes what no named link's effect can explain; values are in the log's torques.
    """
    name, names = judge.key(effect), judge.named(report)
    if name[0] in INERTIAL:
        links = [e for e in report["effects"] if e["effect"] in INERTIAL]
        fitted = _links(truth).fitted(links).get(name, {})
        true: dict[str, True_] = dict(fitted)
    else:
        true = _merged(truth, name, names)
    scales = {
        h["joint"]: h["parameters"]["scale"]
        for h in truth["hidden"]
        if h["effect"] == "torque_scale"
    }
    scale = 1.0 if ("torque_scale", name[1]) in names else scales.get(name[1], 1.0)
    if name[0] not in ("load_dependent_friction", "directional_load_friction", "torque_scale"):
        true = {
            key: _over(value, scale) if key in TORQUES else value for key, value in true.items()
        }
    return errors(true, effect["parameters"], name[1])


def link_error(truth: Record, report: Record | None) -> float:
    """Return the RMS torque of the remaining errors of the links, over that before.

    The remaining errors are those after what a report names.
    """
    links = _links(truth)
    before = links.energy(links.error)
    return (links.energy(_left(truth, report)) / before) ** 0.5 if before else 0.0


def _left(truth: Record, report: Record | None) -> Array:
    """Return the errors of the links (P,) after all that a report names with confidence."""
    links = _links(truth)
    said = [
        e
        for e in (report or {}).get("effects", [])
        if e["effect"] in INERTIAL and judge.confidence(e) >= judge.CONFIDENT
    ]
    return links.error - sum((links.vector(e) for e in said), np.zeros(links.size))


def _merged(truth: Record, name: Key, names: list[Key]) -> dict[str, True_]:
    """Return the true parameters of ``name``.

    They include what else is hidden on its joint, is not named, and has the same form.
    """
    here = {
        h["effect"]: expected(h)
        for h in truth["hidden"]
        if name in [(name[0], joint) for _, joint in names_of(h)]
    }
    unnamed = {effect: p for effect, p in here.items() if (effect, name[1]) not in names}
    true = dict(here.get(name[0], {}))
    if "sublinear_friction" in here and name[0] in judge.COMPANIONS["sublinear_friction"]:
        # where a bent friction is hidden, its line depends on the range of speeds of the fit
        return {}
    dry, offset = (
        _one(unnamed, "coulomb_friction", "level"),
        _one(unnamed, "constant_offset", "offset"),
    )
    sides = "asymmetric_friction" in unnamed
    if name[0] in ("stribeck_friction", "position_dependent_friction") and "level" in true:
        true["level"] = _plus(true["level"], dry)
    elif name[0] == "thermal_friction" and true:
        true["warm"] = _one(unnamed, "viscous_friction", "coefficient") + _one(
            here, "thermal_friction", "warm"
        )
    elif name[0] == "asymmetric_friction":
        both = true or {"positive": 0.0, "negative": 0.0}
        true = {
            "positive": _plus(both["positive"], dry - offset),
            "negative": _plus(both["negative"], dry + offset),
        }
    elif name[0] == "spring" and true and offset:
        true["rest"] = _plus(true["rest"], offset / _one(here, "spring", "stiffness"))
    elif name[0] in ("coulomb_friction", "constant_offset") and sides:
        forward, backward = (
            _one(unnamed, "asymmetric_friction", side) for side in ("positive", "negative")
        )
        if name[0] == "coulomb_friction":
            true = {"level": _plus(true.get("level", 0.0), (forward + backward) / 2)}
        else:
            true = {"offset": _plus(true.get("offset", 0.0), (backward - forward) / 2)}
    return true


def _one(here: Mapping[str, Mapping[str, True_]], effect: str, name: str) -> float:
    """Return a number among the parameters of an effect; 0 if it is missing."""
    value = here.get(effect, {}).get(name, 0.0)
    return 0.0 if callable(value) else float(np.ravel(np.asarray(value))[0])


def _plus(value: True_, more: float) -> True_:
    if callable(value):
        table: Callable[[Array], Array] = value
        return lambda q: table(q) + more
    return value + more


def _over(value: True_, scale: float) -> True_:
    if callable(value):
        table: Callable[[Array], Array] = value
        return lambda q: table(q) / scale
    return value / scale


def _inertial(names: list[Key]) -> list[Key]:
    return [name for name in names if name[0] in INERTIAL]


def _links(truth: Record) -> Links:
    return _made(_Held(truth["inertial"]))


class _Held:
    """A record by its identity, so that results derived from it can be cached."""

    def __init__(self, record: Record):
        self.record = record

    def __hash__(self) -> int:
        return id(self.record)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Held) and other.record is self.record


@lru_cache(maxsize=4)
def _made(held: _Held) -> Links:
    return Links(held.record)
