"""The load: the torque that passes a gear, which is what friction under load depends on.

It is what the joint's other friction, and the acceleration of the rotor on the motor's side, leave
of the motor's torque. On measured robots such a load predicts better than the motor's torque
itself: most friction of a geared drive is on its fast side.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp

from jaxidl.effects.base import Effect
from jaxidl.effects.on_joint import OnJoint
from jaxidl.types import Joints


def load(
    effects: Sequence[Effect], q: Joints, qd: Joints, tau: Joints, direction: Joints
) -> Joints:
    """Return the torque (J,) [N or Nm] that all friction which needs no load leaves of ``tau``.

    The load is that without what accelerates the rotors.

    Args:
        effects: all effects of the plant.
        q: positions (J,).
        qd: velocities (J,).
        tau: torques (J,) that the motors deliver.
        direction: velocities (J,) without dry friction, as for :meth:`Effect.dry`.
    """
    smooth, level = jnp.zeros_like(qd), jnp.zeros_like(qd)
    for effect in filter(dissipates, effects):
        torque, dry = unloaded(effect, q, qd, tau, direction)
        smooth, level = smooth + torque, level + dry
    return tau + smooth - jnp.maximum(level, 0.0) * jnp.sign(direction)


def unloaded(
    effect: Effect, q: Joints, qd: Joints, tau: Joints, direction: Joints
) -> tuple[Joints, Joints]:
    """Return the torque (J,) and the level of dry friction (J,) of an effect without a load."""
    return effect.torque(q, qd, tau), effect.dry(q, qd, jnp.zeros_like(tau), direction)


def dissipates(effect: Effect) -> bool:
    """Return whether an effect is friction."""
    return type(effect.effect if isinstance(effect, OnJoint) else effect).friction


def loaded(effect: Effect, joints: int) -> bool:
    """Return whether an effect is dry friction that depends on the load."""
    kind = jax.tree.structure(effect)
    if kind not in _READS:
        _READS[kind] = effect.grips() and effect.reads_torque(joints)
    return _READS[kind]


# asked for in every step of a plant, so an effect is traced once
_READS: dict[Any, bool] = {}
