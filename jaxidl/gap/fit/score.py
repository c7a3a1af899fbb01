"""The score of a set of effects: its prediction of left-out blocks, and its prior.

score(S) = sum over joints of -N/2 log(max(e, noise floor)) + sum over effects of log(p / (1 - p))
           - sum over coefficients of (x / s)^2 / 2:

* e is the mean squared error of the command on blocks left out, in units of the envelope's
  residual. Where effects change what the motor delivers it is taken relative to the share of the
  command's variance that they let through. At samples where a little more command would deliver no
  more, any command explains the motion: there the command's own variance takes e's place.
* N is the effective number of samples, which accounts for the autocorrelation of the envelope's
  residual and of its columns, and for motions that are repeated
  (:mod:`jaxidl.gap.evidence.samples`).
* p is the effect's prior.
* s is how large a coefficient x may plausibly be, if something is known about it: changes of links
  (:mod:`jaxidl.gap.fit.prior`). What another log says of coefficients counts in the same way.

A set costs one small solve for each block (:mod:`jaxidl.gap.evidence.gram`).
"""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxidl.gap.evidence.delivery import Delivery
from jaxidl.gap.evidence.gram import Gram, Item
from jaxidl.gap.fit.bounded import bounded

RIDGE = 1e-9  # ridge relative to each column's own information
DILUTED = 3  # steps against regression dilution


class Solution(NamedTuple):
    """A fitted set: P coefficients, B blocks, J joints."""

    members: tuple[Item, ...]
    x: Float[np.ndarray, " P"]  # fitted on all training blocks
    folds: Float[np.ndarray, "B P"]  # fitted without one block each
    error: Float[np.ndarray, "B J"]  # sum of squares on each block, fitted without it [noise^2]
    passed: Float[np.ndarray, " J"]  # share of the command's variance that reaches the joint
    value: float

    def of(self, item: Item) -> slice:
        """Return where an item's coefficients are."""
        at = 0
        for m in self.members:
            if m is item:
                return slice(at, at + len(m.lower))
            at += len(m.lower)
        raise KeyError(item.group)


def unconnected(members: Iterable[Item]) -> list[tuple[Item, ...]]:
    """Return the parts of a set that have no joint in common, such as a hand's fingers."""
    parts: list[tuple[set[int], list[Item]]] = []
    for m in members:
        joints, own = set(m.joints), [m]
        rest = []
        for on, part in parts:
            if on & joints:
                joints, own = joints | on, part + own
            else:
                rest.append((on, part))
        parts = [*rest, (joints, own)]
    return [tuple(part) for _, part in parts]


class Score(Gram):
    """The score of sets of a library's items."""

    def __init__(self, *args: Any, **more: Any):
        """Take the arguments of :class:`jaxidl.gap.evidence.gram.Gram`."""
        super().__init__(*args, **more)
        self._solved: dict[frozenset[int], Solution] = {}
        self._quick: dict[frozenset[int], float] = {}
        # scaled coefficients of each column in the set solved last: sets differ by a few members
        self._last = np.full(self.total, np.nan)
        # what :func:`jaxidl.gap.choice.estimates.promise` said so far
        self.promised: dict[Any, dict[int, float]] = {}

    def solve(self, members: Iterable[Item]) -> Solution:
        """Return the set fitted with and without each block, and its score."""
        members = self._ordered(members)
        known = frozenset(map(id, members))
        if known not in self._solved:
            parts = self._parts(members)
            alone = len(parts) < 2
            found = self._solve(members) if alone else self._together(members, parts)
            self._solved[known] = found
        return self._solved[known]

    def quick(self, members: Iterable[Item]) -> float:
        """Return the score if no block were left out: one small solve, not one for each block."""
        members = self._ordered(members)
        known = frozenset(map(id, members))
        if known not in self._quick:
            parts = self._parts(members)
            if len(parts) < 2:
                at = self.indices(members)
                acting = self._acting(at)
                gram, right = self._all_blocks(at, acting, 1)
                x = self._bounded(gram[None], right[None], at)[0]
                found = self._value(members, at, acting, x, self._left(at, x))[0]
            else:
                bare = self.quick(())
                found = bare + sum(self.quick(part) - bare for part in parts)
            self._quick[known] = found
        return self._quick[known]

    def _ordered(self, members: Iterable[Item]) -> tuple[Item, ...]:
        first = lambda i: self.place[id(i)][0] if len(i.lower) else -1
        return tuple(sorted(members, key=first))

    def _parts(self, members: Sequence[Item]) -> list[tuple[Item, ...]]:
        return [] if self.anchor is not None else unconnected(members)

    def _together(self, members: tuple[Item, ...], parts: Sequence[tuple[Item, ...]]) -> Solution:
        """Return the solution of a set whose ``parts`` have no joint in common."""
        bare, at = self.solve(()), self.indices(members)
        x, folds = np.zeros(len(at)), np.zeros((len(bare.folds), len(at)))
        error, passed, value = bare.error.copy(), bare.passed.copy(), bare.value
        for part in parts:
            own = self.solve(part)
            on = sorted({j for m in part for j in m.joints})
            here = np.searchsorted(at, self.indices(own.members))  # members are in this order
            x[here], folds[:, here] = own.x, own.folds
            error[:, on], passed[on] = own.error[:, on], own.passed[on]
            value += own.value - bare.value
        return Solution(members, x, folds, error, passed, value)

    def _solve(self, members: tuple[Item, ...]) -> Solution:
        at = self.indices(members)
        acting, w = self._acting(at), self.weights[:, None]
        gram, right, own = self.normal_equations(at)
        whole, wanted = self._all_blocks(at, acting)
        left = (
            np.concatenate([whole[None], whole - w[:, :, None] * gram]),
            np.concatenate([wanted[None], wanted - w * right]),
        )
        x = self._bounded(*left, at)
        error = np.maximum(self.errors(own, x[1:], slice(len(w))), 0.0)
        value, passed = self._value(members, at, acting, x[0], self.weights @ error)
        return Solution(
            members, x[0] / self.scale[at], x[1:] / self.scale[at], error, passed, value
        )

    def _all_blocks(
        self, at: np.ndarray, acting: Sequence[Delivery], steps: int = DILUTED
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return normal equations (P, P) and (P,) of columns ``at`` on all training blocks."""
        gram, right = self.whole
        gram, right, more = gram[np.ix_(at, at)], right[at], np.zeros(len(at))
        for _ in range(steps if acting else 0):
            x = self._bounded(gram[None], (right + more)[None], at)[0]
            more = self._dilution(x, acting, self._left(at, x))
        return gram, right + more

    def _left(self, at: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Return sums of squares (J,) of scaled coefficients ``x`` (P,) on all training blocks."""
        out = self.weights @ self.square[: len(self.weights)]
        for j, (local, (gram, right)) in enumerate(zip(self.local, self.summed, strict=True)):
            here = np.flatnonzero(local[at] >= 0)
            there, part = local[at[here]], x[here]
            out[j] += part @ (gram[np.ix_(there, there)] @ part - 2.0 * right[there])
        return np.maximum(out, 0.0)

    def errors(self, own: Sequence[Any], x: np.ndarray, blocks: slice) -> np.ndarray:
        """Return sums of squares (B, J) on blocks of scaled coefficients ``x``, (P,) or (B, P)."""
        error = self.square[blocks].copy()
        for j, (here, g, h) in enumerate(own):
            part = x[..., here]
            error[:, j] += np.sum(((g @ part[..., None])[..., 0] - 2 * h) * part, 1)
        return error

    def dilution(self, found: Solution) -> np.ndarray:
        """Return what to add to the right side (P,) of a set's normal equations for its score.

        Least squares make the error small also by making the command small: the log's own command,
        which actuators read, has the residual in it (regression dilution, Fuller 1987). With this
        added, coefficients instead make the error small relative to what arrives of the command.
        """
        at = self.indices(found.members)
        x = found.x * self.scale[at]
        return self._dilution(x, self._acting(at), self._left(at, x)) * self.scale[at]

    def _acting(self, at: np.ndarray) -> list[Delivery]:
        """Return what columns ``at`` (P,) let through, of each joint where some act."""
        return [d for each in self.deliveries if (d := each.among(at, self.total)) is not None]

    def _dilution(self, x: np.ndarray, acting: Sequence[Delivery], left: np.ndarray) -> np.ndarray:
        """Return that right side (P,) of scaled ``x`` (P,) with sums of squares ``left`` (J,)."""
        out = np.zeros(len(x))
        for d in acting:
            share, slope = d.share(x)
            out[d.places] += 0.5 * left[d.joint] * slope / share
        return out

    def _value(
        self,
        members: Iterable[Item],
        at: np.ndarray,
        acting: Sequence[Delivery],
        x: np.ndarray,
        error: np.ndarray,
    ) -> tuple[float, np.ndarray]:
        """Return the score of a set, and how much of each joint's command (J,) it lets through.

        Its columns are ``at`` (P,), its scaled coefficients ``x`` (P,), and its sums of squares on
        the training blocks ``error`` (J,) [noise^2]. The prior and another log are weighted as
        the data are: ``alike`` samples count as one.
        """
        passed, heard = np.ones((2, len(self.which)))
        for d in acting:
            passed[d.joint], heard[d.joint] = d.share(x)[0], d.heard(x)
        count = np.maximum(self.weights @ self.count[: len(self.weights)], 1.0)
        log = lambda square: np.log(np.maximum(square, self.floor))
        said = heard * log(error / count / passed) + (1.0 - heard) * log(self.variance)
        implausible = (0.5 * x @ self._known(at) @ x - self.pull[at] @ x) / self.alike
        value = -0.5 * self.effective @ said + sum(m.odds for m in members) - implausible
        return float(value), passed

    def _bounded(self, gram: np.ndarray, right: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return solutions (F, P) of F normal equations of columns ``at`` (P,)."""
        if not len(at):
            return right
        own, gram = np.diagonal(gram, axis1=1, axis2=2), gram.copy()
        steady = self.prior[at] + RIDGE * own.mean(1, keepdims=True) + RIDGE * own + 1e-12
        gram[:, np.arange(len(at)), np.arange(len(at))] += steady
        lower, upper = self.bounds[0][at], self.bounds[1][at]
        x = bounded(gram, right, lower, upper, self.dead[at], self._last[at])
        self._last[at] = x[0]
        return x

    def likelihood(self, members: Sequence[Item], x: np.ndarray) -> float:
        """Return the score of coefficients ``x`` (P,) of a set on its training blocks."""
        at = self.indices(members)
        scaled = x * self.scale[at]
        return self._value(members, at, self._acting(at), scaled, self._left(at, scaled))[0]

    def covariance(self, found: Solution) -> np.ndarray:
        """Return the covariance (P, P) of coefficients; undetermined ones are as wide as priors."""
        at = self.indices(found.members)
        gram, _, own = self.normal_equations(at)
        known = self._known(at)
        middle = known * self.alike
        for (here, g, _), square in zip(own, self.square_of(found), strict=True):
            middle[np.ix_(here, here)] += g.sum(0) * square
        inside = gram.sum(0) + known
        inside[np.diag_indices(len(at))] += RIDGE * np.diagonal(inside) + 1e-12
        inverse = np.linalg.inv(inside)
        return inverse @ middle @ inverse / self.scale[at, None] / self.scale[at]

    def square_of(self, found: Solution) -> np.ndarray:
        """Return the mean square (J,) of an effective sample of a set's residual [noise^2].

        The floor below which all errors are equal counts once per block.
        """
        blocks = len(self.weights)
        floor = self.floor * self.count[:blocks].sum(0) / blocks
        return found.error.sum(0) / np.maximum(self.effective, 1.0) + floor

    def aside(self, found: Solution) -> np.ndarray:
        """Return sums of squares (A, J) of a set on the A held-out blocks [noise^2]."""
        at, rest = self.indices(found.members), slice(len(self.weights), None)
        error = self.errors(self._own(at, rest), found.x * self.scale[at], rest)
        return np.maximum(error, 0.0)

    def having(self, items: Sequence[Item]) -> "Score":
        """Return the score of these items on the same rows; what both share is kept."""
        return Score(self.rows, items, self.noise, self.effective, self.anchor, self)

    def narrowed(self, items: Sequence[Item]) -> "Score":
        """Return the score of some of the items only; what is known of sets and items is shared."""
        return self._with(items=list(items), whole=self.whole, widths=self.widths)

    def unshared(self, found: Solution) -> "Score":
        """Return the score in which what two logs share keeps the values that it has in a set.

        Without a change the shared effects could move instead, and the error would still be small.
        """
        if self.anchor is None:
            return self
        lower, upper = (bound.copy() for bound in self.bounds)
        for m in self.anchor.items:
            at = self.place[id(m)]
            lower[at] = upper[at] = found.x[found.of(m)] * self.scale[at]
        return self._with(bounds=[lower, upper], _solved={}, _quick={}, promised={})

    def resampled(self, weights: np.ndarray) -> "Score":
        """Return the score with training blocks that count ``weights`` (B,) times."""
        other = self._with(weights=weights, _solved={}, _quick={}, promised={})
        for summed in ("summed", "whole", "widths"):
            other.__dict__.pop(summed, None)
        return other

    def _with(self, **changes: Any) -> "Score":
        other = object.__new__(Score)
        other.__dict__.update({**self.__dict__, **changes})
        return other
