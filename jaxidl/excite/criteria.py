"""What makes a motion good: functions of the Gram matrix of its columns, weighed with the noise.

The matrix is Fisher's information of the columns' coefficients. D: the mean logarithm of the
standard errors. A: their mean square, each relative to a size. T: how well the best of several
explanations differs from the others (Atkinson and Fedorov 1975). All are to be minimised, are
logarithms, and can be differentiated.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

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


class Contest(NamedTuple):
    """Explanations of one log whose columns are among those of a Gram matrix.

    Explanation k adds the torque of column ``value[k]``; a fit of it may change the coefficients of
    columns ``free[k]``. ``wide`` (P,) is the standard deviation of each coefficient beforehand.
    """

    value: tuple[int, ...]
    free: tuple[tuple[int, ...], ...]
    wide: tuple[float, ...]
    pairs: tuple[tuple[int, int], ...]  # which explanation, and which other one is fitted to it


def separations(gram: Any, contest: Contest) -> Any:
    """Return what is left of each pair's first explanation where its second is fitted to it.

    It is the squared residual over the noise's variance: twice the difference of log likelihoods.
    """
    found = []
    for a, b in contest.pairs:
        made, fitted, free = contest.value[a], contest.value[b], np.array(contest.free[b], int)
        wide = jnp.asarray(contest.wide)[free]
        inside = gram[np.ix_(free, free)] * wide[None] * wide[:, None] + jnp.eye(len(free))
        across = wide * (gram[free, made] - gram[free, fitted])
        whole = gram[made, made] + gram[fitted, fitted] - 2.0 * gram[made, fitted]
        best = jax.scipy.linalg.solve(inside, across, assume_a="pos")
        found.append(whole - across @ best)
    return jnp.stack(found)


def t_optimal(gram: Any, contest: Contest) -> Any:
    """Return minus the mean logarithm of the separations.

    Pairs that no motion separates do not hide the others, and those that are far apart already
    count for little.
    """
    return -jnp.mean(jnp.log1p(jnp.maximum(separations(gram, contest), 0.0)))
