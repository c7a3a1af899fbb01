"""Parameters of hidden effects, drawn at random around a size.

The size sets how strong the effect is.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxidl.gap.benchmark.believed import SPAN
from jaxidl.gap.benchmark.imitable import IMITABLE
from jaxidl.gap.benchmark.reference import Array


class Place(NamedTuple):
    """A joint of a mechanism, with the magnitudes to which effects there are proportional."""

    span: float  # m or rad
    rotor: float  # kg or kg m², the model's armature
    link: float  # kg or kg m², the rest of the joint's inertia
    arm: float  # m, length of the last body


PLACES: dict[tuple[str, int], Place] = {
    ("slider", 0): Place(SPAN["slide"], 0.3, 2.0, 0.0),
    ("pendulum", 0): Place(SPAN["hinge"], 0.02, 0.166, 0.5),
    ("two_link", 0): Place(SPAN["hinge"], 0.05, 0.42, 0.35),
    ("two_link", 1): Place(SPAN["hinge"], 0.03, 0.041, 0.35),
}
FINE = 2e-4  # s, the engine's step at 500 Hz; dead times are whole steps


def parameters(
    row: str, size: float, rng: np.random.Generator, mechanism: str, joint: int
) -> Mapping[str, Any]:
    """Return parameters of the effect in the severity table's ``row``, at ``size``.

    A row is ``"name"`` or ``"name/kind"``.
    """
    place, (name, _, kind) = PLACES[mechanism, joint], row.partition("/")
    if name == "outside":
        return {"kind": kind} | (
            _imitable(kind, size, rng, place, joint)
            if kind in IMITABLE
            else _outside(kind, size, rng, place)
        )
    if name == "inertia_error":  # may be too large as well as too small, but has to stay an inertia
        most = 0.6 if kind else 0.8 * place.rotor
        return {
            "extra": size * float(rng.choice([-1, 1])) if size < most else size,
            "kind": kind or "rotor",
        }
    if wide := _wide(row, size, rng, place, joint):
        return wide
    drawn = (
        _plain(name, size, rng)
        or _shaped(name, size, rng, place)
        or _hidden_rotor(name, size, rng, place)
    )
    if name == "coupled_friction":
        drawn["other"] = 1 - joint
    return drawn | ({"kind": kind} if kind else {})


def _plain(name: str, size: float, rng: np.random.Generator) -> dict[str, Any]:
    """Return parameters of effects whose size is the parameter, except for its sign."""
    signed = size * float(rng.choice([-1, 1]))
    match name:
        case "viscous_friction" | "quadratic_drag" | "load_dependent_friction":
            return {"coefficient": size}
        case "coulomb_friction":
            return {"level": size}
        case "stiction":
            return {"breakaway": size}
        case "constant_offset":
            return {"offset": signed}
        case "torque_scale":
            return {"scale": 1 + signed}
        case "torque_saturation":
            return {"limit": size}
        case "actuator_lag":
            return {"time_constant": size}
        case "actuator_delay" | "sensor_delay":
            return {"delay": FINE * round(size / FINE)}
        case "position_bias":
            return {"bias": signed}
        case _:
            return {}


def clipping(share: float, torque: Array) -> float:
    """Return the limit that would clip ``share`` of the RMS of ``torque`` (T,).

    It assumes that nothing reacts. A share is used because peaks differ between motions.
    """
    low, high = 0.0, float(np.abs(torque).max())
    for _ in range(40):
        limit = (low + high) / 2
        clipped = np.linalg.norm(torque - np.clip(torque, -limit, limit)) / np.linalg.norm(torque)
        low, high = (limit, high) if clipped > share else (low, limit)
    return (low + high) / 2


def _shaped(name: str, size: float, rng: np.random.Generator, place: Place) -> dict[str, Any]:
    """Return parameters of effects that have a shape in addition to their size."""
    phase = float(rng.uniform(0, 2 * math.pi))
    wave = {
        "variation": _in(rng, 0.7, 0.95),
        "period": place.span * _in(rng, 0.7, 1.6),
        "phase": phase,
    }
    match name:
        case "asymmetric_friction":
            sides = size * (1 + _in(rng, 0.4, 0.8) * np.array([1, -1]) * rng.choice([-1, 1]))
            return {"positive": float(sides[0]), "negative": float(sides[1])}
        case "stribeck_friction":
            return {
                "sliding": size,
                "excess": size * _in(rng, 0.9, 1.5),
                "speed": place.span * _in(rng, 0.1, 0.25),
            }
        case "presliding_friction":
            return {"level": size, "distance": place.span * _in(rng, 0.05, 0.15)}
        case "position_dependent_friction" | "coupled_friction":
            return {"level": size} | wave
        case "payload":
            return {
                "mass": size,
                "com": [place.arm * _in(rng, -0.15, 0.15), 0.0, -place.arm * _in(rng, 0.6, 1.1)],
            }
        case "spring":
            return {"stiffness": size, "rest": place.span * _in(rng, -0.3, 0.3)}
        case "torque_ripple":
            return {"amplitude": size, "period": place.span * _in(rng, 0.15, 0.45), "phase": phase}
        case _:
            return {}


def _wide(
    row: str, size: float, rng: np.random.Generator, place: Place, joint: int
) -> dict[str, Any]:
    """Return parameters of effects of the wider catalogue."""
    match row:
        case "com_error":
            # sideways, because along the link it is an inertia as well
            turn = _in(rng, -0.15, 0.15) + math.pi * int(rng.integers(2))
            return {"moment": [size * math.cos(turn), 0.0, size * math.sin(turn)]}
        case "inertia_tensor_error":
            return {"tensor": [size, size, 0.0, 0.0, 0.0, 0.0]}
        case "directional_load_friction":
            return {"driving": size, "driven": size * _in(rng, 0.1, 0.5)}
        case "thermal_friction":
            return {"excess": size, "time_constant": _in(rng, 5.0, 9.0)}
        case "torque_curve":
            return {"loss": size}
        case "sublinear_friction":
            return {"coefficient": size, "power": _in(rng, 0.4, 0.6)}
        case "coupled_joint_friction":
            difference, dry = bool(rng.integers(2)), size * _in(rng, 0.2, 0.5)
            return {"other": 1 - joint, "coefficient": size, "level": dry, "difference": difference}
        case "motor_coupling":
            return {"other": 1 - joint, "share": size * float(rng.choice([-1, 1]))}
        case "torque_ripple/harmonics":
            waves = {"amplitude": [size, size * _in(rng, 0.4, 0.8), size * _in(rng, 0.2, 0.5)]}
            return waves | {
                "period": place.span * _in(rng, 0.4, 0.7),
                "phase": rng.uniform(0, 2 * math.pi, 3).tolist(),
            }
        case "payload/inertia":
            load = {
                "mass": size,
                "com": [place.arm * _in(rng, -0.15, 0.15), 0.0, -place.arm * _in(rng, 0.6, 1.1)],
            }
            return load | {
                "inertia": [size * (place.arm * _in(rng, 0.1, 0.3)) ** 2] * 3 + [0.0] * 3
            }
        case _:
            return {}


def _hidden_rotor(name: str, size: float, rng: np.random.Generator, place: Place) -> dict[str, Any]:
    """Return parameters of an elasticity or of backlash.

    ``size`` is its stiffness, or the gap between stiff ends; the damping keeps the loop stable.
    """
    reduced = place.rotor * place.link / (place.rotor + place.link)
    stiffness = size if name == "joint_elasticity" else reduced * (2 * math.pi * 50) ** 2
    drawn = {
        "stiffness": stiffness,
        "damping": 2 * _in(rng, 0.27, 0.35) * math.sqrt(stiffness * reduced),
        "motor_inertia": place.rotor,
    }
    return drawn if name == "joint_elasticity" else drawn | {"gap": size}


def _outside(kind: str, size: float, rng: np.random.Generator, place: Place) -> dict[str, Any]:
    """Return parameters of effects that are not in the catalogue."""
    phase = float(rng.uniform(0, 2 * math.pi))
    match kind:
        case "offset_drift" | "scale_drift":
            return {"amplitude": size, "frequency": _in(rng, 0.04, 0.06), "phase": phase}
        case "disturbance":
            return {"amplitude": size, "frequency": _in(rng, 1.1, 1.6), "phase": phase}
        case "cubic_spring":
            return {"stiffness": size, "rest": place.span * _in(rng, -0.15, 0.15)}
        case "memory_drag":
            return {"coefficient": size, "memory": _in(rng, 0.25, 0.35)}
        case "dropouts":
            return {
                "depth": _in(rng, 0.8, 1.0),
                "length": size,
                "interval": _in(rng, 1.2, 1.8),
                "phase": phase,
            }
        case _:
            raise KeyError(kind)


def _imitable(
    kind: str, size: float, rng: np.random.Generator, place: Place, joint: int
) -> dict[str, Any]:
    """Return parameters of effects outside the catalogue that follow from the state."""
    phase = {"phase": float(rng.uniform(0, 2 * math.pi))}
    match kind:
        case "acceleration_friction" | "root_load_friction":
            return {"coefficient": size}
        case "position_inertia":
            return {"inertia": size, "period": place.span * _in(rng, 1.2, 2.0)} | phase
        case "torque_deadband":
            return {"width": size}
        case "elastic_coupling":
            return {"other": 1 - joint, "stiffness": size}
        case "cable_drag":
            return {"other": 1 - joint, "coefficient": size}
        case "coupled_ripple":
            return {
                "other": 1 - joint,
                "amplitude": size,
                "period": place.span * _in(rng, 0.5, 1.0),
            } | phase
        case "encoder_eccentricity":
            return {"error": size, "period": place.span * _in(rng, 1.5, 2.5)} | phase
        case "fading_motor":
            return {"loss": size}
        case _:
            raise KeyError(kind)


def _in(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))
