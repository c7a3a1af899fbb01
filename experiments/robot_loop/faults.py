"""What goes wrong between robot and controller, on purpose."""

import argparse
from dataclasses import dataclass, field, fields

import numpy as np
from packets import Command


@dataclass
class Faults:
    """Faults of network and sensors; shares are those of packets, in both directions."""

    lose: float = 0.0  # share that never arrives
    late: float = 0.0  # share that arrives late
    late_by: int = 3  # ticks that these are late
    double: float = 0.0  # share that arrives twice
    since: float = 0.0  # [s] from when on packets are lost, late or doubled
    nan_at: float = -1.0  # [s] from when on an encoder gives NaN; < 0: never
    nan_joint: int = 0  # counted from 0
    silent_at: float = -1.0  # [s] from when on the robot sends nothing; < 0: never
    repeat_at: float = -1.0  # [s] from when on it sends its last reading again; < 0: never
    seed: int = 0
    out: list[tuple[int, int, bytes]] = field(default_factory=list)  # due tick, sequence, packet
    come: list[tuple[int, Command]] = field(default_factory=list)
    last: bytes = b""  # the last reading before it is repeated

    def __post_init__(self) -> None:
        self.draws = np.random.default_rng([self.seed, 1])

    @staticmethod
    def add_options(parser: argparse.ArgumentParser) -> None:
        """Add an option for each fault."""
        for f in fields(Faults)[:9]:
            option = f"--{f.name.replace('_', '-')}"
            parser.add_argument(option, type=type(f.default), default=f.default)

    @classmethod
    def of(cls, given: argparse.Namespace) -> "Faults":
        """Return the faults that the options say."""
        return cls(**{f.name: getattr(given, f.name) for f in fields(cls)[:9]}, seed=given.seed)

    def sensed(self, time: float, q: np.ndarray) -> np.ndarray:
        """Return what the encoders give (J,)."""
        if 0.0 <= self.nan_at <= time:
            q[self.nan_joint] = np.nan
        return q

    def sent(self, tick: int, packet: bytes) -> list[tuple[int, bytes]]:
        """Take a reading and return what leaves for the controller now: sequence and packet."""
        repeats = bool(self.last) and 0.0 <= self.repeat_at <= tick * 1e-3
        self.last = packet = self.last if repeats else packet
        if not 0.0 <= self.silent_at <= tick * 1e-3:
            self.out += [(due, tick, packet) for due in self._fate(tick)]
        now = [(sequence, packet) for due, sequence, packet in self.out if due <= tick]
        self.out = [entry for entry in self.out if entry[0] > tick]
        return now

    def arrived(self, tick: int, command: Command) -> None:
        """Take a command from the controller."""
        self.come += [(due, command) for due in self._fate(tick)]

    def delivered(self, tick: int) -> list[Command]:
        """Return the commands that reach the drives now."""
        now = [command for due, command in self.come if due <= tick]
        self.come = [entry for entry in self.come if entry[0] > tick]
        return now

    def _fate(self, tick: int) -> list[int]:
        """Return the ticks at which a packet arrives: none, one or two."""
        lost, late, twice = self.draws.random(3)
        if tick * 1e-3 < self.since:
            return [tick]
        if lost < self.lose:
            return []
        due = tick + (self.late_by if late < self.late else 0)
        return [due, due] if twice < self.double else [due]
