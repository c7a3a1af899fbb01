"""The score of a set of effects: how well it predicts blocks that it was not fitted to, and how likely it was beforehand.

score(S) = sum over joints of -N/2 log(max(e, noise floor)) + sum over effects of log(p / (1 - p)):

* e is the mean squared error of the command on blocks left out, in units of what the envelope leaves. Where effects change what
  the motor delivers it is taken relative to the share of the command's variance that they let through. At samples where a little
  more command would deliver no more, any command explains the motion: there the command's own variance takes e's place.
* N is the effective number of samples, which counts the autocorrelation of what the envelope leaves (Bartlett 1946).
* p is the effect's prior.

Gram matrices per block and joint are made once; a set then costs one small solve for each block.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxidl.gap.rows import Rows

RIDGE = 1e-9  # of each column's own information
ALIKE = 1e-6  # of what columns add: others that leave less imitate them
Group = tuple[str, int | None, str]  # name, joint and part of an effect: one shape of each at a time


@dataclass(frozen=True, eq=False)
class Item:
    """One shape of an effect: P columns of the predicted command on some joints. Compared by identity."""

    group: Group
    shape: Any  # see :mod:`jaxidl.gap.library`
    joints: tuple[int, ...]  # K that it touches
    columns: Float[np.ndarray, "P N K"] = field(repr=False)
    lower: Float[np.ndarray, " P"]
    upper: Float[np.ndarray, " P"]
    odds: float  # log prior odds
    precision: Float[np.ndarray, " P"]  # of the prior on its coefficients: inverse squares of what is plausible
    actuates: bool = False  # does it change what the motor delivers?
    common: bool = False  # part of the envelope?
    always: bool = False  # part of every set, and no effect?
    push: np.ndarray | None = field(default=None, repr=False)  # (P, N, K) derivatives of the columns by the command [1]
    deaf: np.ndarray | None = field(
        default=None, repr=False
    )  # (P, K) share of samples that keep back all of a little more command

    @property
    def key(self) -> tuple[str, int | None]:
        """Name and joint."""
        return self.group[:2]


class Solution(NamedTuple):
    """A fitted set. P coefficients, B blocks, J joints."""

    members: tuple[Item, ...]
    x: Float[np.ndarray, " P"]  # fitted on all blocks of training
    folds: Float[np.ndarray, "B P"]  # without one each
    error: Float[np.ndarray, "B J"]  # sum of squares on each block without it [noise^2]
    passed: Float[np.ndarray, " J"]  # share of the command's variance that reaches the joint
    value: float

    def of(self, item: Item) -> slice:
        """Where an item's coefficients are."""
        at = 0
        for m in self.members:
            if m is item:
                return slice(at, at + len(m.lower))
            at += len(m.lower)
        raise KeyError(item.group)


class Anchor(NamedTuple):
    """What another log of the same machine says of items that both share: changes of their coefficients cost its error."""

    items: tuple[Item, ...]
    information: Float[np.ndarray, "P P"]  # normal matrix of that log [1/coefficient^2]
    pull: Float[np.ndarray, " P"]  # and its right side [1/coefficient]


class Score:
    """Gram matrices of a library of items on the rows of a log."""

    def __init__(
        self,
        rows: Rows,
        items: Sequence[Item],
        noise: np.ndarray,
        effective: np.ndarray,
        anchor: "Anchor | None" = None,
        old: "Score | None" = None,
    ):
        """Compute them.

        Args:
            rows: N rows, B blocks of training, others kept aside.
            items: all that may be in a set.
            noise: (J,) root mean square of what the envelope leaves [N or Nm].
            effective: (J,) effective number of samples of training.
            anchor: what another log says of some of the items.
            old: the score of the same rows with other items: what both have is not computed again.
        """
        self.items, self.noise, self.effective = list(items), noise, effective
        self._alive = list(items)  # of those that ``narrowed`` leaves out, too: no other may get their identity
        sizes = np.cumsum([0, *(len(i.lower) for i in items)])
        self.place = {id(i): np.arange(a, b) for i, a, b in zip(items, sizes, sizes[1:], strict=False)}
        self.total = int(sizes[-1])
        kept_aside = sorted({int(b) for b in rows.block if b < 0}, reverse=True)
        order = [*range(int(rows.block.max()) + 1), *kept_aside]
        self.training = np.array([b >= 0 for b in order])
        joints = rows.gap.shape[1]
        self.which: list[np.ndarray] = []  # of each joint: places of the columns that touch it
        self.gram: list[np.ndarray] = []  # ... (B, p, p)
        self.right: list[np.ndarray] = []  # ... (B, p)
        self.square, self.count = np.zeros((2, len(order), joints))  # of the gap itself, and rows
        self.spread: list[Any] = []  # of columns of actuators: see ``_spread``
        scale = np.zeros(self.total)
        weights = rows.used / np.maximum(noise, 1e-300)
        for i in items:
            for k, j in enumerate(i.joints):
                scale[self.place[id(i)]] += np.sum((i.columns[:, :, k] * weights[:, j]) ** 2, 1)
        self.scale = np.sqrt(np.maximum(scale / max(rows.training.sum(), 1), 1e-300))
        self.dead = scale <= 1e-24 * max(scale.max(initial=0.0), 1e-300)
        same = np.full(self.total, -1)  # places in the old score
        before = {} if old is None else old.place
        for i in items:
            same[self.place[id(i)]] = before.get(id(i), -1)
        for j in range(joints):
            on = [(i, i.joints.index(j)) for i in items if j in i.joints]
            which = np.concatenate([np.zeros(0, int), *(self.place[id(i)] for i, _ in on)])
            x = np.concatenate([np.zeros((0, len(rows.block))), *(i.columns[:, :, k] for i, k in on)])
            x = (x * weights[:, j] / self.scale[which, None]).T  # (N, p)
            y = rows.gap[:, j] * weights[:, j]
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
            self.spread.append(self._spread(rows, j, [i for i, _ in on if i.actuates]))
        self.variance = np.array([c for _, ((_, _, c), _) in self.spread])  # of the command [noise^2]
        self.bounds = [
            np.concatenate([np.zeros(0), *(getattr(i, side) for i in items)]) * self.scale for side in ("lower", "upper")
        ]
        self.prior = np.concatenate([np.zeros(0), *(i.precision for i in items)]) / self.scale**2
        self.anchor = anchor
        self.anchored, self.pull = np.zeros((self.total, self.total)), np.zeros(self.total)
        if anchor is not None:
            at = np.concatenate([np.zeros(0, int), *(self.place[id(i)] for i in anchor.items)])
            self.anchored[np.ix_(at, at)] = anchor.information / self.scale[at, None] / self.scale[at]
            self.pull[at] = anchor.pull / self.scale[at]
        self.floor = (rows.floor / np.maximum(noise, 1e-300)) ** 2
        self.local = [np.full(self.total, -1) for _ in range(joints)]
        for local, which in zip(self.local, self.which, strict=True):
            local[which] = np.arange(len(which))
        self.weights = np.ones(int(self.training.sum()))  # of the blocks of training
        self._known: dict[frozenset[int], Solution] = {}

    def solve(self, members: Iterable[Item]) -> Solution:
        """Return the set fitted with and without each block, and its score."""
        members = tuple(sorted(members, key=lambda i: self.place[id(i)][0] if len(i.lower) else -1))
        known = frozenset(map(id, members))
        if known not in self._known:
            self._known[known] = self._solve(members)
        return self._known[known]

    def normal(self, members: Sequence[Item]) -> tuple[np.ndarray, np.ndarray]:
        """Return normal equations (B, P, P) and (B, P) of the coefficients of a set, on each block of training."""
        at = self._places(members)
        gram, right, _ = self._normal(at)
        return gram * self.scale[at, None] * self.scale[at], right * self.scale[at]

    def anchoring(self, members: Sequence[Item]) -> tuple[np.ndarray, np.ndarray]:
        """Return what another log adds to the normal equations (P, P) and (P,) of a set."""
        at = self._places(members)
        return self.anchored[np.ix_(at, at)] * self.scale[at, None] * self.scale[at], self.pull[at] * self.scale[at]

    def _normal(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[tuple[np.ndarray, ...]]]:
        blocks = len(self.weights)  # those of training come first
        gram, right = np.zeros((blocks, len(at), len(at))), np.zeros((blocks, len(at)))
        own = []
        for local, g, h in zip(self.local, self.gram, self.right, strict=True):
            here = np.flatnonzero(local[at] >= 0)
            there = local[at[here]]
            g, h = g[:blocks, there[:, None], there], h[:blocks, there]
            own.append((here, g, h))
            gram[:, here[:, None], here] += g
            right[:, here] += h
        return gram, right, own

    def _solve(self, members: tuple[Item, ...]) -> Solution:
        at = self._places(members)
        blocks = len(self.weights)
        gram, right, own = self._normal(at)
        w = self.weights[:, None]
        whole, wanted = np.tensordot(self.weights, gram, 1), (w * right).sum(0)
        left = np.concatenate([whole[None], whole - w[:, :, None] * gram]), np.concatenate([wanted[None], wanted - w * right])
        x = self._bounded(*left, at)
        error = np.zeros((len(gram), len(self.which)))
        for j, (here, g, h) in enumerate(own):
            part = x[1:, here]
            error[:, j] = self.square[:blocks, j] + np.sum(((g @ part[..., None])[..., 0] - 2 * h) * part, 1)
        error, (passed, heard) = np.maximum(error, 0.0), self._passed(members, at, x[0])
        mean = (w * error).sum(0) / np.maximum(self.weights @ self.count[:blocks], 1.0)
        value = self.value_of(mean / passed, heard, members)
        return Solution(members, x[0] / self.scale[at], x[1:] / self.scale[at], error, passed, value)

    def value_of(self, error: np.ndarray, heard: np.ndarray, members: Iterable[Item]) -> float:
        """Return the score of a mean squared error (J,) where shares ``heard`` (J,) of the samples tell of the command."""
        said = heard * np.log(np.maximum(error, self.floor)) + (1.0 - heard) * np.log(np.maximum(self.variance, self.floor))
        return float(-0.5 * self.effective @ said + sum(m.odds for m in members))

    def _spread(self, rows: Rows, j: int, acting: Sequence[Item]) -> tuple[dict[int, slice], Any]:
        """Where columns of actuators are, their covariance, with joint j's command, too, and of it; the same of a little more."""
        sizes = np.cumsum([0, *(len(i.lower) for i in acting)])
        places = {id(i): slice(a, b) for i, a, b in zip(acting, sizes, sizes[1:], strict=False)}
        mask = rows.training & rows.used[:, j]
        n, none = max(int(mask.sum()), 1), [np.zeros((0, int(mask.sum())))]
        c = rows.command[mask, j] / self.noise[j]
        x = np.concatenate([*none, *(i.columns[:, mask, i.joints.index(j)] / self.noise[j] for i in acting)])
        more = [np.zeros_like(i.columns) if i.push is None else i.push for i in acting]
        p = np.concatenate([*none, *(m[:, mask, i.joints.index(j)] for i, m in zip(acting, more, strict=True))])
        c, x = c - c.sum() / n, x - x.sum(1, keepdims=True) / n
        deaf = [np.zeros((len(i.lower), len(i.joints))) if i.deaf is None else i.deaf for i in acting]
        d = np.concatenate([np.zeros(0), *(m[:, i.joints.index(j)] for i, m in zip(acting, deaf, strict=True))])
        return places, ((x @ x.T / n, x @ c / n, float(c @ c / n)), (p @ p.T / n, p.sum(1) / n, d))

    def _passed(self, members: Sequence[Item], at: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What actuators let through of each joint's command, or of a little more of it: the share of its variance (J,), and the
        share of samples that tell (J,).
        """
        passed, heard = np.ones((2, len(self.which)))
        for j, (places, ((xx, xc, cc), (pp, mean, deaf))) in enumerate(self.spread):
            acting = [m for m in members if id(m) in places]
            if not acting:
                continue
            there = np.concatenate([np.arange(places[id(m)].start, places[id(m)].stop) for m in acting])
            own = np.concatenate([self.place[id(m)] for m in acting])
            values = x[np.searchsorted(at, own)] / self.scale[own]
            quadratic = lambda a, values=values, there=there: values @ a[np.ix_(there, there)] @ values  # noqa: E731
            variance = (cc - 2 * values @ xc[there] + quadratic(xx)) / max(cc, 1e-300)
            more = 1.0 - 2 * values @ mean[there] + quadratic(pp)
            passed[j] = max(min(variance, more), 1e-9)
            heard[j] = np.clip(1.0 - np.abs(values) @ deaf[there], 0.0, 1.0)
        return passed, heard

    def _bounded(self, gram: np.ndarray, right: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Solutions (F, P) of F normal equations within the bounds; which bounds hold is decided by the first."""
        lower, upper = self.bounds[0][at], self.bounds[1][at]
        if not len(at):
            return right
        own, right = np.diagonal(gram, axis1=1, axis2=2), right + self.pull[at]
        steady = self.prior[at] + RIDGE * own.mean(1, keepdims=True) + RIDGE * own + 1e-12
        gram[:, np.arange(len(at)), np.arange(len(at))] += steady
        if self.anchor is not None:
            gram = gram + self.anchored[np.ix_(at, at)]
        x, free = np.zeros(right.shape), ~self.dead[at]
        held = np.clip(x[0], lower, upper)
        for _ in range(12):
            x[0] = held
            if free.all():
                x[0] = np.linalg.solve(gram[0], right[0])
            elif free.any():
                inner, side = gram[0][np.ix_(free, free)], gram[0][np.ix_(free, ~free)]
                x[0, free] = np.linalg.solve(inner, right[0, free] - side @ held[~free])
            wrong = free & ((x[0] < lower - 1e-12) | (x[0] > upper + 1e-12))
            if not wrong.any():
                if free.all():
                    break
                push = right[0] - gram[0] @ x[0]
                back = ~free & ~self.dead[at] & (lower < upper)
                back &= ((held <= lower) & (push > 1e-9)) | ((held >= upper) & (push < -1e-9))
                if not back.any():
                    break
                free |= back & (np.abs(push) == np.max(np.abs(push[back])))
                continue
            held = np.where(wrong, np.clip(x[0], lower, upper), held)
            free &= ~wrong
        if free.all():
            x[1:] = np.linalg.solve(gram[1:], right[1:, :, None])[..., 0]
        elif free.any():
            rows = gram[1:, free]
            x[1:] = held
            x[1:, free] = np.linalg.solve(rows[:, :, free], (right[1:, free] - rows[:, :, ~free] @ held[~free])[..., None])[
                ..., 0
            ]
        else:
            x[1:] = held
        return np.clip(x, lower, upper)

    def likelihood(self, members: Sequence[Item], x: np.ndarray) -> float:
        """Return the score of coefficients ``x`` (P,) of a set on the blocks of training themselves."""
        at, blocks = self._places(members), len(self.weights)
        _, _, own = self._normal(at)
        scaled, error = x * self.scale[at], np.zeros(len(own))
        for j, (here, g, h) in enumerate(own):
            part = scaled[here]
            error[j] = self.square[:blocks, j].sum() + part @ (g.sum(0) @ part - 2 * h.sum(0))
        passed, heard = self._passed(members, at, scaled)
        return self.value_of(np.maximum(error, 0.0) / np.maximum(self.count[:blocks].sum(0), 1.0) / passed, heard, members)

    def covariance(self, found: Solution) -> np.ndarray:
        """Return the covariance (P, P) of a set's coefficients.

        What the set leaves is as many things as the score counts samples, the floor below which all errors are equal is one for
        each block, and what the log does not tell is as wide as was plausible beforehand.
        """
        at, blocks = self._places(found.members), len(self.weights)
        gram, _, own = self._normal(at)
        known = self.anchored[np.ix_(at, at)] + np.diag(self.prior[at])
        count, effective = self.count[:blocks].sum(0), np.maximum(self.effective, 1.0)
        middle = known * float(np.median(count / effective))
        for j, (here, g, _) in enumerate(own):
            middle[np.ix_(here, here)] += g.sum(0) * (found.error[:, j].sum() / effective[j] + self.floor[j] * count[j] / blocks)
        inside = gram.sum(0) + known
        inside[np.diag_indices(len(at))] += RIDGE * np.diagonal(inside) + 1e-12
        inverse = np.linalg.inv(inside)
        return inverse @ middle @ inverse / self.scale[at, None] / self.scale[at]

    def aside(self, found: Solution) -> np.ndarray:
        """Return sums of squares (A, J) of a set on the A blocks kept aside [noise^2]."""
        at = self._places(found.members)
        x, rest = found.x * self.scale[at], ~self.training
        error = self.square[rest].copy()
        for j, local in enumerate(self.local):
            here = np.flatnonzero(local[at] >= 0)
            there, part = local[at[here]], x[here]
            error[:, j] += -2 * self.right[j][len(self.weights) :, there] @ part
            error[:, j] += np.einsum("bpq,p,q->b", self.gram[j][len(self.weights) :, there[:, None], there], part, part)
        return np.maximum(error, 0.0)

    def promise(self, members: Iterable[Item]) -> dict[int, float]:
        """Return a quick estimate of what adding each other item is worth to the score, from the fit on all blocks."""
        now = self.solve(members)
        at = self._places(now.members)
        gram, push, widths = self._whole
        push = push - gram[:, at] @ (now.x * self.scale[at])
        inside = gram[np.ix_(at, at)] + np.diag(self.prior[at] + RIDGE * np.diagonal(gram)[at] + 1e-9)
        over = gram[at]
        across = np.linalg.solve(inside, over) if len(at) else over
        left = np.maximum(now.error.sum(0), 1e-9)
        out: dict[int, float] = {}
        for items, where, own, on in widths:  # all items of one number of columns at once
            schur = own - np.einsum("anp,anq->npq", over[:, where], across[:, where])
            right = push[where]
            step = np.linalg.solve(schur, right[..., None])[..., 0]
            if where.shape[1] == 1:
                step = np.clip(step, self.bounds[0][where], self.bounds[1][where])
            gain = 2 * np.sum(step * right, 1) - np.einsum("np,npq,nq->n", step, schur, step)
            rate = np.clip(gain / (on @ left), 0.0, 1.0 - 1e-6)
            odds = np.array([i.odds for i in items])
            worth = -0.5 * (on @ self.effective) * np.log(1.0 - rate) - 0.5 * where.shape[1] + odds
            out |= zip(map(id, items), worth.tolist(), strict=True)
        for m in now.members:
            out.pop(id(m), None)
        return out

    def lost(self, now: Solution) -> dict[int, float]:
        """Return a quick estimate of what dropping each member would cost the score."""
        at, (gram, _, _) = self._places(now.members), self._whole
        inside = gram[np.ix_(at, at)] + np.diag(self.prior[at] + 1e-6 * np.diagonal(gram)[at] + 1e-9)
        inverse, x = np.linalg.inv(inside), now.x * self.scale[at]
        left, out = np.maximum(now.error.sum(0), 1e-9), {}
        for m in now.members:
            own, on = now.of(m), list(m.joints)
            cost = float(x[own] @ np.linalg.solve(inverse[own, own], x[own]))
            out[id(m)] = 0.5 * self.effective[on].sum() * np.log1p(cost / left[on].sum()) + m.odds
        return out

    def imitated(self, members: Iterable[Item], whole: Item) -> list[Item]:
        """Return those members that are combinations of an item's several columns."""
        if len(whole.lower) < 2 or whole.group in {m.group for m in members}:
            return []
        gram, _, _ = self._whole
        at, found = self.place[id(whole)], []
        inverse = np.linalg.pinv(gram[np.ix_(at, at)], rcond=RIDGE, hermitian=True)
        for m in members:
            if not m.always and set(m.joints) <= set(whole.joints):
                own = self.place[id(m)]
                left = gram[np.ix_(own, own)] - gram[np.ix_(own, at)] @ inverse @ gram[np.ix_(at, own)]
                if np.trace(left) < ALIKE * np.trace(gram[np.ix_(own, own)]):
                    found.append(m)
        return found

    @cached_property
    def _whole(self) -> tuple[np.ndarray, np.ndarray, list[Any]]:
        """Gram matrix (P, P) and right side (P,) of all items on all blocks of training, and the items by their width: places
        (n, p), their own part of the matrix (n, p, p) and on which joints (n, J) they are.
        """
        gram, push = self.anchored.copy(), self.pull.copy()
        for which, g, h in zip(self.which, self.gram, self.right, strict=True):
            gram[np.ix_(which, which)] += np.tensordot(self.weights, g[self.training], 1)
            push[which] += self.weights @ h[self.training]
        widths = []
        for width in sorted({len(i.lower) for i in self.items} - {0}):
            items = [i for i in self.items if len(i.lower) == width]
            where = np.stack([self.place[id(i)] for i in items])
            own = gram[where[:, :, None], where[:, None, :]].copy()
            own[:, np.arange(width), np.arange(width)] += self.prior[where] + 1e-6 * np.diagonal(gram)[where] + 1e-9
            on = np.zeros((len(items), len(self.which)))
            for n, i in enumerate(items):
                on[n, list(i.joints)] = 1.0
            widths.append((items, where, own, on))
        return gram, push, widths

    def _places(self, members: Iterable[Item]) -> np.ndarray:
        """Places of the columns of some items."""
        return np.concatenate([np.zeros(0, int), *(self.place[id(m)] for m in members)])

    def narrowed(self, items: Sequence[Item]) -> "Score":
        """Return the score of some of the items only."""
        return self._with(items=list(items), _known=self._known)

    def resampled(self, weights: np.ndarray) -> "Score":
        """Return the score on blocks drawn with replacement; ``weights`` (B,) say how often each was drawn."""
        return self._with(weights=weights, _known={})

    def _with(self, **changes: Any) -> "Score":
        other = object.__new__(Score)
        other.__dict__.update({**self.__dict__, **changes})
        other.__dict__.pop("_whole", None)
        return other


def correlation_time(x: np.ndarray) -> float:
    """Return by how much the samples ``x`` (N,) count for less because neighbours are alike [samples], at least 1."""
    f = np.fft.rfft(x - x.mean(), 2 * len(x))
    a = np.fft.irfft(np.abs(f) ** 2)[: len(x)]
    if a[0] <= 0.0:
        return 1.0
    end = int(np.argmax(a < 0.05 * a[0])) or len(x)
    return float(max(1 + 2 * (a[1:end] / a[0]).sum(), 1.0))
