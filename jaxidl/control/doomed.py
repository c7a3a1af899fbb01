"""DOOMED: direct online optimisation of modelling errors (Ratliff et al. 2016).

It is feedback that adapts an offset torque.
"""

from typing import NamedTuple

import jax.numpy as jnp
from flax import struct

from jaxidl.control.filters import Average, start_average, update_average
from jaxidl.control.law import Feedback
from jaxidl.types import Joints, Scalar, State


class DoomedState(NamedTuple):
    """Memory of the DOOMED law."""

    offset: Joints  # (J,) o, the applied torque [N]
    gradient: Average  # g, the filtered gradient step [N]
    filtered: Average  # the learning feedback [N]


class Doomed(struct.PyTreeNode):
    """Gradient steps on the acceleration error e = qdd_actual − qdd_desired.

    g ← EMA(−rate·e), o ← o + g, within ±``limit``. The learner receives o − learner_gain·e,
    filtered, with its value *before* the step (entry 0 is 0). The desired trajectory is not used:
    DOOMED follows the policy itself.
    """

    rate: Joints | Scalar  # learning rate of the applied offset [N s^2/m]
    learner_gain: Joints | Scalar  # 0.5 [N s^2/m]
    smoothing: Scalar  # weight of a new sample in the learning feedback [-]
    gradient_smoothing: Scalar = 0.9  # weight of a new gradient [-]
    limit: Joints | Scalar = jnp.inf  # bound of the offset [N]

    def scaled(self, share: Joints | Scalar) -> "Doomed":
        return self.replace(rate=share * self.rate)

    def init(self, q: Joints) -> DoomedState:
        return DoomedState(jnp.zeros_like(q), start_average(q), start_average(q))

    def act(
        self, memory: DoomedState, desired: State, sensed: State
    ) -> tuple[Feedback, DoomedState]:
        return Feedback(memory.offset, memory.filtered.value), memory

    def observe(self, memory: DoomedState, qdd_desired: Joints, qdd_actual: Joints) -> DoomedState:
        error = qdd_actual - qdd_desired
        filtered = update_average(
            memory.filtered, memory.offset - self.learner_gain * error, self.smoothing
        )
        gradient = update_average(memory.gradient, -self.rate * error, self.gradient_smoothing)
        offset = jnp.clip(memory.offset + gradient.value, -self.limit, self.limit)
        return DoomedState(offset, gradient, filtered)
