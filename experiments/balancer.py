"""A balancer, as industrial arms have on their second joint: ``jaxidl gap … --plugin balancer.py``.

A spring, a gas cylinder or a counterweight carries weight without being a part of the link: it acts
on one joint and adds no inertia. Without this effect a link seems to be too light instead. It is
not in the catalogue, since on a robot without one it looks much like a centre of mass that is off.
"""

from typing import ClassVar

import jax.numpy as jnp

from jaxidl.effects import Effect, Parameter, register
from jaxidl.types import Joints


@register
class Balancer(Effect):
    """s·sin(q) + c·cos(q): weight that is carried in part, on each joint."""

    sine: Joints  # (J,) s [Nm]
    cosine: Joints  # (J,) c [Nm]

    name: ClassVar[str] = "balancer"
    sentence: ClassVar[str] = "a balancer that carries weight without inertia"
    parameters: ClassVar = {
        "sine": Parameter("N", -1e6, 1e6, "the torque at a quarter turn"),
        "cosine": Parameter("N", -1e6, 1e6, "the torque at zero"),
    }
    linear: ClassVar[bool] = True

    def torque(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        return self.sine * jnp.sin(q) + self.cosine * jnp.cos(q)
