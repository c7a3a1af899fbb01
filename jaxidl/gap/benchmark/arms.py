"""Random serial arms of 3 to 7 joints: the believed models, as MJCF.

Units are SI; nothing dissipates.
"""

import math
from dataclasses import dataclass

import numpy as np

from jaxidl.gap.benchmark.reference import Array

TURNS = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
JOINTS = (3, 7)


@dataclass(frozen=True)
class Arm:
    """An arm of J joints as it is believed to be.

    Attributes:
        xml: its MJCF; body ``link<j>`` carries joint ``joint<j>``.
        lengths: of the links (J,) [m].
        masses: of the links (J,) [kg].
        inertias: of the links about their centres of mass in their own axes (J, 3) [kg m²].
    """

    xml: str
    lengths: Array
    masses: Array
    inertias: Array


def random_arm(rng: np.random.Generator) -> Arm:
    """Draw an arm.

    Most of its joints turn about a different axis than the one before, and its links become lighter
    and shorter outwards. Every second arm has rotor inertias in its model, like a manufacturer's
    file; the others have none, like most URDFs.
    """
    joints = int(rng.integers(JOINTS[0], JOINTS[1] + 1))
    shrink = rng.uniform(0.78, 0.92) ** np.arange(joints)
    lengths = np.maximum(0.07, rng.uniform(0.25, 0.45) * shrink * rng.uniform(0.5, 1.2, joints))
    masses = rng.uniform(3.0, 12.0) * shrink**1.5 * rng.uniform(0.7, 1.3, joints)
    radii = rng.uniform(0.12, 0.2) * lengths
    inertias, bodies, along = np.zeros((joints, 3)), [], rng.permutation(["z"] + ["y"] * 2)[0]
    known = rng.uniform(0.02, 0.08) if rng.integers(2) else 0.0
    for j in range(joints):
        axis = "z" if j == 0 and along == "z" else _turn(rng, along)
        along = axis
        slender = masses[j] * (lengths[j] ** 2 / 12 + radii[j] ** 2 / 4)
        inertias[j] = np.array([slender, slender, masses[j] * radii[j] ** 2 / 2]) * rng.uniform(
            0.8, 1.2
        )
        centre = [*rng.uniform(-0.08, 0.08, 2) * lengths[j], lengths[j] * rng.uniform(0.3, 0.6)]
        place = (
            [0.0, 0.0, 0.15]
            if j == 0
            else [*rng.uniform(-0.15, 0.15, 2) * lengths[j - 1], lengths[j - 1]]
        )
        bodies.append(
            f'<body name="link{j}" pos="{_row(place)}"><joint name="joint{j}" type="hinge"'
            f' axis="{TURNS[axis]}" armature="{known * masses[j] * lengths[j] ** 2:.5g}"/><inertial'
            f' pos="{_row(centre)}" mass="{masses[j]:.5g}" diaginertia="{_row(inertias[j])}"/><geom'
            f' fromto="0 0 0 0 0 {lengths[j]:.5g}" size="{radii[j]:.5g}"/>'
        )
    nested = "".join(chr(10) + "    " + "  " * j + body for j, body in enumerate(bodies)).strip()
    xml = f"""<mujoco model="arm">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"><flag contact="disable"/></option>
  <default><geom type="capsule" contype="0" conaffinity="0" group="1"/></default>
  <worldbody>
    {nested}{"</body>" * joints}
  </worldbody>
</mujoco>
"""
    return Arm(xml, lengths, masses, inertias)


def excitation(
    rng: np.random.Generator, joints: int, duration: float, rate: float
) -> tuple[Array, Array, Array]:
    """Return positions, speeds and accelerations, each (T, J), of sums of six harmonics.

    They start and end at rest; SI units. Ranges are ±0.5 to ±1.3 rad and peak speeds at most 0.9 to
    2.2 rad/s, drawn for each joint.
    """
    time = np.arange(round(duration * rate)) / rate
    window = (
        np.sin(math.pi / 2 * np.clip((np.minimum(time, time[-1] - time) - 0.8) / 2.5, 0, 1)) ** 2
    )
    columns = []
    for _ in range(joints):
        first, order = rng.uniform(0.06, 0.13), np.arange(1, 7)
        wave = np.sin(2 * math.pi * first * np.outer(time, order) + rng.uniform(0, 2 * math.pi, 6))
        shape = (wave * rng.uniform(0.3, 1.0, 6) / order**0.7).sum(axis=1) * window
        fastest, widest = rng.uniform(0.9, 2.2), rng.uniform(0.5, 1.3)
        size = min(
            fastest / np.abs(np.gradient(shape, 1 / rate)).max(), widest / np.abs(shape).max()
        )
        columns.append(rng.uniform(-0.5, 0.5) + size * shape)
    q = np.stack(columns, axis=1)
    qd = np.gradient(q, 1 / rate, axis=0)
    return q, qd, np.gradient(qd, 1 / rate, axis=0)


def _turn(rng: np.random.Generator, before: str) -> str:
    """Return an axis for the next joint.

    One time in five it is the same as before, so that parallel joints occur.
    """
    if rng.uniform() < 0.2:
        return before
    return str(rng.choice([axis for axis in TURNS if axis != before]))


def _row(values: list[float] | Array) -> str:
    return " ".join(f"{value:.5g}" for value in values)
