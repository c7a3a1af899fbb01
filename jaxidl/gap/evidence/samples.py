"""For how many independent samples those of a log count, as neighbours are correlated."""

import numpy as np
from scipy.ndimage import uniform_filter1d

SMOOTH = 9  # neighbouring frequencies over which a residual's spectrum is averaged
TINY = 1e-6  # share of a column's energy below which it is a constant


def correlation_time(x: np.ndarray) -> float:
    """Return by which factor samples ``x`` (N,) count for less due to autocorrelation.

    It is in [samples], at least 1.
    """
    f = np.fft.rfft(x - x.mean(), 2 * len(x))
    a = np.fft.irfft(np.abs(f) ** 2)[: len(x)]
    if a[0] <= 0.0:
        return 1.0
    end = int(np.argmax(a < 0.05 * a[0])) or len(x)
    return float(max(1 + 2 * (a[1:end] / a[0]).sum(), 1.0))


def correlation_beside(left: np.ndarray, columns: np.ndarray, repeated: float = 1.0) -> float:
    """Return by which factor samples of a residual (N,) count for less beside columns (P, N).

    It is 1 + 2 sum ρ(k) ρ'(k), where ρ and ρ' are the autocorrelations of the residual and of the
    column for which it is largest (Bartlett 1946), at least 1. In other words it is the residual's
    spectrum where the column has its own, over its mean. The spectrum is smoothed, since at these
    frequencies the fit has removed what it could. If the motion is there ``repeated`` times, the
    spectrum consists of lines, and the smoothing covers as many of them.
    """
    power = lambda x: np.abs(np.fft.rfft(x - x.mean(-1, keepdims=True))) ** 2
    weight = power(columns)
    weight = weight[weight.sum(1) > TINY * (columns**2).sum(1) * columns.shape[1]]
    own = uniform_filter1d(power(left), round(SMOOTH * repeated))
    if not len(weight) or own.mean() <= 0.0:
        return 1.0
    return float(max(np.max(weight @ own / weight.sum(1)) / own.mean(), 1.0))
