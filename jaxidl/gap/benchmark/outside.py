"""Effects outside the catalogue.

Naming an effect of the catalogue for one of them is wrong.
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar

from jaxidl.gap.benchmark.imitable import IMITABLE
from jaxidl.gap.benchmark.injected import Floats, Injected


@dataclass
class OffsetDrift(Injected):
    """A torque that drifts slowly with time."""

    amplitude: float
    frequency: float
    phase: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return self.amplitude * math.sin(2 * math.pi * self.frequency * t + self.phase)


@dataclass
class Disturbance(OffsetDrift):
    """A periodic force from outside that does not depend on the joint's position."""


@dataclass
class ScaleDrift(Injected):
    """A motor constant that drifts slowly with time, as with temperature."""

    amplitude: float
    frequency: float
    phase: float

    def actuate(self, t: float, command: float) -> float:
        return command * (
            1 + self.amplitude * math.sin(2 * math.pi * self.frequency * t + self.phase)
        )


@dataclass
class CubicSpring(Injected):
    stiffness: float
    rest: float

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        return -self.stiffness * (q[self.joint] - self.rest) ** 3


@dataclass
class MemoryDrag(Injected):
    """Drag of a fluid that has to be accelerated: it follows the speed with a lag."""

    friction: ClassVar[bool] = True
    coefficient: float
    memory: float
    _speed: float = field(default=0.0, init=False, repr=False)
    _share: float = field(default=0.0, init=False, repr=False)

    def start(self, step: float, position: float, command: float) -> None:
        self._speed, self._share = 0.0, -math.expm1(-step / self.memory)

    def torque(self, t: float, q: Floats, qd: Floats, delivered: float) -> float:
        self._speed += self._share * (qd[self.joint] - self._speed)
        return -self.coefficient * self._speed


@dataclass
class Dropouts(Injected):
    """The motor loses a share ``depth`` of its torque for ``length`` s at irregular moments.

    They are ``interval`` s apart on average.
    """

    depth: float
    length: float
    interval: float
    phase: float

    def actuate(self, t: float, command: float) -> float:
        count = t / self.interval
        # irregular, and the same in every run
        moment = 0.5 + 0.3 * math.sin(12.9898 * math.floor(count) + self.phase)
        out = 0 <= (count - math.floor(count) - moment) * self.interval < self.length
        return command * (1 - self.depth) if out else command


OUTSIDE: dict[str, type[Injected]] = {
    "offset_drift": OffsetDrift,
    "scale_drift": ScaleDrift,
    "disturbance": Disturbance,
    "cubic_spring": CubicSpring,
    "memory_drag": MemoryDrag,
    "dropouts": Dropouts,
    **IMITABLE,
}
