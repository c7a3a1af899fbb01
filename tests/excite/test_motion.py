"""Motions begin and end at rest and keep their limits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from jaxidl.errors import ConfigurationError
from jaxidl.excite.limits import Limits
from jaxidl.excite.motion import KINDS, basis, instants


@pytest.mark.parametrize("kind", KINDS)
def test_motion_begins_and_ends_at_rest_and_its_derivatives_are_right(kind):
    times = instants(8.0, 500.0)
    b = basis(kind, 8.0, 1.5, times)
    for part in b:
        assert_allclose(part[[0, -1]], 0.0, atol=1e-9)
    for low, high in ((b.q, b.qd), (b.qd, b.qdd)):
        inside = slice(2, -2)
        slope = np.gradient(low, times, axis=0)
        assert_allclose(slope[inside], high[inside], atol=2e-3 * np.abs(high).max())
    assert np.linalg.matrix_rank(b.q) == b.q.shape[1]


def test_a_motion_too_short_for_its_frequency_is_refused():
    with pytest.raises(ConfigurationError, match="longer motion"):
        basis("fourier", 1.0, 1.0, instants(1.0, 100.0))
    with pytest.raises(ConfigurationError, match="fourier"):
        basis("fuorier", 9.0, 1.0, instants(9.0, 100.0))


@settings(max_examples=15, deadline=None)
@given(
    lower=st.floats(-3.0, -0.1),
    upper=st.floats(0.1, 3.0),
    start=st.floats(-0.05, 0.05),
    speed=st.floats(0.05, 5.0),
    acceleration=st.floats(0.1, 50.0),
    size=st.floats(1e-3, 1e3),
    kind=st.sampled_from(KINDS),
    seed=st.integers(0, 99),
)
def test_any_coefficients_keep_any_limits(
    made, lower, upper, start, speed, acceleration, size, kind, seed
):
    one = np.ones(2)
    limits = Limits(
        ("a", "b"), lower * one, upper * one, speed * one, acceleration * one, one, start * one
    )
    plan = replace(made.plan, limits=limits, kind=kind)
    z = size * np.random.default_rng(seed).standard_normal((2, plan.basis.q.shape[1]))
    q, qd, qdd, share = (np.asarray(x) for x in plan.motion(z))
    assert q.min() >= lower - 1e-9
    assert q.max() <= upper + 1e-9
    assert np.abs(qd).max() <= speed * (1 + 1e-9)
    assert np.abs(qdd).max() <= acceleration * (1 + 1e-9)
    assert_allclose(q[[0, -1]], start, atol=1e-9)
    assert_allclose(qd[[0, -1]], 0.0, atol=1e-9 * speed)
    if np.all(share < 1.0):  # made smaller no more than needed
        used = [
            (q.max(0) - start) / (upper - start),
            (start - q.min(0)) / (start - lower),
            np.abs(qd).max(0) / speed,
            np.abs(qdd).max(0) / acceleration,
        ]
        assert_allclose(np.max(used, 0), 1.0, rtol=1e-6)
