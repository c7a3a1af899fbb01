"""Gram matrices of the items that may be in a set of effects.

They are computed once, block by block of a log, so that each set is one small solve. Columns are
scaled to about one, and divided by the noise of their joint.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Float

from jaxidl.gap.evidence.delivery import Delivery, delivery
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.samples import samples_alike

Key = tuple[str, int | None]  # an effect's name and its joint
# name, joint and part of an effect: one shape of each at a time
Group = tuple[str, int | None, str]


@dataclass(frozen=True, eq=False)
class Item:
    """One shape of an effect: P columns of the predicted command; equal to itself alone."""

    group: Group
    shape: Any  # see :mod:`jaxidl.gap.evidence.shape`; None of an alignment of torques
    joints: tuple[int, ...]  # the K joints that it affects
    columns: Float[np.ndarray, "P N K"] = field(repr=False)
    lower: Float[np.ndarray, " P"]
    upper: Float[np.ndarray, " P"]
    odds: float  # log prior odds
    # precision of the prior on its coefficients: inverse squares of plausible values
    precision: Float[np.ndarray, " P"]
    actuates: bool = False  # true if it changes what the motor delivers
    common: bool = False  # true if part of the envelope
    always: bool = False  # true if part of every set without being an effect
    # additional commands on its joints (S, N, K), and what it holds back of them (S, P, N, K) [1]
    push: tuple[np.ndarray, np.ndarray] | None = field(default=None, repr=False)
    # (P, K) share of samples at which no additional command passes
    deaf: np.ndarray | None = field(default=None, repr=False)

    @property
    def key(self) -> Key:
        """Name and joint."""
        return self.group[:2]


_Counted = WeakKeyDictionary[Item, dict[int, np.ndarray]]


def columns_at(items: Iterable[Item], joint: int, rows: int) -> Float[np.ndarray, "P N"]:
    """Return the columns that items have on a joint, side by side, of N ``rows``."""
    on = [i.columns[:, :, i.joints.index(joint)] for i in items if joint in i.joints]
    return np.concatenate([np.zeros((0, rows)), *on])


class Anchor(NamedTuple):
    """Another log's evidence about items of both: changes of coefficients increase its error."""

    items: tuple[Item, ...]
    information: Float[np.ndarray, "P P"]  # normal matrix of that log [1/coefficient^2]
    pull: Float[np.ndarray, " P"]  # right side of its normal equations [1/coefficient]
    alike: float = 1.0  # samples that count as one there; the larger number of both logs holds


class Gram:
    """Gram matrices of a library of items on the rows of a log."""

    def __init__(
        self,
        rows: Rows,
        items: Sequence[Item],
        noise: np.ndarray,
        effective: np.ndarray,
        anchor: Anchor | None = None,
        old: "Gram | None" = None,
    ):
        """Compute the Gram matrices of items on N rows, in B training blocks and held-out ones.

        The envelope's residual has a root mean square ``noise`` (J,) [N or Nm] and an ``effective``
        number (J,) of training samples. An ``anchor`` is evidence of another log about some of the
        items. What is there in ``old``, the score of the same rows with other items, is not
        computed again.
        """
        self.rows, self.items = rows, list(items)
        self.noise, self.effective = noise, effective
        # also holds items that ``narrowed`` leaves out, so that no other item gets their identity
        self._alive = list(items)
        sizes = np.cumsum([0, *(len(i.lower) for i in items)])
        self.place = {
            id(i): np.arange(a, b) for i, a, b in zip(items, sizes, sizes[1:], strict=False)
        }
        self.total = int(sizes[-1])
        kept_aside = sorted({int(b) for b in rows.block if b < 0}, reverse=True)
        order = [*range(int(rows.block.max()) + 1), *kept_aside]
        self.training = np.array([b >= 0 for b in order])
        joints = rows.gap.shape[1]
        self.which: list[np.ndarray] = []  # for each joint: indices of the columns that affect it
        self.gram: list[np.ndarray] = []  # ... (B, p, p)
        self.right: list[np.ndarray] = []  # ... (B, p)
        # squares of the gap itself, and number of rows
        self.square, self.count = np.zeros((2, len(order), joints))
        self.deliveries: list[Delivery] = []  # for each joint: what its actuators let through
        scale = np.zeros(self.total)
        weights = rows.used / np.maximum(noise, 1e-300)
        for i in items:
            for k, j in enumerate(i.joints):
                scale[self.place[id(i)]] += np.sum((i.columns[:, :, k] * weights[:, j]) ** 2, 1)
        # columns without any effect on this log keep their own unit
        self.dead = scale <= 1e-24 * max(scale.max(initial=0.0), 1e-300)
        self.scale = np.where(self.dead, 1.0, np.sqrt(scale / max(rows.training.sum(), 1)))
        same = np.full(self.total, -1)  # indices in the old score
        before = {} if old is None else old.place
        for i in items:
            same[self.place[id(i)]] = before.get(id(i), -1)
        # columns of each item as they count on each joint
        self._counted: _Counted = WeakKeyDictionary() if old is None else old._counted
        for j in range(joints):
            on = [i for i in items if j in i.joints]
            which, each = self.indices(on), [self._columns(i, j, weights[:, j]) for i in on]
            x = np.concatenate([np.zeros((0, len(weights))), *each]).T / self.scale[which]  # (N, p)
            y = rows.steady(rows.gap[:, j] * weights[:, j], j)
            parts = [rows.block == b for b in order]
            g = np.empty((len(order), len(which), len(which)))
            kept = np.flatnonzero(same[which] >= 0)
            fresh = np.flatnonzero(same[which] < 0)
            if old is not None:
                at = old.local[j][same[which[kept]]]
                g[:, kept[:, None], kept] = old.gram[j][:, at[:, None], at]
            for n, b in enumerate(parts):
                across = x[b].T @ x[b][:, fresh]
                g[n][:, fresh], g[n][fresh] = across, across.T
            self.gram.append(g)
            self.right.append(np.stack([x[b].T @ y[b] for b in parts]))
            self.square[:, j] = [y[b] @ y[b] for b in parts]
            self.count[:, j] = [rows.used[b, j].sum() for b in parts]
            self.which.append(which)
            acting = [i for i in on if i.actuates]
            at = self.indices(acting)
            self.deliveries.append(delivery(rows, j, noise[j], acting, at, self.scale[at]))
        # variance of the command [noise^2]
        self.variance = np.array([d.variance for d in self.deliveries])
        self.bounds = [
            np.concatenate([np.zeros(0), *(getattr(i, side) for i in items)]) * self.scale
            for side in ("lower", "upper")
        ]
        self.prior = np.concatenate([np.zeros(0), *(i.precision for i in items)]) / self.scale**2
        self.alike = samples_alike(self.count[self.training].sum(0), effective)
        self.anchor = anchor
        self.anchored, self.pull = np.zeros((self.total, self.total)), np.zeros(self.total)
        if anchor is not None:
            at = self.indices(anchor.items)
            s, counts = self.scale[at], min(1.0, self.alike / anchor.alike)
            self.anchored[np.ix_(at, at)] = counts * anchor.information / s[:, None] / s
            self.pull[at] = counts * anchor.pull / s
        self.floor = (rows.floor / np.maximum(noise, 1e-300)) ** 2
        self.local = [np.full(self.total, -1) for _ in range(joints)]
        for local, which in zip(self.local, self.which, strict=True):
            local[which] = np.arange(len(which))
        self.weights = np.ones(int(self.training.sum()))  # weights of the training blocks

    def _columns(self, i: Item, joint: int, weights: np.ndarray) -> Float[np.ndarray, "P N"]:
        """Return an item's columns on a joint [noise]; items are tried in many sets."""
        kept = self._counted.setdefault(i, {})
        if joint not in kept:
            own = i.columns[:, :, i.joints.index(joint)]
            kept[joint] = self.rows.steady(own * weights, joint)
        return kept[joint]

    def normal(self, members: Sequence[Item]) -> tuple[np.ndarray, ...]:
        """Return normal equations (B, P, P) and (B, P) of a set's coefficients, by training block.

        Also return what priors and another log add to them: a matrix (P, P) and a right side (P,).
        """
        at = self.indices(members)
        gram, right, _ = self.normal_equations(at)
        s = self.scale[at]
        both = s[:, None] * s
        return gram * both, right * s, self._known(at) * both, self.pull[at] * s

    def _known(self, at: np.ndarray) -> np.ndarray:
        return self.anchored[np.ix_(at, at)] + np.diag(self.prior[at])

    def normal_equations(
        self, at: np.ndarray, part: slice | None = None
    ) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, ...]]]:
        """Return normal equations (B, P, P) and (B, P) of scaled columns ``at`` (P,).

        Also return each joint's part of them. They are of ``part`` of the blocks, by default of all
        training blocks, which come first.
        """
        part = slice(len(self.weights)) if part is None else part
        blocks = len(self.count[part])
        gram, right = np.zeros((blocks, len(at), len(at))), np.zeros((blocks, len(at)))
        own = self._own(at, part)
        for here, g, h in own:
            gram[:, here[:, None], here] += g
            right[:, here] += h
        return gram, right, own

    def _own(self, at: np.ndarray, blocks: slice) -> list[tuple[np.ndarray, ...]]:
        """Return each joint's part of columns ``at`` (P,), and its normal equations by block."""
        out = []
        for local, g, h in zip(self.local, self.gram, self.right, strict=True):
            here = np.flatnonzero(local[at] >= 0)
            there = local[at[here]]
            out.append((here, g[blocks, there[:, None], there], h[blocks, there]))
        return out

    @cached_property
    def summed(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return each joint's Gram matrix (p, p) and right side (p,) on all training blocks."""
        w, on = self.weights, self.training
        both = zip(self.gram, self.right, strict=True)
        return [(np.tensordot(w, g[on], 1), w @ h[on]) for g, h in both]

    @cached_property
    def whole(self) -> tuple[np.ndarray, np.ndarray]:
        """Return Gram matrix (P, P) and right side (P,) of all items, with another log's part."""
        gram, push = self.anchored.copy(), self.pull.copy()
        for which, (g, h) in zip(self.which, self.summed, strict=True):
            gram[np.ix_(which, which)] += g
            push[which] += h
        return gram, push

    @cached_property
    def widths(self) -> list[tuple[list[Item], np.ndarray, np.ndarray, np.ndarray]]:
        """Return items by their number of columns.

        There are their indices (n, p), their own part of the matrix (n, p, p), with the prior, and
        on which joints (n, J) they are.
        """
        (gram, _), widths = self.whole, []
        for width in sorted({len(i.lower) for i in self.items} - {0}):
            items = [i for i in self.items if len(i.lower) == width]
            where = np.stack([self.place[id(i)] for i in items])
            own = gram[where[:, :, None], where[:, None, :]].copy()
            own[:, np.arange(width), np.arange(width)] += (
                self.prior[where] + 1e-6 * np.diagonal(gram)[where] + 1e-9
            )
            on = np.zeros((len(items), len(self.which)))
            for n, i in enumerate(items):
                on[n, list(i.joints)] = 1.0
            widths.append((items, where, own, on))
        return widths

    def indices(self, members: Iterable[Item]) -> np.ndarray:
        """Return the indices of the columns of some items."""
        return np.concatenate([np.zeros(0, int), *(self.place[id(m)] for m in members)])
