"""The arm's feedforward at 1 kHz: how long one call takes, from NumPy arrays to a NumPy array, every millisecond anew.

The paper's networks have less than 1 ms in a hard real-time loop. Weights are random, as their values cost no time. One call is
made each millisecond after a sleep, the ways taking turns, so each finds caches as cold as a robot's loop does.
"""

from common import arguments, machine, pin_to_one_core, report

pin_to_one_core()

import gc
import os
import time
from collections.abc import Callable
from pathlib import Path

import jax
import mujoco
import numpy as np

from jaxidl.learning.arm import ArmStudy
from jaxidl.learning.deploy import export_feedforward
from jaxidl.systems.arm import JOINTS, arm

# a CPU program runs in the thread that calls it: none has to be woken, whenever the system gets round to that
jax.config.update("jax_cpu_enable_async_dispatch", False)

PERIOD, DEADLINE = 1e-3, 1e-3  # [s]
STUDY = ArmStudy()
Call = Callable[..., np.ndarray]


def exported() -> Call:
    """Rigid body and seven networks, as a robot loads them."""
    with jax.enable_x64(True):
        task, params = STUDY.task(), STUDY.error_model.init(jax.random.key(0))
        content = export_feedforward(task, arm().plant.body, STUDY.error_model, params)
    return compiled(jax.export.deserialize(bytearray(content)).call)


def rigid_body() -> Call:
    """The same without networks."""
    return compiled(arm().plant.body.inverse_dynamics)


def compiled(function: Callable) -> Call:
    joints = jax.ShapeDtypeStruct((JOINTS,), np.float32)
    program = jax.jit(function).lower(joints, joints, joints).compile()
    return lambda *state: np.asarray(program(*(x.astype(np.float32) for x in state)))


def in_c() -> Call:
    """The same rigid body's inverse dynamics by MuJoCo in C."""
    model = arm().plant.body.source
    data = mujoco.MjData(model)

    def call(q, qd, qdd):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse.copy()

    return call


def hurry() -> bool:
    """Real-time habits, once all is compiled. Returns whether this process now goes before all ordinary ones."""
    gc.collect()
    gc.freeze()
    gc.disable()  # nothing in the loop makes cycles; a collection would stop it for milliseconds
    try:
        for thread in Path("/proc/self/task").iterdir():  # XLA's, too
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(10))
    except (OSError, AttributeError):  # not Linux, or not root
        return False
    return True


def at_one_kilohertz(calls: dict[str, Call], rounds: int) -> dict[str, np.ndarray]:
    """Seconds (rounds,) of each call, and by how much each of the sleeps before was too long."""
    states = np.random.default_rng(0).normal(size=(rounds, 3, JOINTS)) * np.array([1.0, 1.0, 10.0])[:, None]
    seconds = {name: np.empty(rounds) for name in calls}
    late = []
    began, tick = time.perf_counter(), 0
    for k in range(rounds):
        for name, call in calls.items():
            now = time.perf_counter() - began
            tick = max(tick + 1, int(now / PERIOD) + 1)  # what was missed is not made up for
            time.sleep(tick * PERIOD - now)
            woke = time.perf_counter()
            call(*states[k])
            seconds[name][k] = time.perf_counter() - woke
            late.append(woke - began - tick * PERIOD)
    return {"woken too late": np.array(late)} | seconds


def main() -> None:
    options = arguments(__doc__ or "", rounds=20_000)
    calls = {
        "rigid body and seven networks, exported": exported(),
        "rigid body": rigid_body(),
        "rigid body, MuJoCo in C": in_c(),
    }
    for call in calls.values():
        for _ in range(1000):
            call(*np.zeros((3, JOINTS)))
    first = hurry()
    rows = []
    for name, seconds in at_one_kilohertz(calls, options.rounds).items():
        median, most, nearly_all = (1e6 * float(x) for x in np.percentile(seconds, (50, 99, 99.9)))
        times = {"median [us]": median, "99 %": most, "99.9 %": nearly_all, "max": 1e6 * float(seconds.max())}
        rows.append({"what": name} | times | {"over 1 ms": int((seconds > DEADLINE).sum()), "of": len(seconds)})
    scheduling = "SCHED_FIFO, before all ordinary processes" if first else "ordinary, among all other processes"
    report("One call each millisecond", rows, options.json, scheduling=scheduling, machine=machine())


if __name__ == "__main__":
    main()
