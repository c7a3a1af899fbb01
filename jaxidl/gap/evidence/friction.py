"""The torque of friction along a log."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.backend import jit_quickly
from jaxidl.effects import Effect, OnJoint
from jaxidl.effects.load import dissipates
from jaxidl.gap.evidence.links import alterations, narrowed
from jaxidl.logs.low_pass import by_run
from jaxidl.logs.signals import Signals


def friction_along(
    effects: Sequence[Effect], signals: Signals, tau: np.ndarray, load: np.ndarray | None = None
) -> np.ndarray:
    """Return the torque (T, J) [N or Nm] of all friction along a log.

    ``tau`` (T, J) are the commands that the motors deliver, ``load`` (T, J) the torques that pass
    the gears; without it only friction that needs no load counts. A joint at rest breaks away the
    way that the model's torque pushes it. A joint that reverses does so between two instants: dry
    friction has its mean around each, so that it changes steadily with when that happens.
    """
    at = np.clip(np.searchsorted(signals.rows, np.arange(len(signals.q))), 0, len(signals.rows) - 1)
    impending = np.where(signals.pushed[at], 1.0, -1.0)
    motion = (
        signals.q,
        np.where(signals.resting, 0.0, signals.qd),
        tau,
        np.zeros_like(tau) if load is None else load,
        np.where(signals.resting, impending, signals.qd),
    )
    smooth, level = np.zeros_like(signals.q), np.zeros_like(signals.q)
    for effect in filter(dissipates, effects):
        columns, (alone,), (where,) = narrowed([effect])
        if isinstance(alone, OnJoint):
            alone = alone.replace(joint=where)
        leaves, structure = jax.tree.flatten(alone)
        torque, dry = _friction(structure, leaves, *(x[:, columns] for x in motion))
        smooth[:, columns] += np.asarray(torque)
        level[:, columns] += np.asarray(dry)
    way = np.where(signals.resting, impending, by_run(signals.qd, signals.slices, mean_sign))
    return smooth - np.maximum(level, 0.0) * way


def before_gears(effects: Sequence[Effect], signals: Signals, tau: np.ndarray) -> np.ndarray:
    """Return what is added (T, J) [N or Nm] to the motors' torque before it reaches the gears.

    It is the torque of all friction that needs no load, less what accelerates the rotors.
    """
    more = [x for e in effects for way, x in alterations(e) if way == "add_inertia"]
    rotors = np.asarray(signals.body.armature) + sum(more)
    return friction_along(effects, signals, tau) - rotors * signals.qdd


def mean_sign(x: np.ndarray) -> np.ndarray:
    """Return the mean sign of one run (T, ...) within half an interval of each instant."""
    middle = 0.5 * (x[1:] + x[:-1])
    before, after = np.concatenate([x[:1], middle]), np.concatenate([middle, x[-1:]])
    part = lambda a, b: np.where(
        a * b < 0.0, (abs(b) - abs(a)) / np.where(a != b, b - a, 1.0), np.sign(a + b)
    )
    return 0.5 * (part(before, x) + part(x, after))


@partial(jit_quickly, static_argnames="structure")
def _friction(
    structure: Any, leaves: Any, q: Any, qd: Any, tau: Any, load: Any, direction: Any
) -> Any:
    """Return torque and level (T, J) of an effect."""
    effect = jax.tree.unflatten(structure, leaves)
    torque = jax.vmap(effect.torque)(q, qd, tau)
    return torque + jnp.zeros_like(q), jax.vmap(effect.dry)(q, qd, load, direction) + 0.0 * q
