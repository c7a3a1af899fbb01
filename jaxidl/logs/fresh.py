"""The samples of a log in which positions are fresh.

A recorder may repeat each position until the next one comes, or put straight lines between those
that came. Then the first or second differences of all positions are large in every K-th sample
alone. Only these samples were measured, and only they are kept. Torques that were recorded more
often are averaged around them.
"""

from itertools import pairwise

import numpy as np
from scipy.ndimage import convolve1d

from jaxidl.logs.mending import Samples
from jaxidl.logs.sampling import LEAST_RATE

LONGEST = 50  # samples from one fresh position to the next
SURE = 0.95  # share of the largest differences that are in every K-th sample
SMALLER = 0.1  # differences elsewhere over those
LOOKED_AT = 20  # differences, at least
WAYS = {1: "repeated", 2: "interpolated by straight lines"}  # by the order of the differences


def fresh(found: Samples, notes: list[str]) -> Samples:
    """Return a file's samples in which positions are fresh; a note says what was left out."""
    edges = [0, *(np.flatnonzero(np.diff(found.run)) + 1).tolist(), len(found.run)]
    runs = [slice(a, b) for a, b in pairwise(edges)]
    step = float(np.median(np.abs(np.diff(found.time)))) if len(found.time) > 1 else 0.0
    most = LONGEST if step == 0.0 else min(LONGEST, int(1.0 / LEAST_RATE / step * 1.001))
    for order, what in WAYS.items():
        every, first = _every(found.signals["q"], runs, order, most)
        if every == 1:
            continue
        late = np.ones(len(found.time), bool)
        for run, at in zip(runs, first, strict=True):
            late[run.start + at : run.stop : every] = False
        notes.append(
            f"positions of {found.table.name} are {what} between samples {every * step:.3g} s"
            " apart: only these samples are used"
        )
        tau = found.signals["tau"]
        if all(_every(tau, runs, n, most)[0] % every for n in WAYS):
            tau = np.concatenate([_averaged(tau[run], every) for run in runs])
        return found._replace(signals={**found.signals, "tau": tau}).without(late)
    return found


def _every(x: np.ndarray, runs: list[slice], order: int, most: int) -> tuple[int, list[int]]:
    """Return after how many samples of ``x`` (T, J) there is a fresh one, 1 if each is.

    Also return the first fresh one of each run.
    """
    sizes = [np.abs(np.diff(x[run], order, axis=0)) for run in runs]
    each = np.concatenate(sizes)[:, np.ptp(x, axis=0) > 0.0]
    run = np.repeat(np.arange(len(runs)), [len(s) for s in sizes])
    # with which sample of its run a difference ends or, if of second order, in which it bends
    at = np.concatenate([np.arange(len(s)) + 1 for s in sizes])
    count = max(LOOKED_AT, len(each) // (2 * LONGEST))
    if count > len(each) or not each.size:
        return 1, [0] * len(runs)
    largest = np.argpartition(-each, count - 1, axis=0)[:count]  # (count, J)
    for every in range(most, 1, -1):
        votes = np.zeros((len(runs), every), int)
        np.add.at(votes, (run[largest], at[largest] % every), 1)
        first = votes.argmax(1)
        there = at[largest] % every == first[run[largest]]
        if np.all(there.mean(axis=0) > SURE):
            fresh = at % every == first[run]
            if np.all(each[~fresh].mean(0) < SMALLER * each[fresh].mean(0)):
                return every, first.tolist()
    return 1, [0] * len(runs)


def _averaged(x: np.ndarray, every: int) -> np.ndarray:
    """Return each sample of a run (T, J) averaged over ``every`` samples around it."""
    weights = np.ones(every // 2 * 2 + 1)
    if every % 2 == 0:
        weights[[0, -1]] = 0.5
    return convolve1d(x, weights / weights.sum(), axis=0, mode="nearest")
