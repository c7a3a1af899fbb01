"""What is hidden in a whole robot.

These are all common effects on every joint at once, up to two exotic effects, and a remainder.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxidl.gap.benchmark.arms import Arm
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.reference import Array
from jaxidl.gap.benchmark.sizing import sized
from jaxidl.gap.benchmark.worth import Motion, acts, rms

# share of the largest joint torque that even an unloaded joint needs, for the sizes of its
# friction
TINY = 0.03
EXOTIC = (
    "asymmetric_friction",
    "stribeck_friction",
    "quadratic_drag",
    "sublinear_friction",
    "position_dependent_friction",
    "load_dependent_friction",
    "directional_load_friction",
    "coupled_friction",
    "coupled_joint_friction",
    "motor_coupling",
    "thermal_friction",
    "payload",
    "base_tilt",
    "spring",
    "torque_ripple",
    "torque_scale",
    "torque_curve",
    "torque_saturation",
    "actuator_lag",
    "actuator_delay",
    "joint_elasticity",
    "position_bias",
)
WHOLE = ("payload", "base_tilt")


class Part(NamedTuple):
    """A hidden effect or, as ``"outside"``, a part of the remainder.

    ``joint`` is None for one of the whole robot.
    """

    effect: str
    joint: int | None
    parameters: Mapping[str, Any]


def draw(
    rng: np.random.Generator, arm: Arm, motion: Motion, exotic: int
) -> tuple[list[Part], list[Part]]:
    """Draw the hidden effects and the remainder for the ``motion`` of the believed ``arm``.

    ``exotic`` of the effects are uncommon. Sizes are shares of what each joint's motion needs, with
    friction and errors of links as they are found on real arms.
    """
    need = rms(motion.tau)
    need = np.maximum(need, TINY * need.max())
    common = [
        part for j in range(len(need)) for part in _common(rng, arm, motion, j, float(need[j]))
    ]
    whole = _command(arm, motion, common)
    odd: list[Part] = []
    for name in rng.permutation(EXOTIC):
        if len(odd) == exotic:
            break
        joint = int(rng.integers(len(need)))
        odd += _odd(rng, str(name), arm, whole, joint, common)
    return common + odd, [part for j in range(len(need)) for part in _remainder(rng, arm, whole, j)]


def _common(rng: np.random.Generator, arm: Arm, motion: Motion, j: int, need: float) -> list[Part]:
    """Return friction, rotor, offset on some joints, and errors of the link.

    The errors are a few to 20 % of its mass and size.
    """
    speed, acceleration = rms(motion.qd)[j], rms(motion.qdd)[j]
    mass = arm.masses[j] * rng.uniform(0.03, 0.2) * rng.choice([-1, 1])
    error = (
        arm.inertias[j] * (1 + mass / arm.masses[j]) * rng.uniform(0.05, 0.2) * rng.choice([-1, 1])
    )
    parts = [
        Part("viscous_friction", j, {"coefficient": need * _log(rng, 0.07, 0.6) / speed}),
        Part("coulomb_friction", j, {"level": need * _log(rng, 0.07, 0.6)}),
        Part(
            "inertia_error", j, {"extra": need * _log(rng, 0.05, 0.4) / acceleration, "mass": mass}
        ),
        Part(
            "com_error",
            j,
            {"moment": _list((arm.masses[j] + mass) * arm.lengths[j] * rng.normal(0, 0.07, 3))},
        ),
        Part("inertia_tensor_error", j, {"tensor": [*_list(error), 0.0, 0.0, 0.0]}),
    ]
    if rng.uniform() < 0.4:
        parts.append(
            Part(
                "constant_offset",
                j,
                {"offset": need * _log(rng, 0.02, 0.15) * float(rng.choice([-1, 1]))},
            )
        )
    return parts


def _command(arm: Arm, motion: Motion, parts: list[Part]) -> Motion:
    """Return the motion with the torques that it needs with the hidden ``parts``."""
    return motion._replace(
        tau=motion.tau - sum(acts(make(*part), arm.xml, motion) for part in parts)
    )


def _odd(
    rng: np.random.Generator, name: str, arm: Arm, motion: Motion, j: int, common: list[Part]
) -> list[Part]:
    """Return the exotic effect ``name`` with a strength of 5 to 15 % of a joint's command.

    Nothing if it cannot have that strength on this joint.
    """
    aim, joints = _log(rng, 0.05, 0.15), len(arm.masses)
    other = j - 1 if j else 1
    tau, span = motion.tau[:, j], float(np.ptp(motion.q[:, j]))
    period, phase, sign = (
        span * rng.uniform(0.3, 0.8),
        float(rng.uniform(0, 2 * math.pi)),
        float(rng.choice([-1, 1])),
    )
    shapes: dict[str, dict[str, Any]] = {
        "asymmetric_friction": {"positive": ("size", 1.5), "negative": ("size", 0.5)},
        "stribeck_friction": {
            "sliding": ("size", 0.2),
            "excess": ("size", 1.0),
            "speed": 0.2 * float(np.abs(motion.qd[:, j]).max()),
        },
        "quadratic_drag": {"coefficient": ("size", 1.0)},
        "sublinear_friction": {"coefficient": ("size", 1.0), "power": rng.uniform(0.4, 0.6)},
        "position_dependent_friction": {
            "level": ("size", 1.0),
            "variation": 0.9,
            "period": period * 2,
            "phase": phase,
        },
        "coupled_friction": {
            "other": other,
            "level": ("size", 1.0),
            "variation": 0.9,
            "period": period * 2,
            "phase": phase,
        },
        "load_dependent_friction": {"coefficient": ("size", 1.0)},
        "directional_load_friction": {
            "driving": ("size", 1.0),
            "driven": ("size", rng.uniform(0.2, 0.6)),
        },
        "coupled_joint_friction": {
            "other": other,
            "coefficient": ("size", 1.0),
            "level": ("size", 0.5),
            "difference": sign < 0,
        },
        "motor_coupling": {"other": other, "share": ("size", sign)},
        "thermal_friction": {"excess": ("size", 1.0), "time_constant": rng.uniform(12.0, 25.0)},
        "payload": {
            "mass": ("size", 1.0),
            "com": _list(arm.lengths[-1] * rng.uniform([-0.3, -0.3, 0.6], [0.3, 0.3, 1.2])),
        },
        "base_tilt": {"angles": (("size", math.cos(phase)), ("size", math.sin(phase)))},
        "spring": {
            "stiffness": ("size", 1.0),
            "rest": float(motion.q[:, j].mean() + 0.2 * span * sign),
        },
        "torque_ripple": {
            "amplitude": (("size", 1.0), ("size", 0.5), ("size", 0.3)),
            "period": period,
            "phase": _list(rng.uniform(0, 2 * math.pi, 3)),
        },
        "torque_scale": {"scale": 1 + sign * aim},
        "torque_curve": {"loss": ("size", 1.0)},
        "torque_saturation": {"limit": float(np.quantile(np.abs(tau), 1 - aim))},
        "actuator_lag": {"time_constant": ("size", 1.0)},
        "actuator_delay": {"delay": ("size", 1.0)},
        "position_bias": {"bias": ("size", sign)},
        "joint_elasticity": {},
    }
    shape = shapes[name]
    if name == "joint_elasticity":
        shape = _spring(rng, j, common)
    joint = None if name in WHOLE else j
    start = (
        0.01
        if name in ("torque_curve", "base_tilt", "position_bias", "actuator_lag", "actuator_delay")
        else 0.1
    )
    if name in ("actuator_lag", "actuator_delay"):
        size = min(0.015, aim * float(np.std(tau) / np.std(np.gradient(tau, motion.time))))
    elif "size" not in str(shape):
        size = 1.0
    else:
        try:
            size = sized(lambda s: make(name, joint, _at(shape, s)), arm.xml, motion, aim, start)
        except ValueError:
            return []
    parameters = _at(shape, size)
    if _absurd(name, parameters, arm):
        return []
    assert 0 <= other < joints
    return [Part(name, joint, parameters)]


def _absurd(name: str, parameters: Mapping[str, Any], arm: Arm) -> bool:
    """Return whether the effect would have to be unrealistically large to matter on this joint."""
    match name:
        case "payload":
            return parameters["mass"] > 0.5 * float(arm.masses.sum())
        case "motor_coupling":
            return abs(parameters["share"]) > 1.0
        case "base_tilt":
            return math.hypot(*parameters["angles"]) > 0.12
        case "position_bias":
            return abs(parameters["bias"]) > 0.12
        case "load_dependent_friction" | "directional_load_friction":
            return max(parameters.values()) > 0.3
        case _:
            return False


def _spring(rng: np.random.Generator, j: int, common: list[Part]) -> dict[str, Any]:
    """Return parameters of a rotor behind a spring.

    It is the whole error of the rotor's inertia.
    """
    rotor = next(
        part.parameters["extra"]
        for part in common
        if part.effect == "inertia_error" and part.joint == j
    )
    stiffness = rotor * (2 * math.pi * rng.uniform(9, 16)) ** 2
    return {
        "stiffness": stiffness,
        "damping": 2 * 0.3 * math.sqrt(stiffness * rotor),
        "motor_inertia": rotor,
    }


def _remainder(rng: np.random.Generator, arm: Arm, motion: Motion, j: int) -> list[Part]:
    """Return what no effect covers, of 0.7 to 2.5 % of the command each.

    These are hysteresis, drift and a ripple of two positions together.
    """
    span, phase = float(np.ptp(motion.q[:, j])), float(rng.uniform(0, 2 * math.pi))
    shapes: dict[str, dict[str, Any]] = {
        "hysteresis": {"level": ("size", 1.0), "distance": span * rng.uniform(0.02, 0.1)},
        "offset_drift": {
            "amplitude": ("size", 1.0),
            "frequency": rng.uniform(0.01, 0.04),
            "phase": phase,
        },
        "coupled_ripple": {
            "other": j - 1 if j else 1,
            "amplitude": ("size", 1.0),
            "period": span * rng.uniform(0.2, 0.6),
            "phase": phase,
        },
    }
    parts = []
    for kind in rng.permutation(list(shapes))[: rng.integers(1, 4)]:
        shape = {"kind": str(kind)} | shapes[str(kind)]
        aim = _log(rng, 0.007, 0.025)
        size = aim * float(rms(motion.tau)[j])
        parts.append(
            Part("outside", j, _at(shape, size * math.sqrt(1 if kind == "hysteresis" else 2)))
        )
    return parts


def _at(shape: Mapping[str, Any], size: float) -> dict[str, Any]:
    """Return parameters of a shape at ``size``: ("size", x) means x times it."""

    def value(x: Any) -> Any:
        if isinstance(x, tuple):
            return float(size * x[1]) if x[0] == "size" else [value(one) for one in x]
        return float(x) if isinstance(x, float | np.floating) else x

    return {key: value(x) for key, x in shape.items()}


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def _list(values: Array) -> list[float]:
    return [float(x) for x in values]
