"""A torque that drifts slowly, and a motor constant beside much that no effect explains."""

import numpy as np
import pytest
from scipy.fft import dct

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.gap.evidence.drift import SHORTEST, SLOW, slower, weighted, weights_of
from jaxidl.logs.log import from_arrays
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

DT, SECONDS = 5e-3, 40.0
VISCOUS, DRY = 0.4, 0.3


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("drift") / "model.xml"
    path.write_text(TWO_LINK)
    return read_model(path)


def log(model, strange, scale=1.0):
    """A log with friction, what ``strange`` says of the times (T,), and a motor constant."""
    t = DT * np.arange(round(SECONDS / DT))
    at, size = 2.0 * np.pi * np.array([[0.17, 0.41], [0.23, 0.53]]), np.array([[0.5, 0.3]] * 2)
    wave = lambda k: np.real(
        np.sum(size * (1j * at) ** k * np.exp(1j * (at * t[:, None, None] + size)), 2)
    )
    q, qd, qdd = (wave(k) for k in range(3))
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + VISCOUS * qd + DRY * np.tanh(qd / 0.01)
    draw = np.random.default_rng(0)
    noise = lambda size: size * draw.standard_normal(q.shape)
    return from_arrays(t, q + noise(1e-5), (tau + strange(t)[:, None]) / scale + noise(1e-2))


def test_drift_is_weighted_down_to_what_is_beside_it():
    draw = np.random.default_rng(2)
    white = [draw.standard_normal(2000) for _ in range(40)]
    slow = 3.0 * np.cos(np.pi * np.linspace(0.0, 1.0, 2000)) + 1.0
    assert np.mean([weights_of(x, SECONDS) for x in white]) > 0.8
    for x in white:
        weights = weights_of(x + slow, SECONDS)
        left = dct(weighted(x + slow, weights), norm="ortho")[:2]
        assert np.all(weights[:2] < 0.1)
        assert np.all(np.diff(weights[2:]) >= 0.0)
        assert np.all(np.abs(left) < 4.0)  # of a white component's standard deviation


def test_other_components_stay():
    x = np.cos(3 * SLOW * np.pi * (np.arange(1000) + 0.5) / 1000)
    np.testing.assert_allclose(weighted(x, np.zeros(SLOW + 1)), x, atol=1e-12)


def test_a_short_log_has_none():
    """What changes within seconds is no drift: a pendulum that swings, say."""
    slow = 3.0 * np.cos(np.pi * np.linspace(0.0, 1.0, 2000)) + 1.0
    x = slow + np.random.default_rng(2).standard_normal(2000)
    assert np.all(weights_of(x, 0.9 * SHORTEST) == 1.0)
    assert np.all(weights_of(x, 1.1 * SHORTEST)[:3] < 0.1)
    assert np.all(weights_of(x, 1.1 * SHORTEST)[3:] == 1.0)  # waves of less than that time


def test_a_shorter_time_has_fewer_slow_components():
    weights = np.array([0.1, 0.1, 0.2, 0.4, 0.8])
    np.testing.assert_allclose(slower(weights, 0.5), weights[[0, 2, 4]])
    np.testing.assert_allclose(slower(weights, 1.0), weights)
    np.testing.assert_allclose(slower(weights, 0.0), weights[:1])


@pytest.mark.slow
def test_friction_is_found_beside_drift(model):
    drifting = log(model, lambda t: 1.5 * np.cos(np.pi * t / SECONDS + 0.3))
    found = diagnose(drifting, model, rollouts=False)
    sure = {(f.name, f.joint): f for f in found.findings if f.confidence >= 0.8}
    assert set(sure) == {(n, j) for n in ("viscous_friction", "coulomb_friction") for j in (0, 1)}
    assert sum("slow drift" in note for note in found.notes) == 2
    for (name, _), f in sure.items():
        (value,) = f.parameters.values()
        assert value.value == pytest.approx(VISCOUS if name == "viscous_friction" else DRY, rel=0.1)


def test_a_motor_constant_is_not_diluted(model):
    """What no effect explains is in the command that the motor gets, and makes it no smaller."""
    draw = np.random.default_rng(3)
    wave, phase = draw.uniform(0.7, 2.0, 12), draw.uniform(0.0, 6.0, 12)
    strange = lambda t: 0.3 * np.sin(2.0 * np.pi * wave * t[:, None] + phase).sum(1)
    names = ["viscous_friction", "coulomb_friction", "torque_scale"]
    found = diagnose(log(model, strange, 0.8), model, effects=names, rollouts=False)
    (scale,) = (f for f in found.findings if f.name == "torque_scale")
    assert found.gap.after.torque_relative[scale.joint] > 0.15
    assert scale.parameters["scale"].value == pytest.approx(0.8, abs=0.02)
