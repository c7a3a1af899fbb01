"""Checks of the motion of a whole log before anything is concluded from it, and notes about it."""

from collections.abc import Callable

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.rests import STILL
from jaxidl.logs.table import listed

LEAST_SAMPLES, LEAST_DURATION = 200, 1.0  # of a log [-], [s]
CLIPPED = 20  # consecutive samples at exactly the same extreme


def long_enough(time: np.ndarray, dt: float) -> None:
    """Raise LogError for a log of too few samples ``time`` (T,), ``dt`` [s] apart."""
    if len(time) < LEAST_SAMPLES or round(len(time) * dt, 6) < LEAST_DURATION:
        got = f"{len(time)} samples over {len(time) * dt:.3g} s"
        remedy = "record longer, and give time in seconds"
        raise LogError(
            f"at least {LEAST_SAMPLES} samples and {LEAST_DURATION:g} s of motion", got, remedy
        )


def motion(
    q: np.ndarray,
    tau: np.ndarray,
    time: np.ndarray,
    segments: list[slice],
    called: Callable[[str], str] = str,
) -> list[str]:
    """Return notes on what is odd about a whole log.

    These are channels that stay constant, stay at a limit, or jump.

    Args:
        q: (T, J) [m or rad]; tau: (T, J) [N or N m]; time: (T,) [s].
        segments: the rows of each run.
        called: gives a column's name as the log's own one.

    Raises:
        LogError: if nothing moved or no torque acted.
    """
    q_of, tau_of = (lambda j: called(f"q{j}")), (lambda j: called(f"tau{j}"))
    still = [j for j, s in enumerate(q.T) if all(np.ptp(s[run]) <= STILL for run in segments)]
    if len(still) == q.shape[1]:
        remedy = "record a motion, or check that the q columns are the measured positions"
        raise LogError(
            "a joint that moves",
            f"nothing moved: {listed([*map(q_of, still)])} constant",
            remedy,
        )
    idle = [j for j, s in enumerate(tau.T) if not s.any()]
    if len(idle) == tau.shape[1]:
        remedy = "check that the tau columns are the measured or commanded torques"
        raise LogError(
            "a torque",
            f"no torque acted: {listed([*map(tau_of, idle)])} zero throughout",
            remedy,
        )
    notes = [f"{q_of(j)} is constant: nothing can be found out about that joint" for j in still]
    free = [tau_of(j) for j in idle if j not in still]  # a brake may hold the others
    notes += [f"{name} is zero throughout: treated as a joint without a drive" for name in free]
    notes += [
        f"{tau_of(j)} is constant at {s[0]:g}"
        for j, s in enumerate(tau.T)
        if s[0] and not np.ptp(s)
    ]
    for j, s in enumerate(tau.T):
        for limit in (s.max(), s.min()):
            at = s == limit
            if limit and np.ptp(s) and at.mean() >= 0.01 and _longest(at) >= CLIPPED:
                notes.append(
                    f"{tau_of(j)} sits at its limit {limit:g} for {at.mean():.0%} of the time"
                )
    for j, s in enumerate(q.T):
        jumps = [run.start + i for run in segments for i in _jumps(s[run])]
        if jumps:
            often = f", and {len(jumps) - 1} more" if len(jumps) > 1 else ""
            notes.append(
                f"{q_of(j)} jumps at {time[jumps[0]]:.6g} s{often}: possibly a sensor glitch"
            )
    return notes


def _longest(flags: np.ndarray) -> int:
    """Return the length of the longest sequence of True in flags (T,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _jumps(q: np.ndarray) -> list[int]:
    """Return the samples of one run (n,) at which the position jumps.

    There its second difference is far above nearly all others.
    """
    bend = np.abs(np.diff(q, 2))
    # or one count of the encoder
    usual = max(float(np.quantile(bend, 0.98)), float(bend[bend > STILL].min(initial=np.inf)))
    far = np.flatnonzero(bend > 50 * usual) + 1
    return far[np.diff(far, prepend=-9) > 3].tolist()  # one jump bends up to three samples
