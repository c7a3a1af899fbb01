"""How well sets of effects predict what was held out, and standard errors by the jackknife."""

import numpy as np

from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score, Solution


def worse_aside(score: Score, before: Solution, after: Solution, joints: list[int]) -> bool:
    """Return whether held-out blocks are predicted worse than before.

    The increase has to exceed the scatter between them, and what noise would explain.
    """
    count = np.maximum(score.count[~score.training], 1.0)
    a, b = (np.maximum(score.aside(s), score.floor * count)[:, joints] for s in (after, before))
    rise = (a - b).sum(1)
    return bool(len(rise) > 1 and rise.sum() > np.std(rise, ddof=1) * np.sqrt(len(rise)))


def worse_by(rows: Rows, before: Solution, after: Solution, joint: int) -> tuple[float, float]:
    """Return the share of a joint's root mean square held-out error that goes, and its error."""
    a, b = (squares(rows, s, joint) / s.passed[joint] for s in (after, before))
    share = lambda x, y: 1.0 - np.sqrt(x / np.maximum(y, 1e-300))
    return float(share(a.sum(), b.sum())), float(jackknife(share(a.sum() - a, b.sum() - b)))


def squares(rows: Rows, found: Solution, joint: int) -> np.ndarray:
    """Return sums of squares (A,) of a joint's residual on the held-out blocks, drift and all."""
    left = residual(rows, found)[:, joint] ** 2 * rows.used[:, joint]
    return np.array([left[rows.block == b].sum() for b in np.unique(rows.block[rows.block < 0])])


def aside(rows: Rows, found: Solution, joint: int) -> float:
    """Return a joint's root mean square held-out error [N or Nm] over what motors let through."""
    count = max(int(rows.used[~rows.training, joint].sum()), 1)
    return float(np.sqrt(squares(rows, found, joint).sum() / count / found.passed[joint]))


def gain(score: Score, before: Solution, after: Solution) -> np.ndarray:
    """Return the share (J,) by which the root mean square error on left-out blocks falls."""
    count = np.maximum(score.count[score.training].sum(0), 1.0)
    a, b = (
        np.sqrt(np.maximum(s.error.sum(0) / count / s.passed, score.floor)) for s in (after, before)
    )
    return 1.0 - a / b


def jackknife(samples: np.ndarray) -> np.ndarray:
    """Return the standard error (...) of ``samples`` (B, ...), each without one block."""
    b = len(samples)
    return np.asarray(np.sqrt((b - 1) / b * np.sum((samples - samples.mean(0)) ** 2, axis=0)))


def covariance_of(folds: np.ndarray) -> np.ndarray:
    """Return the jackknife's covariance (P, P) of coefficients ``folds`` (B, P)."""
    apart = folds - folds.mean(0)
    return (len(folds) - 1) / len(folds) * apart.T @ apart


def wald(x: np.ndarray, covariance: np.ndarray) -> float:
    """Return the root mean square of coefficients (P,) in standard errors, jointly."""
    return float(np.sqrt(max(x @ np.linalg.pinv(covariance, hermitian=True) @ x, 0.0) / len(x)))
