"""Moments in which something acted that is no property of the robot: a collision, a push.

A moment of motion stands out if what remains has there, on some joint, ``ENERGY`` times the mean
square that it has in all but a tenth of the log, and is no small part of the command. What
happens so rarely says nothing about an effect, and would decide about all of them: such moments are
left out, and the search begins again. What is there in more than a tenth of the log is left in.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from jaxidl.gap.evidence.rows import Rows

LENGTH = 0.25  # of a moment [s]
ENERGY = 50.0
LARGE = 0.3  # of the command's spread
SELDOM = 0.1  # share of the log


def strange(rows: Rows, left: np.ndarray) -> np.ndarray:
    """Return which of N rows lie in a moment that stands out, those that were left out included.

    Args:
        rows: N rows of the log.
        left: (N, J) residual of what was found [N or Nm].
    """
    step = float(np.median(np.diff(rows.signals.rows))) * rows.signals.dt
    mean = lambda x: uniform_filter1d(x, max(1, round(LENGTH / step)), axis=0, mode="constant")
    counted = rows.used & rows.signals.moving[rows.signals.rows]
    share = mean(counted.astype(float))
    square = np.where(share > 0.5, mean(left**2 * counted) / np.maximum(share, 0.5), 0.0)
    usual = ENERGY * np.quantile(square, 1.0 - SELDOM, axis=0)
    out = rows.strange | (square > np.maximum(usual, (LARGE * rows.spread) ** 2)).any(1)
    return out if out.mean() < SELDOM else rows.strange


def moments(rows: Rows, left: np.ndarray, names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Return a sentence about the moments of a log that were left out, if there are any.

    Args:
        rows: N rows of the log.
        left: (N, J) residual of what was found [N or Nm].
        names: names of the joints.
        units: units of their torques.
    """
    if not rows.strange.any():
        return []
    signals, found = rows.signals, list[str]()
    near = LENGTH / (float(np.median(np.diff(signals.rows))) * signals.dt)
    edges = np.flatnonzero(np.diff(rows.strange, prepend=False, append=False))
    inner = edges[1:-1].reshape(-1, 2)
    apart = inner[np.diff(inner)[:, 0] > near]  # what follows closely is the same moment
    for a, b in np.concatenate([edges[:1], apart.ravel(), edges[-1:]]).reshape(-1, 2).tolist():
        run = next(k for k, s in enumerate(signals.slices) if signals.rows[a] < s.stop)
        peak = np.abs(left[a:b]).max(0)
        j = int(np.argmax(peak / np.maximum(rows.floor, 1e-300)))
        at = (signals.rows[[a, b - 1]].mean() - signals.slices[run].start) * signals.dt
        where = f" of run {run + 1}" if len(signals.slices) > 1 else ""
        found.append(f"at {at:.1f} s{where} ({names[j]}, up to {peak[j]:.2g} {units[j]})")
    return [
        f"{', '.join(found)} the torque has an error that no effect explains, as in a collision or"
        " a push: these moments are left out"
    ]
