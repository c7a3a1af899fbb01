"""Effects with a hidden motor side: the encoder sees the link, the command moves the rotor."""

import math
from dataclasses import dataclass, field
from typing import Any

from jaxidl.gap.benchmark.injected import Injected


@dataclass
class JointElasticity(Injected):
    """A rotor of ``motor_inertia`` behind a spring and a damper.

    The inertia is taken from the link so that the total stays. Units: N/m or Nm/rad, N s/m or Nm
    s/rad, kg or kg m².
    """

    stiffness: float
    damping: float
    motor_inertia: float
    _rotor: float = field(default=0.0, init=False, repr=False)
    _speed: float = field(default=0.0, init=False, repr=False)
    _step: float = field(default=0.0, init=False, repr=False)

    def alter(self, spec: Any) -> None:
        joint = spec.joints[self.joint]
        if joint.armature < self.motor_inertia - 1e-12:
            raise ValueError(
                f"a rotor of {self.motor_inertia:g} cannot be taken from an armature of"
                f" {joint.armature:g}"
            )
        joint.armature = max(0.0, joint.armature - self.motor_inertia)

    def start(self, step: float, position: float, command: float) -> None:
        self._rotor, self._speed, self._step = position + self.wound(command), 0.0, step

    def wound(self, command: float) -> float:
        """Return how far the rotor is ahead of the link when it carries ``command`` at rest."""
        return command / self.stiffness

    def transmit(self, q: float, qd: float, delivered: float) -> float:
        """Return the torque on the link.

        The rotor moves by a step under the delivered torque.
        """
        torque = self.bear(self._rotor - q, self._speed - qd)
        self._speed += self._step * (delivered - torque) / self.motor_inertia
        self._rotor += self._step * self._speed
        return torque

    def bear(self, ahead: float, speed: float) -> float:
        """Return the torque transmitted when the rotor is ``ahead`` of the link.

        ``speed`` is its speed relative to the link.
        """
        return self.stiffness * ahead + self.damping * speed


@dataclass
class Backlash(JointElasticity):
    """The same with a dead zone of width ``gap`` [m or rad].

    At its two ends the contact is stiff and damped, and never pulls.
    """

    gap: float

    def wound(self, command: float) -> float:
        return command / self.stiffness + math.copysign(self.gap / 2, command)

    def bear(self, ahead: float, speed: float) -> float:
        depth = abs(ahead) - self.gap / 2
        if depth <= 0:
            return 0.0
        side = math.copysign(1.0, ahead)
        return side * max(0.0, self.stiffness * depth + self.damping * speed * side)
