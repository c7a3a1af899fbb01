"""Logs whose signs, zeros, units or gravity are not the model's, and logs whose are."""

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.gap.conventions import conventions
from jaxidl.gap.rows import rows_of
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.report import table
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics, tables

DT = 5e-3
T = DT * np.arange(6000)
VISCOUS, DRY = 0.4, 0.3


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("conventions") / "model.xml"
    path.write_text(TWO_LINK)
    return read_model(path)


@pytest.fixture(scope="module")
def motion(model):
    """Positions and torques of the model with friction."""
    at = np.array([[0.9, 1.7], [1.3, 2.1]])
    size = np.array([[0.7, 0.4], [0.5, 0.6]])
    wave = lambda k: np.real(
        np.sum(size * (1j * at) ** k * np.exp(1j * (at * T[:, None, None] + size)), 2)
    )
    q, qd, qdd = wave(0), wave(1), wave(2)
    body = model.plant.body
    return q, inverse_dynamics(body, q, qd, qdd) + VISCOUS * qd + DRY * np.tanh(qd / 0.01), qd, qdd


def read(model, q, tau):
    noise = 1e-5 * np.random.default_rng(0).standard_normal(q.shape)
    rows = rows_of(prepare(from_arrays(T, q + noise, tau), model.plant.body))
    return conventions(rows, model.names)


def test_a_log_as_the_model_has_it_raises_no_doubt(model, motion):
    q, tau, *_ = motion
    assert read(model, q, tau) == []


@pytest.mark.parametrize(
    ("words", "read_as"),
    [
        ("its torque had the opposite sign", lambda q, tau, j: (q, np.where(j, -tau, tau))),
        (
            "its position and torque had the opposite sign",
            lambda q, tau, j: (np.where(j, -q, q), np.where(j, -tau, tau)),
        ),
        ("90° had to be added", lambda q, tau, j: (q - np.pi / 2 * j, tau)),
        ("-90° had to be added", lambda q, tau, j: (q + np.pi / 2 * j, tau)),
        ("180° had to be added", lambda q, tau, j: (q + np.pi * j, tau)),
    ],
)
@pytest.mark.parametrize("joint", [0, 1])
def test_a_joint_that_is_read_the_wrong_way_is_found(model, motion, words, read_as, joint):
    q, tau, *_ = motion
    (said,) = read(model, *read_as(q, tau, np.arange(2) == joint))
    assert f"{model.names[joint]} reads as if {words}" in said


def test_gravity_the_other_way_round_or_none_is_found(model, motion):
    q, tau, *_ = motion
    still = np.zeros_like(q)
    weight = inverse_dynamics(model.plant.body, q, still, still)
    (said,) = read(model, q, tau - weight)
    assert "the torques that carry the weight had been left out" in said
    (said,) = read(model, q, tau - 2.0 * weight)
    assert "the base hung upside down" in said
    assert "shoulder reads as if 180° had to be added" in said  # in a plane, the same


@pytest.mark.parametrize(
    ("words", "read_as"),
    [
        ("torques had to be multiplied by 1000", lambda q, tau: (q, 1e-3 * tau)),
        ("torques had to be multiplied by 0.1", lambda q, tau: (q, 10.0 * tau)),
        ("positions were in degrees", lambda q, tau: (np.rad2deg(q), tau)),
    ],
)
def test_another_unit_is_found(model, motion, words, read_as):
    (said,) = read(model, *read_as(*motion[:2]))
    assert said.startswith("the log reads as if ")
    assert words in said


def test_an_inertia_error_of_the_model_raises_no_doubt(model, motion):
    q, tau, qd, qdd = motion
    body = model.plant.body
    of_elbow = tables(body, q, qd, qdd).by_mass[:, :, 1]
    assert read(model, q, tau + 1.5 * of_elbow) == []


def test_the_doubt_is_the_first_that_is_said(model, motion):
    q, tau, *_ = motion
    found = diagnose(
        from_arrays(T, q, tau * [1.0, -1.0]), model, effects=["viscous_friction"], rollouts=False
    )
    assert "sign" in found.notes[0]
    assert found.summary.startswith("First of all")
    assert "First of all" in table(found).split(". ")[1]


def test_a_load_that_is_gone_raises_no_doubt_where_friction_explains_the_torque(model, motion):
    # with torques ten times as large, the error of the load would only look ten times smaller
    q, tau, qd, _ = motion
    friction = VISCOUS * qd + DRY * np.tanh(qd / 0.01)
    size = 2.0 * np.std(tau - friction, axis=0) / np.std(friction, axis=0)
    assert read(model, q, size * friction) == []
