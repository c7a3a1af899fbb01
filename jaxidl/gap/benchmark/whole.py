"""What is hidden in a whole robot.

These are all common effects on every joint at once, up to two exotic effects, a little presliding
friction on some joints, and a remainder that no effect covers. A worn robot has friction under load
on half of its joints, too, and more of the last two.
"""

import math
from typing import Any

import numpy as np

from jaxidl.gap.benchmark.arms import Arm
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.exotic import EXOTIC, uncommon
from jaxidl.gap.benchmark.parts import Part, at, listed, log_uniform
from jaxidl.gap.benchmark.worth import Motion, acts, rms

# least and largest share of the command of what is small, by the robot's family
SMALL = {"robot": (0.007, 0.025), "worn": (0.015, 0.06)}
# share of the largest joint torque that even an unloaded joint needs, for the sizes of its
# friction
TINY = 0.03


def draw(
    rng: np.random.Generator, arm: Arm, motion: Motion, exotic: int, family: str
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
    if family == "worn":
        loaded = np.flatnonzero(rng.uniform(size=len(need)) < 0.5).tolist()
        level = rng.uniform(0.03, 0.15, len(need)).tolist()
        common += [Part("load_dependent_friction", j, {"coefficient": level[j]}) for j in loaded]
    whole = _command(arm, motion, common)
    odd: list[Part] = []
    for name in rng.permutation(EXOTIC):
        if len(odd) == exotic:
            break
        joint = int(rng.integers(len(need)))
        odd += uncommon(rng, str(name), arm, whole, joint, common)
    left = [_small(rng, arm, whole, j, SMALL[family]) for j in range(len(need))]
    small = [part for parts in left for part in parts]
    known = [part for part in small if part.effect != "outside"]
    return common + odd + known, [part for part in small if part not in known]


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
        Part("viscous_friction", j, {"coefficient": need * log_uniform(rng, 0.07, 0.6) / speed}),
        Part("coulomb_friction", j, {"level": need * log_uniform(rng, 0.07, 0.6)}),
        Part(
            "inertia_error",
            j,
            {"extra": need * log_uniform(rng, 0.05, 0.4) / acceleration, "mass": mass},
        ),
        Part(
            "com_error",
            j,
            {"moment": listed((arm.masses[j] + mass) * arm.lengths[j] * rng.normal(0, 0.07, 3))},
        ),
        Part("inertia_tensor_error", j, {"tensor": [*listed(error), 0.0, 0.0, 0.0]}),
    ]
    if rng.uniform() < 0.4:
        parts.append(
            Part(
                "constant_offset",
                j,
                {"offset": need * log_uniform(rng, 0.02, 0.15) * float(rng.choice([-1, 1]))},
            )
        )
    return parts


def _command(arm: Arm, motion: Motion, parts: list[Part]) -> Motion:
    """Return the motion with the torques that it needs with the hidden ``parts``."""
    return motion._replace(
        tau=motion.tau - sum(acts(make(*part), arm.xml, motion) for part in parts)
    )


def _small(
    rng: np.random.Generator, arm: Arm, motion: Motion, j: int, sizes: tuple[float, float]
) -> list[Part]:
    """Return one to three small parts, each of a size between two shares of the command.

    They are presliding friction, and what no effect covers: drift, and a ripple of two positions
    together.
    """
    span, phase = float(np.ptp(motion.q[:, j])), float(rng.uniform(0, 2 * math.pi))
    shapes: dict[str, dict[str, Any]] = {
        "presliding_friction": {
            "level": ("size", 1.0),
            "distance": span * rng.uniform(0.02, 0.1),
        },
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
    for kind in map(str, rng.permutation(list(shapes))[: rng.integers(1, 4)]):
        size = log_uniform(rng, *sizes) * float(rms(motion.tau)[j])
        if kind == "presliding_friction":
            parts.append(Part(kind, j, at(shapes[kind], size)))
        else:
            parts.append(Part("outside", j, {"kind": kind} | at(shapes[kind], size * math.sqrt(2))))
    return parts
