"""The samples of a log in which positions are fresh.

A recorder may repeat each position until the next one comes, or put straight lines between those
that came. Then the first or second differences of the positions are large at every P-th sample
alone, where P need not be whole: they are in step with one frequency. Only the positions at these
instants were measured, and only they are kept. Torques that were recorded more often are averaged.
"""

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.ndimage import convolve1d
from scipy.optimize import minimize_scalar

from jaxidl.logs.mending import Samples
from jaxidl.logs.sampling import LEAST_RATE

LONGEST = 50.0  # samples from one fresh position to the next
IN_STEP = 0.6  # least share of the differences; of noise it is about 0.01
OFTEN = 0.1  # least share of the instants at which there has to be a difference, and
FEW = 20  # least number of them
SAME = 0.01  # relative difference of periods that are the same
CAPPED = 10.0  # a larger multiple of their mean counts as this one
WAYS = {1: "repeated", 2: "interpolated by straight lines"}  # by the order of the differences


def fresh(found: Samples, notes: list[str]) -> Samples:
    """Return a file's samples at the instants at which positions are fresh, with a note."""
    edges = [0, *(np.flatnonzero(np.diff(found.run)) + 1).tolist(), len(found.run)]
    runs = [slice(a, b) for a, b in pairwise(edges)]
    step = float(np.median(np.abs(np.diff(found.time)))) if len(found.time) > 1 else 0.0
    longest = min(LONGEST, 1.001 / max(LEAST_RATE * step, 1e-9))
    for order, what in WAYS.items():
        period = _period(found.signals["q"], runs, order, longest)
        if period is None:
            continue
        notes.append(
            f"positions of {found.table.name} are {what} between samples {period * step:.3g} s"
            " apart: only these samples are used"
        )
        given = dict(found.signals)
        periods = [_period(given["tau"], runs, n, longest) for n in WAYS]
        often = not any(other and abs(other / period - 1.0) < SAME for other in periods)
        if often:
            given["tau"] = np.concatenate([_averaged(given["tau"][r], period) for r in runs])
        parts = [_taken(given, found.time, r, period, order, often) for r in runs]
        rows, time, signals = zip(*parts, strict=True)
        late = np.ones(len(found.time), bool)
        late[np.concatenate(rows)] = False
        joined = {kind: np.concatenate([s[kind] for s in signals]) for kind in given}
        return found.without(late)._replace(time=np.concatenate(time), signals=joined)
    return found


def _taken(
    given: dict[str, np.ndarray],
    time: np.ndarray,
    run: slice,
    period: float,
    order: int,
    often: bool,
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return rows, time and signals of a run where positions are fresh.

    Torques were recorded more ``often``, or are fresh there, too.
    """
    length = run.stop - run.start
    large = _differences(given["q"][run], order)
    angle = np.angle(_wave(large, 1.0 / period))
    # between the first two samples a difference is that of the second, or bends there
    first = 1.0 - angle / (2.0 * np.pi) * period
    # a position that is repeated comes up to a sample later than it was measured
    late = 0.5 if order == 1 and period % 1.0 else 0.0
    at = first + period * np.arange(-2.0, length / period + 2.0)
    rows = np.ceil(at + late - 0.05).astype(int)
    inside = (rows >= 2) & (rows < length)
    at, rows = at[inside] - late, rows[inside]
    between = lambda x: np.stack([np.interp(at, np.arange(length), e) for e in x[run].T], axis=1)
    out = {
        kind: between(x) if order == 2 or (often and kind == "tau") else x[run][rows]
        for kind, x in given.items()
    }
    if order == 2:
        before = given["q"][run][rows - 1]  # the line that ends at this instant
        slope = before - given["q"][run][rows - 2]
        out["q"] = before + slope * (at - rows + 1)[:, None]
    return run.start + rows, np.interp(at, np.arange(length), time[run]), out


def _period(x: np.ndarray, runs: list[slice], order: int, longest: float) -> float | None:
    """Return after how many samples of ``x`` (T, J) a difference is large; None if any may be.

    It is found in the longest run.
    """
    large = _differences(x[max(runs, key=lambda run: run.stop - run.start)], order)
    total, length = large.sum(), len(large)
    if total == 0.0 or length < FEW * longest:
        return None
    share = np.abs(np.fft.rfft(large, 2 * length)) / total
    frequency = np.arange(len(share)) / (2 * length)
    high = np.flatnonzero((share > 0.8 * IN_STEP) & (frequency > 0.99 / longest))
    if not high.size:
        return None
    near = frequency[high[0]]
    bounds = near - 1.0 / length, min(near + 1.0 / length, 0.5)
    best: Any = minimize_scalar(
        lambda f: -abs(_wave(large, f)), bounds=bounds, options={"xatol": 1e-4 / length}
    )
    count, period = total**2 / np.sum(large**2), 1.0 / float(best.x)
    if abs(period - round(period)) * length < period:
        period = float(round(period))
    enough = count > max(FEW, OFTEN * length / period)
    return period if enough and -best.fun > IN_STEP * total else None


def _differences(x: np.ndarray, order: int) -> np.ndarray:
    """Return the sizes (T - order,) of differences of ``x`` (T, J), of all joints together."""
    each = np.abs(np.diff(x, order, axis=0))
    mean = each.sum(axis=0) / max(len(each), 1)
    return np.minimum(each[:, mean > 0.0] / mean[mean > 0.0], CAPPED).sum(axis=1)


def _wave(x: np.ndarray, frequency: float) -> complex:
    """Return the Fourier transform of ``x`` (T,) at a frequency [1/sample]."""
    return complex(x @ np.exp(-2j * np.pi * frequency * np.arange(len(x))))


def _averaged(x: np.ndarray, period: float) -> np.ndarray:
    """Return each sample of a run (T, J) averaged over a period around it."""
    half = int(period / 2.0)
    weights = np.ones(2 * half + 1)
    weights[[0, -1]] = (period - 2 * half + 1) / 2.0
    return convolve1d(x, weights / period, axis=0, mode="nearest")
