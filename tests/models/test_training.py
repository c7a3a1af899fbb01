"""The trainer's schedule, optimiser and snapshots."""

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from jaxidl.models import ErrorModel, Training, adam, draw_batches, fit, start
from jaxidl.models.training import loss_of, reciprocal
from jaxidl.types import Dataset

MODEL = ErrorModel(
    joints=2, layers=(8, 1), velocity_scale=1.0, acceleration_scale=1.0, torque_scale=1.0
)


def data_of(rows, seed=0):
    rng = np.random.default_rng(seed)
    x = jnp.asarray(rng.normal(size=(rows, 6)))
    return Dataset(x, jnp.asarray(np.asarray(x)[:, :2] * [1.0, -2.0] + 0.5))


def test_held_out_rows_are_6_11_16_and_so_on():
    np.testing.assert_array_equal(np.flatnonzero(~Training().train_mask(22)), [6, 11, 16, 21])


def test_steps_and_snapshots_of_the_study():
    training = Training(epochs=20)
    assert [training.steps(rows) for rows in (1000, 999, 1999)] == [240, 240, 500]
    assert np.flatnonzero(training.snapshots(1999)).tolist() == [0, 250, 499]
    assert np.flatnonzero(training.snapshots(1000)).tolist() == [0, 125, 239]


def test_batches_use_each_row_at_most_once_an_epoch_and_reshuffle():
    training = Training(epochs=3, batch=8)
    batches = np.asarray(draw_batches(jax.random.key(0), 50, training))
    assert batches.shape == (18, 8)
    epochs = batches.reshape(3, 48)
    assert all(len(set(epoch)) == 48 for epoch in epochs.tolist())
    assert not (epochs[0] == epochs[1]).all()


def test_adam_is_the_form_with_epsilon_outside_the_bias_correction():
    rng = np.random.default_rng(1)
    theta, m, v = rng.normal(size=5), np.zeros(5), np.zeros(5)
    optimiser = adam(1e-3)
    params = jnp.asarray(theta)
    state = optimiser.init(params)
    for t in range(1, 6):
        gradient = rng.normal(size=5) * 1e-7  # small, so that epsilon matters
        m, v = 0.9 * m + 0.1 * gradient, 0.999 * v + 0.001 * gradient**2
        theta = theta - 1e-3 * np.sqrt(1 - 0.999**t) / (1 - 0.9**t) * m / (np.sqrt(v) + 1e-8)
        updates, state = optimiser.update(jnp.asarray(gradient), state)
        params = optax.apply_updates(params, updates)
    np.testing.assert_allclose(params, theta, rtol=1e-12)


def fitted(training, rows=200, data=None):
    data = data or data_of(rows)
    learner = start(training, MODEL.init(jax.random.key(2)))
    batches = draw_batches(jax.random.key(3), int(training.train_mask(rows).sum()), training)
    return learner, *jax.jit(lambda *a: fit(MODEL, training, *a))(learner, data, batches)


def test_a_simple_map_is_learned_and_the_weights_stay_float32():
    _, best, progress = fitted(Training(epochs=60, batch=16, learning_rate=1e-2))
    assert progress.loss[-1] < 1e-2 * progress.loss[0]
    assert progress.validation < 2e-2
    assert {leaf.dtype for leaf in jax.tree.leaves(best.params)} == {jnp.dtype("float32")}


def test_the_best_snapshot_is_kept_with_its_optimiser_state():
    # validation rows contradict the training rows, so every step after the first makes validation
    # worse
    training = Training(epochs=5, batch=16, learning_rate=3e-2, snapshot_epochs=1.0)
    data = data_of(200)
    mask = training.train_mask(200)
    start_model = MODEL.init(jax.random.key(2))
    far = MODEL.apply(start_model, data.x.T.astype(jnp.float32)).T
    y = jnp.where(mask[:, None], data.y + 5.0, far)
    _, best, progress = fitted(training, data=Dataset(data.x, y.astype(float)))
    assert int(best.optimiser.count) == 1
    assert jnp.isfinite(progress.validation)


def test_without_a_finite_snapshot_the_learner_comes_back_as_it_was():
    before, best, progress = fitted(
        Training(epochs=1, batch=16), data=Dataset(data_of(200).x, jnp.full((200, 2), jnp.nan))
    )
    assert progress.validation == jnp.inf
    jax.tree.map(np.testing.assert_array_equal, before, best)


def test_reciprocal_is_within_two_units_in_the_last_place_and_differentiable():
    a = jnp.asarray(np.exp(np.random.default_rng(5).uniform(-60, 60, 100_000)), jnp.float32)
    exact = 1 / np.asarray(a, float)
    np.testing.assert_allclose(np.asarray(reciprocal(a), float), exact, rtol=2e-7)
    assert (reciprocal(a.astype(jnp.float64)) == 1 / a.astype(jnp.float64)).all()
    near_one = a[(a > 1e-12) & (a < 1e12)]  # elsewhere the slope leaves float32
    slopes = np.asarray(jax.vmap(jax.grad(reciprocal))(near_one), float)
    np.testing.assert_allclose(slopes, -(np.asarray(near_one, float) ** -2), rtol=1e-6)


def test_the_training_backward_pass_agrees_with_automatic_differentiation():
    model = ErrorModel()
    rng = np.random.default_rng(6)
    params = model.init(jax.random.key(0))
    x, y = (
        jnp.asarray(rng.normal(size=(6, 64)), jnp.float32),
        jnp.asarray(rng.normal(size=(2, 64)), jnp.float32),
    )
    plain, fast = (
        jax.jit(jax.grad(lambda p, fast=fast: loss_of(model, p, x, y, in_training=fast)))(params)
        for fast in (False, True)
    )
    for a, b in zip(jax.tree.leaves(plain), jax.tree.leaves(fast), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-8)


@pytest.mark.parametrize(("dtype", "tolerance"), [(jnp.float64, 1e-9), (jnp.float32, 1e-3)])
def test_fast_training_is_plain_training(dtype, tolerance):
    """96 steps against automatic differentiation and textbook Adam.

    The tolerance is relative to the loss.
    """
    model, training = ErrorModel(layers=(40, 20, 1)), Training(epochs=8, batch=16, holdout_every=0)
    data = data_of(200, seed=7)
    batches = draw_batches(jax.random.key(8), 200, training)
    params = jax.tree.map(lambda leaf: leaf.astype(dtype), model.init(jax.random.key(9)))
    _, progress = jax.jit(lambda *a: fit(model, training, *a))(
        start(training, params), data, batches
    )
    x, y = model.scale_inputs(data.x).astype(dtype).T, (data.y / model.torque_scale).astype(dtype).T

    @jax.jit
    def step(params, m, v, rows, rate):
        loss, g = jax.value_and_grad(lambda p: loss_of(model, p, x[:, rows], y[:, rows]))(params)
        m = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, m, g)
        v = jax.tree.map(lambda v, g: 0.999 * v + 0.001 * g * g, v, g)
        params = jax.tree.map(lambda p, m, v: p - rate * m / (jnp.sqrt(v) + 1e-8), params, m, v)
        return loss, params, m, v

    m = v = jax.tree.map(jnp.zeros_like, params)
    losses = []
    for t, rows in enumerate(batches, start=1):
        rate = dtype(1e-3 * np.sqrt(1 - 0.999**t) / (1 - 0.9**t))
        loss, params, m, v = step(params, m, v, rows, rate)
        losses.append(float(loss))
    assert len(losses) == 96
    np.testing.assert_allclose(progress.loss, losses, rtol=tolerance)


def test_the_error_model_is_differentiable_in_both_modes():
    """Training's own backward pass knows reverse mode only; what users differentiate must know
    both.
    """
    params = MODEL.init(jax.random.key(0))
    x = jnp.asarray(np.random.default_rng(1).normal(size=(6, 5)), jnp.float32)
    forward = jax.jacfwd(lambda x: MODEL.apply(params, x))(x)
    np.testing.assert_allclose(
        forward, jax.jacrev(lambda x: MODEL.apply(params, x))(x), rtol=1e-5, atol=1e-7
    )
