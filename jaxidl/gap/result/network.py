"""A check for a systematic residual that no effect explains.

It tests whether a network still predicts the residual. Trained on some blocks and tested on the
others, a network has position, velocity and acceleration of all joints as inputs. Where it removes
a good part of the residual, something systematic remains. Its hidden layer is random and only the
last one is fitted, by ridge regression (an extreme learning machine; Huang, Zhu and Siew 2006): no
training that could stop too early.
"""

import numpy as np

from jaxidl.gap.evidence.rows import Rows, rms
from jaxidl.gap.fit.held_out import jackknife

FOLDS = 3
HIDDEN = 300
# scale of the random weights, for inputs of unit variance: half of the hidden units each
WIDTHS = (0.3, 1.0)
# relative to the rows; the best on a quarter of the training rows is used
RIDGES = (1e-3, 1e-2, 1e-1)
# share of a joint's residual that the network must remove for it to be called systematic
SYSTEMATIC = 0.25


def check(data: Rows, residual: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Return the share of each joint's residual (N, J) that a network removes.

    It is a share of the root mean square, with its standard error, and measured on blocks that it
    was not trained on, in ``FOLDS`` turns.
    """
    signals, rows = data.signals, data.signals.rows
    x = np.concatenate([signals.q[rows], signals.qd[rows], signals.qdd[rows]], axis=1)
    x = np.clip((x - x.mean(0)) / np.maximum(x.std(0), 1e-12), -4.0, 4.0)
    counted = data.used
    scale = rms(residual, counted)
    y = np.clip(residual / np.maximum(scale, 1e-12), -5.0, 5.0) * counted
    rng = np.random.default_rng(0)
    width = np.repeat(WIDTHS, HIDDEN // len(WIDTHS))
    hidden = np.tanh(x @ (rng.normal(size=(x.shape[1], HIDDEN)) * width) + rng.normal(size=HIDDEN))
    features = np.concatenate([hidden, x, np.ones((len(x), 1))], axis=1)
    predicted, fold = np.zeros_like(residual), np.where(data.block >= 0, data.block % FOLDS, -1)
    for k in range(FOLDS):
        train, asked = (fold >= 0) & (fold != k), fold == k
        predicted[asked] = (
            _predict(features[train], y[train], features[asked], data.block[train]) * scale
        )
    inside = np.arange(data.block.max() + 1)[:, None] == data.block
    before, after = (inside @ (e**2 * counted) for e in (residual, residual - predicted))  # (B, J)
    share = lambda a, b: 1.0 - np.sqrt(a / np.maximum(b, 1e-300))
    value = share(after.sum(0), before.sum(0))
    parts = share(after.sum(0) - after, before.sum(0) - before)
    return tuple(zip(value.tolist(), jackknife(parts).tolist(), strict=True))


def _predict(x: np.ndarray, y: np.ndarray, asked: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Return predictions for rows that the last layer was not fitted to.

    The ridge is the best one for each joint on every fourth block.
    """
    check = block % 4 == 0
    errors = np.stack(
        [np.sum((y[check] - x[check] @ w) ** 2, 0) for w in _weights(x[~check], y[~check])]
    )
    every = np.stack([asked @ w for w in _weights(x, y)])
    return np.take_along_axis(every, errors.argmin(0)[None, None], 0)[0]


def _weights(x: np.ndarray, y: np.ndarray) -> list[np.ndarray]:
    gram, right = x.T @ x, x.T @ y
    return [np.linalg.solve(gram + ridge * len(x) * np.eye(len(gram)), right) for ridge in RIDGES]
