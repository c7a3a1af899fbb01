"""Rests of a joint with dry friction: the torque that breaks it away, and what it adds there."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import CoulombFriction, OnJoint
from jaxidl.gap.benchmark.mechanisms import MASSES, MECHANISMS
from jaxidl.gap.evidence.additions import additions
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.logs.log import from_arrays
from jaxidl.logs.rests import withstood
from jaxidl.logs.signals import prepare
from jaxidl.systems.mjcf import read_model

DT, STEPS, FINE = 1e-3, 16_000, 10
LEVEL, DAMPING = 0.8, 3.0  # [N], [N/(m/s)]


@pytest.fixture(scope="module")
def swung():
    """Times, positions and forces of a slider that a swinging force breaks away."""
    mass = MASSES["slider", 0]
    q, qd, step = np.zeros(STEPS), 0.0, DT / FINE
    t = DT * np.arange(STEPS)
    force = 1.6 * LEVEL * np.sin(2.0 * t)
    for k in range(1, STEPS):
        place = q[k - 1]
        for _ in range(FINE):
            net = force[k - 1] - DAMPING * qd
            if qd == 0.0:
                change = np.sign(net) * max(abs(net) - LEVEL, 0.0)
            else:
                change = net - np.sign(qd) * LEVEL
            then = qd + step * change / mass
            qd = 0.0 if then * qd < 0.0 else then
            place += step * qd
        q[k] = place
    read = q + 2e-5 * np.random.default_rng(0).standard_normal(STEPS)
    return t, read[:, None], force[:, None]


def signals(folder, time, q, tau):
    path = folder / "slider.xml"
    path.write_text(MECHANISMS["slider"])
    return prepare(from_arrays(time, q, tau), read_model(path).plant.body)


@pytest.fixture(scope="module")
def rests(swung, tmp_path_factory):
    return signals(tmp_path_factory.mktemp("rests"), *swung)


def test_a_log_that_is_read_at_fewer_instants_has_the_same_rests(rests):
    few = rests.thinned()
    (every,), (some,) = rests.peaks, few.peaks
    assert rests.every > 1
    assert len(every) > 3
    np.testing.assert_array_equal(some[:, 1:], every[:, 1:])
    at, now = every[:, 0].astype(int), some[:, 0].astype(int)
    np.testing.assert_array_equal(few.q[now], rests.q[at])
    assert few.resting[now].all()
    assert np.isin(now, few.rows).all()


@pytest.mark.parametrize(
    ("rate", "kept", "error"),
    [
        (0.5, 1.0, 0.05),
        (2.0, 1.0, 0.05),
        (8.0, 1.0, 0.05),
        (0.5, 0.0, 0.05),
        (2.0, 0.0, 0.1),
        (8.0, 0.0, 0.25),  # the acceleration that the rise adds is taken for the whole of it
    ],
)
def test_the_torque_withstood_is_the_one_that_broke_the_joint_away(rate, kept, error):
    """Not the one at which its motion is seen, which is later and higher.

    The torque rises by ``rate`` [N/s]; a moving joint keeps a share ``kept`` of its friction.
    """
    t, noise, seen = DT * np.arange(STEPS), 2e-5, 1e-4
    broke, mass = LEVEL / rate + 2.0, 2.0
    since = np.maximum(t - broke, 0.0)
    q = (rate * since**3 / 6.0 + (1.0 - kept) * LEVEL * since**2 / 2.0) / mass
    q += noise * np.random.default_rng(1).standard_normal(STEPS)
    torque = rate * np.maximum(t - 2.0, 0.0)
    sight = np.flatnonzero(q > seen)[0]
    assert kept == 0.0 or torque[sight] > 1.05 * LEVEL
    rests, resting = t < t[sight] + 0.2, t < broke - 0.1
    rests[0] = resting[0] = False
    ((last, peak, way, _),) = withstood(rests, resting, torque, q, np.sign(np.gradient(q)), seen, 0)
    assert way == 1.0
    assert t[int(last)] == pytest.approx(broke - 0.1, abs=2.0 * DT)
    assert peak == pytest.approx(LEVEL, rel=error)


def test_a_joint_that_creeps_is_not_at_rest():
    t, seen = DT * np.arange(STEPS), 1e-4
    rests = (t > 1.0) & (t < 3.0)
    found = lambda creeping: withstood(
        rests,
        rests,
        0.1 * t,
        creeping * seen * t + np.maximum(t - 3.0, 0.0),
        0.0 * t + 1.0,
        seen,
        0,
    )
    assert len(found(0.0)) == len(found(0.5)) == 1
    assert len(found(10.0)) == 0


def test_noise_of_the_torque_does_not_add_to_what_is_withstood():
    """The largest of a thousand noisy readings is three standard deviations too large."""
    t, draw, noise = DT * np.arange(STEPS), np.random.default_rng(2), 0.1 * LEVEL
    torque = LEVEL * np.sin(0.7 * t) ** 3
    still = np.abs(torque) < 0.9 * LEVEL
    read = lambda noise: torque + noise * draw.standard_normal(STEPS)
    held = lambda noise: withstood(
        still, still, read(noise), 0.0 * t, np.sign(torque), 1.0, 0, noise
    )[:, 1]
    np.testing.assert_allclose(np.abs(held(0.0)), 0.9 * LEVEL, rtol=0.01)
    np.testing.assert_allclose(np.abs(held(noise)), 0.9 * LEVEL, rtol=0.05)


def test_the_torques_withstood_in_a_motion_are_the_level(rests):
    (held,) = rests.peaks
    assert len(held) >= 4
    np.testing.assert_allclose(held[:, 1] * held[:, 2], LEVEL, rtol=0.05)


def test_at_rest_dry_friction_adds_its_level_and_no_sliding(rests):
    (held,) = rests.peaks
    friction = OnJoint(CoulombFriction(jnp.array([LEVEL])), 0, 1)
    added, _ = additions([friction], rests, rests.tau, rests.tau)
    there = np.searchsorted(rests.rows, held[:, 0].astype(int))
    np.testing.assert_allclose(np.abs(added[0, there, 0]), LEVEL, rtol=1e-6)


def test_a_joint_breaks_away_the_way_it_goes_whatever_the_model_lacks(swung, tmp_path):
    """The wrong weight of a vertical axis may exceed its dry friction."""
    time, q, tau = swung
    weight = 2.5 * LEVEL
    (held,) = signals(tmp_path, time, q, tau + weight).peaks
    assert {*held[:, 2]} == {-1.0, 1.0}
    np.testing.assert_allclose(held[:, 1] - weight, held[:, 2] * LEVEL, rtol=0.05)


def test_where_the_torque_jumps_it_is_not_known_what_broke_the_joint_away():
    """It counts only while the model's torque, and so the torque's sign, is right."""
    t = DT * np.arange(STEPS)
    q = 0.5 * np.clip(t - 4.0, 0.0, 0.9) ** 2 + 0.5 * np.maximum(t - 8.0, 0.0) ** 2
    resting = (t < 3.9) | ((t > 5.0) & (t < 7.9))
    rests = (t < 4.02) | ((t > 4.9) & (t < 8.02))
    rests[0] = resting[0] = False
    # it breaks away slowly at 4 s, and at 8 s within the time in which it is seen to move
    torque = lambda rise: np.where(t < 5.0, 0.1 * t, np.clip((t - 8.0) / rise, -0.1, 1.0))
    found = lambda rise, weight: withstood(
        rests, resting, torque(rise) - weight, q, np.ones(STEPS), 1e-4, 0
    )
    assert len(found(0.01, 0.0)) == 2
    assert len(found(10.0, 2.0)) == 2
    assert len(found(0.01, 2.0)) == 1


def test_a_known_breakaway_counts_even_if_the_joint_withstood_more_the_other_way():
    """With a wrong weight, the torque of the other way says nothing."""
    t = DT * np.arange(STEPS)
    q, rests, resting = 0.5 * np.maximum(t - 4.0, 0.0) ** 2, t < 4.02, t < 3.9
    rests[0] = resting[0] = False
    slow = np.where(t < 2.0, -1.2 * np.sin(np.pi * t / 2.0), 0.2 * (t - 2.0))
    ((_, torque, way, _),) = withstood(rests, resting, slow, q, np.ones(STEPS), 1e-4, 0)
    assert way == 1.0
    assert torque == pytest.approx(0.4, abs=0.01)
    fast = np.where(t < 3.99, slow, np.minimum(0.4 + 40.0 * (t - 3.99), 2.0))
    ((_, torque, *_),) = withstood(rests, resting, fast, q, np.ones(STEPS), 1e-4, 0)
    assert torque == pytest.approx(1.2, abs=0.01)


def test_where_a_joint_moves_at_less_than_it_withstood_that_counts_the_way_it_points():
    """A joint withstands as much either way only about the true weight."""
    t = DT * np.arange(STEPS)
    q, rests, resting = 0.5 * np.maximum(t - 4.0, 0.0) ** 2, t < 4.02, t < 3.9
    rests[0] = resting[0] = False
    jump = lambda before, after: np.where(t < 4.005, before, after)
    found = lambda before, after: withstood(
        rests, resting, jump(before, after), q, np.ones(STEPS), 1e-4, 0
    )[:, 1:]
    np.testing.assert_allclose(found(-1.2, 1.3), [[1.2, 1.0, 0.0]])
    np.testing.assert_allclose(found(-1.2, 0.4), [[-1.2, -1.0, 1.0]])


def test_a_rest_that_nothing_agrees_with_does_not_count(rests):
    rows = rows_of(rests)
    at = np.searchsorted(rests.rows, rests.peaks[0][:, 0])
    left = 0.01 * np.random.default_rng(0).standard_normal(rows.gap.shape)

    def counted(excess):
        left[at, 0] = np.array(excess) * rests.peaks[0][:, 2]
        friction = 0.0 * left
        friction[at, 0] = LEVEL * rests.peaks[0][:, 2]
        return rows.agreeing(left, friction).used[at, 0]

    several = np.full(len(at), 0.8)
    alone = np.where(np.arange(len(at)) == 2, 0.8, 0.0)
    assert counted(several).all()  # it sticks
    np.testing.assert_array_equal(counted(alone), alone == 0.0)
    # it sticks less than it slides; but with friction that pushes it has not broken away
    assert counted(-0.5 * several).all()
    assert not counted(-1.5 * several).any()
