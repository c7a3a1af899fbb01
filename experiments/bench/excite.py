"""How long `jaxidl excite` takes from a cold start on two cores: for a seven-joint arm, and after a
diagnosis in doubt.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import arguments, machine, report
from gap import arm

from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import PENDULUM

CORES, TARGET = 2, 60.0  # , [s]
LIMITS = "speed: 2\nacceleration: 6\n"
KEYS = [("spring", 0), ("com_error", 0)]  # what the doubt is about, whatever was found


def seconds(words: list[str]) -> tuple[float, float]:
    """Wall and processor time of the command in a process that has compiled nothing."""
    among = sorted(os.sched_getaffinity(0))[:CORES]
    used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    began, before = time.perf_counter(), used()
    subprocess.run(
        [sys.executable, "-m", "jaxidl", *words],
        env=os.environ | {"JAX_COMPILATION_CACHE_DIR": ""},
        capture_output=True,
        check=True,
        preexec_fn=lambda: os.sched_setaffinity(0, among),
    )
    return time.perf_counter() - began, used() - before


def doubt(folder: Path) -> Path:
    """A pendulum with a hidden spring, and a diagnosis that doubts whether it is one."""
    model, log, out = folder / "pendulum.xml", folder / "pendulum.npz", folder / "gap"
    model.write_text(PENDULUM)
    hidden = [make("spring", 0, {"stiffness": 0.85, "rest": -0.2})]
    np.savez(log, **simulate(PENDULUM, hidden, 3, duration=24.0))  # pyright: ignore[reportArgumentType]
    seconds(["gap", str(log), "--model", str(model), "--out", str(out)])
    content = json.loads((out / "report.json").read_text())
    candidates = [{"effect": name, "joint": joint} for name, joint in KEYS]
    content["effects"] = [e for e in content["effects"] if (e["effect"], e["joint"]) in KEYS][:1]
    content["ambiguous"] = [{"candidates": candidates}]
    (out / "report.json").write_text(json.dumps(content))
    return model


def main() -> None:
    options = arguments(__doc__ or "", rounds=1)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "arm.xml").write_text(arm())
        (folder / "limits.yaml").write_text("position: [-2.5, 2.5]\n" + LIMITS)
        model = doubt(folder)
        jobs = {
            "seven joints, all common effects": [
                *("--model", str(folder / "arm.xml"), "--limits", str(folder / "limits.yaml"))
            ],
            "a pendulum, after a diagnosis": ["--model", str(model), "--for", str(folder / "gap")],
        }
        for number, (what, words) in enumerate(jobs.items()):
            out = ["--out", str(folder / f"{number}.csv")]
            found = [seconds(["excite", *words, *out]) for _ in range(options.rounds)]
            wall, used = np.median(found, axis=0)
            rows.append(
                {"what": what, "cold [s]": wall, "processor [s]": used, "target [s]": TARGET}
            )
    waiting = f"{os.getloadavg()[0]:.1f} processes for {CORES} cores in the last minute"
    report("from the prompt to the motion", rows, options.json, machine=machine(), load=waiting)


if __name__ == "__main__":
    main()
