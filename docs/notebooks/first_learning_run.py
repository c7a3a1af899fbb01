# %% [markdown]
# # A first learning run
#
# A robot follows a path badly because its model is wrong. We let it follow the path, learn from
# what happened, let it follow the path again, and so on. Three kinds of data can be learned from.
# This notebook builds a small plant, runs it once, and then compares the three. It takes about a
# minute.

# %%
import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

jax.config.update("jax_enable_x64", True)  # accelerations at 1 ms need double precision

from jaxidl import (
    ErrorModel,
    PdPolicy,
    Pid,
    PidGains,
    Plant,
    Setting,
    State,
    Task,
    Training,
    desired_trajectory,
    draw_noise,
    execute,
    learn,
    point_mass,
)
from jaxidl.effects import CoulombFriction, SensingNoise, ViscousFriction
from jaxidl.plot.style import SOURCE_STYLE

# %% [markdown]
# ## The robot and its model
#
# A plant is a rigid body plus a list of named effects. Ours is a mass of 5 kg on two axes, with
# friction and noisy encoders. The model is a mass of 0.5 kg without friction.

# %%
true = Plant(
    point_mass(5.0),
    (
        CoulombFriction(jnp.array([20.0, 30.0])),  # [N]
        ViscousFriction(jnp.array([20.0, 40.0])),  # [N s/m]
        SensingNoise(jnp.array(1e-4)),  # [m]
    ),
)
model = point_mass(0.5)

# %% [markdown]
# ## The task
#
# At each instant a policy gives the desired acceleration: here that of a spring and a damper that
# pull the mass to (1, 1) m. The command is the model's torque for this acceleration plus weak
# feedback. The feedback law has separate gains for learning (`learner`): the data should show what
# a stiff controller would have done, while the robot stays compliant.

# %%
task = Task(
    start=State(jnp.zeros(2), jnp.zeros(2)),
    policy=PdPolicy(jnp.ones(2), 100.0, 20.0),
    torque_limit=jnp.asarray(5000.0),
    steps=1000,  # of 1 ms
)
law = Pid(
    applied=PidGains(25.0, 5.0, 0.0),  # what acts on the robot
    learner=PidGains(500.0, 50.0, 0.0),  # what direct data is computed from
    smoothing=0.1,
)
path = desired_trajectory(task).q
run = execute(true, model, law, task, draw_noise(1, 1, task.steps)[0])

time = np.arange(task.steps) * task.dt
plt.figure(figsize=(6, 2.6), layout="constrained")
plt.plot(time, path[:, 0], "k:", label="wanted")
plt.plot(time, run.q[:, 0], label="first execution")
plt.xlabel("time [s]")
plt.ylabel("position of axis 0 [m]")
plt.legend()
plt.show()
# %% [markdown]
# The mass lags far behind.
#
# ## Learn
#
# `learn` executes the task, trains an error model on the execution's data, executes again with the
# error model in the loop, and so on: ten executions here, with nine trainings between them. The
# error model is one small network for each axis. It is a pure function of its arguments, so the
# five seeds are one `jax.vmap`.
#
# - **indirect** data: the torque that was applied, at the acceleration that *happened*. This is the
#   usual way.
# - **direct** data: the feedback that was needed, at the acceleration that was *wanted*.
# - **joint** data: both together.

# %%
setting = Setting(plant=true, model=model, law=law, task=task, reference=path)
how = {"error_model": ErrorModel(layers=(50, 20, 1)), "training": Training(epochs=10)}
seeds, executions = jnp.arange(1, 6), 10
noise = jnp.stack([jnp.asarray(draw_noise(int(seed), executions, task.steps)) for seed in seeds])

errors = {}
for source in ("indirect", "direct", "joint"):

    def one(noise, key, source=source):
        metrics, _, _ = learn(setting, noise, key, source=source, **how)
        return metrics.q_error  # (executions,) [m]

    keys = jax.vmap(jax.random.key)(seeds)
    errors[source] = np.asarray(jax.jit(jax.vmap(one))(noise, keys))
    first, *_, last = 1e3 * np.median(errors[source], axis=0)
    print(f"{source:>8}: {first:6.1f} mm at first, {last:6.2f} mm in execution {executions}")

# %%
plt.figure(figsize=(6, 3.2), layout="constrained")
for source, e in errors.items():
    plt.plot(1e3 * np.median(e, axis=0), label=source, **SOURCE_STYLE[source])
    style = {"alpha": 0.2, "color": SOURCE_STYLE[source]["color"]}
    plt.fill_between(range(executions), 1e3 * e.min(0), 1e3 * e.max(0), **style)
plt.yscale("log")
plt.xlabel("trainings so far")
plt.ylabel("mean position error [mm]")
plt.legend(title="data source")
plt.show()

# %% [markdown]
# The lines are medians over five seeds, the bands their range.
#
# Where to go on:
#
# - [The method](../explanation/method.md): the three sources in equations.
# - [What the paper claims, and what comes out](../explanation/claims.md): the same for 1280
#   configurations.
# - [Run part of the study](../howto/study.md), or [a sweep of your own](own_sweep.py).
# - [Derivatives from end to end](derivatives.py): this learning run is differentiable.
