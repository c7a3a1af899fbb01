"""Presliding friction: against Dahl's solution, and hidden in another engine's log."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.gap import diagnose, read, read_model
from jaxidl.gap.benchmark.cases import Case
from jaxidl.gap.benchmark.hidden import Hidden
from tests.helpers.effects import one

LEVEL, DISTANCE = 2.0, 0.05
FRICTION = fx.PreslidingFriction(one(LEVEL), one(DISTANCE))


def along(speed, dt):
    """Torques (T,) along a motion with these speeds (T,) [rad/s]."""

    def step(memory, qd):
        left, memory = FRICTION.actuate(memory, one(0.0), qd[None], one(0.0), dt)
        return memory, left[0]

    return np.asarray(jax.lax.scan(step, FRICTION.start(one(0.0)), jnp.asarray(speed))[1])


def test_it_builds_up_over_a_distance_from_rest_and_after_a_reversal():
    dt, way = 1e-4, 1e-4 * (np.arange(10_000) + 0.5)  # at 1 rad/s
    there, back = np.split(along(np.repeat([1.0, -1.0], 10_000), dt), 2)
    np.testing.assert_allclose(there, LEVEL * np.expm1(-way / DISTANCE), atol=2e-6)
    np.testing.assert_allclose(back, LEVEL * (1.0 - 2.0 * np.exp(-way / DISTANCE)), atol=2e-6)


def test_a_cycle_costs_energy_whatever_the_rate_of_its_samples():
    def lost(rate):
        speed = 0.3 * np.cos(2.0 * np.pi * np.arange(4 * rate) / rate)
        power = along(speed, 1.0 / rate) * speed
        return -np.sum(power[rate:]) / rate

    assert 0.0 < lost(2000) < 3 * LEVEL * 4 * 0.3 / (2.0 * np.pi)  # less than dry friction
    assert lost(100) == pytest.approx(lost(2000), rel=0.02)


def test_its_derivative_at_rest_is_that_of_a_spring():
    torque = lambda qd: FRICTION.actuate(one(0.0), one(0.0), qd, one(0.0), 1e-3)[0][0]
    for d in (jax.jacfwd(torque), jax.jacrev(torque)):
        assert d(one(0.0))[0] == pytest.approx(-LEVEL / DISTANCE * 1e-3 / 2.0)


@pytest.mark.slow
def test_it_is_found_in_a_log_of_another_engine_beside_dry_friction(tmp_path):
    hidden = {
        "presliding_friction": {"level": 0.35, "distance": 0.12},
        "coulomb_friction": {"level": 0.2},
        "viscous_friction": {"coefficient": 0.3},
    }
    parts = tuple(Hidden(name, 0, values) for name, values in hidden.items())
    case = Case("", "pendulum", 5, parts, "clear")
    case.write(tmp_path)
    found = diagnose(read(tmp_path / case.log), read_model(tmp_path / "model.xml"), rollouts=False)
    assert {f.name for f in found.findings if f.confidence > 0.8} == hidden.keys()
    for finding in found.findings:
        for name, estimate in finding.parameters.items():
            assert abs(estimate.value - hidden[finding.name][name]) < 2.0 * estimate.stderr
