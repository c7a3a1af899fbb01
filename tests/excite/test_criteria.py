"""Criteria and their derivatives."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from jaxidl.backend import jit_quickly
from jaxidl.excite.criteria import Contest, Evidence, separations, standard_errors
from jaxidl.excite.plan import random_start
from jaxidl.gap.choice.rivals import ALIKE, EQUAL

BOTH = ((0, 1), (1, 0))
CONTEST = Contest(
    (0, 1), ((2, 3), (3, 4)), (1.0,) * 6, BOTH, (0.1,), (0.05,), (2.0,), 0.1, 9.0, (20.0,)
)


@pytest.mark.parametrize(
    "criterion",
    ["t", *(pytest.param(c, marks=pytest.mark.slow) for c in ("a", "d", "condition"))],
)
def test_derivatives_forward_reverse_and_numeric_agree(made, criterion):
    plan = replace(made.plan, criterion=criterion, contest=CONTEST)
    rng = np.random.default_rng(3)
    z = 0.7 * random_start(plan, rng)
    way = rng.standard_normal(z.shape) * np.abs(z)
    value = lambda z: plan.judged(z)[0]
    forward = jit_quickly(lambda z, way: jax.jvp(value, (z,), (way,))[1])(z, way)
    reverse = jnp.vdot(jit_quickly(jax.grad(value))(z), way)
    assert float(forward) != 0.0
    assert_allclose(forward, reverse, rtol=1e-7)
    step, run = 1e-5, jit_quickly(value)
    numeric = (run(z + step * way) - run(z - step * way)) / (2.0 * step)
    assert_allclose(forward, numeric, rtol=1e-4)


def test_standard_errors_are_those_of_least_squares():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((200, 3)) * [1.0, 5.0, 0.1]
    true, noise = np.array([1.0, -2.0, 3.0]), 0.3
    fits = [
        np.linalg.lstsq(x, x @ true + noise * rng.standard_normal(200), rcond=None)[0]
        for _ in range(2000)
    ]
    predicted = standard_errors(x.T @ x / noise**2, np.ones(3))
    assert_allclose(np.std(fits, 0), predicted, rtol=0.06)


def seen_of(x, torque=0.0, dt=0.01):
    """Return the evidence of columns (P, T) of one joint."""
    steps = x.shape[1]
    half = np.repeat([torque, -torque], steps // 2)
    return Evidence(dt * (x @ x.T)[None], dt * steps, np.zeros(1), dt * np.array([half @ half]))


def contest(free, left=1.0, floor=1e-6, wide=1e6):
    # a command without a spread: the noise is as usual
    own = (left,), (floor,), (0.0,), 0.1, 10.0, (50.0,)
    return Contest((0, 1), free, (1.0, 1.0, wide), BOTH, *own)


def test_separation_is_what_the_other_explanation_leaves_by_the_gap_finders_score():
    rng = np.random.default_rng(1)
    a, b, slope = rng.standard_normal((3, 100))
    seen = seen_of(np.stack([a, b, slope]))
    apart = separations(seen, contest(((), (2,)), left=0.5))
    y = a - b
    rest = y - slope * (slope @ y) / (slope @ slope)
    # b with its slope fitted to a; a, which nothing can change, fitted to b
    errors = np.array([rest @ rest, y @ y]) / 100
    effective = 50.0 * 1.0
    assert_allclose(apart.score, 0.5 * effective * np.log((0.25 + errors) / 0.25), rtol=1e-6)
    assert_allclose(apart.smooth, apart.score, rtol=1e-6)  # the residual is above the floor


def test_what_is_left_below_the_floor_does_not_count():
    x = np.zeros((3, 100))
    x[0] = 0.1
    free = ((), ())
    for floor, torque in ((1.0, 0.0), (1e-6, 1.0 / 0.003)):  # the encoder's, and the command's
        quiet = separations(seen_of(x, torque), contest(free, 0.9, floor))
        assert_allclose(quiet.score, 0.0, atol=1e-12)
        assert np.all(np.asarray(quiet.smooth) > 0.0)  # and still has a slope
    # more is counted from there on, however long the motion
    heard = separations(seen_of(7.0 * x), contest(free, 0.9, 1.0))
    assert_allclose(heard.score, 0.5 * 50.0 * np.log(0.81 + 0.49), rtol=1e-6)


def test_twice_the_torque_lets_the_filter_pass_twice_the_noise():
    x = np.ones((3, 100))
    x[1:] = 0.0
    usual = contest(((), ()), 0.5, 0.6)._replace(usual=(2.0,))
    one = separations(seen_of(x, 2.0), usual)
    assert_allclose(one.score, 0.5 * 50.0 * np.log(1.25 / 0.36), rtol=1e-6)
    twice = separations(seen_of(2.0 * x, 4.0), usual)  # so nothing is gained
    assert_allclose(twice.score, one.score, rtol=1e-6)
    most = separations(seen_of(2.0 * x, 4.0), usual._replace(most=1.0))  # but at the widest band
    assert_allclose(most.score, 0.5 * 50.0 * np.log(4.25 / 0.36), rtol=1e-6)


def test_what_is_asked_grows_with_the_samples_as_in_the_gap_finder():
    x = np.ones((3, 1000))
    x[1:] = 0.0
    short = separations(seen_of(x[:, :100]), contest(((), ())))
    long = separations(seen_of(x, dt=1.0), contest(((), ())))
    assert_allclose(short.asked, EQUAL)
    assert_allclose(long.asked, ALIKE * 50.0 * 1000.0)


def test_an_explanation_that_imitates_another_is_not_told_apart():
    a = np.random.default_rng(1).standard_normal(50)
    x = np.stack([a, 0.0 * a, 2.0 * a])
    apart = separations(seen_of(x), contest(((), (2,))))
    assert float(apart.score[0]) < 1e-6 * float(apart.score[1])
