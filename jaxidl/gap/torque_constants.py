"""How far a fit's coefficients move if a joint's torque is logged by a factor too large or small.

No torque constant is known exactly. Where it is wrong and nothing in the set says so, the other
effects take its place: a share of the command, as far as their columns can form it. With another
log of the same machine as the reference, what both need is off in both: only what is new counts.
"""

import numpy as np

from jaxidl.gap.rows import Rows
from jaxidl.gap.score import RIDGE, Score, Solution

# every factor within 2 % of the given torque constant is equally likely
SHARE = 0.02 / np.sqrt(3.0)


def swayed(score: Score, found: Solution, rows: Rows) -> np.ndarray:
    """Return the covariance (P, P) of a set's coefficients due to unknown torque constants.

    What motors do to the command is in the log's own torques, and does not move.

    Args:
        score: the score of ``rows``.
        found: the set with its P coefficients.
        rows: the rows of the score.
    """
    own = score.normal(found.members)[0].sum(0) + score.known(found.members)[0]
    size = np.sqrt(np.maximum(np.diagonal(own), 1e-300))
    own = own / size[:, None] / size + RIDGE * np.eye(len(own))
    torque = rows.command if score.anchor is None else rows.gap
    noise = np.where(score.noise > 1e-150, score.noise, np.inf)  # a joint without a residual
    torque = SHARE * torque * (rows.used & rows.training[:, None]) / noise**2
    for j in range(torque.shape[1]):  # weighted twice: like a column, and like what it is fitted to
        torque[:, j] = rows.steady(rows.steady(torque[:, j], j), j)
    right = np.zeros((len(own), torque.shape[1]))
    for m in found.members:
        for k, j in enumerate(m.joints):
            right[found.of(m), j] = m.columns[:, :, k] @ torque[:, j]
    moves = np.linalg.solve(own, right / size[:, None]) / size[:, None]
    for m in found.members:
        if m.actuates:
            moves[found.of(m)] = 0.0
    return moves @ moves.T
