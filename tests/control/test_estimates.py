"""Estimates of motion from readings of a known motion."""

import jax
import numpy as np
import pytest

from jaxidl.control import Filtered, FiniteDifference
from tests.helpers.estimates import DT, estimated


def test_filtered_estimates_are_the_truth_a_known_time_ago():
    """A low pass of band f and a difference over the last step are late by 1/(2πf) in all, the
    second difference by dt/2 more.

    A lag wrong by one step would be an error of 6e-3 of the amplitude.
    """
    t, wave = DT * np.arange(2000)[:, None], 2.0 * np.pi * np.array([[1.0, 0.7]])
    motion = estimated(Filtered(80.0, 30.0), np.sin(wave * t), np.zeros((1999, 2)))
    late, later = (t - 1 / (2 * np.pi * 80.0))[1:], (t - 1 / (2 * np.pi * 30.0) - DT / 2)[1:]
    settled = slice(200, None)
    np.testing.assert_array_equal(motion.sensed.q, np.sin(wave * t)[1:])
    np.testing.assert_allclose(
        (motion.sensed.qd / wave)[settled], np.cos(wave * late)[settled], atol=1e-3
    )
    np.testing.assert_allclose(
        (motion.qdd / wave**2)[settled], -np.sin(wave * later)[settled], atol=1e-3
    )


def test_finite_differences_are_those_of_readings_and_of_velocities():
    q, wanted = np.random.default_rng(1).normal(size=(2, 6, 3))
    motion, qd = estimated(FiniteDifference(), q, wanted[1:]), np.diff(q, axis=0) / DT
    np.testing.assert_allclose(motion.sensed.qd, qd, rtol=1e-12)
    np.testing.assert_allclose(
        motion.qdd, np.diff(qd, axis=0, prepend=qd[:1]) / DT, rtol=1e-9, atol=1e-9
    )
    np.testing.assert_array_equal(motion.qdd_desired, wanted[1:])


def test_the_lag_is_a_number_inside_of_jit_too():
    filtered = Filtered(80.0)
    inside = jax.jit(lambda x: x * filtered.lag(1e-3))(2.0)
    assert inside == pytest.approx(2.0 * filtered.lag(1e-3))
    assert filtered.lag(1e-3) == pytest.approx(1e-3 / (1.0 - np.exp(-0.16 * np.pi)) - 5e-4)
