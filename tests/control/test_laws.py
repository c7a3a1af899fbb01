"""Policies and feedback laws against their equations in plain NumPy."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

from jaxidl.control import Doomed, PdPolicy, Pid, PidGains, lqr
from jaxidl.control.policy import double_integrator
from jaxidl.errors import ConfigurationError
from jaxidl.systems import integrate
from jaxidl.types import State

RNG = np.random.default_rng(3)


def test_pd_policy_is_its_equation():
    policy = PdPolicy(jnp.ones(2), 100.0, 10.0)
    np.testing.assert_allclose(
        policy(jnp.array([0.5, 1.0]), jnp.array([1.0, -1.0]), 0), [40.0, 10.0]
    )


def test_pid_and_its_learning_feedback_are_their_equations_step_by_step():
    law = Pid(PidGains(25.0, 2.5, 0.005), PidGains(500.0, 50.0, 0.01), 0.1)
    memory, integral, filtered = law.init(jnp.zeros(2)), np.zeros(2), None
    for _ in range(5):
        q, qd, qs, qds = RNG.normal(size=(4, 2))
        feedback, memory = law.act(
            memory, State(*map(jnp.asarray, (q, qd))), State(*map(jnp.asarray, (qs, qds)))
        )
        e, rate = q - qs, qd - qds
        sample = 500 * e + 50 * rate + 0.01 * e + integral  # the integral from before this step
        filtered = sample if filtered is None else 0.1 * sample + 0.9 * filtered
        integral = integral + 0.005 * e
        np.testing.assert_allclose(feedback.applied, 25 * e + 2.5 * rate + integral, rtol=1e-12)
        np.testing.assert_allclose(feedback.learning, filtered, rtol=1e-12)


def test_doomed_is_its_equations_step_by_step():
    law = Doomed(0.2, 0.5, 0.1)
    memory = law.init(jnp.zeros(2))
    rest = State(jnp.zeros(2), jnp.zeros(2))
    offset, gradient, filtered, given = np.zeros(2), None, None, np.zeros(2)
    for _ in range(5):
        feedback, memory = law.act(memory, rest, rest)
        np.testing.assert_allclose(feedback.applied, offset, rtol=1e-12)
        # what was known before the step
        np.testing.assert_allclose(feedback.learning, given, rtol=1e-12)
        wanted, happened = RNG.normal(size=(2, 2))
        memory = law.observe(memory, jnp.asarray(wanted), jnp.asarray(happened))
        e = happened - wanted
        sample = offset - 0.5 * e
        filtered = given = sample if filtered is None else 0.1 * sample + 0.9 * filtered
        gradient = -0.2 * e if gradient is None else 0.9 * (-0.2 * e) + 0.1 * gradient
        offset = offset + gradient


def riccati_value(gain, a, b, q, r):
    """Cost-to-go of a constant gain, from the Lyapunov equation of its closed loop."""
    closed = a - b @ gain
    return scipy.linalg.solve_discrete_lyapunov(closed.T, q + r * gain.T @ gain)


@pytest.mark.parametrize("costs", [(1.0, 0.0, 1e-4), (100.0, 1.0, 1e-2)])
def test_infinite_horizon_lqr_satisfies_the_riccati_equation(costs):
    position, velocity, effort = costs
    a, b = double_integrator(1e-3)
    policy = lqr(jnp.ones(2), 1e-3, position=position, velocity=velocity, effort=effort)
    gain = np.asarray(policy.gains)
    q = np.diag([position, velocity])
    p = riccati_value(gain, a, b, q, effort)
    right = a.T @ p @ a - a.T @ p @ b @ np.linalg.inv(effort + b.T @ p @ b) @ b.T @ p @ a + q
    np.testing.assert_allclose(p, right, rtol=1e-7)
    np.testing.assert_allclose(gain, (b.T @ p @ a) / (effort + b.T @ p @ b), rtol=1e-6)


def test_finite_horizon_lqr_is_the_least_squares_optimum():
    dt, steps, costs = 0.1, 15, {"position": 2.0, "velocity": 0.3, "effort": 0.05}
    policy = lqr(jnp.zeros(1), dt, horizon=steps, **costs)
    # the same problem as one least-squares problem in all accelerations at once
    a, b = double_integrator(dt)
    x0 = np.array([1.0, -0.5])
    free = np.concatenate([np.linalg.matrix_power(a, k) @ x0 for k in range(1, steps + 1)])
    forced = np.zeros((2 * steps, steps))
    for k in range(steps):
        for j in range(k + 1):
            forced[2 * k : 2 * k + 2, j] = (np.linalg.matrix_power(a, k - j) @ b)[:, 0]
    root = np.sqrt(np.tile([costs["position"], costs["velocity"]], steps))
    tall = np.concatenate([root[:, None] * forced, np.sqrt(costs["effort"]) * np.eye(steps)])
    best = np.linalg.lstsq(tall, np.concatenate([-root * free, np.zeros(steps)]), rcond=None)[0]
    state, applied = State(jnp.array([x0[0]]), jnp.array([x0[1]])), []
    for t in range(steps):
        applied.append(policy(state.q, state.qd, t))
        state = integrate(state, applied[-1], dt)
    np.testing.assert_allclose(np.concatenate(applied), best, rtol=1e-9)


def test_a_long_finite_horizon_starts_as_the_infinite_one():
    finite, infinite = (lqr(jnp.zeros(1), 0.01, effort=0.01, horizon=h) for h in (3000, None))
    np.testing.assert_allclose(finite.gains[0], infinite.gains[0], rtol=1e-9)


@pytest.mark.parametrize(
    "bad", [{"position": 0.0}, {"effort": 0.0}, {"velocity": -1.0}, {"horizon": 0}]
)
def test_impossible_lqr_problems_are_refused(bad):
    with pytest.raises(ConfigurationError):
        lqr(jnp.zeros(1), 0.01, **bad)
