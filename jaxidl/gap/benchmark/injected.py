"""The catalogue's effects as they are put into MuJoCo, in plain floats, written apart from the code
that is to find them.

Each acts on one joint ``joint`` through the hooks of :class:`Injected` that it overrides; the
engine calls them at every fine step. Positions in m or rad, torques in N or Nm, times in s.
"""

import math
from dataclasses import dataclass, field
from typing import Any

import mujoco as _mujoco
import numpy as np

from jaxidl.gap.benchmark.reference import Array

mujoco: Any = _mujoco  # its names are made when it is imported

Floats = list[float]


def tensor(six: Floats) -> Array:
    """The symmetric matrix (3, 3) of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float)


def principal(inertia: Array) -> tuple[list[float], list[float]]:
    """Principal moments and the quaternion (w, x, y, z) of the principal axes of a tensor (3, 3).

    Raises:
        ValueError: for a tensor that no body has.
    """
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] <= 0 or moments[2] > moments[0] + moments[1] + 1e-12:
        raise ValueError(f"no body has principal moments of inertia {moments}")
    axes = axes * np.linalg.det(axes)  # a rotation, no reflection
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return moments.tolist(), quaternion.tolist()


def row(values: float | Floats) -> Floats:
    return [float(values)] if isinstance(values, float | int) else list(values)


@dataclass
class Injected:
    """One hidden effect; a plain one changes nothing."""

    joint: int

    def alter(self, spec: Any) -> None:
        """Change the true mechanism before it is compiled."""

    def start(self, step: float, position: float, command: float) -> None:
        """Forget everything: a run with the fine step ``step`` [s] starts at rest at ``position``
        under ``command``.
        """

    def encoder(self) -> tuple[float, float]:
        """How late the reading is, and how much it reads too much."""
        return 0.0, 0.0

    def misread(self, q: float) -> float:
        """How much the reading is too much at the true position ``q``, if that varies."""
        return 0.0

    def actuate(self, t: float, command: float) -> float:
        """The torque that the motor delivers for ``command``, or for what the stage before it
        delivers.
        """
        return command

    def spread(self, delivered: Floats) -> tuple[int, float]:
        """Another joint, and the torque that what the motors deliver makes there."""
        return self.joint, 0.0

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        """A smooth torque on the joint."""
        return 0.0

    def dry(self, q: float, qd: float, delivered: float) -> tuple[float, float, float]:
        """Dry friction: its level when moving forward, backward, and what it bears at rest if that
        is more.
        """
        return 0.0, 0.0, 0.0

    def passive(self, qd: Floats) -> dict[int, float]:
        """The torques by joint of what :meth:`alter` has made the engine do; only for keeping
        account of them.
        """
        return {}


@dataclass
class InertiaError(Injected):
    """``extra`` rotor inertia, or (``kind="mass"``) the joint's body with mass and inertia (1 +
    ``extra``) times as large.

    ``mass`` [kg] comes on top of a body's, whose inertia grows in proportion.
    """

    extra: float
    kind: str = "rotor"
    mass: float = 0.0

    def alter(self, spec: Any) -> None:
        joint = spec.joints[self.joint]
        if self.kind == "rotor":
            joint.armature += self.extra
        else:
            joint.parent.mass *= 1 + self.extra
            joint.parent.inertia = joint.parent.inertia * (1 + self.extra)
        if self.mass:
            joint.parent.inertia = joint.parent.inertia * (1 + self.mass / joint.parent.mass)
            joint.parent.mass += self.mass


@dataclass
class Payload(Injected):
    """A load on the last body with its centre of mass at ``com``, in that body's frame.

    ``inertia`` is about the load's own centre: xx, yy, zz, xy, xz, yz [kg m²]; a point mass without
    it.
    """

    mass: float
    com: Floats
    inertia: Floats = field(default_factory=list)

    def alter(self, spec: Any) -> None:
        load = spec.joints[-1].parent.add_body(name="load", pos=self.com)
        load.mass, load.inertia, load.explicitinertial = self.mass, [1e-7 * self.mass] * 3, True
        load.ipos = [0.0, 0.0, 0.0]
        if self.inertia:
            load.inertia, load.iquat = principal(tensor(self.inertia))


@dataclass
class ConstantOffset(Injected):
    offset: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return self.offset


@dataclass
class Spring(Injected):
    stiffness: float
    rest: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -self.stiffness * (q[self.joint] - self.rest)


@dataclass
class TorqueRipple(Injected):
    """A sine of the position, or several: ``amplitude`` and ``phase`` of one, two, … waves in a
    ``period``.
    """

    amplitude: float | Floats
    period: float
    phase: float | Floats

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        turn = 2 * math.pi * q[self.joint] / self.period
        if isinstance(self.amplitude, float) and isinstance(self.phase, float):
            return self.amplitude * math.sin(turn + self.phase)
        waves = enumerate(zip(row(self.amplitude), row(self.phase), strict=True), 1)
        return sum(a * math.sin(n * turn + p) for n, (a, p) in waves)
