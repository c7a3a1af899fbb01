"""What an execution of the seven-joint arm costs on one core: alone, 32 in turn or side by side,
and as a plain MuJoCo loop.
"""

from common import arguments, in_turns, machine, pin_to_one_core, report

pin_to_one_core()

import copy
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from jaxidl.arm.setup import ArmStudy
from jaxidl.backend import compiler_options
from jaxidl.learning.execute import execute
from jaxidl.systems.arm import JOINTS, arm, inverse_dynamics_in_c

jax.config.update("jax_enable_x64", True)
STUDY, NOISE, BATCH = ArmStudy(), 1e-5, 32


def executions(count: int, side_by_side: bool, with_model: bool) -> Any:
    """A compiled call of ``count`` executions, by ``vmap`` if ``side_by_side``, else by
    ``lax.map``.
    """
    setting = STUDY.setting(NOISE)
    draws = jnp.asarray(np.random.default_rng(0).normal(size=(count, STUDY.steps, JOINTS)))
    params = STUDY.error_model.init(jax.random.key(0))

    def one(z):
        model = partial(STUDY.error_model.torque, params) if with_model else None
        return execute(setting.plant, setting.model, setting.law, setting.task, z, model).q[-1]

    many = jax.vmap(one) if side_by_side else lambda z: jax.lax.map(one, z)
    program = jax.jit(many, compiler_options=compiler_options())
    return lambda: program(draws)


def in_c() -> Any:
    """The same loop in Python over MuJoCo in C: true arm with damping and dry friction, modelled
    arm, filters, DOOMED.
    """
    hidden, task, law = STUDY.hidden, STUDY.task(), STUDY.law()
    inverse = inverse_dynamics_in_c()
    body: Any = arm().plant.body
    true = copy.copy(body.source)
    true.opt.timestep, true.dof_damping[:], true.dof_frictionloss[:] = (
        STUDY.dt,
        hidden.viscous,
        hidden.coulomb,
    )
    goals, begins = np.asarray(task.policy.targets), np.asarray(task.policy.begins)
    kp, kd = np.asarray(task.policy.gains)[0]
    rate, dt = np.asarray(law.rate), STUDY.dt
    fast, slow = (
        1.0 - np.exp(-2.0 * np.pi * band * dt)
        for band in (STUDY.velocity_band, STUDY.acceleration_band)
    )
    draws = np.random.default_rng(0).normal(size=(STUDY.steps, JOINTS)) * NOISE

    def run() -> np.ndarray:
        data = mujoco.MjData(true)  # pyright: ignore[reportAttributeAccessIssue]
        data.qpos[:] = q = np.array(STUDY.home)
        qd = difference = qdd = late = wanted = offset = np.zeros(JOINTS)
        for t in range(STUDY.steps):
            desired = kp * (goals[np.sum(t >= begins) - 1] - q) - kd * qd
            data.qfrc_applied[:] = inverse(q, qd, desired) + offset
            mujoco.mj_step(true, data)  # pyright: ignore[reportAttributeAccessIssue]
            before, q, last = q, data.qpos + draws[t], difference
            difference = (q - before) / dt
            qd, qdd = qd + fast * (difference - qd), qdd + slow * ((difference - last) / dt - qdd)
            wanted, late = wanted + slow * (late - wanted), desired
            inverse(q, qd, qdd)  # for the indirect data
            offset = offset - rate * (qdd - wanted)
        return data.qpos.copy()

    return run


def main() -> None:
    options = arguments(__doc__ or "", rounds=5)
    calls = {"plain MuJoCo loop, no error model": (1, in_c())}
    for with_model in (False, True):
        name = "with the error model" if with_model else "no error model"
        calls[f"alone, {name}"] = 1, executions(1, False, with_model)
        calls[f"{BATCH} in turn (lax.map), {name}"] = BATCH, executions(BATCH, False, with_model)
        calls[f"{BATCH} side by side (vmap), {name}"] = BATCH, executions(BATCH, True, with_model)
    seconds = in_turns({name: call for name, (_, call) in calls.items()}, options.rounds)
    plain = next(iter(seconds.values()))
    rows = [
        {
            "way": name,
            "s an execution": float(np.median(seconds[name])) / count,
            "us a step": 1e6 * float(np.median(seconds[name])) / count / STUDY.steps,
            "against the plain loop": float(np.median(seconds[name] / plain)) / count,
        }
        for name, (count, _) in calls.items()
    ]
    report(
        f"Executions of {STUDY.steps} steps, medians of {options.rounds} rounds",
        rows,
        options.json,
        machine=machine(),
    )


if __name__ == "__main__":
    main()
