"""Effects outside the catalogue that follow from the state.

They can be imitated, which makes them the harder half.
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar

from jaxidl.gap.benchmark.injected import Floats, Injected

SETTLING = 0.004  # s; time constant of the acceleration that an effect feels


@dataclass
class _Accelerated(Injected):
    """An effect that feels the acceleration, derived from the speed by a fast low pass."""

    _before: float = field(default=0.0, init=False, repr=False)
    _acceleration: float = field(default=0.0, init=False, repr=False)
    _step: float = field(default=0.0, init=False, repr=False)

    def start(self, step: float, position: float, command: float) -> None:
        self._before, self._acceleration, self._step = 0.0, 0.0, step

    def feel(self, speed: float) -> float:
        share = -math.expm1(-self._step / SETTLING)
        self._acceleration += share * ((speed - self._before) / self._step - self._acceleration)
        self._before = speed
        return self._acceleration


@dataclass
class AccelerationFriction(_Accelerated):
    """Dry friction in proportion to the acceleration.

    Gear teeth are pressed together by the inertia behind them.
    """

    friction: ClassVar[bool] = True
    coefficient: float = 0.0

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        level = self.coefficient * abs(self.feel(qd))
        return level, level, 0.0


@dataclass
class PositionInertia(_Accelerated):
    """An inertia that varies with the joint's own position, as of a crank.

    It is ``inertia`` · sin(2π q / ``period`` + ``phase``).
    """

    inertia: float = 0.0
    period: float = 1.0
    phase: float = 0.0

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        speed, turn = qd[self.joint], 2 * math.pi * q[self.joint] / self.period + self.phase
        slope = self.inertia * 2 * math.pi / self.period * math.cos(turn)
        return -self.inertia * math.sin(turn) * self.feel(speed) - slope * speed * speed / 2


@dataclass
class TorqueDeadband(Injected):
    """An amplifier that delivers nothing below ``width``, and that much less above it."""

    width: float

    def actuate(self, t: float, command: float) -> float:
        return math.copysign(max(0.0, abs(command) - self.width), command)


@dataclass
class RootLoadFriction(Injected):
    """Dry friction in proportion to the square root of the load."""

    loaded: ClassVar[bool] = True
    coefficient: float

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        level = self.coefficient * math.sqrt(abs(load))
        return level, level, 0.0


@dataclass
class ElasticCoupling(Injected):
    """A hose between two joints: a hardening spring on the difference of their positions."""

    other: int
    stiffness: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -self.stiffness * (q[self.joint] - q[self.other]) ** 3


@dataclass
class CableDrag(Injected):
    """Drag of a cable that grows the further two joints together are from the middle."""

    friction: ClassVar[bool] = True
    other: int
    coefficient: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -self.coefficient * abs(q[self.joint] * q[self.other]) * qd[self.joint]


@dataclass
class CoupledRipple(Injected):
    """A torque that is a sine of two positions together."""

    other: int
    amplitude: float
    period: float
    phase: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        turn = (q[self.joint] + 1.6 * q[self.other]) / self.period
        return self.amplitude * math.sin(2 * math.pi * turn + self.phase)


@dataclass
class EncoderEccentricity(Injected):
    """An encoder disc that is off its centre.

    The reading is wrong by up to ``error`` once per turn of its shaft.
    """

    error: float
    period: float
    phase: float

    def misread(self, q: float) -> float:
        return self.error * math.sin(2 * math.pi * q / self.period + self.phase)


@dataclass
class FadingMotor(Injected):
    """A motor constant that falls with the speed.

    The share ``loss`` · |speed| of the torque is missing.
    """

    loss: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -delivered * min(0.5, self.loss * abs(qd[self.joint]))


IMITABLE: dict[str, type[Injected]] = {
    "acceleration_friction": AccelerationFriction,
    "position_inertia": PositionInertia,
    "torque_deadband": TorqueDeadband,
    "root_load_friction": RootLoadFriction,
    "elastic_coupling": ElasticCoupling,
    "cable_drag": CableDrag,
    "coupled_ripple": CoupledRipple,
    "encoder_eccentricity": EncoderEccentricity,
    "fading_motor": FadingMotor,
}
