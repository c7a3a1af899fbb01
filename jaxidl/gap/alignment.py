"""How torque and position are aligned in time, to a fraction of a sample.

Whether a logged torque acts at its instant, over the interval that follows, or over the one before is the logger's convention and
no physical effect. Every fit is free to choose, up to a sample; what goes beyond is an effect.
"""

from typing import ClassVar

import jax.numpy as jnp

from jaxidl.effects import Effect, Parameter
from jaxidl.gap.candidates import Candidate
from jaxidl.gap.data import Data
from jaxidl.gap.members import Member
from jaxidl.gap.terms import Contribution
from jaxidl.types import Joints

ALIGNMENT = "alignment"
REACH = (-1.0, 0.5)  # beside half an interval late, where a held command is [sampling intervals]


class Alignment(Effect):
    """The torque acts ``shift`` later than a held command does. Not in the catalogue."""

    shift: Joints  # (J,) [s]

    name: ClassVar[str] = ALIGNMENT
    parameters: ClassVar = {"shift": Parameter("s", -1.0, 1.0, "the alignment")}
    linear: ClassVar[bool] = True


def alignments(data: Data) -> tuple[Member, ...]:
    """One member for each joint, at no shift."""
    signals, (_, joints) = data.signals, data.base.shape
    slope = signals.differentiate(signals.command(signals.tau))[signals.rows]
    reach = {"shift": (REACH[0] * signals.dt, REACH[1] * signals.dt)}
    found = []
    for j in range(joints):
        candidate = Candidate(ALIGNMENT, j, "", Alignment(jnp.zeros(1)), ("shift",), within=reach, at_bounds=True)
        net = -slope[None, :, j : j + 1]
        slopes, nothing = Contribution(net, 0.0 * net, 0.0 * net), 0.0 * net[0]
        found.append(Member(candidate, candidate.guess, (j,), Contribution(nothing, nothing, nothing), slopes))
    return tuple(found)
