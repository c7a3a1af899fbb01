"""The residual of all common effects.

It shows which shapes promise most beside them, and when the logged torque acts.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy import linalg

from jaxidl.gap.evidence.gram import Item, columns_at
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.samples import correlation_time

SHAPES = 3  # shapes kept of each effect on a joint
ALIGNMENT = "alignment"
CONVENTION = (-1.5, 0.5)  # samples by which a logged torque may be late without being an effect
FAINT = 1e-4  # weight of a prior with the width of one sample
CLEAR = 2.0  # rise of the log likelihood


class Projection:
    """The part of torques on the training rows of some joints that ``items`` cannot imitate."""

    def __init__(
        self,
        rows: Rows,
        items: Sequence[Item],
        noise: np.ndarray | None = None,
        joints: Iterable[int] | None = None,
    ):
        """Find what ``items`` can imitate on some of J joints, by default all.

        Torques are in units of ``noise`` (J,) [N or Nm], by default 1.
        """
        size = rows.gap.shape[1]
        self.rows, self.use = rows, rows.used & rows.training[:, None]
        self.noise = np.ones(size) if noise is None else noise
        self.bases = {
            j: basis(self.seen(columns_at(items, j, len(rows.gap)), j).T)
            for j in (range(size) if joints is None else joints)
        }

    def seen(self, x: np.ndarray, j: int) -> np.ndarray:
        """Return what is fitted of torques (..., N) of a joint."""
        return self.rows.steady(x, j)[..., self.use[:, j]] / self.noise[j]

    def left(self, x: np.ndarray, j: int) -> np.ndarray:
        """Return what the items cannot imitate of torques (..., N) of a joint."""
        seen = self.seen(x, j)
        return seen - (seen @ self.bases[j]) @ self.bases[j].T

    def residuals(self, rows: Rows) -> list[np.ndarray]:
        """Return what is left of the residual of other ``rows`` of the log, on each joint."""
        return [self.left(gap, j) for j, gap in enumerate(rows.gap.T)]

    def best(self, items: Sequence[Item], left: np.ndarray, effective: np.ndarray) -> list[Item]:
        """Return the most promising shapes of each effect and joint.

        The residual of what is projected out is ``left`` (N, J), with an ``effective`` number (J,)
        of samples.
        """
        groups: dict[Any, list[tuple[float, int, Item]]] = {}
        for number, i in enumerate(items):
            groups.setdefault(i.group, []).append((self._promise(i, left, effective), -number, i))
        return [
            i
            for group in groups.values()
            for _, _, i in sorted(group, key=lambda g: g[:2], reverse=True)[:SHAPES]
        ]

    def _promise(self, i: Item, left: np.ndarray, effective: np.ndarray) -> float:
        parts = [self.left(i.columns[:, :, k], j) for k, j in enumerate(i.joints)]
        x, y = (
            np.concatenate(parts, 1),
            np.concatenate([self.seen(left[:, j], j) for j in i.joints]),
        )
        gram = x @ x.T
        ridge = (1e-6 * np.trace(gram) / len(gram) + 1e-300) * np.eye(len(gram))
        step = np.linalg.solve(gram + ridge, x @ y)
        if len(step) == 1:
            step = np.clip(step, i.lower, i.upper)
        gain = float(2 * step @ (x @ y) - step @ gram @ step)
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
    projected = Projection(rows, common)
    steps = np.linspace(*CONVENTION, 9) * rows.signals.interval

    def unlikely(late: float) -> list[float]:
        """Return minus the log likelihood of what is left on each joint."""
        out = []
        for left, floor in zip(projected.residuals(rows.shifted(late)), rows.floor, strict=True):
            square = float(left @ left) / max(len(left), 1)
            alike = correlation_time(left) if square > 0.0 else np.inf
            out.append(0.5 * len(left) / alike * np.log(max(square, floor**2, 1e-300)))
        return out

    values = np.array([unlikely(late) for late in steps.tolist()])  # (S, J)
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
