"""Whether torques were logged later than the motion that they cause.

A motor may act late, but no motion precedes its torque. Where the torques of most joints fit the
motion far better a while earlier, the log's two clocks differ, or its torques were filtered. This
is reported, and nothing is changed.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.projection import CONVENTION, Projection
from jaxidl.gap.evidence.rows import Rows

LONGEST = 0.2  # [s]
LESS = 0.7  # of a joint's error: what has to be left at most,
ABOVE = 1.5  # where it is this many times its floor


def late_torques(rows: Rows, items: Sequence[Item], names: Sequence[str]) -> list[str]:
    """Return a sentence if torques of most joints were logged late; otherwise nothing.

    Args:
        rows: N rows of the log.
        items: the common effects and what was found, beside which torques are compared.
        names: names of the joints.
    """
    moving = np.flatnonzero(rows.used.any(0) & (rows.spread > 0.0))
    once = list({i.group: i for i in items}.values())
    projected, dt = Projection(rows, once, np.ones(len(names))), rows.signals.interval

    def error(late: float) -> np.ndarray:
        left = projected.residuals(rows.shifted(-late))
        return np.array([np.sqrt(np.mean(left[j] ** 2)) for j in moving])

    total = lambda late: float(np.sum(np.log(error(late) + 1e-300)))
    usual = -CONVENTION[0] * dt
    last, late = total(usual), usual
    while 2.0 * late < LONGEST and (more := total(2.0 * late)) < last:
        last, late = more, 2.0 * late
    if late == usual:
        return []
    bounds = late / 2.0, 2.0 * late
    found: Any = minimize_scalar(total, bounds=bounds, options={"xatol": 0.1 * dt})
    best = float(found.x)
    before, after = error(0.0), error(best)
    able, better = before > ABOVE * rows.floor[moving], after < LESS * before
    if 2 * np.count_nonzero(better) <= np.count_nonzero(able):
        return []
    return [
        f"the torques of {', '.join(np.array(names)[moving[better]])} fit the motion if they were"
        f" logged {1e3 * best:.2g} ms late, later than they act: check the clocks of positions and"
        " torques, and filters of the torques"
    ]
