"""How far a fit's coefficients move if a joint's torque is logged by a factor too large or small.

No torque constant is known exactly. Where it is wrong and nothing in the set says so, the other
effects take its place: a share of the command, as far as their columns can form it. How wrong it
may be is known beforehand, and the log says the rest: a column of the predicted command is fitted
beside the set. With another log of the same machine as the reference, what both need is off in
both: only what is new counts.
"""

import numpy as np

from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.fit.score import RIDGE, Score, Solution

# every factor within 2 % of the given torque constant is equally likely
SHARE = 0.02 / np.sqrt(3.0)


def swayed(score: Score, found: Solution, rows: Rows, left: np.ndarray) -> np.ndarray:
    """Return the covariance (P, P) of a set's coefficients due to unknown torque constants.

    What motors do to the command is in the log's own torques, and does not move. The ``rows`` are
    those of the score; ``left`` (N, J) [N or Nm] is the set's residual there.
    """
    # what a bound holds, such as the alignment of torques, stays there
    at = score.indices(found.members)
    lower, upper = (bound[at] / score.scale[at] for bound in score.bounds)
    held = lambda bound: np.isclose(found.x, bound, rtol=1e-9, atol=0.0)
    free = ~(held(lower) | held(upper))
    gram, _, known, _ = score.normal(found.members)
    own = gram.sum(0) + known
    own = np.where(np.outer(free, free), own, np.diag(np.diagonal(own)))
    size = np.sqrt(np.maximum(np.diagonal(own), 1e-300))
    own = own / size[:, None] / size + RIDGE * np.eye(len(own))
    joints = range(len(score.noise))
    noise = np.where(score.noise > 1e-150, score.noise, np.inf)  # a joint without a residual
    within = (rows.used & rows.training[:, None]) / noise
    steady = lambda x: np.stack([rows.steady(x[:, j], j) for j in joints], 1)
    # the predicted one: the command itself contains the residual, and would seem to explain it
    torque = SHARE * ((rows.command if score.anchor is None else rows.gap) - left)
    torque, left = steady(torque * within), steady(left * within)
    twice = steady(torque) * within  # weighted like a column, and like what it is fitted to
    right = np.zeros((len(own), len(joints)))
    for m in found.members:
        for k, j in enumerate(m.joints):
            right[found.of(m), j] = m.columns[:, :, k] @ twice[:, j]
    right *= (free / size)[:, None]
    moves = np.linalg.solve(own, right)
    # normal equations of the errors that the set leaves, and their mean square given the log
    information, push = np.diag(np.sum(torque**2, 0)) - right.T @ moves, np.sum(torque * left, 0)
    each = np.sqrt(np.maximum(score.square_of(found), 1e-300))
    spread = np.linalg.inv(information / each[:, None] / each + np.eye(len(each)))
    mean = spread @ (push / each**2)
    constants = spread + np.outer(mean, mean)
    moves /= size[:, None]
    for m in found.members:
        if m.actuates:
            moves[found.of(m)] = 0.0
    return moves @ constants @ moves.T
