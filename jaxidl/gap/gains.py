"""How much smaller a held-out error has become, and whether that is more than chance and noise."""

from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from jaxidl.gap.data import Data
from jaxidl.gap.fit import Fit

SIGNIFICANT = 2.0  # standard errors by which an effect must win
SELDOM = 4.0  # times the least gain: what an effect must remove that acts in few blocks only,
FEWEST = 1.8  # and at as many moments at least (saturation in one fast stretch of a log, for one)
LOSS = 0.02  # of a joint's error: so much one joint may lose by what another one gains from
FEW = 2  # joints that are always fitted, and judged, together
NOISE_MARGIN = 1.2  # below this multiple of the noise floor errors are not told apart: a changed inertia changes the floor


class Gain(NamedTuple):
    """How much smaller a held-out error is: 1 − after/before, and its standard error."""

    value: float
    stderr: float
    few: bool = False  # is it made at several moments, if few, and hardly any lost at others?

    def clear(self, least: float) -> bool:
        """Two standard errors and the least gain; where an effect seldom acts, several times that gain and no loss elsewhere."""
        usual = self.value >= least and self.value > SIGNIFICANT * self.stderr
        return usual or (self.few and self.value >= SELDOM * least)


class Errors(NamedTuple):
    """Sums of squares (B, J) on blocks that took no part, and those of the noise floor; weighted alike.

    A total is that of the mean of the blocks' root mean squares: one block with a huge error, of a motor in saturation say, would
    otherwise drown what all others have to tell.
    """

    error: np.ndarray
    noise: np.ndarray
    counts: np.ndarray  # (B, J) rows
    moments: np.ndarray  # (E, J) the error's, on shorter stretches

    def of(self, columns: list[int]) -> "Errors":
        """Of some of the J joints only."""
        return Errors(*(x[:, columns] for x in self))

    def total(self) -> float:
        """The total over all blocks and joints."""
        error, noise = (np.sqrt(x * self.counts).sum(0) for x in self[:2])
        return float(_total(error, noise, self.counts.sum(0)))

    def square(self) -> float:
        """The plain sum of squares, not less than the noise's."""
        return float(np.maximum(self.error.sum(0), self.noise.sum(0)).sum())

    def without_each(self) -> np.ndarray:
        """Totals (B,) without one block each."""
        error, noise, counts = (x.sum(0) - x for x in (*(np.sqrt(x * self.counts) for x in self[:2]), self.counts))
        return _total(error, noise, counts)


def _total(error: np.ndarray, noise: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Totals (...) over joints of weighted block sums (..., J), none below the noise's."""
    return np.asarray(np.sum(np.maximum(error, noise) ** 2 / np.maximum(count, 1.0), axis=-1))


def errors_of(
    found: Fit, data: Data, weight: np.ndarray, joints: tuple[int, ...] | None = None, margin: float = NOISE_MARGIN
) -> Errors:
    """Errors of a fit of some joints, or all, with their weights (J,); none counts as less than ``margin`` noise floors."""
    pick = list(range(len(weight)) if joints is None else joints)
    square = weight[pick] ** 2
    return Errors(
        found.error * square, found.counts * (margin * data.floor[pick]) ** 2 * square, found.counts, found.moments * square
    )


def gain(before: Errors, after: Errors) -> Gain:
    """Gain of ``after`` over ``before`` on the same blocks; jackknife over blocks.

    No error counts as less than the noise's: an effect that filters what the encoder's noise makes explains nothing.
    """
    value = 1.0 - np.sqrt(after.total() / max(before.total(), 1e-300))
    parts = 1.0 - np.sqrt(after.without_each() / np.maximum(before.without_each(), 1e-300))
    stderr = float(jackknife(parts))
    plain = 1.0 - np.sqrt(after.square() / max(before.square(), 1e-300))
    if plain > 0.0 and _seldom(before.moments, after.moments):
        return Gain(float(max(value, plain)), stderr, True)
    return Gain(float(value), stderr)


def best_gain(before: Errors, after: Errors) -> tuple[Gain, Gain, list[int]]:
    """Gain on the joints that say most, gain on all, and which these are: of many the one that gains most, unless others lose.

    A load at the flange is hardly seen in a strong shoulder, but it may be most of what a wrist does not know. The best of many
    looks better than it is: its standard error is enlarged so that by chance it wins as seldom as one alone would.
    """
    overall, joints = gain(before, after), list(range(before.error.shape[1]))
    if len(joints) > FEW and overall.value > 0.0:
        each = [gain(before.of([k]), after.of([k])) for k in joints]
        k = max(joints, key=lambda k: each[k].value)
        lost = any(-g.value > max(LOSS, SIGNIFICANT * g.stderr) for g in each)
        if each[k].value > overall.value and not lost:
            wider = norm.isf(norm.sf(SIGNIFICANT) / len(joints)) / SIGNIFICANT
            return each[k]._replace(stderr=float(wider * each[k].stderr)), overall, [k]
    return overall, overall, joints


def jackknife(samples: np.ndarray) -> np.ndarray:
    """Standard error (...) from what comes out without one block each, ``samples`` (B, ...)."""
    b = len(samples)
    return np.asarray(np.sqrt((b - 1) / b * np.sum((samples - samples.mean(0)) ** 2, axis=0)))


def _seldom(before: np.ndarray, after: np.ndarray) -> bool:
    """Is the gain made at several moments, and hardly any lost at others?"""
    change = (before - after).sum(1)
    better, worse = np.maximum(change, 0.0), np.maximum(-change, 0.0).sum()
    moments = better.sum() ** 2 / max(np.sum(better**2), 1e-300)  # as many of equal gain would have this sum and these squares
    return bool(moments > FEWEST and worse < 0.1 * better.sum())
