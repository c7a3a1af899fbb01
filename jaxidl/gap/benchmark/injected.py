"""The catalogue's effects as they are injected into MuJoCo, in plain floats.

They are written independently of the code that has to find them. Each acts on one joint ``joint``
through the hooks of :class:`Injected` that it overrides; the engine calls them at every fine step.
Positions in m or rad, torques in N or Nm, times in s.
"""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import mujoco as _mujoco
import numpy as np

from jaxidl.gap.benchmark.reference import Array

mujoco: Any = _mujoco  # its names are made when it is imported

Floats = list[float]


def tensor(six: Floats) -> Array:
    """Return the symmetric matrix (3, 3) of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], float)


def principal(inertia: Array) -> tuple[list[float], list[float]]:
    """Return principal moments and axes of a tensor (3, 3).

    The axes are a quaternion (w, x, y, z).

    Raises:
        ValueError: for a tensor that no body has.
    """
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] <= 0 or moments[2] > moments[0] + moments[1] + 1e-12:
        raise ValueError(f"no body has principal moments of inertia {moments}")
    axes = axes * np.linalg.det(axes)  # a rotation, not a reflection
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    return moments.tolist(), quaternion.tolist()


def row(values: float | Floats) -> Floats:
    return [float(values)] if isinstance(values, float | int) else list(values)


@dataclass
class Injected:
    """One hidden effect; this base class changes nothing."""

    joint: int
    friction: ClassVar[bool] = False  # whether it is friction that needs no load
    loaded: ClassVar[bool] = False  # whether it is friction under load

    def alter(self, spec: Any) -> None:
        """Change the true mechanism before it is compiled."""

    def start(self, step: float, position: float, command: float) -> None:
        """Reset the effect.

        A run with the fine step ``step`` [s] starts at rest at ``position`` under ``command``.
        """

    def encoder(self) -> tuple[float, float]:
        """Return the delay of the reading, and its offset."""
        return 0.0, 0.0

    def misread(self, q: float) -> float:
        """Return the error of the reading at the true position ``q``, if it varies."""
        return 0.0

    def actuate(self, t: float, command: float) -> float:
        """Return the torque that the motor delivers for ``command``.

        The command may also be what the stage before it delivers.
        """
        return command

    def spread(self, delivered: Floats) -> tuple[int, float]:
        """Return another joint, and the torque there due to what the motors deliver."""
        return self.joint, 0.0

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        """Return a smooth torque on the joint."""
        return 0.0

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        """Return dry friction: its level when moving forward, backward, and at rest.

        The last one is the level that it withstands at rest if that is larger. ``load`` is the
        torque that passes the gear.
        """
        return 0.0, 0.0, 0.0

    def passive(self, qd: Floats) -> dict[int, float]:
        """Return the torques, by joint, of what :meth:`alter` makes the engine do.

        They are used only for records.
        """
        return {}


@dataclass
class InertiaError(Injected):
    """Additional inertia: of the rotor, or of the joint's body.

    ``extra`` is rotor inertia, or with ``kind="mass"`` the body has (1 + ``extra``) times its mass
    and inertia. ``mass`` [kg] is added to a body's, whose inertia grows in proportion.
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
    """A sine of the position, or several.

    They have ``amplitude`` and ``phase`` of one, two, … waves in a ``period``.
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
