"""The residual of all common effects.

It shows which shapes promise most beside them, and when the logged torque acts.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import linalg

from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.samples import correlation_time

SHAPES = 3  # shapes kept of each effect on a joint
ALIGNMENT = "alignment"
CONVENTION = (-1.5, 0.5)  # samples by which a logged torque may be late without being an effect
FAINT = 1e-4  # weight of a prior with the width of one sample
CLEAR = 2.0  # rise of the log likelihood


class Projection:
    """The part of a column that common effects cannot imitate, to rank shapes."""

    def __init__(self, rows: Rows, common: Sequence[Item], noise: np.ndarray):
        self.use, self.noise, self.bases = rows.used & rows.training[:, None], noise, []
        self.rows = rows
        for j in range(len(noise)):
            on = [self._of(i.columns[:, :, i.joints.index(j)], j) for i in common if j in i.joints]
            self.bases.append(basis(np.concatenate([np.zeros((0, self.use[:, j].sum())), *on]).T))

    def _of(self, x: np.ndarray, j: int) -> np.ndarray:
        """Return what is fitted of torques (..., N) of a joint."""
        return self.rows.steady(x, j)[..., self.use[:, j]]

    def left_of(self, rows: Rows) -> np.ndarray:
        """Return minus the log likelihood (J,) of the residual of all common effects."""
        total = np.zeros(len(self.bases))
        for j, left in enumerate(self.residuals(rows)):
            square = float(left @ left) / max(len(left), 1)
            if square > 0.0:
                total[j] = (
                    0.5
                    * len(left)
                    / correlation_time(left)
                    * np.log(max(square, rows.floor[j] ** 2))
                )
        return total

    def residuals(self, rows: Rows) -> list[np.ndarray]:
        """Return the residual of all common effects on the training rows of each joint."""
        gaps = [self._of(gap, j) for j, gap in enumerate(rows.gap.T)]
        return [y - basis @ (basis.T @ y) for y, basis in zip(gaps, self.bases, strict=True)]

    def best(self, items: Sequence[Item], left: np.ndarray, effective: np.ndarray) -> list[Item]:
        """Return the most promising shapes of each effect and joint."""
        groups: dict[Any, list[tuple[float, int, Item]]] = {}
        for number, i in enumerate(items):
            groups.setdefault(i.group, []).append((self._promise(i, left, effective), -number, i))
        return [
            i
            for group in groups.values()
            for _, _, i in sorted(group, key=lambda g: g[:2], reverse=True)[:SHAPES]
        ]

    def _promise(self, i: Item, left: np.ndarray, effective: np.ndarray) -> float:
        parts, wanted = [], []
        for k, j in enumerate(i.joints):
            x = self._of(i.columns[:, :, k], j).T / self.noise[j]
            parts.append(x - self.bases[j] @ (self.bases[j].T @ x))
            wanted.append(self._of(left[:, j], j) / self.noise[j])
        x, y = np.concatenate(parts), np.concatenate(wanted)
        gram = x.T @ x
        step = np.linalg.solve(
            gram + (1e-6 * np.trace(gram) / len(gram) + 1e-300) * np.eye(len(gram)), x.T @ y
        )
        if len(step) == 1:
            step = np.clip(step, i.lower, i.upper)
        gain = float(2 * step @ (x.T @ y) - step @ gram @ step)
        rate = float(np.clip(gain / max(y @ y, 1e-300), 0.0, 1.0 - 1e-9))
        return -0.5 * effective[list(i.joints)].sum() * np.log(1.0 - rate) - len(step) + i.odds


def basis(x: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (N, K) of columns (N, P)."""
    x = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    if not x.size:
        return x
    # LAPACK's faster driver does not always converge where columns are there twice
    u, s, _ = linalg.svd(x, full_matrices=False, lapack_driver="gesvd")
    return u[:, s > 1e-5 * s.max(initial=1e-300)]


def aligned(rows: Rows, common: Sequence[Item]) -> Rows:
    """Return the rows with the torque of each joint shifted in time for the best common fit.

    Whether a logged torque acts at its instant, over the interval that follows or over the one
    before is the logger's convention, and no effect. A torque that precedes its motion by more than
    that is a delay, and left for the search.
    """
    joints = rows.gap.shape[1]
    projected = Projection(rows, common, np.ones(joints))
    steps = np.linspace(*CONVENTION, 9) * rows.signals.interval
    values = np.stack([projected.left_of(rows.shifted(s)) for s in steps])  # (S, J)
    zero, best = int(np.argmin(np.abs(steps))), values.argmin(0)
    unclear = (values[zero] - values.min(0) < CLEAR) | (best == 0) | (best == len(steps) - 1)
    return rows.shifted(steps[np.where(unclear, zero, best)])


def alignments(rows: Rows, predicted: np.ndarray, alike: float = 1.0) -> list[Item]:
    """Return for each joint a further shift within that convention, which every set has.

    A weak prior keeps it unchanged if a delay would do as well. Neighbouring samples are
    correlated, ``alike`` of them count as one.
    """
    s, found = rows.signals, []
    slope = s.smooth(s.differentiate(predicted))[s.rows]
    already = np.broadcast_to(rows.shift, rows.gap.shape[1])
    for j in np.flatnonzero(np.any(slope != 0.0, 0)).tolist():
        lower, upper = (np.array([edge * s.interval - already[j]]) for edge in CONVENTION)
        precision = np.array([FAINT * alike / s.interval**2])
        column = slope[None, :, j : j + 1]
        found.append(
            Item((ALIGNMENT, j, ""), None, (j,), column, lower, upper, 0.0, precision, always=True)
        )
    return found
