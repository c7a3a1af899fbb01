"""Moments of a log in which something acted that is no property of the robot."""

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.moments import SELDOM, moments, strange
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.point import point_mass
from jaxidl.systems.tables import inverse_dynamics

DT, RUN = 5e-3, 4000
T = DT * np.arange(2 * RUN)
NAMES, UNITS = ("a", "b"), ("N", "N")


@pytest.fixture(scope="module")
def rows():
    q = np.stack([np.sin(2.1 * T) + 0.5 * np.sin(5.3 * T), np.cos(1.7 * T)], 1)
    tau = np.stack([np.cos(2.1 * T), np.sin(1.7 * T)], 1)
    time = T + 100.0 * (np.arange(2 * RUN) >= RUN)  # two runs
    return rows_of(prepare(from_arrays(time, q, tau), point_mass(1.0)))


@pytest.fixture
def residual(rows):
    return 0.01 * np.random.default_rng(0).standard_normal(rows.gap.shape)


def found_in(rows, left, items=()):
    """The moments that stand out where ``items`` have to explain ``left`` (N, J)."""
    return strange(rows._replace(gap=left), items, np.ones(2), 1.0)


def test_a_hit_is_left_out_and_said_with_its_time(rows, residual):
    since = (rows.signals.rows - rows.signals.slices[1].start) * rows.signals.dt  # [s]
    hit = np.abs(since - 7.5) < 0.15
    residual[hit, 0] = 1.0
    found = found_in(rows, residual)
    assert found[hit].all()
    assert not found[np.abs(since - 7.5) > 0.3].any()
    without = rows.without(found)
    assert not without.used[found].any()
    (sentence,) = moments(without, residual, NAMES, UNITS)
    assert sentence.startswith("at 7.5 s of run 2 (a, up to 1 N)")
    np.testing.assert_array_equal(found_in(without, residual), found)


def test_each_moment_is_said_once(rows, residual):
    """Two pieces that follow each other closely are one."""
    at = rows.signals.rows * rows.signals.dt
    for middle, half in ((3.0, 0.1), (3.3, 0.05), (9.0, 0.1)):
        residual[np.abs(at - middle) < half, 1] = 1.0
    without = rows.without(found_in(rows, residual) & (np.abs(at - 3.17) > 0.03))
    (sentence,) = moments(without, residual, NAMES, UNITS)
    assert sentence.count(" (b, up to 1 N)") == 2
    assert sentence.startswith("at 3.1 s of run 1 (b, up to 1 N), at 9.0 s of run 1")


@pytest.mark.parametrize(
    ("size", "share", "why"),
    [(0.1, 0.01, "a small part of the command"), (1.0, 1.2 * SELDOM, "there too often")],
)
def test_what_is_small_or_often_stays(rows, residual, size, share, why):
    count = round(share * len(residual))
    residual[300 : 300 + count, 0] = size
    assert not found_in(rows, residual).any(), why
    assert moments(rows, residual, NAMES, UNITS) == []


def test_what_comes_with_the_motion_stays(rows):
    speed = np.abs(rows.signals.qd[rows.signals.rows])
    fast = speed > np.quantile(speed, 0.8, axis=0)
    assert not found_in(rows, fast.astype(float)).any()


def test_a_hit_does_not_hide_behind_an_effect_that_seems_to_explain_it(rows, residual):
    """It is seven tenths of a joint's torque for a second: least squares alone call it friction."""
    at, speed = rows.signals.rows, rows.signals.qd[rows.signals.rows, 0]
    bump = lambda middle: np.exp(-(((rows.signals.q[at, 0] - middle) / 0.2) ** 2))
    columns = np.stack([speed, *(bump(middle) for middle in np.linspace(-1.4, 1.4, 12))])
    free = np.full(len(columns), np.inf)
    item = Item(("friction", 0, ""), None, (0,), columns[:, :, None], -free, free, 0.0, 0.0 / free)
    hit = np.abs(at * rows.signals.dt - 7.5) < 0.5
    residual[:, 0] += 0.05 * speed
    residual[hit, 0] += 0.5
    found = found_in(rows, residual, [item])
    assert found[hit].mean() > 0.9
    assert found[~hit].mean() < 0.02
    assert not found_in(rows, residual - hit[:, None] * [0.5, 0.0], [item]).any()


@pytest.mark.slow
def test_a_collision_does_not_change_what_is_found(tmp_path):
    """Friction is found as without it, and no motor is blamed."""
    path = tmp_path / "model.xml"
    path.write_text(TWO_LINK)
    model, time = read_model(path), 4e-3 * np.arange(7500)
    at, size = np.array([[0.9, 1.7], [1.3, 2.1]]), np.array([[0.7, 0.4], [0.5, 0.6]])
    q, qd, qdd = (
        np.real(np.sum(size * (1j * at) ** k * np.exp(1j * (at * time[:, None, None] + size)), 2))
        for k in range(3)
    )
    draw = np.random.default_rng(1).standard_normal((2, *q.shape))
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + 0.4 * qd + 0.3 * np.tanh(qd / 0.01)
    hit = np.abs(time - 9.3) < 0.1
    struck = tau + 20.0 * hit[:, None] * [1.0, 0.4]
    names = ["viscous_friction", "coulomb_friction", "torque_curve", "torque_saturation"]
    quiet, loud = (
        diagnose(
            from_arrays(time, q + 1e-5 * draw[0], torque + 0.02 * draw[1]),
            model,
            effects=names,
            rollouts=False,
        )
        for torque in (tau, struck)
    )
    keys = lambda found: {(f.name, f.joint) for f in found.findings}
    assert keys(quiet) == keys(loud)
    value = lambda found: {
        (f.name, f.joint): p.value for f in found.findings for p in f.parameters.values()
    }
    assert value(loud) == pytest.approx(value(quiet), rel=0.03)
    assert [n for n in loud.notes if n.startswith("at 9.3 s (")]
    assert not [n for n in quiet.notes if "left out" in n]
