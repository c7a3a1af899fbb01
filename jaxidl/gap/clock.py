"""Whether torques were logged later than the motion that they cause.

A motor may act late, but no motion precedes its torque. Where the torques of most joints fit the
motion far better a while earlier, the log's two clocks differ, or its torques were filtered. This
is reported, and nothing is changed.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from jaxidl.gap.gram import Item
from jaxidl.gap.projection import CLEAR, CONVENTION, Projection
from jaxidl.gap.rows import Rows

LONGEST = 0.2  # [s]
RISE = 5.0 * CLEAR  # of the log likelihood, of every joint that counts


def late_torques(rows: Rows, common: Sequence[Item], names: Sequence[str]) -> list[str]:
    """Return a sentence if torques of most joints were logged late; otherwise nothing.

    Args:
        rows: N rows of the log.
        common: items of the common effects, beside which torques are compared.
        names: names of the joints.
    """
    moving = rows.used.any(0) & (rows.spread > 0.0)
    projected, dt = Projection(rows, common, np.ones(len(moving))), rows.signals.dt
    left = lambda late: projected.left_of(rows.shifted(-late))[moving]
    usual = -CONVENTION[0] * dt
    before, last, late = left(0.0), left(usual).sum(), usual
    while 2.0 * late < LONGEST and (more := left(2.0 * late).sum()) < last:
        last, late = more, 2.0 * late
    if late == usual:
        return []
    found: Any = minimize_scalar(
        lambda at: left(at).sum(), bounds=(late / 2.0, 2.0 * late), options={"xatol": 0.1 * dt}
    )
    best = float(found.x)
    better = before - left(best) > RISE
    if 2 * np.count_nonzero(better) <= len(better):
        return []
    return [
        f"the torques of {', '.join(np.array(names)[moving][better])} fit the motion if they were"
        f" logged {1e3 * best:.2g} ms late, later than they act: check the clocks of positions and"
        " torques, and filters of the torques"
    ]
