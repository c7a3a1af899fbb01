"""Samples that were taken evenly, but stamped when they came, or with few digits.

A robot's controller samples evenly. A program that receives the samples over a network stamps them
late and in bursts, or a little early and late, and some are lost. A program that asks for each
sample itself takes them unevenly, and its stamps are right. Motion tells one from the other:
positions are smooth in the time at which they were taken.
"""

from itertools import pairwise

import numpy as np
from scipy.ndimage import minimum_filter1d

from jaxidl.logs.mending import Samples

UNEVEN = 0.02  # mean deviation from even stamps, in intervals, from which on the motion is asked
SOON = 40  # samples among which at least one is not late
ROUNDS = 20  # of looking for lost samples
WINDOW = 7  # samples through which a parabola passes if their times are right
WINDOWS = 20_000  # most that are looked at
SMOOTHER = 0.5  # share of the roughness that is left
TINY = np.finfo(float).tiny


def counted(found: Samples, notes: list[str]) -> Samples:
    """Return a file's samples with even stamps where positions say that they were taken evenly.

    What was done is added to the notes.
    """
    time, late = found.time.copy(), 0.0
    edges = np.flatnonzero(np.diff(found.run)) + 1
    for a, b in pairwise([0, *edges.tolist(), len(time)]):
        if b - a >= 2 * SOON:
            q = found.signals["q"][a:b]
            ways = (_even(found.time[a:b]), _nearest(found.time[a:b]))
            even = min(ways, key=lambda way: np.sum(np.log(_roughness(way, q) + TINY)))
            if _evenly_taken(found.time[a:b], even, q):
                time[a:b], late = even, max(late, float(np.max(np.abs(found.time[a:b] - even))))
    if not late:
        return found
    notes.append(
        f"times in {found.table.name} are off by up to {1e3 * late:.3g} ms: positions are far"
        " smoother if samples were taken evenly, so samples are counted instead"
    )
    return found._replace(time=time)


def _even(time: np.ndarray) -> np.ndarray:
    """Return stamps (T,) on an even grid, with gaps where samples were lost.

    A sample that comes late is soon followed by one that does not; after a lost one all are later.
    """
    number = np.arange(len(time), dtype=float)
    step = np.median(time[SOON:] - time[:-SOON]) / SOON
    for _ in range(ROUNDS):
        lag = time / step - number
        before = minimum_filter1d(lag, SOON, origin=SOON // 2 - 1, mode="nearest")[:-1]
        after = minimum_filter1d(lag, SOON, origin=-(SOON // 2), mode="nearest")[1:]
        lost = np.rint(np.maximum(after - before, 0.0))
        lost[1:][lost[:-1] > 0] = 0.0  # the first of a row is where it happened
        lost[-SOON:] = 0.0  # not known before the next one in time
        number[1:] += np.cumsum(lost)
        blocks = np.arange(len(time) // SOON)
        whole = (time - step * number)[: SOON * len(blocks)].reshape(-1, SOON)
        in_time = SOON * blocks + np.argmin(whole, axis=1)
        step = np.polyfit(number[in_time], time[in_time], 1)[0]
        if not lost.any():
            break
    return number * step + np.min(time - number * step)


def _nearest(time: np.ndarray) -> np.ndarray:
    """Return stamps (T,) on the even grid that is nearest: none is off by half an interval."""
    between = np.diff(time)
    number = np.append(0.0, np.cumsum(np.maximum(np.rint(between / np.median(between)), 1.0)))
    step, begin = np.polyfit(number, time, 1)
    return begin + step * number


def _evenly_taken(time: np.ndarray, even: np.ndarray, q: np.ndarray) -> bool:
    """Return whether positions (T, J) are far smoother in ``even`` time (T,) than in ``time`` (T,).

    The joint decides on which the two differ most.
    """
    if np.mean(np.abs(np.diff(time - even))) < UNEVEN * np.min(np.diff(even)):
        return False
    moving = np.ptp(q, axis=0) > 0.0
    if not moving.any():
        return False
    ratio = np.log(_roughness(even, q[:, moving]) + TINY) - np.log(
        _roughness(time, q[:, moving]) + TINY
    )
    return bool(ratio[np.argmax(np.abs(ratio))] < np.log(SMOOTHER))


def _roughness(time: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the mean squared deviation (J,) of positions (T, J) from parabolas through windows."""
    first = np.arange(0, len(time) - WINDOW + 1, 1 + len(time) // WINDOWS)
    rows = first[:, None] + np.arange(WINDOW)
    at = time[rows] - time[rows].mean(1, keepdims=True)
    at = at / max(np.max(np.abs(at)), TINY)
    basis, _ = np.linalg.qr(np.stack([np.ones(at.shape), at, at**2], axis=-1))
    left = q[rows] - basis @ (np.swapaxes(basis, 1, 2) @ q[rows])
    return np.mean(left**2, axis=(0, 1))
