"""PID feedback on the desired trajectory, with a stiffer copy of itself for the learner."""

from typing import NamedTuple

import jax.numpy as jnp
from flax import struct

from jaxidl.control.filters import Average, start_average, update_average
from jaxidl.control.law import Feedback
from jaxidl.types import Joints, Scalar, State


class PidGains(NamedTuple):
    """Gains on the position error, its rate and its sum over steps."""

    kp: Joints | Scalar  # [N/m]
    kd: Joints | Scalar  # [N s/m]
    ki: Joints | Scalar  # per control step, no dt [N/m]


class PidState(NamedTuple):
    """Memory of the PID law."""

    integral: Joints  # (J,) I, accumulated ki·e of the applied gains [N]
    filtered: Average  # the learning feedback [N]


class Pid(struct.PyTreeNode):
    """kp·e + kd·ė + I against the desired trajectory.

    The learner receives the same with its own gains, filtered. Reference experiment, section "One
    control step": the learning feedback is kp'·e + kd'·ė + ki'·e + I_previous, with the applied
    law's integral from before this step; it is filtered before the plant moves, so entry t belongs
    to step t.
    """

    applied: PidGains
    learner: PidGains
    smoothing: Scalar  # weight of a new sample in the learning feedback [-]

    def scaled(self, share: Joints | Scalar) -> "Pid":
        return self.replace(applied=PidGains(*(share * gain for gain in self.applied)))

    def init(self, q: Joints) -> PidState:
        return PidState(jnp.zeros_like(q), start_average(q))

    def act(self, memory: PidState, desired: State, sensed: State) -> tuple[Feedback, PidState]:
        error, rate = desired.q - sensed.q, desired.qd - sensed.qd
        g, h = self.applied, self.learner
        integral = memory.integral + g.ki * error
        sample = h.kp * error + h.kd * rate + h.ki * error + memory.integral
        filtered = update_average(memory.filtered, sample, self.smoothing)
        return Feedback(g.kp * error + g.kd * rate + integral, filtered.value), PidState(
            integral, filtered
        )

    def observe(self, memory: PidState, qdd_desired: Joints, qdd_actual: Joints) -> PidState:
        return memory
