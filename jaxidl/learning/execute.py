"""Algorithm 1 of the paper: execute the task once and record what happened."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct

from jaxidl.control import FeedbackLaw
from jaxidl.systems import Plant, RigidBody, integrate
from jaxidl.types import History, Joints, Scalar, State, Trajectory

Policy = Callable[[Joints, Joints, Any], Joints]
Feedforward = Callable[[State, Joints], Joints]  # (sensed state, desired acceleration) -> torque (J,) [N]


class Task(struct.PyTreeNode):
    """What is to be done, whoever does it."""

    start: State  # exact initial state, sensed and true
    policy: Policy  # desired acceleration in a state
    torque_limit: Scalar  # bound of each of feedback, feedforward and rigid-body torque [N]
    dt: float = struct.field(pytree_node=False, default=0.001)  # control step [s]
    steps: int = struct.field(pytree_node=False, default=1000)  # T, control steps of one execution

    def clip(self, tau: Joints) -> Joints:
        return jnp.clip(tau, -self.torque_limit, self.torque_limit)


def desired_trajectory(task: Task) -> State:
    """The policy integrated from the start without any dynamics: (T, J) states, each before its step."""

    def instant(state: State, t: Any) -> tuple[State, State]:
        return integrate(state, task.policy(state.q, state.qd, t), task.dt), state

    _, states = jax.lax.scan(instant, task.start, jnp.arange(task.steps))
    return states


def execute(
    plant: Plant, model: RigidBody, law: FeedbackLaw, task: Task, noise: History, feedforward: Feedforward | None = None
) -> Trajectory:
    """Run the task once (Algorithm 1) as a scan over control steps.

    Args:
        plant: the true system.
        model: the rigid body one believes in; its inverse dynamics is the first part of the command.
        law: feedback, applied and for learning.
        task: start, policy, time step, bounds.
        noise: (T, J) standard-normal draws; row t makes the sensed state after step t.
        feedforward: the error model's torque at the sensed state and desired acceleration; None before any learning.
    """

    def instant(carry, inputs):
        true, hidden, sensed, memory = carry
        t, desired, draw = inputs
        qdd_desired = task.policy(sensed.q, sensed.qd, t)
        tau_rbd = task.clip(model.inverse_dynamics(sensed.q, sensed.qd, qdd_desired))
        feedback, memory = law.act(memory, desired, sensed)
        applied = task.clip(feedback.applied)
        tau_ff = task.clip(feedforward(sensed, qdd_desired)) if feedforward else jnp.zeros_like(tau_rbd)
        tau = tau_rbd + applied + tau_ff

        true_next, hidden = plant.step(true, hidden, tau, task.dt)
        q_sensed = plant.sense(hidden, true_next.q, draw)
        qd_sensed = (q_sensed - sensed.q) / task.dt
        qdd_actual = (qd_sensed - sensed.qd) / task.dt
        memory = law.observe(memory, qdd_desired, qdd_actual)
        record = Trajectory(
            q=true.q,
            qd=true.qd,
            q_sensing=sensed.q,
            qd_sensing=sensed.qd,
            qdd_desired=qdd_desired,
            qdd_actual=qdd_actual,
            tau=tau,
            tau_inverse_desired=tau_rbd,
            tau_inverse_actual=task.clip(model.inverse_dynamics(sensed.q, sensed.qd, qdd_actual)),
            tau_feedback=task.clip(feedback.learning),
            tau_feedback_applied=applied,
            tau_feedforward=tau_ff,
        )
        return (true_next, hidden, State(q_sensed, qd_sensed), memory), record

    carry = (task.start, plant.start(task.start.q), task.start, law.init(task.start.q))
    inputs = (jnp.arange(task.steps), desired_trajectory(task), noise)
    return jax.lax.scan(instant, carry, inputs)[1]
