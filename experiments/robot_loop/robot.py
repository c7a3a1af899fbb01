"""The robot: a process of its own that talks to a controller over UDP, 1 kHz.

Each millisecond it sends a reading, and goes on with the newest command that has come: a command
acts from the tick after the reading that it answers. If the newest command is older than the
watchdog allows, is not finite, or says stop, the brakes close and stay closed.

``--lock-step`` lets each tick last until its command is there: the same numbers each time.
Otherwise ticks are a millisecond long. The last line of output is a summary in JSON.
"""

import argparse
import json
import os
import select
import socket
import time
from pathlib import Path

import numpy as np
from faults import Faults
from packets import BRAKED, HELLO, STOP, Command, command, reading
from plant import DT, Plant

PATIENCE = 3.0  # [s] for a command in lock-step, and for the first hello
SETTLE = 0.3  # [s] of standing still before the robot is switched off, ...
LONGEST = 5.0  # [s] of brakes after which it is switched off anyway
SLIP = 5  # ticks behind the clock from which on a late robot does not catch up


class Robot:
    """Plant, drives and watchdog behind a socket."""

    def __init__(self, plant: Plant, faults: Faults, watchdog: int, lock_step: bool):
        self.plant, self.faults, self.watchdog = plant, faults, watchdog
        self.lock_step, self.patience = lock_step, PATIENCE
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.peer: tuple[str, int] | None = None
        self.tick, self.newest = 0, Command(0, -1, np.zeros(plant.joints))
        self.sent = -1  # newest reading that has left
        self.why = ""  # the brakes were closed
        self.log: list[tuple[float, np.ndarray, np.ndarray, np.ndarray, bool]] = []
        self.behind: list[float] = []  # [s] that ticks began late

    def run(self) -> dict[str, object]:
        """Serve one controller until the robot stands still behind closed brakes."""
        print(f"port {self.socket.getsockname()[1]}", flush=True)
        self._meet()
        due, still, stopped = time.perf_counter(), 0, 0
        while still < SETTLE / DT and stopped < LONGEST / DT:
            late = 0.0 if self.lock_step else time.perf_counter() - due
            self.behind.append(late)
            due = due + DT if late < SLIP * DT else time.perf_counter() + DT
            sent = self._send()
            q, qd = self.plant.data.qpos.copy(), self.plant.data.qvel.copy()
            tau = self.plant.advance(self.newest.tau)
            self.log.append((self.tick * DT, q, qd, tau, self.plant.braked))
            self._wait(sent, due)
            self._guard()
            self.tick += 1
            still = still + 1 if self.why and self.plant.at_rest else 0
            stopped += bool(self.why)
        late = 1e6 * np.array(self.behind)
        return {
            "stopped": self.why,
            "ticks": self.tick,
            "late_us": {str(p): round(float(np.percentile(late, p)), 1) for p in (50, 99, 99.9)},
            "slips": int(np.sum(late > 1e6 * SLIP * DT)),
        }

    def _meet(self) -> None:
        """Wait for a controller, and answer it alone from then on."""
        self.socket.settimeout(PATIENCE)
        while True:
            packet, peer = self.socket.recvfrom(1024)
            wanted = command(packet, self.plant.joints)
            if wanted is not None and wanted.flags & HELLO:
                self.peer = peer
                return

    def _send(self) -> int:
        """Send this tick's reading; return the sequence that the controller will answer, or -1.

        It ignores an old reading that arrives late.
        """
        assert self.peer is not None
        q = self.faults.sensed(self.tick * DT, self.plant.read())
        flags = BRAKED if self.why else 0
        packet = reading(flags, self.tick, self.newest.answers, self.tick * DT, q)
        before = self.sent
        for sequence, leaving in self.faults.sent(self.tick, packet):
            self.socket.sendto(leaving, self.peer)
            self.sent = max(self.sent, sequence)
        return self.sent if self.sent > before else -1

    def _wait(self, sent: int, due: float) -> None:
        """Take commands until the tick ends; in lock-step until the answer to ``sent`` is there."""
        until = time.perf_counter() + self.patience if self.lock_step else due
        answered = sent < 0 or bool(self.why)
        while not (self.lock_step and answered):
            left = until - time.perf_counter()
            if left <= 0.0:
                # a silent controller is not waited for again at every tick
                self.patience = DT if self.lock_step else self.patience
                break
            # select counts microseconds, a socket's own timeout milliseconds
            if not select.select([self.socket], [], [], left)[0]:
                continue
            packet, peer = self.socket.recvfrom(1024)
            wanted = command(packet, self.plant.joints) if peer == self.peer else None
            if wanted is None or wanted.flags & HELLO:
                continue
            answered = answered or wanted.answers >= sent or bool(wanted.flags & STOP)
            self.patience = PATIENCE
            self.faults.arrived(self.tick, wanted)
        for wanted in self.faults.delivered(self.tick):
            if wanted.flags & STOP:
                self._brake("the controller said stop")
            elif wanted.answers > self.newest.answers:  # neither doubled nor overtaken
                self.newest = wanted

    def _guard(self) -> None:
        """Open the brakes for the first command; close them if commands fail."""
        if self.why:
            return
        if not np.isfinite(self.newest.tau).all():
            self._brake("a command that is not finite")
        elif self.tick - self.newest.answers > self.watchdog:
            self._brake("watchdog: no new command")
        elif self.newest.answers >= 0:
            self.plant.braked = False

    def _brake(self, why: str) -> None:
        self.why, self.plant.braked = self.why or why, True


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path, help="robot.json, as prepare.py writes it")
    parser.add_argument("--lock-step", action="store_true")
    parser.add_argument("--watchdog", type=int, default=20, help="ticks without a new command")
    parser.add_argument("--seed", type=int, default=0, help="of encoder noise and faults")
    parser.add_argument("--priority", type=int, default=0, help="real-time priority, 0: none")
    parser.add_argument("--truth", type=Path, help="NPZ of what truly happened")
    Faults.add_options(parser)
    given = parser.parse_args()
    settings = json.loads(given.file.read_text())
    plant = Plant(
        given.file.parent / settings["model"], settings["hidden"], settings["home"], given.seed
    )
    robot = Robot(plant, Faults.of(given), given.watchdog, given.lock_step)
    if given.priority:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(given.priority))
    summary = robot.run()
    if given.truth:
        names = ("time", "q", "qd", "tau", "braked")
        columns = zip(*robot.log, strict=True)
        np.savez(given.truth, **dict(zip(names, map(np.array, columns), strict=True)))
    print(json.dumps(summary))


if __name__ == "__main__":
    main()
