"""Accelerations without lag: what is estimated after an execution may use its future."""

from dataclasses import replace

import jax
import jax.numpy as jnp

from jaxidl.control.estimate import share
from jaxidl.control.filters import average_around
from jaxidl.learning.execute import Task
from jaxidl.systems import RigidBody
from jaxidl.types import Scalar, Trajectory


def zero_phase(run: Trajectory, model: RigidBody, task: Task, band: Scalar = 30.0) -> Trajectory:
    """Return the execution (T, J) with accelerations smoothed without delay.

    Central differences, and a low pass (cut-off ``band`` [Hz]) forwards and backwards.
    """
    q = run.q_sensing
    # at both ends it goes on as it went
    longer = jnp.concatenate([2 * q[:1] - q[1:2], q, 2 * q[-1:] - q[-2:-1]])
    qdd = average_around(jnp.diff(longer, 2, axis=0) / task.dt**2, share(band, task.dt))
    tau = jax.vmap(lambda *now: task.clip(model.inverse_dynamics(*now)))(q, run.qd_sensing, qdd)
    return replace(run, qdd_actual=qdd, tau_inverse_actual=tau)
