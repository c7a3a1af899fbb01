"""A sweep of one's own: how far a point mass is off its path, by feedback gain, friction and seed.

``python experiments/own_sweep.py OUT.nc`` runs 60 executions, side by side on all cores. Stop it
and start it again: it continues. Add values to an axis and start it again: only the new ones are
computed.
"""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp

from jaxidl import (
    PdPolicy,
    Pid,
    PidGains,
    Plant,
    State,
    Task,
    desired_trajectory,
    execute,
    point_mass,
)
from jaxidl.effects import SensingNoise, ViscousFriction
from jaxidl.jobs import Variable, sweep

AXES = {"gain": (25.0, 100.0, 400.0), "friction": (0.0, 1.0, 10.0, 100.0), "seed": (1, 2, 3, 4, 5)}
STEPS = 500


def run_one(*, gain, friction, seed):
    """Return the mean position error [m] and the mean feedback [N] over time of one execution."""
    task = Task(
        State(jnp.zeros(2), jnp.zeros(2)),
        PdPolicy(jnp.ones(2), 100.0, 20.0),
        jnp.asarray(5000.0),
        steps=STEPS,
    )
    plant = Plant(
        point_mass(5.0), (ViscousFriction(jnp.full(2, friction)), SensingNoise(jnp.asarray(1e-5)))
    )
    gains = PidGains(gain, 0.1 * gain, 0.0)
    run = execute(
        plant,
        point_mass(5.0),
        Pid(gains, gains, 0.1),
        task,
        jax.random.normal(jax.random.key(seed), (STEPS, 2)),
    )
    error = jnp.abs(run.q - desired_trajectory(task).q).mean()
    return {"error": error, "feedback": jnp.abs(run.tau_feedback_applied).mean(1)}


if __name__ == "__main__":
    data = sweep(
        run_one,
        AXES,
        Path(sys.argv[1]),
        settings={"steps": STEPS},
        variables={
            "error": Variable((), "m", "mean position error"),
            "feedback": Variable(("step",), "N", "mean feedback"),
        },
    )
    print(data["error"].mean("seed").to_pandas())
