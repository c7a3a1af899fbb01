"""One execution: starts the robot and a controller, waits for both, prints a line.

``python execute.py FOLDER CONTROLLER LOG``, FOLDER as prepare.py writes it. ``--kill-at SECONDS``
kills the controller in mid motion. All other options go to robot.py. Ends with status 0 if the
task came to its end, 1 if the robot was stopped before.
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
WHY = {
    0: "finished",
    2: "no robot",
    3: "silent robot",
    4: "a number that is not finite",
    5: "beyond limits",
    6: "too many readings lost",
    7: "the robot braked",
    -9: "killed",
}


def execute(
    folder: Path,
    controller: Path,
    log: Path,
    options: list[str],
    *,
    kill_at: float | None = None,
    watchdog_ms: int = 20,
    priority: int = 0,
) -> dict[str, object]:
    """Run the task once and return the robot's summary, with the controller's end."""
    robot = subprocess.Popen(
        [
            sys.executable,
            str(HERE / "robot.py"),
            str(folder / "robot.json"),
            f"--priority={priority}",
            *options,
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert robot.stdout is not None
        word = robot.stdout.readline().split()
        if word[:1] != ["port"]:
            raise SystemExit("execute.py: expected the robot's port; got none: see above")
        patient = 3000 if "--lock-step" in options else watchdog_ms  # a slow machine is no fault
        loop = subprocess.Popen([str(controller), word[1], str(log), str(patient), str(priority)])
        if kill_at is not None:
            _kill(loop, log, kill_at)
        status = loop.wait(120)
        summary = json.loads(robot.communicate(timeout=120)[0].splitlines()[-1])
    finally:
        robot.kill()
    return {"controller": WHY.get(status, f"status {status}"), **summary}


def _kill(loop: "subprocess.Popen[bytes]", log: Path, at: float) -> None:
    """Kill the controller once its log has come to a time [s]."""
    while loop.poll() is None:
        last = log.read_text().rpartition("\n")[0].rpartition("\n")[2] if log.exists() else ""
        time_stamp = last.partition(",")[0]
        if time_stamp[:1].isdigit() and float(time_stamp) >= at:
            loop.kill()
        time.sleep(1e-3)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("controller", type=Path)
    parser.add_argument("log", type=Path)
    parser.add_argument("--kill-at", type=float)
    parser.add_argument("--watchdog-ms", type=int, default=20, help="of the controller")
    parser.add_argument("--priority", type=int, default=0)
    given, options = parser.parse_known_args()
    summary = execute(
        given.folder,
        given.controller.resolve(),
        given.log,
        options,
        kill_at=given.kill_at,
        watchdog_ms=given.watchdog_ms,
        priority=given.priority,
    )
    print(json.dumps(summary))
    return summary["controller"] != "finished"


if __name__ == "__main__":
    sys.exit(main())
