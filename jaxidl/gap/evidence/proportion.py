"""Whether the torques' factor may be wrong rather than the links.

If all links seem to be heavier by the same share, motor constants, gear ratios or the unit of the
torques may be wrong by a common factor instead, and no number of the log tells which. So if what
was found of the links needs the same share of the model's own torque on two joints or more, rotors
aside, this is said.
"""

from collections.abc import Sequence

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.evidence.gram import Group, Item
from jaxidl.gap.evidence.items import spread
from jaxidl.gap.evidence.rows import Rows, rms

LEAST = 0.04  # share of a joint's command that counts
OTHERWISE = 0.01  # share of a torque, squared, that may be something else


def proportion(
    rows: Rows, members: Sequence[Item], x: Sequence[np.ndarray]
) -> tuple[list[str], set[Group]]:
    """Return a sentence if all links lack the same share of the model's torque; otherwise nothing.

    Also return which of the effects found the torques' factor would replace.

    Args:
        rows: N rows of the log.
        members: effects found.
        x: their coefficients.
    """
    signals, links, lacking = rows.signals, set[Group](), np.zeros_like(rows.gap)
    qdd = signals.qdd[signals.rows]

    def without_rotor(torque: np.ndarray) -> np.ndarray:
        """Return the part of a torque (N, J) that no rotor inertia needs."""
        rotor = np.sum(qdd * torque * rows.used, 0) / np.maximum(
            np.sum(qdd**2 * rows.used, 0), 1e-300
        )
        return (torque - rotor * qdd) * rows.used

    for m, a in zip(members, x, strict=True):
        if m.shape is not None and not m.always and m.shape.cls.alter is not Effect.alter:
            whole = np.tensordot(a, spread(m, rows), 1)
            lacking += (part := without_rotor(whole))
            if np.sum(part**2) > OTHERWISE * np.sum((whole * rows.used) ** 2):
                links.add(m.group)
    own = without_rotor(signals.tables.torque[signals.rows])
    weight = np.where(rows.spread > 0.0, rows.spread, np.inf) ** -2.0
    share = float(np.sum(weight * own * lacking) / max(float(np.sum(weight * own**2)), 1e-300))
    size, rest = rms(lacking, rows.used), rms(lacking - share * own, rows.used)
    counts = size > LEAST * rows.spread
    if counts.sum() < 2 or np.any(rest[counts] ** 2 > OTHERWISE * size[counts] ** 2):
        return [], set()
    return [
        f"all links seem to be about {abs(share):.0%} too {'light' if share > 0.0 else 'heavy'} in"
        " the model; then the torques' common factor may be wrong instead (motor constants, gear"
        f" ratios, a unit): multiplied by {1.0 / (1.0 + share):.2g}, they would fit the model's"
        " links, and friction and rotors would change as much; weigh a link or a known load"
    ], links
