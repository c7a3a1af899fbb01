"""Estimators of motion, without a plant."""

import jax
import jax.numpy as jnp

from jaxidl.types import State

DT = 1e-3


def estimated(estimator, q, wanted):
    """All motions (T - 1) that an estimator makes of readings ``q`` (T, J).

    There is one desired acceleration for each step.
    """

    def step(carry, inputs):
        motion, memory = estimator.update(carry[1], carry[0], *inputs, DT)
        return (motion.sensed, memory), motion

    q, wanted = jnp.asarray(q), jnp.asarray(wanted)
    start = State(q[0], (q[1] - q[0]) / DT)
    return jax.lax.scan(step, (start, estimator.start(start)), (q[1:], wanted))[1]
