"""Dry friction as a true stop.

Within a fine step it applies the torque that brings the joint to rest, if its level allows,
otherwise its level.
"""

import math
from collections.abc import Mapping

from jaxidl.gap.benchmark.injected import Floats

Level = tuple[float, float, float]  # moving forward, backward, and at rest if that is more; N or Nm


def rub(
    levels: Mapping[int, Level], qd: Floats, net: Floats, mass: list[Floats], step: float
) -> Floats:
    """Return friction (J,) of one or two joints.

    Two joints with friction act on each other through the mass matrix: unless both can be stopped
    at once, each is improved in turn.

    Args:
        levels: by joint, for those with friction.
        qd: speeds (J,).
        net: all other torques (J,), less weight and Coriolis torques.
        mass: mass matrix (J, J).
        step: length of the step [s].
    """
    joints, friction = range(len(qd)), [0.0] * len(qd)
    if len(levels) == 2:
        stop = [-sum(mass[j][k] * qd[k] for k in joints) / step - net[j] for j in joints]
        if all(abs(stop[j]) <= _bears(levels[j], qd[j], 0.0, -stop[j]) for j in joints):
            return stop
    inverse = _inverse(mass)
    for _ in range(1 if len(levels) == 1 else 4):
        for j, level in levels.items():
            free = qd[j] + step * sum(
                inverse[j][k] * (net[k] + (friction[k] if k != j else 0.0)) for k in joints
            )
            stopping, side = -free / (step * inverse[j][j]), level[0] if free > 0 else level[1]
            friction[j] = (
                stopping
                if abs(stopping) <= _bears(level, qd[j], free, free)
                else math.copysign(side, stopping)
            )
    return friction


def _bears(level: Level, speed: float, free: float, push: float) -> float:
    """Return what the friction withstands against ``push``.

    It is more at rest, or where the joint would reverse to the speed ``free``.
    """
    side = level[0] if push > 0 else level[1]
    return max(side, level[2]) if abs(speed) < 1e-9 or speed * free <= 0 else side


def _inverse(mass: list[Floats]) -> list[Floats]:
    if len(mass) == 1:
        return [[1 / mass[0][0]]]
    (a, b), (_, c) = mass
    det = a * c - b * b
    return [[c / det, -b / det], [-b / det, a / det]]
