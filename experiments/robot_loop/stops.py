"""What becomes of the robot when something goes wrong in mid motion: ``python stops.py WORK``.

Executions with the controller before any learning, in lock-step, one for each fault. WORK gets
stops.json: why robot and controller stopped, how long until the drives gave no torque and until
the arm stood still, how far it went meanwhile, and whether `jaxidl learn` reads the log.
"""

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import jax
import numpy as np
from execute import execute

from jaxidl.backend import choose_devices
from jaxidl.errors import LogError
from jaxidl.files import plain, write_bytes
from jaxidl.robot.execution import read_execution
from jaxidl.systems.arm import torque_limits
from jaxidl.systems.mjcf import read_model

AT, REST = 1.0, 1e-3  # [s] of the fault; [rad/s] below which the arm stands still
FAULTS: dict[str, tuple[str, ...]] = {
    "1 % of packets lost": ("--lose=0.01",),
    "10 % of packets 3 ms late": ("--late=0.1", "--late-by=3"),
    "half of the packets doubled": ("--double=0.5",),
    "all packets 3 ms late": ("--late=1", "--late-by=3", f"--since={AT}"),
    "80 % of packets lost": ("--lose=0.8", f"--since={AT}"),
    "all packets 30 ms late": ("--late=1", "--late-by=30", f"--since={AT}"),
    "an encoder gives NaN": (f"--nan-at={AT}", "--nan-joint=3"),
    "the robot sends nothing more": (f"--silent-at={AT}",),
    "the robot repeats its last reading": (f"--repeat-at={AT}",),
    "the controller is killed": (f"--kill-at={AT}",),
}


def stop(work: Path, options: tuple[str, ...], folder: Path) -> dict[str, Any]:
    """Run one execution with a fault."""
    log, truth = folder / "log.csv", folder / "truth.npz"
    kill = [float(o.partition("=")[2]) for o in options if o.startswith("--kill-at")]
    rest = [o for o in options if not o.startswith("--kill-at")]
    summary = execute(
        work,
        work / "0" / "controller",
        log,
        ["--lock-step", f"--truth={truth}", *rest],
        kill_at=kill[0] if kill else None,
    )
    true = dict(np.load(truth))
    moving = np.flatnonzero(~true["braked"])
    out: dict[str, Any] = {"controller": summary["controller"], "robot": summary["stopped"]}
    rows = np.genfromtxt(log, delimiter=",", names=True, usecols=0).size
    if moving.size:
        braked = min(moving[-1] + 1, len(true["time"]) - 1)
        going = np.flatnonzero(np.abs(true["qd"]).max(1) > REST)
        out |= {
            "braked_at": true["time"][braked],
            "speed": np.abs(true["qd"][braked]).max(),
            "to_rest": max(0.0, true["time"][going[-1]] - true["time"][braked]),
            "travel": np.abs(true["q"][-1] - true["q"][braked]).max(),
        }
    try:
        model = read_model(work / "arm.xml")
        read_execution(log, model, torque_limit=torque_limits())
        read = "yes"
    except LogError as error:
        read = f"refused: {error}"
    return out | {"rows": rows, "read": read}


def main() -> int:
    if len(sys.argv) != 2:
        print(f"expected WORK; got {' '.join(sys.argv[1:])}", file=sys.stderr)
        return 2
    work, found = Path(sys.argv[1]), {}
    choose_devices(None)
    with jax.enable_x64(True):
        for name, options in FAULTS.items():
            with tempfile.TemporaryDirectory() as folder:
                found[name] = stop(work, options, Path(folder))
            print(f"{name}: {found[name]}", flush=True)
    write_bytes(work / "stops.json", (json.dumps(plain(found), indent=1) + "\n").encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
