"""How long `jaxidl gap` takes from a cold start: a measured drive on one core, a seven-joint arm on
all.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from common import arguments, machine, report

EMPS = Path(
    os.environ.get(
        "JAXIDL_EMPS", Path(__file__).parents[3] / "shared" / "data" / "emps" / "emps.csv"
    )
)
SLIDER = """<mujoco><worldbody><body name="slider"><joint name="slide" type="slide" axis="1 0 0"/>
<inertial pos="0 0 0" mass="95.1089" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
OFFSETS, AXES = (
    (0.102, 0.2085, 0.1915, 0.2085, 0.1915, 0.1985, 0.078),
    ("0 0 1", "0 -1 0", "0 0 1", "0 1 0", "0 0 1", "0 -1 0", "0 0 1"),
)
MASSES, ARMATURES = (2.7, 2.7, 2.5, 2.5, 1.7, 1.6, 0.3), (0.3, 0.3, 0.2, 0.2, 0.1, 0.06, 0.05)
VISCOUS, COULOMB = (
    np.array([4, 4, 2.5, 2.5, 1.2, 0.6, 0.4]),
    np.array([2, 2, 1.2, 1.2, 0.6, 0.4, 0.3]),
)
DURATION, DT, NOISE, COUNT = 60.0, 0.004, 1e-5, 2e-5  # [s], [s], [rad], [rad]


def arm() -> str:
    """A light arm of seven hinges."""
    text = ""
    for j in reversed(range(7)):
        inertia = f"{0.012 * MASSES[j]} {0.012 * MASSES[j]} {0.004 * MASSES[j]}"
        inertial = (
            f'<inertial pos="0.01 0 {OFFSETS[(j + 1) % 7] / 2}" mass="{MASSES[j]}"'
            f' diaginertia="{inertia}"/>'
        )
        hinge = f'<joint name="j{j + 1}" type="hinge" axis="{AXES[j]}" armature="{ARMATURES[j]}"/>'
        text = f'<body name="link{j + 1}" pos="0 0 {OFFSETS[j]}">{hinge}{inertial}{text}</body>'
    return f'<mujoco model="arm"><worldbody>{text}</worldbody></mujoco>'


def moved(text: str) -> dict[str, np.ndarray]:
    """A log of the arm on smooth paths, with viscous and Coulomb friction on every joint that the
    model has not.
    """
    model: Any = mujoco.MjModel.from_xml_string(text)  # pyright: ignore[reportAttributeAccessIssue]
    data: Any = mujoco.MjData(model)  # pyright: ignore[reportAttributeAccessIssue]
    rng, time_ = np.random.default_rng(0), np.arange(round(DURATION / DT)) * DT
    q, qd, qdd = (np.zeros((len(time_), 7)) for _ in range(3))
    for j in range(7):
        for hertz in rng.uniform(0.05, 0.6, 5):
            size, phase, w = 0.35 / (1 + 3 * hertz), rng.uniform(0.0, 2 * np.pi), 2 * np.pi * hertz
            q[:, j] += size * np.sin(w * time_ + phase)
            qd[:, j] += size * w * np.cos(w * time_ + phase)
            qdd[:, j] -= size * w * w * np.sin(w * time_ + phase)
    tau = np.empty_like(q)
    for t in range(len(time_)):
        data.qpos, data.qvel, data.qacc = q[t], qd[t], qdd[t]
        mujoco.mj_inverse(model, data)  # pyright: ignore[reportAttributeAccessIssue]
        tau[t] = data.qfrc_inverse
    tau += VISCOUS * qd + COULOMB * np.tanh(qd / 1e-3)
    return {
        "time": time_,
        "q": np.round((q + rng.normal(0.0, NOISE, q.shape)) / COUNT) * COUNT,
        "tau": tau,
    }


def seconds(log: Path, model: Path, out: Path, cores: int) -> float:
    """Wall time of the command in a process that has compiled nothing."""
    among = sorted(os.sched_getaffinity(0))[:cores]
    words = [
        sys.executable,
        "-m",
        "jaxidl",
        "gap",
        str(log),
        "--model",
        str(model),
        "--out",
        str(out),
    ]
    began = time.perf_counter()
    environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": ""}
    subprocess.run(
        words,
        env=environment,
        capture_output=True,
        check=True,
        preexec_fn=lambda: os.sched_setaffinity(0, among),
    )
    return time.perf_counter() - began


def main() -> None:
    options = arguments(__doc__ or "", rounds=1)
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "slider.xml").write_text(SLIDER)
        (folder / "arm.xml").write_text(arm())
        np.savez(folder / "arm.npz", **moved(arm()))  # pyright: ignore[reportArgumentType]
        jobs = [
            (
                "seven joints, 60 s at 250 Hz, two cores",
                folder / "arm.npz",
                folder / "arm.xml",
                2,
                60.0,
            )
        ]
        if EMPS.is_file():
            jobs.insert(
                0,
                (
                    "measured drive (EMPS), 25 s at 1 kHz, one core",
                    EMPS,
                    folder / "slider.xml",
                    1,
                    10.0,
                ),
            )
        for number, (what, log, model, cores, target) in enumerate(jobs):
            found = [
                seconds(log, model, folder / f"{number}-{k}", cores) for k in range(options.rounds)
            ]
            rows.append({"what": what, "cold [s]": float(np.median(found)), "target [s]": target})
    report("from the prompt to the report", rows, options.json, machine=machine())


if __name__ == "__main__":
    main()
