"""The wider catalogue as it is injected into MuJoCo.

It has errors of links, a tilted base, and friction and motors of real gears.
"""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from jaxidl.gap.benchmark.injected import Floats, Injected, mujoco, principal, tensor


@dataclass
class ComError(Injected):
    """The centre of mass of the joint's body is off.

    ``moment`` is mass times shift, in the body's frame [kg m]. Its mass is right, and its inertia
    about the centre, so that the inertia about the joint changes as it does on a real link.
    """

    moment: Floats

    def alter(self, spec: Any) -> None:
        body = spec.joints[self.joint].parent
        body.ipos = body.ipos + np.array(self.moment) / body.mass


@dataclass
class InertiaTensorError(Injected):
    """The body's inertia about its centre of mass is ``tensor`` larger.

    Its elements are xx, yy, zz, xy, xz, yz [kg m²] in the body's axes.
    """

    tensor: Floats

    def alter(self, spec: Any) -> None:
        body = spec.joints[self.joint].parent
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, np.asarray(body.iquat, float))
        axes = turn.reshape(3, 3)
        body.inertia, body.iquat = principal(
            axes @ np.diag(body.inertia) @ axes.T + tensor(self.tensor)
        )


@dataclass
class BaseTilt(Injected):
    """The base is turned by the small ``angles`` about x and y [rad].

    Seen from it, gravity is turned in the opposite direction.
    """

    angles: Floats

    def alter(self, spec: Any) -> None:
        about_x, about_y = self.angles
        turn = np.array([about_x, about_y, 0.0])
        size = float(np.linalg.norm(turn))
        if size:
            quaternion, gravity = np.zeros(4), np.zeros(3)
            mujoco.mju_axisAngle2Quat(quaternion, turn / size, -size)
            mujoco.mju_rotVecQuat(gravity, np.array(spec.option.gravity), quaternion)
            spec.option.gravity = gravity


@dataclass
class DirectionalLoadFriction(Injected):
    """Friction in proportion to the torque that passes the gear.

    The share where the motor drives differs from that where it is driven.
    """

    loaded: ClassVar[bool] = True
    driving: float
    driven: float

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        forward, backward = (self.driving, self.driven) if load > 0 else (self.driven, self.driving)
        return forward * abs(load), backward * abs(load), 0.0


@dataclass
class ThermalFriction(Injected):
    """Viscous friction that falls from ``warm`` + ``excess`` to ``warm`` as the grease warms up.

    ``time_constant`` [s]; with ``work`` [J] in its place it falls with the work that the friction
    has done.
    """

    friction: ClassVar[bool] = True
    excess: float
    warm: float = 0.0
    time_constant: float = math.inf
    work: float = math.inf
    _heat: float = field(default=0.0, init=False, repr=False)
    _step: float = field(default=0.0, init=False, repr=False)

    def start(self, step: float, position: float, command: float) -> None:
        self._heat, self._step = 0.0, step

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        speed = qd[self.joint]
        coefficient = self.warm + self.excess * math.exp(
            -t / self.time_constant - self._heat / self.work
        )
        self._heat += self._step * coefficient * speed * speed
        return -coefficient * speed


@dataclass
class TorqueCurve(Injected):
    """A motor that saturates magnetically.

    The share ``loss`` · |torque| [1/Nm] of the commanded torque is missing.
    """

    loss: float

    def actuate(self, t: float, command: float) -> float:
        return command * (1 - min(0.5, self.loss * abs(command)))


@dataclass
class SublinearFriction(Injected):
    """Friction that grows less than in proportion to the speed.

    It is ``coefficient`` · |speed|^``power``, against the motion.
    """

    friction: ClassVar[bool] = True
    coefficient: float
    power: float = 0.5

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        speed = qd[self.joint]
        # m/s or rad/s; linear below it, since no step is short enough for an infinite slope
        slow = 1e-3
        size = (
            abs(speed) ** self.power if abs(speed) > slow else abs(speed) * slow ** (self.power - 1)
        )
        return -math.copysign(self.coefficient * size, speed)


@dataclass
class CoupledJointFriction(Injected):
    """Friction on the sum or the ``difference`` of the speeds of two joints, as in a wrist.

    It is the engine's own tendon.
    """

    friction: ClassVar[bool] = True
    other: int
    coefficient: float
    level: float = 0.0
    difference: bool = False

    def alter(self, spec: Any) -> None:
        tendon = spec.add_tendon(name=f"couple{self.joint}{self.other}")
        tendon.wrap_joint(spec.joints[self.joint].name, 1.0)
        tendon.wrap_joint(spec.joints[self.other].name, -1.0 if self.difference else 1.0)
        # newer engines accept a polynomial of the speed, linear term first
        viscous = np.zeros(np.shape(tendon.damping))
        tendon.damping = self.coefficient if viscous.ndim == 0 else [self.coefficient, *viscous[1:]]
        tendon.frictionloss = self.level
        tendon.solref_friction, tendon.solimp_friction = (
            (1e-3, 1.0),
            (0.9999, 0.9999, 0.001, 0.5, 2.0),
        )

    def passive(self, qd: Floats) -> dict[int, float]:
        sign = -1.0 if self.difference else 1.0
        speed = qd[self.joint] + sign * qd[self.other]
        torque = -self.coefficient * speed - (math.copysign(self.level, speed) if speed else 0.0)
        return {self.joint: torque, self.other: sign * torque}


@dataclass
class MotorCoupling(Injected):
    """The motor of the joint also turns ``other``, with a ``share`` of its torque."""

    other: int
    share: float

    def spread(self, delivered: Floats) -> tuple[int, float]:
        return self.other, self.share * delivered[self.joint]
