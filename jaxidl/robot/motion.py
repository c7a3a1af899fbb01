"""Velocities and accelerations of an execution, where the log has only positions."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.control import Filtered
from jaxidl.errors import one_of
from jaxidl.logs.low_pass import choose_band, derivative, encoder_noise, low_pass
from jaxidl.logs.signals import typical_inertia
from jaxidl.systems.mjcf import Model
from jaxidl.types import State

MOTIONS = ("offline", "finite_difference", "filtered")


class Moved(NamedTuple):
    """The motion of an execution in its T control steps."""

    qd: np.ndarray  # (T, J) [m/s or rad/s] before each step
    qdd: np.ndarray  # (T, J) [m/s^2 or rad/s^2] over each step
    qdd_desired: np.ndarray  # (T, J) delayed as the estimate of ``qdd`` is


def moved(
    motion: str,
    signals: dict[str, np.ndarray],
    model: Model,
    dt: float,
) -> Moved:
    """Return the motion behind N logged rows, of T control steps.

    What was logged (``qd``, ``qdd``) is taken as it is. Else "offline" differentiates positions
    that a low pass without delay has smoothed, in the band that the gap finder uses; the other two
    are what a controller can do (:mod:`jaxidl.control.estimate`). These need the position after a
    step, so that T = N − 1; if ``qdd`` was logged, or "offline", T = N. An execution begins at
    rest.

    Args:
        motion: one of ``MOTIONS``.
        signals: ``q``, ``tau``, ``qdd_desired`` (N, J) and, if logged, ``qd`` and ``qdd``.
        model: of the robot; its inertia weighs the joints' noise.
        dt: control step [s].

    Raises:
        ConfigurationError: for an unknown motion.
    """
    if motion not in MOTIONS:
        raise one_of("--motion", motion, MOTIONS)
    q, wanted = signals["q"], signals["qdd_desired"]
    qd, qdd = signals.get("qd"), signals.get("qdd")
    if qd is not None and qdd is not None:
        return Moved(qd, qdd, wanted)
    if motion == "offline":
        whole = (slice(0, len(q)),)
        sigma = encoder_noise(q, whole)
        reach = np.sqrt(typical_inertia(q, model.plant.body) ** 2 @ sigma**2)
        band = choose_band(reach, q, signals["tau"], whole, dt)
        smooth = low_pass(q, band, dt)
        slope = derivative(smooth, dt)
        return Moved(
            slope if qd is None else qd, derivative(slope, dt) if qdd is None else qdd, wanted
        )
    if motion == "filtered":
        found = _filtered(q, wanted, dt)
    else:
        speed = np.concatenate([np.zeros_like(q[:1]), np.diff(q, axis=0) / dt])
        speed = speed if qd is None else qd
        found = Moved(speed[:-1], np.diff(speed, axis=0) / dt, wanted[:-1])
    if qdd is not None:
        return Moved(np.concatenate([found.qd, found.qd[-1:]]), qdd, wanted)
    return found if qd is None else found._replace(qd=qd[:-1])


def _filtered(q: np.ndarray, wanted: np.ndarray, dt: float) -> Moved:
    """Return what :class:`jaxidl.control.Filtered` makes of readings ``q`` (N, J), from rest."""
    estimator = Filtered()

    def step(carry: tuple[State, Any], row: tuple[jax.Array, jax.Array]):
        sensed, memory = carry
        motion, memory = estimator.update(memory, sensed, *row, dt)
        return (motion.sensed, memory), (sensed.qd, motion.qdd, motion.qdd_desired)

    start = State(jnp.asarray(q[0]), jnp.zeros_like(q[0]))
    rows = jnp.asarray(q[1:]), jnp.asarray(wanted[:-1])
    _, found = jax.lax.scan(step, (start, estimator.start(start)), rows)
    return Moved(*map(np.asarray, found))
