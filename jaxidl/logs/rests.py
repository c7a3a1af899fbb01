"""Rests of a joint, and the torque that it withstands in them."""

from typing import Any

import numpy as np
from scipy import ndimage, signal

AGAINST = 0.1  # share of rests after which a joint goes against the torque
SHARP = 0.3  # share of the torque's spread by which it may rise while a breakaway is seen
STEP = 27.0 / 8.0  # ratio of the distances from a rest at which times are compared
QUIET = 0.01  # share of the torque's spread in rests below which its noise does no harm

STILL = 1e-9  # [m or rad]; a smaller range is no motion


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

    The instant is a ``resting`` one, the way that in which the joint breaks away or would, one of
    ``ways`` (T,) in which it moves (1 or -1, 0 where it does not). A fourth column of the result
    (E, 4) is 1 where the joint went the other way. The ``torque`` (T,) is unfiltered and lacks what
    the model needs without an acceleration of the joint.

    In a rest the position ``q`` (T,) stays within ``seen`` [m or rad] most of the time: a joint
    that creeps is not at rest. A rest ends when its torque exceeds what holds it, but until that is
    seen the torque changes further. A joint that breaks away moves with a power of time: the cube
    if the torque rises against the same friction, the square if friction falls at once. The times
    at which it has gone one, 27/8 and (27/8)² times ``seen`` tell the power, and when it began. The
    largest of many noisy readings is too large: with ``noise`` [N or Nm] lines are fitted to as few
    readings as bring it below a hundredth of the torque's spread in rests.

    The torque of a breakaway is known where it rises by little until the joint is seen to move.
    Elsewhere the largest torque of the rest counts, whichever way it points: a joint withstands as
    much either way. Where it is seen to move at less, that torque counts the way it points:
    friction differs, or the model's own torque is wrong. If the joint often goes against the
    torque, only breakaways whose torque is known count.
    """
    spread = max(float(np.std(torque[resting])), 1e-300) if resting.any() else 1.0
    width = int(np.ceil((noise / (QUIET * spread)) ** 2)) | 1
    labelled: Any = ndimage.label(rests)
    found = []
    for part in ndimage.find_objects(labelled[0]):
        still = part[0].start + np.flatnonzero(resting[part])
        within = part[0].start > edge and part[0].stop < len(rests) - edge
        if not (within and len(still) and ways[part[0].stop]):
            continue
        start, stop = part[0].start, min(part[0].stop + len(still), len(q))
        away = np.abs(q[start:stop] - np.median(q[still]))
        there = np.flatnonzero(away[: still[-1] + 1 - start] <= seen)
        if 2 * len(there) < len(still):
            continue
        tail = away[there[-1] :]
        last, far, farther = (
            there[-1] + gone(tail, seen * times) for times in (1.0, STEP, STEP**2)
        )
        growth = np.clip((farther - far) / max(far - last, 1), STEP ** (1 / 3), STEP ** (1 / 2))
        broke = int(last - (far - last) / (growth - 1.0))
        broke = np.clip(broke, there[0] + 1, part[0].stop - start)
        way = float(ways[part[0].stop])
        held = without_noise(way * torque[start + there[0] : start + broke], width)
        later = without_noise(way * torque[start + broke - 1 : start + last + 1], width)
        rise = later.max(initial=held[-1]) - held.max()
        found.append((still[-1], way, held.max(), np.abs(held).max(), rise))
    at, way, final, most, rise = np.array(found, float).reshape(-1, 5).T
    known = rise < SHARP * np.std(torque)
    against = np.sum(known & (final < 0.0)) > AGAINST * len(at)
    other = ~known & (most > final + rise)
    way = np.where(other, -way, way)
    counted = known if against else slice(None)
    return np.stack([at, way * np.where(known, final, most), way, other], axis=1)[counted]


def gone(away: np.ndarray, distance: float) -> int:
    """Return after how many of the distances ``away`` (N,) one is reached.

    Noise crosses it before and after.
    """
    far = np.flatnonzero(away > STEP * distance)
    return int(np.count_nonzero(away[: far[0] if len(far) else None] <= distance))


def without_noise(x: np.ndarray, width: int) -> np.ndarray:
    """Return values (N,) of lines that are fitted to at most ``width`` of ``x`` (N,) each."""
    window = min(width, (len(x) - 1) | 1)
    return np.asarray(signal.savgol_filter(x, window, 1)) if window > 2 else x
