"""For how many independent samples those of a log count.

Neighbours are correlated, and motions return: a cycle that a robot repeats, or executions of one
task. A repetition averages noise, but what the model lacks is the same again: it is no further
evidence. A motion returns after a lag if all joints then are again where they were, as fast as they
were, throughout. Pauses do not count, since people and machines make them as long as they like:
time here stands still while all joints rest. A residual's samples then count as independent as far
as they differ between one repetition and the next.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from jaxidl.logs.signals import Signals

SMOOTH = 9  # neighbouring frequencies over which a residual's spectrum is averaged
TINY = 1e-6  # share of a column's energy below which it is a constant
SAME = 0.02  # mean squared difference of positions and speeds, over twice their variance
ANOTHER = 0.5  # that difference from which a motion has gone elsewhere before it returns
LEAST = 0.1  # share of the log that has to be there again, and in which a joint that moves does
INSTANTS = 8192  # instants compared


def correlation_time(x: np.ndarray) -> float:
    """Return by which factor, at least 1, samples ``x`` (N,) count for less as they correlate."""
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


def samples_alike(count: np.ndarray, effective: np.ndarray) -> float:
    """Return how many of ``count`` (J,) samples count as one if ``effective`` (J,) are independent.

    It is the median over the joints that move.
    """
    moves = count > 0
    return (
        float(np.median(count[moves] / np.maximum(effective[moves], 1.0))) if moves.any() else 1.0
    )


def without_pauses(signals: Signals) -> np.ndarray:
    """Return the number (T,) of earlier instants at which not all joints rest."""
    goes = ~signals.resting.all(1)
    return np.cumsum(goes) - goes


def returns(signals: Signals) -> tuple[int, ...]:
    """Return after how many instants of a log, pauses aside, its motion is there again."""
    goes = np.flatnonzero(~signals.resting.all(1))
    step = max(1, len(goes) // INSTANTS)
    moving = signals.moving.mean(0) > LEAST
    state = np.concatenate([x[goes[::step]][:, moving] for x in (signals.q, signals.qd)], axis=1)
    count, lag = len(state), np.arange(len(state))
    z = (state - state.mean(0)) / np.maximum(state.std(0), 1e-300)
    product = np.fft.irfft(np.abs(np.fft.rfft(z, 2 * count, axis=0)) ** 2, axis=0)[:count]
    squares = np.concatenate([np.zeros((1, z.shape[1])), np.cumsum(z**2, axis=0)])
    both = squares[count - lag] + squares[count] - squares[lag] - 2.0 * product
    apart = (both / (2.0 * (count - lag))[:, None]).max(1, initial=0.0)
    away = next(iter(np.flatnonzero(apart > ANOTHER)), count)
    there = (apart < SAME) & (away < lag) & (lag < (1.0 - LEAST) * count)
    edges = np.flatnonzero(np.diff(there, prepend=False, append=False)).reshape(-1, 2)
    return tuple(step * (a + int(np.argmin(apart[a:b]))) for a, b in edges.tolist())


def copies(lags: Sequence[int], left: np.ndarray, rows: np.ndarray) -> tuple[float, float]:
    """Return how many samples of a residual ``left`` (N,) count as one.

    They are of instants ``rows`` (N,), pauses aside. Of M repetitions, each some of ``lags`` after
    another, with a correlation c between any two it is 1 + (M - 1) c. The second value is M.
    """
    found = repeated = 1.0
    for lag in lags:
        later = np.searchsorted(rows, rows + lag)
        both = later < len(rows)
        a, b = left[both], left[later[both]]
        alike = float(a @ b) / max(float(np.sqrt((a @ a) * (b @ b))), 1e-300)
        found += 2.0 * float(np.mean(both)) * max(alike, 0.0)
        repeated += 2.0 * float(np.mean(both))
    return found, repeated
