"""What robot and controller say to each other over UDP; see packets.h for the meaning."""

import struct
from typing import NamedTuple

import numpy as np

READING, COMMAND = 0x3152444A, 0x3143444A
BRAKED = 1  # flag of a reading
HELLO, STOP = 1, 2  # flags of a command


class Command(NamedTuple):
    """What a controller wants."""

    flags: int
    answers: int  # sequence of the reading that it answers
    tau: np.ndarray  # (J,) [Nm]


def reading(flags: int, sequence: int, in_force: int, time: float, q: np.ndarray) -> bytes:
    """Return the packet of a reading ``q`` (J,) [rad]."""
    return struct.pack(f"<IIqqd{len(q)}d", READING, flags, sequence, in_force, time, *q)


def command(packet: bytes, joints: int) -> Command | None:
    """Return the command in a packet; None if it is none."""
    layout = struct.Struct(f"<IIq{joints}d")
    if len(packet) != layout.size:
        return None
    kind, flags, answers, *tau = layout.unpack(packet)
    return Command(flags, answers, np.array(tau)) if kind == COMMAND else None
