"""Fits of the shapes of effects: speeds, periods, delays ... of those that a search chose.

Effects are fitted one after the other: what the other members can imitate is projected out of what
an effect adds and of its derivatives (variable projection, Golub and Pereyra 1973); bounded least
squares then change all of its free parameters. Members that its shape can take up are left out, as
the search will leave them out: a spring's rest position takes up an offset. What the encoder's
noise alone contributes does not count (:mod:`jaxidl.gap.evidence.noise`).

An effect that jumps responds roughly to its parameters: with a little more backlash each contact
comes later, or not at all. Such a fit follows the mean response to parameters around, first far
apart and then closer, and large errors, such as of a contact at the wrong moment, count less.

Effects of a motor act one behind the other, each on the command that those before it deliver. The
catalogue has them in the order in which a command passes them. A part of an effect does not come
before it: it takes its place, as a gear's elasticity does of its play.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from jaxidl.effects import place_of
from jaxidl.gap.evidence.additions import additions
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.items import columns_of, item, part
from jaxidl.gap.evidence.noise import accelerates, read_again
from jaxidl.gap.evidence.projection import Projection
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import (
    Shape,
    amplitudes,
    at_parameters,
    effect_at,
    limits,
    on_bound,
    vector,
)
from jaxidl.gap.fit.library import pushed, residual
from jaxidl.gap.fit.score import Score, Solution

EVALUATIONS = 20
CLEAR = 2.0  # rise of the log likelihood
PULLS = (30.0, 3.0)  # pulls towards the start of a fit, in units of one effective sample
TINY = np.finfo(float).tiny
# relative size of a fit's last step, which is at least that share of a difference's step
FINEST, RESOLVED = 1e-4, 0.01
SMOOTH = (1e-4,)  # relative steps of a parameter for differences; a fit for each of them
ROUGH = (0.2, 0.05)  # where an effect jumps
LEAST_SCALE = 1e-3  # least size of a large error, in units of the noise


class Tangent(NamedTuple):
    """The torque that an effect adds at parameters theta (P,), and its derivatives."""

    value: np.ndarray  # (N, J) [N or Nm]
    columns: np.ndarray  # (P, N, J)


def fitted(m: Item, found: Solution, rows: Rows, predicted: np.ndarray, score: Score) -> Item:
    """Return a member with its shape fitted beside the other members of a set.

    What a reference log knows stays what it is: free, it would imitate what has changed.
    """
    known = () if score.anchor is None else score.anchor.items
    free = [o for o in found.members if o not in known and o is not m and not taken_up(o, m)]
    beside = Projection(rows, free, score.noise, m.joints)
    gap = residual(rows, found, [o for o in found.members if o in known])

    def projected(x: np.ndarray) -> np.ndarray:
        """Return stacked rows of (P, N, J) that the others cannot imitate (sum of N, P)."""
        return np.concatenate([beside.left(x[:, :, j], j) for j in m.joints], 1).T

    wanted = projected(gap[None])[:, 0]
    shape, tried = m.shape, {}
    steps = steps_of(shape)
    noise_alone = NoiseAlone(m, found, rows, predicted, score) if accelerates(shape) else None

    def missed(theta: np.ndarray, step: float = steps[-1]) -> tuple[np.ndarray, np.ndarray]:
        """Return what is left (M,) at theta (P,), in units of the noise, and derivatives (M, P)."""
        key = theta.tobytes(), step
        if key not in tried:
            t = tangent(shape, theta, rows, predicted, step)
            left, slopes = wanted - projected(t.value[None])[:, 0], -projected(t.columns)
            if noise_alone is not None:
                spared, slope = noise_alone.spared(theta, t)
                left, slopes = np.append(left, spared), np.append(slopes, slope[None], axis=0)
            tried[key] = left, slopes
        return tried[key]

    lower, upper = limits(shape)
    # without amplitudes: scaled, or as it is, which may be a fit beside other members
    share = found.x[found.of(m)]
    starts = [np.clip(vector(shape, x), lower, upper) for x in (share, np.ones_like(share))]
    starts = starts[:1] if shape.free else starts
    start = min(starts, key=lambda x: float(np.sum(missed(x, steps[0])[0] ** 2)))
    inside = 1e-6 * np.maximum(np.abs(start), 1e-6)
    begin = np.clip(start, lower + inside, upper - inside)

    def minimum(first: np.ndarray, pull: np.ndarray, step: float = steps[-1]) -> np.ndarray:
        """Return the best parameters from ``first``, with a ``pull`` (Q, P) back to the start."""
        left, slopes = missed(first, step)
        typical = 1.4826 * float(np.median(np.abs(left)))
        # in units of which each parameter changes the residual by one
        unit = 1.0 / np.where(np.any(slopes, 0), np.linalg.norm(slopes, axis=0), 1.0)
        return (
            unit
            * least_squares(
                lambda x: np.append(missed(unit * x, step)[0], pull @ (unit * x - begin)),
                first / unit,
                lambda x: np.concatenate([missed(unit * x, step)[1], pull]) * unit,  # pyright: ignore[reportArgumentType]
                (lower / unit, upper / unit),
                x_scale="jac",
                max_nfev=EVALUATIONS,
                ftol=1e-5,
                xtol=max(FINEST, RESOLVED * step),
                loss="soft_l1" if shape.cls.jumps else "linear",
                f_scale=max(typical, LEAST_SCALE) if shape.cls.jumps else 1.0,
            ).x
        )

    best = begin
    for step in steps:
        inner = np.clip(best, lower + inside, upper - inside)
        best = minimum(inner, np.zeros((0, len(begin))), step)
    if on_bound(shape, best):  # what the log does not determine stays near its start
        offset = 0.0 if noise_alone is None else noise_alone.most
        square = lambda theta: float(np.sum(missed(theta)[0] ** 2)) - offset
        least = sum(beside.use[:, j].sum() * score.floor[j] for j in m.joints)
        alike = max(score.effective[list(m.joints)].sum(), 1.0)
        good = max(square(best) * (1.0 + 2.0 * CLEAR / alike), least)
        free = np.arange(len(begin)) >= amplitudes(shape)
        unit = np.sqrt(good / alike) * np.diag(free / np.maximum(np.abs(begin), 1e-300))[free]
        pulled = (minimum(begin, pull * unit) for pull in PULLS)
        best = next((theta for theta in pulled if square(theta) <= good), best)
    return seen_from(m, at_parameters(shape, best), rows, predicted)


def arriving(
    at: Item, members: Sequence[Item], x: Sequence[np.ndarray], rows: Rows, predicted: np.ndarray
) -> Rows:
    """Return the rows with the command that ``members`` before a motor's effect deliver to it."""
    tau = rows.tau
    motors = [
        (place_of(m.key[0]), effect_at(m.shape, vector(m.shape, own)))
        for m, own in zip(members, x, strict=True)
        if at.actuates and m.actuates and set(m.joints) & set(at.joints) and not part(m, at)
    ]
    for place, effect in sorted(motors, key=lambda motor: motor[0]):
        if place < place_of(at.key[0]):
            _, tau = additions([effect], rows.signals, tau, predicted)
    return rows if tau is rows.tau else rows._replace(tau=tau)


def seen_from(m: Item, shape: Shape, rows: Rows, predicted: np.ndarray) -> Item:
    """Return a member with another ``shape``, or on other ``rows``.

    One that does nothing there stays what it was, and the search will drop it.
    """
    fresh = item(shape, *columns_of([shape], rows, predicted))
    return pushed([fresh], rows, predicted)[0] if fresh.joints else m


def taken_up(o: Item, m: Item) -> bool:
    """Return whether a member's shape takes up another one, which its amplitudes cannot."""
    by_amplitude = {name for name, _ in m.shape.parts}
    return o.key[1] == m.key[1] and part(o, m) and o.key[0] not in by_amplitude


class NoiseAlone:
    """What noise alone contributes to the residual beside an effect, by the effect's parameters.

    The root of ``most`` minus that contribution is one more residual: the sum of squares is then
    the compensated one, plus ``most``.
    """

    def __init__(self, m: Item, found: Solution, rows: Rows, predicted: np.ndarray, score: Score):
        """Read the log once more; the other members of the set ``found`` stay what they are."""
        self.shape, self.again, self.predicted = m.shape, read_again(rows), predicted
        weights = rows.used * rows.training[:, None] / np.maximum(score.noise, 1e-300)
        on = np.isin(np.arange(rows.gap.shape[1]), m.joints)
        self.weights = weights * on  # (N, J)
        self.alone = self.again.gap - rows.gap
        for o in found.members:
            if o is not m and accelerates(o.shape):
                (columns,) = columns_of([o.shape], self.again, predicted)
                change = columns[:, :, list(o.joints)] - o.columns
                self.alone[:, list(o.joints)] -= np.tensordot(found.x[found.of(o)], change, 1)
        self.most = 2.0 * float(np.sum((self.alone * self.weights) ** 2))

    def spared(self, theta: np.ndarray, t: Tangent) -> tuple[float, np.ndarray]:
        """Return that residual at theta (P,), where ``t`` is the tangent, and its slope (P,)."""
        again = tangent(self.shape, theta, self.again, self.predicted)
        noise = (self.alone - again.value + t.value) * self.weights
        slope = np.tensordot((t.columns - again.columns) * self.weights, noise, 2)
        spared = max(self.most - float(np.sum(noise**2)), 1e-6 * self.most, TINY)
        return np.sqrt(spared), -slope / np.sqrt(spared)


def steps_of(shape: Shape) -> tuple[float, ...]:
    """Return relative steps of parameters for differences, from coarse to fine."""
    return ROUGH if shape.cls.jumps else SMOOTH


def tangent(
    shape: Shape, theta: np.ndarray, rows: Rows, predicted: np.ndarray, step: float | None = None
) -> Tangent:
    """Return what an effect adds at its parameters, and differences by a relative ``step``.

    Where the effect jumps, it is the mean at these parameters and at those around.
    """
    lower, upper = limits(shape)
    relative = steps_of(shape)[-1] if step is None else step
    size = np.maximum(relative * np.abs(theta), 1e-7 * np.max(np.abs(theta), initial=0.0) + 1e-12)
    ahead, behind = np.minimum(theta + size, upper), np.maximum(theta - size, lower)
    if not shape.cls.jumps:  # one side is enough
        ahead, behind = np.where(theta + size <= upper, ahead, behind), theta
    ends = [ahead, behind] if shape.cls.jumps else [ahead]
    around = [theta, *(one for end in ends for one in theta + np.diag(end - theta))]
    added = rows.added([effect_at(shape, one) for one in around], predicted)
    here, there, back = added[:1], added[1 : len(theta) + 1], added[len(theta) + 1 :]
    value, back = (added.mean(0), back) if shape.cls.jumps else (here[0], here)
    return Tangent(value, (there - back) / (ahead - behind)[:, None, None])
