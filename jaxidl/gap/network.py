"""The check for what no effect explains: does the paper's error network still predict the remaining residual?

Trained on some blocks and asked on the others, a network of the house (:mod:`jaxidl.models`) sees position, velocity and
acceleration of all joints. Where it removes a good part of the residual, something systematic is left.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.gap.find import jackknife
from jaxidl.gap.library import rms
from jaxidl.gap.rows import Rows
from jaxidl.models import ErrorModel, Training
from jaxidl.models.training import draw_batches, fit, start
from jaxidl.types import Dataset

FOLDS = 3
MODEL = ErrorModel(1, (48, 24, 1), 1.0, 1.0, 1.0, 1.0)
TRAINING = Training(epochs=1, batch=64, learning_rate=3e-3, holdout_every=0, snapshot_epochs=1e9)
STEPS = 1500
SYSTEMATIC = 0.25  # share of a joint's residual that the network must remove for it to be called systematic


class Gain(NamedTuple):
    """Share of a joint's root mean square residual that goes, and its standard error."""

    value: float
    stderr: float


def check(data: Rows, residual: np.ndarray) -> tuple[Gain, ...]:
    """Return what a network removes of each joint's residual (N, J) on blocks that it was not trained on, in ``FOLDS`` turns."""
    signals, rows = data.signals, data.signals.rows
    x = np.concatenate([signals.q[rows], signals.qd[rows], signals.qdd[rows]], axis=1)
    x = (x - x.mean(0)) / np.maximum(x.std(0), 1e-12)
    counted = data.used
    scale = rms(residual, counted)
    y = np.clip(residual / np.maximum(scale, 1e-12), -5.0, 5.0) * counted
    predicted = np.zeros_like(residual)
    fold = np.where(data.block >= 0, data.block % FOLDS, -1)
    fewest = min(int(np.sum((fold >= 0) & (fold != k))) for k in range(FOLDS))
    for k in range(FOLDS):
        train, asked = np.flatnonzero((fold >= 0) & (fold != k))[:fewest], np.flatnonzero(fold == k)
        predicted[asked] = _predict(x[train], y[train], x[asked], k) * scale
    before, after = (_by_block(e, data, counted) for e in (residual, residual - predicted))
    share = lambda a, b: 1.0 - np.sqrt(a / np.maximum(b, 1e-300))  # noqa: E731
    value, parts = share(after.sum(0), before.sum(0)), share(after.sum(0) - after, before.sum(0) - before)
    return tuple(Gain(float(v), float(e)) for v, e in zip(value, jackknife(parts), strict=True))


def _by_block(residual: np.ndarray, data: Rows, counted: np.ndarray) -> np.ndarray:
    """Sums of squares (B, J)."""
    return np.stack([np.sum((residual**2 * counted)[data.block == b], 0) for b in range(data.block.max() + 1)])


def _predict(x: np.ndarray, y: np.ndarray, asked: np.ndarray, seed: int) -> np.ndarray:
    joints = y.shape[1]
    model = ErrorModel(joints, MODEL.layers, 1.0, 1.0, 1.0, 1.0)
    epochs = max(1, round(STEPS * TRAINING.batch / len(x)))
    training = Training(epochs, TRAINING.batch, TRAINING.learning_rate, 0, TRAINING.snapshot_epochs)
    key = jax.random.key(seed)
    learner = start(training, model.init(key))
    data = Dataset(jnp.asarray(x), jnp.asarray(y))
    batches = draw_batches(jax.random.fold_in(key, 1), len(x), training)
    learner, _ = jax.jit(fit, static_argnums=(0, 1))(model, training, learner, data, batches)
    out = jax.jit(model.apply)(learner.params, jnp.asarray(model.scale_inputs(jnp.asarray(asked)).T, jnp.float32))
    return np.asarray(out.T, float)
