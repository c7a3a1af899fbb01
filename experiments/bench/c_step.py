"""A control step of the seven-joint arm in generated C on one core, a million calls: rigid body
with the effects of a corrected model, seven networks, guard, filters and DOOMED.

Each program and the feedforward in Python take turns. A loop without memory, as long as the fastest
step, shows how much of the long times is the machine's. Programs run with real-time priority where
the machine allows it, as a robot's loop does. Weights are random, as their values cost no time.
"""

import functools
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from common import arguments, machine, pin_to_one_core, report

pin_to_one_core()

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.arm.setup import ArmStudy
from jaxidl.learning.deploy import export_feedforward
from jaxidl.learning.guard import Region
from jaxidl.robot.c import Controller, generate
from jaxidl.systems import Plant
from jaxidl.systems.arm import arm, inverse_dynamics_in_c

PARTS = 10  # rounds
MAIN = """
#define _POSIX_C_SOURCE 200809L
#include "arm.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return 1e6 * (double)t.tv_sec + 1e-3 * (double)t.tv_nsec;
}

static double count_up(int times, double x)
{
    while (times--) x = 0.999 * x + 0.1;
    return x;
}

/* calls, bytes to touch between two calls, turns of a loop in place of a step (0: a step) */
int main(int count, char **given)
{
    const int calls = atoi(given[1]), touch = atoi(given[2]), counted = atoi(given[3]);
    float *spent = malloc(2 * sizeof(float) * (size_t)calls);
    volatile char *other = malloc((size_t)touch + 1);
    arm_state s;
    arm_real q[7], qd[7], d[7], dd[7], tau[7] = {0}, sum = 0;
    int t, j, k;
    (void)count;
    for (j = 0; j < 7; j++) q[j] = 0;
    arm_init(&s, q);
    for (t = 0; t < calls; t++) {
        double wall, cpu;
        for (j = 0; j < 7; j++) {
            d[j] = (arm_real)(0.8 * sin(1e-3 * t + j));
            qd[j] = (arm_real)(0.8 * cos(1e-3 * t + j));
            dd[j] = -d[j];
            q[j] = d[j] + (arm_real)(0.01 * sin(0.02 * t));
        }
        for (k = 0; k < touch; k += 64) other[k]++;
        cpu = now(CLOCK_THREAD_CPUTIME_ID);
        wall = now(CLOCK_MONOTONIC);
        if (counted) tau[0] = (arm_real)count_up(counted, tau[0]);
        else arm_step(&s, q, t * ARM_DT, d, qd, dd, tau);
        spent[2 * t] = (float)(now(CLOCK_MONOTONIC) - wall);
        spent[2 * t + 1] = (float)(now(CLOCK_THREAD_CPUTIME_ID) - cpu);
        sum += tau[0];
    }
    fwrite(spent, 2 * sizeof(float), (size_t)calls, stdout);
    return sum != sum;
}
"""
FLAGS = {
    "double": (),
    "double, the machine's own vectors": ("-march=native",),
    "single": ("-DARM_SINGLE",),
    "double, networks too": ("-DARM_DOUBLE_NETWORKS",),
    "double, networks too, the machine's own vectors": ("-DARM_DOUBLE_NETWORKS", "-march=native"),
}
FASTEST = "double, the machine's own vectors"
COLD = 8 * 2**20  # bytes between two calls: more than the caches near the core
MANY = 10**9


def main() -> None:
    options = arguments(__doc__ or "", calls=1_000_000, python=20_000)
    if not shutil.which("gcc"):
        raise SystemExit("c_step: expected a C compiler; got no gcc on the path; install it")
    study, given = ArmStudy(), arm()
    with jax.enable_x64(True), tempfile.TemporaryDirectory() as folder:
        task, error_model = study.task(), study.error_model
        params = error_model.init(jax.random.key(0))
        wide, most = jnp.full(21, 30.0), jnp.full(7, 100.0)
        region = Region(-wide, wide, -most, most, jnp.array(0.1), 1.2, 2.4)
        model = Plant(given.plant.body, study.effects(0.0)[:6])
        own = Controller.of(task, model, study.law(), given.names, error_model, params, region)
        began = time.perf_counter()
        code = generate(own, "arm", "the arm of jaxidl with random weights")
        generating = time.perf_counter() - began
        Path(folder, "arm.h").write_text(code.header)
        Path(folder, "arm.c").write_text(code.source)
        Path(folder, "main.c").write_text(MAIN)
        content = export_feedforward(task, given.plant.body, error_model, params)
        programs = {
            name: built(Path(folder), k, flags) for k, (name, flags) in enumerate(FLAGS.items())
        }
        runs = {name: functools.partial(stepped, program, 0) for name, program in programs.items()}
        fastest, turns = programs[FASTEST], 1000
        took = [np.median(stepped(fastest, 0, 10_000, turns=n)[:, 0]) for n in (0, turns)]
        runs["a loop without memory, as long as the second row"] = functools.partial(
            stepped, fastest, 0, turns=round(turns * took[0] / took[1])
        )
        runs["double, caches emptied before each call"] = functools.partial(
            stepped, programs["double"], COLD, most=options.calls // 50
        )
        runs |= in_python(content, options.python)
        table = rows(runs, options.calls)
    report(
        "A control step of seven joints, one core [µs]",
        table,
        options.json,
        machine=machine(),
        priority="real-time" if realtime() else "ordinary",
        compiler=subprocess.run(
            ["gcc", "--version"], capture_output=True, text=True
        ).stdout.splitlines()[0],
        lines_of_C=code.source.count("\n"),
        megabytes_of_C=len(code.source) / 1e6,
        seconds_to_generate=generating,
    )


def built(folder: Path, number: int, flags: tuple[str, ...]) -> Path:
    program = folder / f"step_{number}"
    files = [str(folder / name) for name in ("arm.c", "main.c")]
    subprocess.run(
        ["gcc", "-std=c99", "-O2", *flags, *files, "-o", str(program), "-lm"], check=True
    )
    return program


@functools.cache
def realtime() -> bool:
    """Whether programs may have real-time priority here."""
    if not shutil.which("chrt"):
        return False
    return subprocess.run(["chrt", "-f", "50", "true"], capture_output=True).returncode == 0


def stepped(program: Path, touch: int, calls: int, most: int = MANY, turns: int = 0) -> np.ndarray:
    """Wall-clock and processor time (calls, 2) [µs] of a C program's steps, or a loop's turns."""
    words = [*(["chrt", "-f", "50"] if realtime() else []), program]
    calls = min(calls, max(most // PARTS, 1))
    done = subprocess.run(
        [*words, str(calls), str(touch), str(turns)], capture_output=True, check=True
    )
    return np.frombuffer(done.stdout, np.float32).reshape(calls, 2)


def in_python(content: bytes, calls: int) -> dict[str, functools.partial]:
    """The exported feedforward, without effects and feedback, and MuJoCo's rigid body alone."""
    loaded = jax.export.deserialize(bytearray(content))
    with jax.enable_x64(False):
        compiled = jax.jit(loaded.call).lower(*loaded.in_avals).compile()
    alone = inverse_dynamics_in_c()

    def timed(function, kind, _, most=calls):
        motion = [np.linspace(low, 0.9, 7).astype(kind) for low in (-0.5, 0.1, -2.0)]
        spent = np.empty((max(most // PARTS, 1), 2), np.float32)
        for row in spent:
            wall, cpu = time.perf_counter(), time.thread_time()
            np.asarray(function(*motion))
            row[:] = 1e6 * (time.perf_counter() - wall), 1e6 * (time.thread_time() - cpu)
        return spent

    return {
        "Python: exported feedforward": functools.partial(timed, compiled, np.float32),
        "Python: MuJoCo's rigid body in C": functools.partial(timed, alone, float),
    }


def rows(runs: dict[str, functools.partial], calls: int) -> list[dict[str, object]]:
    spent = {name: [] for name in runs}
    for run in runs.values():
        run(100)  # memory touched
    for _ in range(PARTS):
        for name, run in runs.items():
            spent[name].append(run(calls // PARTS))
    out, base = [], None
    for name, parts in spent.items():
        wall, cpu = np.concatenate(parts).T
        base = np.median(wall) if base is None else base
        out.append(
            {
                "way": name,
                "calls": len(wall),
                "median": float(np.median(wall)),
                "99 %": float(np.quantile(wall, 0.99)),
                "99.9 %": float(np.quantile(wall, 0.999)),
                "worst": float(wall.max()),
                "99.9 % of processor time": float(np.quantile(cpu, 0.999)),
                "median over the first": float(np.median(wall) / base),
            }
        )
    return out


if __name__ == "__main__":
    main()
