"""Whether logged speeds and positions are in units of one kind."""

import numpy as np

from jaxidl.errors import LogError

SPAN = 0.1  # [s]


def check_speeds(q: np.ndarray, qd: np.ndarray, dt: float, segments: list[slice]) -> None:
    """Raise LogError where logged speeds are clearly another multiple of the positions' change.

    They are compared over ``SPAN`` seconds, where noise hardly counts.

    Args:
        q: (T, J) [m or rad]; qd: (T, J) [m/s or rad/s]; dt: the sampling interval [s].
        segments: the rows of each run.
    """
    step = max(1, round(SPAN / dt))
    parts = [(q[run], qd[run]) for run in segments if run.stop - run.start > step]
    if not parts:
        return
    moved = np.concatenate([x[step:] - x[:-step] for x, _ in parts])
    sums = [np.cumsum(0.5 * dt * (v[1:] + v[:-1]), 0) for _, v in parts]
    logged = np.concatenate(
        [np.concatenate([s[step - 1 : step], s[step:] - s[:-step]]) for s in sums]
    )
    both, size = np.sum(moved * logged, 0), np.sqrt(np.sum(moved**2, 0) * np.sum(logged**2, 0))
    for j in np.flatnonzero(np.abs(both) > 0.9 * size):
        ratio = float(both[j] / np.sum(logged[:, j] ** 2))
        if size[j] > 0.0 and not 0.5 < ratio < 2.0:
            degrees = {
                180.0 / np.pi: f"q{j} in radians",
                np.pi / 180.0: f"qd{j} in radians per second",
            }
            near = [text for x, text in degrees.items() if abs(ratio / x - 1.0) < 0.1]
            raise LogError(
                f"speeds qd{j} at which the positions q{j} change",
                f"positions that change {ratio:.4g} times as fast",
                f"give {near[0]}" if near else f"correct their units or signs, or leave qd{j} out",
            )
