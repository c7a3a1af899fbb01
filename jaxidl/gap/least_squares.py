"""Bounded least squares on the linearised torque balance, with one solution beside for each block that is left out."""

from dataclasses import KW_ONLY, dataclass
from typing import NamedTuple

import numpy as np

from jaxidl.gap.data import Data, used

SHARE_AT_REST = 1.0  # an error at rest counts up to this share of the error in motion, however much friction could hold
RIDGE = 1e-9  # of each parameter's own information
NOTHING = 1e-250  # information below which a parameter has none
TOGETHER = 1e-3  # of a table's mean information: how strongly its neighbouring values are held together


class Columns(NamedTuple):
    """One joint's part of the linearised balance, ``net0 + step[which] @ net`` and so on: what does not touch it is left out."""

    which: np.ndarray  # (p,) the parameters that touch the joint, by their places among all P
    net0: np.ndarray  # (N,) balance
    slide0: np.ndarray  # (N,) dry friction in motion
    grip0: np.ndarray  # (N,) ... and at rest
    net: np.ndarray  # (p, N) derivatives of the three
    slide: np.ndarray
    grip: np.ndarray


@dataclass
class Problem:
    """The linearised balance of J joints about the members' P parameters."""

    data: Data
    weight: np.ndarray  # (J,) or (N, J) [1/N or 1/Nm]
    theta0: np.ndarray  # (P,) where it is linearised
    columns: list[Columns]  # of each joint
    _: KW_ONLY
    shaped: list[tuple[int, int, float]]  # see ``_shaping`` of :mod:`jaxidl.gap.fit`

    def __post_init__(self) -> None:
        parts = lambda c: (c.slide0, c.grip0, c.slide, c.grip)  # noqa: E731
        self.dry = np.array([any(map(np.any, parts(c))) for c in self.columns], bool)
        speaks, holds = np.zeros((2, len(self.theta0)), bool)  # has a parameter a say in motion? at rest?
        for c in self.columns:
            speaks[c.which] |= np.any(c.net, 1) | np.any(c.slide, 1)
            holds[c.which] |= np.any(c.grip, 1)
        self.at_rest_only = holds & ~speaks
        self.products: dict[int, tuple[bytes, np.ndarray]] = {}  # of each joint, as last computed, and of what
        self.train = np.flatnonzero(self.data.block >= 0)
        self.edges = np.flatnonzero(np.diff(self.data.block[self.train], prepend=-1))

    def _part(self, part: str, step: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """One part of the balance (n, J) at ``rows`` (n,); ``step`` is (P,), or (n, P) with one of its own for each row."""
        out = np.empty((len(rows), len(self.columns)))
        for j, c in enumerate(self.columns):
            zero, slope, own = getattr(c, f"{part}0")[rows], getattr(c, part), step[..., c.which]
            if not len(c.which):
                out[:, j] = zero
            elif own.ndim == 1:
                out[:, j] = zero + (own @ slope)[rows]
            else:
                out[:, j] = zero + np.einsum("np,pn->n", own, slope if len(rows) == slope.shape[1] else slope[:, rows])
        return out

    def _balance(self, step: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Balance, sliding friction and hold at ``rows`` (n,); ``step`` (P,), or (n, P) with one of its own for each row."""
        net, slide, grip = (self._part(part, step, rows) for part in ("net", "slide", "grip"))
        return net, slide, np.maximum(grip, 0.0)

    def residual(self, step: np.ndarray, rows: np.ndarray, size: np.ndarray) -> np.ndarray:
        """What is left (n, J) at ``rows``; at rest nothing is thought to be known to better than ``size`` (J,)."""
        net, slide, grip = self._balance(step, rows)
        moving = net - slide
        resting = self.data.resting[rows] & self.dry
        if not resting.any():
            return moving
        beyond = np.maximum(np.abs(net) - grip, 0.0)
        held = np.sign(net) * np.maximum(beyond, np.minimum(np.abs(net), size))
        return np.where(resting, held, moving)

    def typical(self, step: np.ndarray) -> np.ndarray:
        """Error in motion (J,), which friction is not believed to undo at rest; never below three times the noise."""
        rows = self.train[::4]
        net, slide, _ = self._balance(step, rows)
        moving = self.data.moving[rows]
        rms = np.sqrt(np.sum((net - slide) ** 2 * moving, 0) / np.maximum(moving.sum(0), 1))
        return SHARE_AT_REST * np.maximum(rms, 3.0 * self.data.floor)

    def solve(self, lower: np.ndarray, upper: np.ndarray, neighbours: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Step (P,) from all blocks, and (B, P) from all but one each; ``neighbours`` (n, 2) are held together a little."""
        blocks = self.data.block.max() + 1
        step = np.clip(np.zeros(len(lower)), lower, upper)
        if not len(lower):
            return step, np.tile(step, (blocks, 1))
        pinned = self.at_rest_only.copy()
        gram, right = np.zeros(0), np.zeros(0)
        sticking = bool((self.data.resting & self.dry).any())
        for _ in range(3 if sticking else 1):
            gram, right = self._normal(step)
            gram += _together(gram, neighbours)
            self._quieten(gram, right)
            for _ in range(4):
                step[~pinned] = _solve(gram.sum(0), right.sum(0), step, ~pinned)
                wrong = ~pinned & ((step < lower) | (step > upper))
                step = np.clip(step, lower, upper)
                if not wrong.any():
                    break
                pinned |= wrong
            self._cover(step, np.ones(len(self.data.base), bool), lower)
        steps = np.tile(step, (blocks, 1))
        steps[:, ~pinned] = _solve(gram.sum(0) - gram, right.sum(0) - right, step, ~pinned)
        if self.at_rest_only.any():
            for b in range(blocks):
                self._cover(steps[b], self.data.block != b, lower)
        return step, steps

    def _normal(self, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Normal equations (B, P, P) and (B, P) of each training block."""
        rows, count = self.train, len(self.theta0)
        counted, resting = used(self.data)[rows].astype(float), self.data.resting[rows] & self.dry
        net, _, grip = self._balance(step, rows) if resting.any() else (np.zeros(resting.shape),) * 3
        loose = np.abs(net) > grip + (self.typical(step) if resting.any() else 0.0)
        counted = np.where(resting & ~loose, 0.0, counted)
        weight = counted * (self.weight[rows] if self.weight.ndim == 2 else self.weight)
        gram, right = np.zeros((len(self.edges), count, count)), np.zeros((len(self.edges), count))
        for j, c in enumerate(self.columns):
            if not len(c.which):
                continue
            sign = np.where(resting[:, j], np.sign(net[:, j]), 0.0)
            product = self._products(j, sign, ~resting[:, j], weight[:, j])
            gram[:, c.which[:, None], c.which] += product[:, :-1, :-1]
            right[:, c.which] -= product[:, :-1, -1]
        return gram, right

    def _products(self, j: int, sign: np.ndarray, moves: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Of one joint: products (B, p + 1, p + 1) of its columns and what they are to explain; the last ones if nothing changed.

        At rest a level counts in the direction in which the joint is pushed, ``sign``.
        """
        key = (sign * weight).tobytes() + weight.tobytes()
        if j in self.products and self.products[j][0] == key:
            return self.products[j][1]
        c, rows = self.columns[j], self.train
        whole = slice(rows[0], rows[-1] + 1) if rows[-1] - rows[0] == len(rows) - 1 else rows
        both = np.empty((len(c.which) + 1, len(rows)))
        both[:-1], both[-1] = c.net[:, whole], c.net0[whole]
        for slopes, zero, on in ((c.slide, c.slide0, moves), (c.grip, c.grip0, sign)):
            acts = np.flatnonzero(np.any(slopes, 1))
            both[acts] -= on * slopes[acts][:, whole]
            both[-1] -= on * zero[whole]
        both *= weight
        product = np.stack([part @ part.T for part in np.split(both, self.edges[1:], axis=1)])
        self.products[j] = key, product
        return product

    def _quieten(self, gram: np.ndarray, right: np.ndarray) -> None:
        """The noise that motor inertia takes away, as one more residual √n·floor·√(1 − (1 − share)²) spread over the blocks."""
        for place, joint, inertia in self.shaped:
            share = np.clip(self.theta0[place] / inertia, 1e-3, 1.0 - 1e-3)
            weight = self.weight[..., joint].mean() * self.data.floor[joint]
            size = weight * np.sqrt(np.sum(self.data.block >= 0) / len(gram))
            value = np.sqrt(1.0 - (1.0 - share) ** 2)
            slope = size * (1.0 - share) / (value * inertia)
            gram[:, place, place] += slope**2
            right[:, place] -= slope * size * value

    def _cover(self, step: np.ndarray, among: np.ndarray, lower: np.ndarray) -> None:
        """Levels that act at rest only: what rests typically withstood before they ended, beyond what other friction holds."""
        for p in np.flatnonzero(self.at_rest_only):
            step[p] = lower[p]
            j, own = next((j, c.grip[c.which == p][0]) for j, c in enumerate(self.columns) if np.any(c.grip[c.which == p]))
            acts = self.data.resting[:, j] & (own != 0.0)
            rows = np.flatnonzero((self.data.block >= 0) & among & acts)
            peaks = self.data.peaks[j]
            at = peaks[:, 0].astype(int)
            last = np.maximum.accumulate(np.where(self.data.resting[:, j], np.arange(len(acts)), 0))  # instant of rest so far
            peaks = peaks[among[at] & acts[last[at]]]
            if len(rows) and len(peaks):
                grip = np.maximum(self._part("grip", step, rows)[:, j], 0.0)
                step[p] = max(lower[p] + np.median(peaks[:, 1]) - np.median(grip), lower[p])


def _together(gram: np.ndarray, neighbours: np.ndarray) -> np.ndarray:
    """Penalty (P, P), spread over the blocks, on differences of neighbours: what no data shows is as beside it."""
    out = np.zeros(gram.shape[1:])
    size = np.diagonal(gram.sum(0))
    for a, b in neighbours:
        strength = TOGETHER * np.mean(size[neighbours])
        out[[a, b], [a, b]] += strength
        out[[a, b], [b, a]] -= strength
    return out / len(gram)


def _solve(gram: np.ndarray, right: np.ndarray, step: np.ndarray, free: np.ndarray) -> np.ndarray:
    """The free part of the solution (..., F), the rest of ``step`` being given.

    Scaled, and slightly damped so that what the data does not show stays where it is.
    """
    if not free.any():
        return np.zeros((*gram.shape[:-2], 0))
    a = gram[..., free, :][..., :, free]
    y = right[..., free] - gram[..., free, :][..., :, ~free] @ step[~free]
    size = np.diagonal(a, axis1=-2, axis2=-1)
    scale = np.where(size > NOTHING, np.sqrt(np.maximum(size, NOTHING)), np.inf)  # what no row shows stays where it is
    with np.errstate(over="ignore", invalid="ignore"):  # a hidden state that ran away: its fit is refused afterwards
        a = a / (scale[..., :, None] * scale[..., None, :]) + RIDGE * np.eye(a.shape[-1])
        return np.linalg.solve(a, (y / scale)[..., None])[..., 0] / scale
