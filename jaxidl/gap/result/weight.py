"""What was found of all links and loads together, beside the model's own torque; rotors aside.

* If all links seem to be heavier by the same share, motor constants, gear ratios or the unit of the
  torques may be wrong by a common factor instead, and no number of the log tells which. So if what
  was found needs the same share of the model's own torque on two joints or more, this is said.
* If a joint carries much less than the model says, a balancer may carry the rest: a counterweight,
  a spring or a gas cylinder. It looks like a link that is too light, and this is said, too.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.choice.find import Found
from jaxidl.gap.evidence.gram import Group
from jaxidl.gap.evidence.items import spread
from jaxidl.gap.evidence.rows import Rows, rms

COUNTS = 0.04  # share of a joint's command that counts
OTHERWISE = 0.01  # share of a torque, squared, that may be something else
CARRIED = 0.3  # share of the model's torque that no wrong link is expected to lack


class Weight(NamedTuple):
    """Torques (N, J) [N or Nm] of links without what rotors would need."""

    own: np.ndarray  # of the model
    found: np.ndarray  # of what was found
    effects: set[Group]  # what that is, if it is more than a rotor


def weight_of(found: Found) -> Weight:
    """Return the torques of links in the model, and of links and loads that were found."""
    rows, solution = found.library.rows, found.solution
    lacking, effects = np.zeros_like(rows.gap), set[Group]()
    for m in found.named:
        if m.shape.cls.alter is not Effect.alter:
            whole = np.tensordot(solution.x[solution.of(m)], spread(m, rows), 1)
            lacking += (part := without_rotor(rows, whole))
            if np.sum(part**2) > OTHERWISE * np.sum((whole * rows.used) ** 2):
                effects.add(m.group)
    own = without_rotor(rows, rows.signals.tables.torque[rows.signals.rows])
    return Weight(own, lacking, effects)


def without_rotor(rows: Rows, torque: np.ndarray) -> np.ndarray:
    """Return the part of a torque (N, J) that no rotor inertia needs."""
    qdd = rows.signals.qdd[rows.signals.rows]
    square = np.sum(qdd**2 * rows.used, 0)
    rotor = np.sum(qdd * torque * rows.used, 0) / np.maximum(square, 1e-300)
    return (torque - rotor * qdd) * rows.used


def proportion(found: Found, weight: Weight) -> tuple[list[str], set[Group]]:
    """Return a sentence if all links lack one share of the torque, and which effects that are."""
    rows, own, lacking = found.library.rows, weight.own, weight.found
    scale = np.where(rows.spread > 0.0, rows.spread, np.inf) ** -2.0
    share = float(np.sum(scale * own * lacking) / max(float(np.sum(scale * own**2)), 1e-300))
    size, rest = rms(lacking, rows.used), rms(lacking - share * own, rows.used)
    counts = size > COUNTS * rows.spread
    if counts.sum() < 2 or np.any(rest[counts] ** 2 > OTHERWISE * size[counts] ** 2):
        return [], set()
    return [
        f"all links seem to be about {abs(share):.0%} too {'light' if share > 0.0 else 'heavy'} in"
        " the model; then the torques' common factor may be wrong instead (motor constants, gear"
        f" ratios, a unit): multiplied by {1.0 / (1.0 + share):.2g}, they would fit the model's"
        " links, and friction and rotors would change as much; weigh a link or a known load"
    ], weight.effects


def balanced(found: Found, names: Sequence[str]) -> list[str]:
    """Return a sentence if joints called ``names`` carry much less than the model says.

    Of changes since another log nothing is said: there it is a load that was put down.
    """
    if found.score.anchor is not None:
        return []
    own, lacking, _ = weight_of(found)
    share = np.sum(own * lacking, 0) / np.maximum(np.sum(own**2, 0), 1e-300)
    # a load on a joint with hardly any weight of its own is neither
    least = COUNTS * found.library.rows.spread
    counts = np.minimum(*(rms(x, found.library.rows.used) for x in (own, lacking))) > least
    return [
        f"{name} carries {-part:.0%} less than the model says: its links are that much lighter, or"
        " something carries them (a balancer: a counterweight, a spring, a gas cylinder), which"
        " looks the same; experiments/balancer.py looks for one (--plugin)"
        for name, part, much in zip(names, share.tolist(), counts.tolist(), strict=True)
        if much and -1.0 - CARRIED < part < -CARRIED
    ]
