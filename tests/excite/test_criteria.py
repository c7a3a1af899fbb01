"""Criteria and their derivatives."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from jaxidl.backend import jit_quickly
from jaxidl.excite.criteria import Contest, separations, standard_errors, t_optimal
from jaxidl.excite.plan import random_start

BOTH = ((0, 1), (1, 0))
CONTEST = Contest((0, 1), ((2, 3), (3, 4)), (1.0,) * 6, BOTH)


@pytest.mark.parametrize(
    "criterion",
    ["d", "t", *(pytest.param(c, marks=pytest.mark.slow) for c in ("a", "condition"))],
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


def test_separation_is_what_the_other_explanation_leaves():
    rng = np.random.default_rng(1)
    a, b, slope = rng.standard_normal((3, 100))
    x = np.stack([a, b, slope])
    contest = Contest((0, 1), ((), (2,)), (1.0, 1.0, 1e6), BOTH)
    left = np.asarray(separations(jnp.asarray(x @ x.T), contest))
    y = a - b
    rest = y - slope * (slope @ y) / (slope @ slope)
    # b with its slope fitted to a; a, which nothing can change, fitted to b
    assert_allclose(left, [rest @ rest, y @ y], rtol=1e-6)


def test_an_explanation_that_imitates_another_is_not_told_apart():
    a = np.random.default_rng(1).standard_normal(50)
    x = np.stack([a, 0.0 * a, 2.0 * a])
    left = separations(jnp.asarray(x @ x.T), Contest((0, 1), ((), (2,)), (1.0, 1.0, 1e6), BOTH))
    assert float(left[0]) < 1e-6 * a @ a


def test_a_pair_that_no_motion_separates_does_not_hide_the_others():
    """Explanations 0 and 1 are equal; 2 differs, and more so on the second motion."""
    a, c = np.random.default_rng(2).standard_normal((2, 50))
    pairs = ((0, 1), (1, 0), (0, 2), (2, 0))
    contest = Contest((0, 1, 2), ((), (), ()), (1.0,) * 3, pairs)
    values = [
        float(t_optimal(jnp.asarray(x @ x.T), contest))
        for x in (np.stack([a, a, a + size * c]) for size in (0.1, 0.2))
    ]
    far = [np.log1p(size**2 * c @ c) for size in (0.1, 0.2)]
    assert_allclose(values, [-0.5 * f for f in far], rtol=1e-9)
