"""Torques that depend on position alone."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from jaxidl.effects.base import Effect, Guess, Parameter, Scale
from jaxidl.types import Joints


class Spring(Effect):
    """−k·(q − rest): a spring, a cable or a hose parallel to the joint."""

    stiffness: Joints  # (J,) k [N/m or Nm/rad]
    rest: Joints  # (J,) [m or rad]

    name: ClassVar[str] = "spring"
    sentence: ClassVar[str] = "a spring that pulls towards a rest position"
    parameters: ClassVar = {
        "stiffness": Parameter("N/m", 0.0, 1e6, "torque per displacement"),
        "rest": Parameter("m", -1e4, 1e4, "the position where it does not pull"),
    }
    mjcf: ClassVar = {"stiffness": "joint/stiffness", "rest": "joint/springref"}

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return -self.stiffness * (q - self.rest)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        middle, width = (scale.lower + scale.upper) / 2, scale.upper - scale.lower
        return [{"stiffness": scale.residual / max(width, 1e-9), "rest": middle}]


class TorqueRipple(Effect):
    """s·sin(2π·q/p) + c·cos(2π·q/p): cogging, a magnet's poles, a gear's teeth."""

    sine: Joints  # (J,) s [N or Nm]
    cosine: Joints  # (J,) c [N or Nm]
    period: Joints  # (J,) p [m or rad]

    name: ClassVar[str] = "torque_ripple"
    sentence: ClassVar[str] = "a torque that repeats periodically along the way"
    parameters: ClassVar = {
        "sine": Parameter("N", -1e5, 1e5, "the sine's amplitude"),
        "cosine": Parameter("N", -1e5, 1e5, "the cosine's amplitude"),
        "period": Parameter("m", 1e-6, 1e4, "the period"),
    }

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        angle = 2.0 * jnp.pi * q / self.period
        return self.sine * jnp.sin(angle) + self.cosine * jnp.cos(angle)

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        width = max(scale.upper - scale.lower, 1e-9)
        least = max(width / 60.0, 2.0 * scale.speed / max(scale.band, 1e-9))  # passed slowly enough to be seen
        waves = np.arange(1.5, max(width / least, 2.0), 0.4)
        return [{"sine": 0.0, "cosine": 0.0, "period": width / n} for n in waves]
