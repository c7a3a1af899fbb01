"""Effects of a motor in a row: each acts on the command that those before it deliver.

The catalogue has them in the order in which a command passes them. A part of an effect does not
come before it: it takes its place, as a gear's elasticity does of its play.
"""

from collections.abc import Sequence

import numpy as np

from jaxidl.effects import place_of
from jaxidl.gap.evidence.additions import additions
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.items import part
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import effect_at, vector


def arriving(
    at: Item, members: Sequence[Item], x: Sequence[np.ndarray], rows: Rows, predicted: np.ndarray
) -> Rows:
    """Return the rows with the command that arrives at an effect of a motor.

    It is what those ``members``, with coefficients ``x``, deliver that come before it.
    """
    tau = rows.tau
    motors = [
        (place_of(m.key[0]), effect_at(m.shape, vector(m.shape, own)))
        for m, own in zip(members, x, strict=True)
        if at.actuates and m.actuates and set(m.joints) & set(at.joints) and not part(m, at)
    ]
    for place, effect in sorted(motors, key=lambda motor: motor[0]):
        if place < place_of(at.key[0]):
            _, tau = additions([effect], rows.signals, tau, predicted)
    return rows if tau is rows.tau else rows._replace(tau=tau)
