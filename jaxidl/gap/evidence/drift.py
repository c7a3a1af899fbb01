"""Slow drift of a joint's torque: a motor that warms up, a current sensor whose zero wanders.

Drift is no effect on the motion, and one log shows only a few independent samples of it. If it
stands beside everything else in a residual, evidence about friction would count as little as
evidence about an offset. So the slowest components of all torques of a joint are weighted down
until drift is no larger than what the residual has at somewhat higher frequencies: generalised
least squares (Aitken 1935) with that spectrum. An offset is a component, too, the slowest.
"""

import numpy as np
from scipy.fft import dct, idct

# components of half a wave, two half waves, ... over the log; blocks that are left out are shorter
SLOW = 4
BESIDE = 4 * SLOW  # the next components, up to this one, show what is no drift
LEAST = 4 * BESIDE  # samples for which that can be said
SHORTEST = 15.0  # period of the fastest drift [s]: motors warm up and sensors wander slowly


def slowest(seconds: float) -> int:
    """Return how many components are slow in a log of so many seconds; in a short one none is."""
    return min(SLOW, int(2.0 * seconds / SHORTEST))


def weights_of(left: np.ndarray, seconds: float) -> np.ndarray:
    """Return weights (K,) of slow components, at most 1, for a joint's residual ``left`` (N,).

    A component counts with the mean power of those that are slower, and itself.
    """
    most = slowest(seconds)
    if len(left) < LEAST or most < 2:
        return np.ones(SLOW + 1)
    power = np.asarray(dct(left, norm="ortho"))[: BESIDE + 1] ** 2
    slow = np.cumsum(power[1 : most + 1]) / np.arange(1, most + 1)
    # two at least, since one alone says little; the offset as the slowest of them
    slow = np.concatenate([[slow[1]] * 3, slow[2:]])
    usual = power[SLOW + 1 :].mean()
    weights = np.sqrt(usual / np.maximum(np.maximum(slow, usual), 1e-300))
    return np.append(weights, np.ones(SLOW - most))


def weighted(x: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return samples (..., N) with their slow components times ``weights`` (K,)."""
    if not x.size or np.all(weights == 1.0):
        return x
    waves = np.asarray(dct(x, norm="ortho"))
    waves[..., : len(weights)] *= weights[: x.shape[-1]]
    return np.asarray(idct(waves, norm="ortho"))


def slower(weights: np.ndarray, shorter: float) -> np.ndarray:
    """Return the weights in a time that is ``shorter`` by that factor, up to the same frequency."""
    if shorter <= 0.0:
        return weights[:1]
    most = int((len(weights) - 1) * min(shorter, 1.0))
    return weights[np.round(np.arange(most + 1) / shorter).astype(int)]
