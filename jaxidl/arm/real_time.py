"""The arm's feedforward at 1 kHz: how long one call takes, from NumPy arrays to a NumPy array,
every millisecond anew.

The paper's control loop is a hard real-time one of 1 kHz, and all predictions take less than 1 ms.
One call is made each millisecond after a sleep, the ways taking turns, so each finds caches as cold
as a robot's loop does.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import gc
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from jaxidl.errors import JaxidlError
from jaxidl.systems.arm import JOINTS, arm, inverse_dynamics_in_c

PERIOD, DEADLINE = 1e-3, 1e-3  # [s]
WARM = 1000  # calls before the first one that counts
ON_ONE_CORE = """  # chosen before JAX counts them
import os, runpy
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
runpy.run_module("jaxidl.arm.real_time", run_name="__main__")
"""
Call = Callable[..., np.ndarray]


class RealTimeError(JaxidlError):
    """The loop did not come to its end."""


def latency(file: Path, rounds: int) -> list[dict[str, Any]]:
    """Measure the exported feedforward in ``file``, in a process of its own on one core.

    Returns its :func:`rows`.
    """
    with tempfile.TemporaryDirectory() as name:
        to = Path(name) / "rows.json"
        words = [sys.executable, "-c", ON_ONE_CORE, str(file), str(rounds), str(to)]
        said = subprocess.run(
            words,
            env=os.environ | {"JAX_PLATFORMS": "cpu"},
            capture_output=True,
            text=True,
            check=False,
        )
        if said.returncode:
            got = (said.stderr.strip().splitlines() or ["no message"])[-1]
            raise RealTimeError("a loop at 1 kHz", got[:300], "run it again")
        return json.loads(to.read_text())


def rows(content: bytes, rounds: int) -> list[dict[str, Any]]:
    """Time the exported feedforward, the rigid body alone, and MuJoCo's inverse dynamics in C.

    ``rounds`` calls each.

    For the process that does nothing else: it takes the system's highest priority if it may.
    """
    # a CPU program runs in the thread that calls it: none has to be woken, whenever the system gets
    # round to that
    jax.config.update("jax_cpu_enable_async_dispatch", False)
    calls = {
        "rigid body and seven networks, exported": compiled(
            jax.export.deserialize(bytearray(content)).call
        ),
        "rigid body": compiled(arm().plant.body.inverse_dynamics),
        "rigid body, MuJoCo in C": inverse_dynamics_in_c(),
    }
    for call in calls.values():
        for _ in range(WARM):
            call(*np.zeros((3, JOINTS)))
    first = take_priority()
    found = []
    for name, seconds in at_one_kilohertz(calls, rounds).items():
        median, most, nearly_all = (1e6 * float(x) for x in np.percentile(seconds, (50, 99, 99.9)))
        times = {
            "median [us]": median,
            "99 %": most,
            "99.9 %": nearly_all,
            "max": 1e6 * float(seconds.max()),
        }
        late = {
            "over 1 ms": int((seconds > DEADLINE).sum()),
            "of": len(seconds),
            "before all others": first,
        }
        found.append({"what": name} | times | late)
    return found


def compiled(function: Callable[..., Any]) -> Call:
    """Compile a function of three (7,) arrays; it takes NumPy's arrays and returns one."""
    joints = jax.ShapeDtypeStruct((JOINTS,), np.float32)
    program = jax.jit(function).lower(joints, joints, joints).compile()
    return lambda *state: np.asarray(program(*(x.astype(np.float32) for x in state)))


def take_priority() -> bool:
    """Ask for real-time priority, once all is compiled; return whether it was granted."""
    gc.collect()
    gc.freeze()
    gc.disable()  # nothing in the loop makes cycles; a collection would stop it for milliseconds
    try:
        for thread in Path("/proc/self/task").iterdir():  # XLA's, too
            os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(10))
    except (OSError, AttributeError):  # not Linux, or not root
        return False
    return True


def at_one_kilohertz(calls: dict[str, Call], rounds: int) -> dict[str, Float[np.ndarray, " N"]]:
    """Return seconds (rounds,) of each call, and by how much each sleep was too long."""
    states = (
        np.random.default_rng(0).normal(size=(rounds, 3, JOINTS))
        * np.array([1.0, 1.0, 10.0])[:, None]
    )
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


if __name__ == "__main__":
    Path(sys.argv[3]).write_text(json.dumps(rows(Path(sys.argv[1]).read_bytes(), int(sys.argv[2]))))
