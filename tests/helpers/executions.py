"""Simulated executions, and the logs that a robot's controller would write of them."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.control import Doomed, Pid, PidGains, lqr
from jaxidl.effects import CoulombFriction, SensingNoise, ViscousFriction
from jaxidl.learning.execute import Task, desired_trajectory
from jaxidl.learning.iterate import Setting
from jaxidl.models import ErrorModel, Training
from jaxidl.systems import Plant, PointMass
from jaxidl.types import State

# slides along x and y: to a model of MuJoCo what a point mass is to the simulation
GANTRY = """<mujoco model="gantry">
  <worldbody>
    <body name="bridge">
      <joint name="bridge" type="slide" axis="1 0 0" range="-2 2" limited="true"/>
      <inertial pos="0 0 0" mass="0.5" diaginertia="0.004 0.004 0.004"/>
      <body name="carriage">
        <joint name="carriage" type="slide" axis="0 1 0" range="-2 2" limited="true"/>
        <inertial pos="0 0 0" mass="1.5" diaginertia="0.004 0.004 0.004"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
BODY = PointMass(jnp.array([2.0, 1.5]))
NETWORKS = ErrorModel(2, (16, 8, 1), 1.0, 2.0, 20.0, 10.0)
TRAINING = Training(epochs=4, batch=32)
SMOOTHING = 0.1
LAWS = {
    "doomed": Doomed(jnp.array([0.2, 0.15]), jnp.array([2.0, 1.5]), SMOOTHING, 1.0),
    "pid": Pid(
        PidGains(jnp.array([60.0, 40.0]), jnp.array([12.0, 9.0]), jnp.array([0.2, 0.1])),
        PidGains(jnp.array([600.0, 400.0]), jnp.array([60.0, 40.0]), jnp.array([0.2, 0.1])),
        0.2,
    ),
}
GAINS = """law: pid
kp: [60.0, 40.0]
kd: [12.0, 9.0]
ki: [0.2, 0.1]
learner: {kp: [600, 400], kd: [60, 40], ki: [0.2, 0.1]}
smoothing: 0.2
"""
DT, STEPS = 0.002, 600


def setting_of(law="doomed", steps=STEPS, limit=jnp.inf):
    """A gantry with friction and a noisy encoder that its model does not have."""
    hidden = (
        ViscousFriction(jnp.array([6.0, 4.0])),
        CoulombFriction(jnp.array([3.0, 2.0])),
        SensingNoise(jnp.array(1e-6)),
    )
    task = Task(
        start=State(jnp.array([0.2, -0.3]), jnp.zeros(2)),
        policy=lqr(jnp.array([-0.6, 0.9]), DT, effort=1e-3),
        torque_limit=limit,
        dt=DT,
        steps=steps,
    )
    return Setting(Plant(BODY, hidden), BODY, LAWS[law], task, desired_trajectory(task).q)


def draws_of(executions, joints=2, steps=STEPS, seed=5):
    return jax.random.normal(jax.random.key(seed), (executions, steps, joints))


def columns_of(run, dt, desired=None, derivatives=True):
    """The columns of one execution (T, J) as a robot logs it.

    Without ``derivatives`` there is one row more: the position after the last step.
    """
    rows = len(run.tau)
    parts = {
        "q": run.q_sensing,
        "qdd_desired": run.qdd_desired,
        "tau": run.tau,
        "tau_feedback": run.tau_feedback,
        "tau_feedback_applied": run.tau_feedback_applied,
        "tau_feedforward": run.tau_feedforward,
    }
    if desired is not None:
        parts |= {"q_desired": desired.q, "qd_desired": desired.qd}
    if derivatives:
        parts |= {"qd": run.qd_sensing, "qdd": run.qdd_actual}
    parts = {name: np.asarray(part) for name, part in parts.items()}
    if not derivatives:
        speed = np.asarray(run.qd_sensing[-1] + dt * run.qdd_actual[-1])
        parts = {name: np.concatenate([part, part[-1:]]) for name, part in parts.items()}
        parts["q"][-1] += dt * speed
        rows += 1
    columns = {"time": np.arange(rows) * dt}
    return columns | {
        f"{name}{j}": column for name, part in parts.items() for j, column in enumerate(part.T)
    }
