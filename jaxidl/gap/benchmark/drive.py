"""Effects between the controller and the joint.

Motors deliver less or later, encoders read late or with an offset.
"""

import math
from collections import deque
from dataclasses import dataclass, field

from jaxidl.gap.benchmark.injected import Injected


@dataclass
class TorqueScale(Injected):
    scale: float

    def actuate(self, t: float, command: float) -> float:
        return self.scale * command


@dataclass
class TorqueSaturation(Injected):
    limit: float

    def actuate(self, t: float, command: float) -> float:
        return min(max(command, -self.limit), self.limit)


@dataclass
class ActuatorLag(Injected):
    time_constant: float
    _delivered: float = field(default=0.0, init=False, repr=False)
    _share: float = field(default=1.0, init=False, repr=False)

    def start(self, step: float, position: float, command: float) -> None:
        self._delivered, self._share = command, -math.expm1(-step / self.time_constant)

    def actuate(self, t: float, command: float) -> float:
        self._delivered += self._share * (command - self._delivered)
        return self._delivered


@dataclass
class ActuatorDelay(Injected):
    delay: float
    _line: deque[float] = field(default_factory=deque, init=False, repr=False)

    def start(self, step: float, position: float, command: float) -> None:
        steps = round(self.delay / step)
        self._line = deque([command] * (steps + 1), maxlen=steps + 1)

    def actuate(self, t: float, command: float) -> float:
        self._line.append(command)
        return self._line[0]


@dataclass
class PositionBias(Injected):
    bias: float

    def encoder(self) -> tuple[float, float]:
        return 0.0, self.bias


@dataclass
class SensorDelay(Injected):
    delay: float

    def encoder(self) -> tuple[float, float]:
        return self.delay, 0.0
