"""The load: the torque that passes a gear, which is what friction under load depends on.

It is what the joint's other friction leaves of the motor's torque. On measured robots such a load
predicts better than the motor's torque itself: most friction of a geared drive is on its fast side.
"""

from collections.abc import Sequence

import jax.numpy as jnp

from jaxidl.effects.base import Effect
from jaxidl.effects.on_joint import OnJoint
from jaxidl.types import Joints


def load(
    effects: Sequence[Effect], q: Joints, qd: Joints, tau: Joints, direction: Joints
) -> Joints:
    """Return the torque (J,) [N or Nm] that all friction which needs no load leaves of ``tau``.

    Args:
        effects: all effects of the plant.
        q: positions (J,).
        qd: velocities (J,).
        tau: torques (J,) that the motors deliver.
        direction: velocities (J,) without dry friction, as for :meth:`Effect.dry`.
    """
    return tau + unloaded_friction(effects, q, qd, tau, direction)


def unloaded_friction(
    effects: Sequence[Effect], q: Joints, qd: Joints, tau: Joints, direction: Joints
) -> Joints:
    """Return the torque (J,) [N or Nm] of all friction that needs no load, as for :func:`load`."""
    total, level, none = jnp.zeros_like(qd), jnp.zeros_like(qd), jnp.zeros_like(tau)
    for effect in effects:
        if dissipates(effect):
            total = total + effect.torque(q, qd, tau)
            level = level + effect.dry(q, qd, none, direction)
    return total - jnp.maximum(level, 0.0) * jnp.sign(direction)


def dissipates(effect: Effect) -> bool:
    """Return whether an effect is friction."""
    return type(effect.effect if isinstance(effect, OnJoint) else effect).friction
