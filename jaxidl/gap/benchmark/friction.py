"""Friction as it is injected into MuJoCo, in the joints of a mechanism."""

import math
from dataclasses import dataclass, field
from typing import ClassVar

from jaxidl.gap.benchmark.injected import Floats, Injected


@dataclass
class ViscousFriction(Injected):
    friction: ClassVar[bool] = True
    coefficient: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -self.coefficient * qd[self.joint]


@dataclass
class QuadraticDrag(Injected):
    friction: ClassVar[bool] = True
    coefficient: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -self.coefficient * qd[self.joint] * abs(qd[self.joint])


@dataclass
class CoulombFriction(Injected):
    friction: ClassVar[bool] = True
    level: float

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        return self.level, self.level, 0.0


@dataclass
class AsymmetricFriction(Injected):
    friction: ClassVar[bool] = True
    positive: float
    negative: float

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        return self.positive, self.negative, 0.0


@dataclass
class StribeckFriction(Injected):
    friction: ClassVar[bool] = True
    sliding: float
    excess: float
    speed: float

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        level = self.sliding + self.excess * math.exp(-((qd / self.speed) ** 2))
        return level, level, self.sliding + self.excess


@dataclass
class Stiction(Injected):
    friction: ClassVar[bool] = True
    breakaway: float
    sliding: float = 0.0

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        return self.sliding, self.sliding, self.breakaway


@dataclass
class PositionDependentFriction(Injected):
    """Dry or viscous friction whose coefficient is a sine of the joint's own position.

    It is viscous with ``kind="viscous"``.
    """

    friction: ClassVar[bool] = True
    level: float
    variation: float
    period: float
    phase: float
    kind: str = "coulomb"

    def coefficient(self, q: float) -> float:
        return self.level * (
            1 + self.variation * math.sin(2 * math.pi * q / self.period + self.phase)
        )

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -self.coefficient(q[self.joint]) * qd[self.joint] if self.kind == "viscous" else 0.0

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        level = 0.0 if self.kind == "viscous" else self.coefficient(q)
        return level, level, 0.0


@dataclass
class LoadDependentFriction(Injected):
    loaded: ClassVar[bool] = True
    coefficient: float

    def dry(self, q: float, qd: float, load: float) -> tuple[float, float, float]:
        level = self.coefficient * abs(load)
        return level, level, 0.0


@dataclass
class CoupledFriction(Injected):
    """Viscous friction whose coefficient is a sine of another joint's position."""

    friction: ClassVar[bool] = True
    other: int
    level: float
    variation: float
    period: float
    phase: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        wave = math.sin(2 * math.pi * q[self.other] / self.period + self.phase)
        return -self.level * (1 + self.variation * wave) * qd[self.joint]


@dataclass
class PreslidingFriction(Injected):
    """Dahl's friction [N or Nm]."""

    friction: ClassVar[bool] = True
    level: float
    distance: float
    _stretch: float = field(default=0.0, init=False, repr=False)
    _step: float = field(default=0.0, init=False, repr=False)

    def start(self, step: float, position: float, command: float) -> None:
        self._stretch, self._step = 0.0, step

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        speed = qd[self.joint]
        self._stretch += self._step * (speed - abs(speed) * self._stretch / self.distance)
        return -self.level * self._stretch / self.distance
