"""Criteria for motions: functions of the Gram matrix of its columns, weighted by the noise.

The matrix is Fisher's information of the columns' coefficients. D: the mean logarithm of the
standard errors. A: their mean square, each relative to a size. T: how well the best of several
explanations differs from the others (Atkinson and Fedorov 1975). All are to be minimised, are
logarithms, and can be differentiated.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.gap.choice.rivals import ALIKE, EQUAL
from jaxidl.gap.evidence.rows import LEAST_FLOOR

LEAST = 1e-3  # separation over what is asked below which one is as good as another
ACTS = 1e-4  # share of the noise's mean square from which an explanation acts on a joint
RIDGE = 1e-9  # information that is there at least, as a share of the size's


def scaled(gram: Any, size: Any) -> Any:
    """Return a Gram matrix (P, P) of coefficients in units of ``size`` (P,), never singular."""
    return gram * size[None] * size[:, None] + RIDGE * jnp.eye(len(size))


def d_optimal(gram: Any, size: Any) -> Any:
    """Return the mean logarithm of the standard errors, relative to ``size`` (P,)."""
    factor = jnp.linalg.cholesky(scaled(gram, size))
    return -jnp.mean(jnp.log(jnp.diagonal(factor)))


def a_optimal(gram: Any, size: Any) -> Any:
    """Return half the logarithm of the mean squared relative standard error."""
    factor = jnp.linalg.cholesky(scaled(gram, size))
    inverse = jax.scipy.linalg.solve_triangular(factor, jnp.eye(len(size)), lower=True)
    return 0.5 * jnp.log(jnp.sum(inverse**2) / len(size))


def condition(gram: Any, size: Any) -> Any:
    """Return the logarithm of the regressor's condition number, as conventional designs use it."""
    values = jnp.linalg.eigvalsh(gram * size[None] * size[:, None])
    return 0.5 * (jnp.log(values[-1]) - jnp.log(jnp.maximum(values[0], 1e-300)))


def standard_errors(gram: np.ndarray, size: np.ndarray, least: float = RIDGE) -> np.ndarray:
    """Return standard errors (P,) in the parameters' units.

    ``least`` is the information that there was beforehand, in units of the ``size`` (P,).
    """
    whole = gram * size * size[:, None] + least * np.eye(len(size))
    return size * np.sqrt(np.diagonal(np.linalg.inv(whole)))


class Evidence(NamedTuple):
    """What motions tell about P columns, and the torque that they need; J joints."""

    gram: Any  # (J, P, P) integral over time of the columns' products [(N or Nm)^2 s]
    seconds: Any
    total: Any  # (J,) integral of the torque [N s or Nm s]
    square: Any  # (J,) of its square

    def plus(self, other: "Evidence") -> "Evidence":
        """Return the evidence of both."""
        return Evidence(*(a + b for a, b in zip(self, other, strict=True)))

    def spread(self) -> Any:
        """Return the standard deviation (J,) of the torque [N or Nm]."""
        mean = self.total / self.seconds
        return jnp.sqrt(jnp.maximum(self.square / self.seconds - mean**2, 0.0))


class Contest(NamedTuple):
    """Explanations of one log whose columns are among those of a Gram matrix.

    Explanation k adds the torque of column ``value[k]``; a fit of it may change the coefficients of
    columns ``free[k]``. ``wide`` (P,) is the standard deviation of each coefficient beforehand. The
    rest is what the gap finder judges by: the residual of a good explanation and the floor below
    which errors are equal for the encoder's noise, both of a log whose command had the spread
    ``usual``; and samples that count per second.
    """

    value: tuple[int, ...]
    free: tuple[tuple[int, ...], ...]
    wide: tuple[float, ...]
    pairs: tuple[tuple[int, int], ...]  # which explanation, and which other one is fitted to it
    left: tuple[float, ...]  # (J,) [N or Nm]
    floor: tuple[float, ...]  # (J,) [N or Nm]
    usual: tuple[float, ...]  # (J,) [N or Nm]
    least: (
        float  # factors by which the filter's limits allow the noise to be less or more than then
    )
    most: float
    rate: tuple[float, ...]  # (J,) [1/s]
    asked: tuple[float, ...] = ()  # difference in score that each explanation needs at least


class Apart(NamedTuple):
    """How far apart each of N pairs is, and how far the gap finder asks them to be."""

    score: Any  # (N,) difference of the gap finder's scores, priors aside
    smooth: Any  # (N,) the same with errors below the floor counted, too: it has a slope there
    asked: Any  # (N,) what a smaller difference leaves tied


def separations(seen: Evidence, contest: Contest) -> Apart:
    """Return what is left of each pair's first explanation where its second is fitted to it.

    It is in the terms of :mod:`jaxidl.gap.fit.score`: mean squares over all logs, of which those
    below the floor are equal. A motion that needs more torque raises the floor: the filter's band
    grows until noise is the same share of the command as before (:mod:`jaxidl.logs.low_pass`), and
    a share of the command's spread is in the floor itself.
    """
    spread = seen.spread()
    there = np.flatnonzero((np.array(contest.floor) > 0.0) & (np.array(contest.usual) > 0.0))
    # the band is that of the joint with most noise for its command
    each = spread[there] / np.array(contest.floor)[there]
    usual = np.array(contest.usual)[there] / np.array(contest.floor)[there]
    more = jnp.min(each) / np.min(usual) if len(there) else 1.0
    louder = jnp.clip(more, contest.least, contest.most)
    left = louder * jnp.asarray(contest.left)
    floor = jnp.maximum(louder * jnp.asarray(contest.floor), LEAST_FLOOR * spread)
    floor = jnp.maximum(floor, 1e-300)
    noise, count = jnp.maximum(left, floor), jnp.asarray(contest.rate) * seen.seconds
    gram = jnp.tensordot(jnp.asarray(contest.rate) / noise**2, seen.gram, 1)
    found = []
    for a, b in contest.pairs:
        made, fitted, free = contest.value[a], contest.value[b], np.array(contest.free[b], int)
        wide = jnp.asarray(contest.wide)[free]
        inside = gram[np.ix_(free, free)] * wide[None] * wide[:, None] + jnp.eye(len(free))
        across = wide * (gram[free, made] - gram[free, fitted])
        best = wide * jax.scipy.linalg.solve(inside, across, assume_a="pos")
        at = np.array([made, fitted, *free])
        way = jnp.concatenate([jnp.array([1.0, -1.0]), -best])
        own = seen.gram[:, at[:, None], at]
        rest = jnp.maximum(jnp.einsum("p,jpq,q->j", way, own, way), 0.0) / seen.seconds
        floored = [jnp.maximum(left**2 + x, floor**2) for x in (rest, 0.0)]
        acts = own[:, 0, 0] + own[:, 1, 1] > ACTS * noise**2 * seen.seconds
        found.append(
            (
                0.5 * jnp.sum(count * (jnp.log(floored[0]) - jnp.log(floored[1]))),
                0.5 * jnp.sum(count * jnp.log1p(rest / noise**2)),
                jnp.maximum(
                    contest.asked[a] if contest.asked else 0.0,
                    jnp.maximum(EQUAL, ALIKE * jnp.sum(count * acts)),
                ),
            )
        )
    return Apart(*(jnp.stack(x) for x in zip(*found, strict=True)))


def t_optimal(seen: Evidence, contest: Contest) -> Any:
    """Return the mean logarithm of one plus what is asked over each pair's separation.

    A pair that is far enough apart counts for nothing, and one that no motion separates counts the
    same for every motion.
    """
    apart = separations(seen, contest)
    return jnp.mean(jnp.log1p(1.0 / (apart.smooth / apart.asked + LEAST)))
