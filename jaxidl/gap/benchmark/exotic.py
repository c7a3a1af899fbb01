"""One uncommon effect of a whole robot, with a strength that matters on its joint."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from jaxidl.gap.benchmark.arms import Arm
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.parts import Part, at, listed, log_uniform
from jaxidl.gap.benchmark.sizing import sized
from jaxidl.gap.benchmark.worth import Motion

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


def uncommon(
    rng: np.random.Generator, name: str, arm: Arm, motion: Motion, j: int, common: list[Part]
) -> list[Part]:
    """Return the exotic effect ``name`` with a strength of 5 to 15 % of a joint's command.

    Nothing if it cannot have that strength on this joint.
    """
    aim = log_uniform(rng, 0.05, 0.15)
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
            "com": listed(arm.lengths[-1] * rng.uniform([-0.3, -0.3, 0.6], [0.3, 0.3, 1.2])),
        },
        "base_tilt": {"angles": (("size", math.cos(phase)), ("size", math.sin(phase)))},
        "spring": {
            "stiffness": ("size", 1.0),
            "rest": float(motion.q[:, j].mean() + 0.2 * span * sign),
        },
        "torque_ripple": {
            "amplitude": (("size", 1.0), ("size", 0.5), ("size", 0.3)),
            "period": period,
            "phase": listed(rng.uniform(0, 2 * math.pi, 3)),
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
            size = sized(lambda s: make(name, joint, at(shape, s)), arm.xml, motion, aim, start)
        except ValueError:
            return []
    parameters = at(shape, size)
    if _absurd(name, parameters, arm):
        return []
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
