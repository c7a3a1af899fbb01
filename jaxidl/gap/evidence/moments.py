"""Moments in which something acted that is no property of the robot: a collision, a push.

All common effects and what was found are fitted to the nine tenths of the moments that they
explain best (least trimmed squares, Rousseeuw 1984), so that a collision cannot hide behind the
friction that it seems to show. A moment of motion stands out if what remains has there, on some
joint, ``ENERGY`` times the mean square that it has in all but a tenth of the log, and is no small
part of the command. What happens so rarely says nothing about an effect, and would decide about all
of them: such moments are left out, and the search begins again. What is there in more than a tenth
of the log is left in.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from jaxidl.gap.evidence.gram import Item, columns_at
from jaxidl.gap.evidence.rows import Rows

LENGTH = 0.25  # of a moment [s]
ENERGY = 50.0
LARGE = 0.3  # of the command's spread
SELDOM = 0.1  # share of the log
STEPS = 10  # of concentration, at most
RIDGE = 1e-6


def strange(rows: Rows, items: Sequence[Item], noise: np.ndarray, alike: float) -> np.ndarray:
    """Return which of N rows lie in a moment that stands out, those that were left out included.

    The ``items`` are all common effects and what was found. What the common ones leave has a root
    mean square ``noise`` (J,) [N or Nm]; ``alike`` neighbouring rows count as one.
    """
    square = trimmed(rows, items, noise, alike)
    usual = ENERGY * np.quantile(square, 1.0 - SELDOM, axis=0)
    out = rows.strange | (square > np.maximum(usual, (LARGE * rows.spread) ** 2)).any(1)
    return out if out.mean() < SELDOM else rows.strange


def trimmed(rows: Rows, items: Sequence[Item], noise: np.ndarray, alike: float) -> np.ndarray:
    """Return the mean square (N, J) [N^2 or (Nm)^2] around each row of what ``items`` leave.

    They are fitted to the moments of each joint that they explain best, anew until these stay the
    same. Elsewhere what is left is divided by its variance as the fit predicts it, in units of the
    noise: what no fitted moment resembles is no surprise.
    """
    long = max(1, round(LENGTH / rows.step))
    mean = lambda x: uniform_filter1d(x, long, axis=0, mode="constant")
    counted = rows.used & rows.signals.moving[rows.signals.rows]
    share = mean(counted.astype(float))
    sizes = [len(i.lower) for i in items]
    each, size, noise = [], np.zeros(sum(sizes)), np.maximum(noise, 1e-300)
    for j, use in enumerate(counted.T):
        at = np.flatnonzero(np.repeat([j in i.joints for i in items], sizes))
        each.append((at, columns_at(items, j, len(use)) / noise[j]))
        size[at] += np.sum(each[-1][1] ** 2 * use, 1)
    size = np.sqrt(np.where(size > 0.0, size, 1.0) / len(rows.gap))
    prior = np.concatenate([np.zeros(0), *(i.precision for i in items)]) / size**2
    each = [(at, x / size[at, None]) for at, x in each]
    wanted, kept = rows.gap / noise, counted
    square, around = np.zeros_like(rows.gap), np.zeros_like(rows.gap)
    for _ in range(STEPS):
        gram, right = np.diag(prior + RIDGE * len(wanted)), np.zeros(len(size))
        for (at, x), use, y in zip(each, kept.T, wanted.T, strict=True):
            gram[np.ix_(at, at)] += x[:, use] @ x[:, use].T
            right[at] += x[:, use] @ y[use]
        inverse = np.linalg.inv(gram)
        for j, (at, x) in enumerate(each):
            square[:, j] = (wanted[:, j] - x.T @ (inverse @ right)[at]) ** 2
            far = x[:, ~kept[:, j]]
            leverage = np.sum(far * (inverse[np.ix_(at, at)] @ far), 0)
            square[~kept[:, j], j] /= 1.0 + alike * leverage
        around = mean(square * counted) / np.maximum(share, 0.5) * (share > 0.5)
        often = [
            np.quantile(a[u], 1.0 - SELDOM) if u.any() else 0.0
            for a, u in zip(around.T, counted.T, strict=True)
        ]
        before, kept = kept, counted & (around <= often)
        if np.array_equal(kept, before):
            break
    return around * noise**2


def moments(rows: Rows, left: np.ndarray, names: Sequence[str], units: Sequence[str]) -> list[str]:
    """Return a sentence about moments left out, if any; ``left`` (N, J) [N or Nm] remains."""
    if not rows.strange.any():
        return []
    found = list[str]()
    edges = np.flatnonzero(np.diff(rows.strange, prepend=False, append=False))
    inner = edges[1:-1].reshape(-1, 2)
    apart = inner[
        np.diff(inner)[:, 0] > LENGTH / rows.step
    ]  # what follows closely is the same moment
    for a, b in np.concatenate([edges[:1], apart.ravel(), edges[-1:]]).reshape(-1, 2).tolist():
        peak = np.abs(left[a:b]).max(0)
        j = int(np.argmax(peak / np.maximum(rows.floor, 1e-300)))
        at, run = rows.when([a, b - 1])
        found.append(f"at {at:.1f} s{run} ({names[j]}, up to {peak[j]:.2g} {units[j]})")
    return [
        f"{', '.join(found)} the torque has an error that no effect explains, as in a collision,"
        " a push or at an end stop: these moments are left out"
    ]
