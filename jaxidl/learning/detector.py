"""Pushes and collisions, felt in the torque that a model does not explain.

1. The residual of a joint estimates the torque from outside: what the motion took, by the model,
   less what was commanded, through a low pass. With sensed velocities :math:`\\dot q`, command
   :math:`\\tau` and the model's inverse dynamics :math:`\\hat\\tau`

   .. math:: r_{t+1} = r_t + \\alpha\\,[\\hat\\tau(q_t, \\dot q_t, (\\dot q_{t+1} - \\dot q_t)/dt)
             - \\tau_t - r_t].

   This is the generalised momentum observer (De Luca and Mattone 2003; Haddadin, De Luca and
   Albu-Schäffer 2017) in discrete time: momentum changes by
   :math:`M \\Delta\\dot q + \\dot M \\dot q\\,dt`, its Coriolis terms make the second part that of
   the inverse dynamics, and the observer's gain is :math:`\\alpha/dt`. The command is held back by
   as much as the sensed velocity lags behind.
2. A joint feels a push where its residual exceeds its threshold, which follows from executions
   without one and from the false alarms that the user accepts: the largest residuals of executions
   have an extreme value distribution (Gumbel's), and another execution exceeds the threshold with
   the probability that leaves so many alarms an hour.

What it feels with which model: :doc:`/explanation/pushes`.
"""

from functools import cache
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Array, Bool, Float
from scipy.optimize import brentq

from jaxidl.errors import ConfigurationError
from jaxidl.systems import Plant, RigidBody
from jaxidl.types import History, Joints, Scalar, State, Trajectory

FEWEST = 3  # executions that a threshold needs
_BEFORE, _AFTER = slice(None, -1), slice(1, None)  # of each step
DRAWS = 20_000  # of sets of executions, for the threshold's margin


class Memory(NamedTuple):
    """What an observer keeps from step to step, (J,) each."""

    residual: Joints  # [N or Nm]
    command: Joints  # that shows in the sensed velocity by now [N or Nm]


class Observer(struct.PyTreeNode):
    """The generalised momentum observer of the torque from outside."""

    model: RigidBody | Plant  # a plant's friction is explained, too
    dt: Scalar  # control step [s]
    smoothing: Scalar = 0.1  # weight of a new sample in the residual [-]
    # time until a command shows in the sensed velocity [s]: the motor's delay, half a step, and the
    # delay of the velocity's own filter
    lag: Scalar = 0.0

    def start(self, sensed: State) -> Memory:
        """Return the memory at rest in the ``sensed`` state."""
        zero = jnp.zeros_like(sensed.q)
        return Memory(zero, self.model.inverse_dynamics(sensed.q, zero, zero))

    def update(self, memory: Memory, before: State, after: State, tau: Joints) -> Memory:
        """Return the memory with the residual after a control step.

        Args:
            memory: before the step.
            before: sensed state before the step.
            after: sensed state after it.
            tau: (J,) the command of the step less what a learned model says [N or Nm].
        """
        qdd = (after.qd - before.qd) / self.dt
        command = memory.command + self.dt / (self.lag + self.dt) * (tau - memory.command)
        outside = self.model.inverse_dynamics(before.q, before.qd, qdd) - command
        residual = memory.residual + self.smoothing * (outside - memory.residual)
        return Memory(residual, command)

    def along(self, run: Trajectory) -> History:
        """Return the residual (T, J) of an execution, before each of its steps.

        What the error model said counts as explained.
        """

        def step(memory: Memory, now: tuple[State, State, Joints]) -> tuple[Memory, Joints]:
            memory = self.update(memory, *now)
            return memory, memory.residual

        sensed = State(run.q_sensing, run.qd_sensing)
        before, after = (jax.tree.map(lambda x, at=at: x[at], sensed) for at in (_BEFORE, _AFTER))
        explained = (run.tau - run.tau_feedforward)[_BEFORE]
        start = self.start(State(sensed.q[0], sensed.qd[0]))
        later = jax.lax.scan(step, start, (before, after, explained))[1]
        return jnp.concatenate([start.residual[None], later])


class Detector(struct.PyTreeNode):
    """Thresholds of the residuals, above which a joint feels a push."""

    threshold: Joints  # (J,) [N or Nm]

    def feels(self, residual: History) -> Bool[Array, "*T"]:
        """Return whether any joint feels a push, (T,) of residuals (T, J)."""
        return jnp.any(jnp.abs(residual) > jnp.broadcast_to(self.threshold, residual.shape), -1)


def calibrate(residuals: Float[Array, "E T J"], dt: float, alarms_per_hour: float) -> Detector:
    """Return the detector that gives so many false alarms an hour of execution, on average.

    Args:
        residuals: of E executions without a push, (E, T, J) [N or Nm].
        dt: control step [s].
        alarms_per_hour: executions with a false alarm, in an hour of them.

    The average is over executions to come and over those that it was calibrated with: fewer of them
    give higher thresholds.

    Raises:
        ConfigurationError: with fewer than three executions, one that is not finite, or a rate of
            alarms that is not between none and one in each execution.
    """
    executions, steps, joints = residuals.shape
    share = alarms_per_hour * steps * dt / 3600.0
    largest = np.abs(np.asarray(residuals)).max(1)  # (E, J)
    if executions < FEWEST:
        raise ConfigurationError(
            f"{FEWEST} executions without a push", f"{executions}", "record more"
        )
    if not np.isfinite(largest).all():
        raise ConfigurationError("finite residuals", "NaN or infinity", "leave that execution out")
    if not 0.0 < share < 1.0:
        most = 3600.0 / (steps * dt)
        raise ConfigurationError(
            f"more than 0 and fewer than {most:.4g} alarms an hour, one in each execution",
            f"{alarms_per_hour:g}",
            "correct it",
        )
    # any of the joints may give the alarm
    margin = prediction_limit(executions, -np.expm1(np.log1p(-share) / joints))
    return Detector(jnp.asarray(largest.mean(0) + margin * largest.std(0, ddof=1)))


@cache
def prediction_limit(executions: int, share: float) -> float:
    """Return the limit that another value exceeds with probability ``share``.

    It is in standard deviations above the mean, both estimated from as many values as
    ``executions``, and the same for every Gumbel distribution. Found from ``DRAWS`` sets of values
    with a fixed seed.
    """
    drawn = np.random.default_rng(0).gumbel(size=(DRAWS, executions))
    mean, deviation = drawn.mean(1), drawn.std(1, ddof=1)

    def excess(margin: float) -> float:
        return float(np.mean(-np.expm1(-np.exp(-(mean + margin * deviation)))) - share)

    return brentq(excess, -10.0, 1e4)  # type: ignore[return-value]
