"""Means over seeds with their intervals: one statistic for every study."""

from dataclasses import dataclass

import numpy as np
from scipy import stats

LEVEL = 0.95  # of the intervals


@dataclass(frozen=True)
class Mean:
    """A geometric mean over seeds."""

    value: float
    # 95 %, Student's, of the logarithm; None with fewer than two seeds
    interval: tuple[float, float] | None
    seeds: int  # that it is made of

    def __str__(self) -> str:
        low, high = self.interval or (None, None)
        return f"{self.value:.2g}" + ("" if low is None else f" [{low:.2g}, {high:.2g}]")


def geometric(values: np.ndarray) -> Mean | None:
    """Return the geometric mean of positive ``values`` (seeds,), NaN left out; None if there are
    none.
    """
    # a share of none, or a ratio to it
    logs = np.log(np.clip(values[~np.isnan(values)], 1e-12, 1e12))
    if len(logs) == 0:
        return None
    interval = None
    if len(logs) > 1:
        half = (
            stats.t.ppf((1.0 + LEVEL) / 2.0, len(logs) - 1) * logs.std(ddof=1) / np.sqrt(len(logs))
        )
        interval = (float(np.exp(logs.mean() - half)), float(np.exp(logs.mean() + half)))
    return Mean(float(np.exp(logs.mean())), interval, len(logs))
