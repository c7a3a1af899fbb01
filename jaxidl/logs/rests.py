"""Rests of a joint, and the torque that it withstands in them."""

from typing import Any

import numpy as np
from scipy import ndimage, signal

AGAINST = 0.1  # share of rests after which a joint goes against the torque
SHARP = 0.1  # share of the torque's spread by which it may rise while a breakaway is seen
QUIET = 0.01  # share of the torque's spread below which its noise does no harm


def classify(
    qd: np.ndarray, rest_speed: np.ndarray, half: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return moving and resting instants (T, J), and whole rests with their blurred ends.

    The filter blurs the ends of a rest. A rest shorter than the filter, which reaches ``half``
    instants, is a reversal: neither motion nor rest.
    """
    slow = np.abs(qd) < rest_speed
    long = np.asarray(ndimage.binary_opening(slow, np.ones((3 * half + 1, 1))))
    resting = ndimage.binary_erosion(long, np.ones((2 * half + 1, 1)), border_value=1)
    moving = ~slow & ~np.asarray(ndimage.binary_dilation(long, np.ones((2 * half + 1, 1))), bool)
    return moving, resting, long


def withstood(
    rests: np.ndarray,
    resting: np.ndarray,
    torque: np.ndarray,
    q: np.ndarray,
    ways: np.ndarray,
    seen: float,
    edge: int,
    noise: float = 0.0,
) -> np.ndarray:
    """Return the last instant of each rest that ends within the log, its torque, and its way.

    The instant is a ``resting`` one, the way that in which the joint breaks away, one of ``ways``
    (T,) in which it moves (1 or -1, 0 where it does not); the result is (E, 3). The ``torque`` (T,)
    is unfiltered and lacks the model's.

    A rest ends when its torque exceeds what holds it. Filtered, the peak would be cut off; and
    until the position ``q`` (T,) is seen to move, by more than ``seen`` [m or rad], the torque
    rises further. Pushed by a rising torque, a joint moves with the cube of time and needs half as
    long again for 27/8 of the way, so that it broke away twice as long before it was seen as it
    takes from there. The largest of many noisy readings is too large: with ``noise`` [N or Nm]
    lines are fitted to as few readings as bring it below a hundredth of the torque's spread.

    The torque of a breakaway is known where it rises by little until the joint is seen to move.
    Elsewhere the largest torque of the rest counts, whichever way it points: a joint withstands as
    much either way. But if the joint often goes against the torque, the model's own torque is wrong
    by more than friction, and only breakaways whose torque is known count.
    """
    width = int(np.ceil((noise / max(QUIET * float(np.std(torque)), 1e-300)) ** 2)) | 1
    labelled: Any = ndimage.label(rests)
    found = []
    for part in ndimage.find_objects(labelled[0]):
        still = part[0].start + np.flatnonzero(resting[part])
        within = part[0].start > edge and part[0].stop < len(rests) - edge
        if not (within and len(still) and ways[part[0].stop]):
            continue
        away = np.abs(q[still[-1] :] - np.median(q[still[-50:]]))
        last = part[0].stop - still[-1]
        far = next(iter(np.flatnonzero(away > 27.0 / 8.0 * seen)), last)
        near = np.count_nonzero(away[:far] <= seen)  # noise crosses it before and after
        end = len(still) - 1 + np.clip(3 * near - 2 * far, 1, last)
        way = float(ways[part[0].stop])
        held = way * torque[still[0] : still[-1] + max(near, 1) + 1]
        window = min(width, (len(held) - 1) | 1)
        held = np.asarray(signal.savgol_filter(held, window, 1)) if window > 1 else held
        rise = held.max() - held[:end].max()
        found.append((still[-1], way, held[:end].max(), np.abs(held[:end]).max(), rise))
    at, way, there, most, rise = np.array(found, float).reshape(-1, 5).T
    known = rise < SHARP * np.std(torque)
    against = np.sum(known & (there < 0.0)) > AGAINST * len(at)
    counted = known if against else slice(None)
    return np.stack([at, way * np.where(known, there, most), way], axis=1)[counted]
