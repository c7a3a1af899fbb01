"""Algorithm 1 of the paper: execute the task once and record what happened."""

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from jaxidl.control import Estimator, FeedbackLaw, FiniteDifference
from jaxidl.scan import scan
from jaxidl.systems import Plant, RigidBody, integrate
from jaxidl.types import Circumstances, History, Joints, Scalar, State, Trajectory

Policy = Callable[[Joints, Joints, Any], Joints]
# sensed, desired acceleration, … -> torque (J,)
Feedforward = Callable[[State, Joints, Circumstances | None], Joints]


class Task(struct.PyTreeNode):
    """The task to be executed, and under which circumstances."""

    # initial state as sensed; also the true one, unless an execution is given another
    start: State
    policy: Policy  # desired acceleration in a state
    # bound of each of feedback, feedforward and rigid-body torque [N or Nm]
    torque_limit: Joints | Scalar
    feedforward_limit: Joints | Scalar = jnp.inf  # bound of the error model's torque [N or Nm]
    estimator: Estimator = FiniteDifference()
    # (T, C) conditions set from outside, such as the load that is carried
    circumstances: Circumstances | None = None
    dt: float = struct.field(pytree_node=False, default=0.001)  # control step [s]
    steps: int = struct.field(pytree_node=False, default=1000)  # T, control steps of one execution
    # returns the plant under given circumstances
    world: Callable[[Plant, Circumstances], Plant] | None = struct.field(
        pytree_node=False, default=None
    )

    def clip(self, tau: Joints) -> Joints:
        return jnp.clip(tau, -self.torque_limit, self.torque_limit)

    def plant(self, plant: Plant, circumstances: Circumstances | None) -> Plant:
        """Return the plant under ``circumstances`` (C,)."""
        return (
            plant
            if self.world is None or circumstances is None
            else self.world(plant, circumstances)
        )


def desired_trajectory(task: Task) -> State:
    """Integrate the policy from the start without any dynamics.

    Returns (T, J) states, each before its step.
    """

    def instant(state: State, t: Any) -> tuple[State, State]:
        return integrate(state, task.policy(state.q, state.qd, t), task.dt), state

    _, states = jax.lax.scan(instant, task.start, jnp.arange(task.steps))
    return states


@cache
def _warn_of_single_precision() -> None:
    """Warn once that single precision is used.

    Accelerations from two differences of positions at 1 ms lose most of their digits in it.
    """
    remedy = 'call jax.config.update("jax_enable_x64", True) before anything else'
    warnings.warn(
        f"jaxidl executes in single precision, where accelerations are mostly rounding; {remedy}",
        stacklevel=3,
    )


def execute(
    plant: Plant,
    model: RigidBody,
    law: FeedbackLaw,
    task: Task,
    noise: History,
    feedforward: Feedforward | None = None,
    start: Joints | None = None,
    *,
    fade: Callable[[State, State], Joints | Scalar] | None = None,
    gains: Callable[[State, State], Joints | Scalar] | None = None,
    checkpoint: bool = False,
) -> Trajectory:
    """Run the task once (Algorithm 1) as a scan over control steps.

    Args:
        plant: the true system.
        model: the modelled rigid body; its inverse dynamics are the first part of the command.
        law: feedback, applied and for learning.
        task: start, policy, time step, bounds.
        noise: (T, J) standard-normal draws; row t determines the sensed state after step t.
        feedforward: the error model's torque at the sensed state and desired acceleration; None
            before any learning.
        start: (J,) true initial position of the mechanism. Default: the task's.
        fade: share of the error model's torque that is applied, from the sensed and the desired
            state; see :mod:`jaxidl.learning.guard`. Default: all of it.
        gains: share of the applied gains, from the sensed and the desired state; see
            :mod:`jaxidl.learning.schedule`. Default: all of them.
        checkpoint: for derivatives in reverse mode, see :func:`jaxidl.scan.scan`. Forward mode
            needs hardly any memory.

    The trajectory can be differentiated, forward and in reverse, by every number in ``plant``,
    ``model``, ``law``, ``task`` and in what ``feedforward`` closes over. The derivative is that of
    the branches taken: see the effects' docstrings for what that means where they jump or stick. A
    torque at its bound passes no derivative.

    Warns once if 64-bit mode is off.
    """

    if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        _warn_of_single_precision()

    def instant(carry: Any, inputs: Any) -> tuple[Any, Any]:
        true, hidden, sensed, memory, estimate = carry
        t, desired, draw, now = inputs
        qdd_desired = task.policy(sensed.q, sensed.qd, t)
        tau_rbd = task.clip(model.inverse_dynamics(sensed.q, sensed.qd, qdd_desired))
        acting = law.scaled(gains(sensed, desired)) if gains else law
        feedback, memory = acting.act(memory, desired, sensed)
        applied = task.clip(feedback.applied)
        tau_ff = jnp.zeros_like(tau_rbd)
        if feedforward:
            tau_ff = task.clip(
                jnp.clip(
                    feedforward(sensed, qdd_desired, now),
                    -task.feedforward_limit,
                    task.feedforward_limit,
                )
            )
            if fade:
                tau_ff = fade(sensed, desired) * tau_ff
        tau = tau_rbd + applied + tau_ff

        present = task.plant(plant, now)
        true_next, hidden = present.step(true, hidden, tau, task.dt)
        q_sensed = present.sense(hidden, true_next.q, draw)
        motion, estimate = task.estimator.update(estimate, sensed, q_sensed, qdd_desired, task.dt)
        memory = acting.observe(memory, motion.qdd_desired, motion.qdd)
        record = Trajectory(
            q=true.q,
            qd=true.qd,
            q_sensing=sensed.q,
            qd_sensing=sensed.qd,
            qdd_desired=qdd_desired,
            qdd_actual=motion.qdd,
            tau=tau,
            tau_inverse_desired=tau_rbd,
            tau_inverse_actual=task.clip(model.inverse_dynamics(sensed.q, sensed.qd, motion.qdd)),
            tau_feedback=task.clip(feedback.learning),
            tau_feedback_applied=applied,
            tau_feedforward=tau_ff,
            circumstances=now,
        )
        return (true_next, hidden, motion.sensed, memory, estimate), record

    sensed = task.start
    true = sensed if start is None else State(start, sensed.qd)
    carry = (true, plant.start(true.q), sensed, law.init(sensed.q), task.estimator.start(sensed))
    inputs = (jnp.arange(task.steps), desired_trajectory(task), noise, task.circumstances)
    return scan(instant, carry, inputs, checkpoint=checkpoint)[1]
