"""Effects with a hidden state, and those of the sensor, against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxidl.effects as fx
from tests.helpers.effects import DT, one, run


def delivered(effect, tau):
    """The torques (T,) that act on a mass on one axis, from its motion."""
    qd = run([effect], tau, mass=1.0)[1]
    return np.diff(qd) / DT


PULSES = np.array([0.0, 1.0, 3.0, -2.0, 0.5, 0.0, 4.0, 1.0, 0.0, 0.0])


def test_scale_and_saturation_change_the_delivered_torque():
    np.testing.assert_allclose(
        delivered(fx.TorqueScale(one(0.8)), PULSES), 0.8 * PULSES, atol=1e-11
    )
    np.testing.assert_allclose(
        delivered(fx.TorqueSaturation(one(1.5)), PULSES), np.clip(PULSES, -1.5, 1.5), atol=1e-11
    )


def test_lag_answers_a_step_exponentially_whatever_the_step_size():
    wanted = 3.0 * (1.0 - np.exp(-DT / 0.02 * np.arange(1, 101)))
    np.testing.assert_allclose(
        delivered(fx.ActuatorLag(one(0.02)), np.full(100, 3.0)), wanted, rtol=1e-9
    )


@pytest.mark.parametrize("steps", [0, 1, 3, 6])
def test_dead_time_of_whole_steps_is_a_shift(steps):
    late = np.concatenate([np.zeros(steps), PULSES])[: len(PULSES)]
    np.testing.assert_allclose(
        delivered(fx.ActuatorDelay(one(steps * DT), steps=6), PULSES), late, atol=1e-5
    )


def test_dead_time_between_steps_interpolates():
    t = np.arange(len(PULSES))
    wanted = np.interp(t - 2.25, t, PULSES, left=0.0)
    np.testing.assert_allclose(
        delivered(fx.ActuatorDelay(one(2.25 * DT), steps=4), PULSES), wanted, atol=1e-11
    )


@pytest.mark.parametrize("steps", [3.0, 4.6])
def test_a_late_sensor_reads_past_positions_and_can_be_put_right(steps):
    effect, t = fx.SensorDelay(one(steps * DT), steps=8), DT * np.arange(801)
    tau = 30.0 * np.cos(9.0 * t[:-1])
    q, _, reading, _ = run([effect], tau, q=0.2)
    np.testing.assert_allclose(reading, np.interp(t - steps * DT, t, q), atol=1e-12)
    again = np.asarray(effect.true_position(jnp.asarray(reading)[:, None], DT))[:, 0]
    # what interpolation cuts off
    np.testing.assert_allclose(again[10:-10], q[10:-10], atol=0.25 * np.abs(np.diff(q, 2)).max())
    np.testing.assert_array_equal(q, run([], tau, q=0.2)[0])


def test_position_bias_is_read_and_taken_off_again():
    effect = fx.PositionBias(one(0.3))
    q, _, reading, _ = run([effect], PULSES, q=0.1)
    np.testing.assert_allclose(reading, q + 0.3)
    np.testing.assert_allclose(effect.true_position(jnp.asarray(reading)[:, None], DT)[:, 0], q)


@pytest.mark.parametrize("steps", [0.4, 2.0, 3.7])
def test_positions_between_samples_follow_a_cubic(steps):
    cubic = lambda t: 0.3 - 2.0 * t + 5.0 * t**2 - 40.0 * t**3
    t = DT * np.arange(40.0)
    found = fx.SensorDelay(one(steps * DT), steps=6).true_position(
        jnp.asarray(cubic(t))[:, None], DT
    )
    np.testing.assert_allclose(found[2:-6, 0], cubic(t + steps * DT)[2:-6], atol=1e-12)


STIFF = {"stiffness": one(900.0), "damping": one(3.0), "motor_inertia": one(0.5)}


def test_a_spring_between_motor_and_held_link_twists_by_torque_over_stiffness():
    q, _, _, ((twist, speed), _) = run(
        [fx.JointElasticity(**STIFF), fx.CoulombFriction(one(50.0))], np.full(4000, 9.0)
    )
    np.testing.assert_allclose(q, 0.0, atol=1e-12)
    assert twist[-1, 0] == pytest.approx(9.0 / 900.0, rel=1e-4)
    assert speed[-1, 0] == pytest.approx(0.0, abs=1e-4)


def test_motor_and_link_swing_against_each_other_at_their_resonance():
    effect = fx.JointElasticity(one(900.0), one(0.02), one(0.5))
    # a blow, then it rings
    q, _, _, ((twist, _),) = run([effect], np.where(np.arange(4000) < 5, 20.0, 0.0), dt=5e-4)
    twist = np.asarray(twist)[50:, 0]
    at = np.flatnonzero((twist[:-1] < 0.0) & (twist[1:] >= 0.0))
    crossing = at - twist[at] / (twist[at + 1] - twist[at])
    omega = 2.0 * np.pi / (np.diff(crossing).mean() * 5e-4)
    assert omega == pytest.approx(np.sqrt(900.0 * (1.0 / 0.5 + 1.0 / 1.5)), rel=0.02)
    assert len(crossing) > 10
    momentum = 20.0 * 5 * 5e-4
    # and together they are the rigid mass
    assert (q[-1] - q[2000]) / 1.0 == pytest.approx(momentum / 2.0, rel=0.05)


def test_a_stiff_transmission_is_a_rigid_one():
    tau = 5.0 * np.sin(np.linspace(0.0, 12.0, 2000))
    rigid = run([], tau)[0]
    joined = lambda k: run([fx.JointElasticity(one(k), one(0.2 * k**0.5), one(0.5))], tau)[0]
    errors = [np.abs(joined(stiffness) - rigid).max() for stiffness in (1e3, 1e4, 1e5)]
    assert errors[2] < 1e-3 * np.ptp(rigid)
    assert errors[2] < errors[1] < errors[0]


def test_the_motor_crosses_the_play_before_the_link_feels_it():
    effect = fx.Backlash(
        gap=one(0.02), stiffness=one(900.0), damping=one(3.0), motor_inertia=one(0.5)
    )
    _, qd, _, ((twist, speed),) = run([effect], np.full(300, 1.0))
    free = int(np.sqrt(2.0 * 0.01 / 2.0) / DT)  # half the gap at 1 N / 0.5 kg
    np.testing.assert_array_equal(qd[: free - 1], 0.0)
    np.testing.assert_allclose(speed[: free - 1, 0], 2.0 * DT * np.arange(free - 1), rtol=1e-9)
    assert qd[free + 5] > 0.0
    assert twist.max() > 0.01


def test_play_of_no_width_is_elasticity():
    tau = 5.0 * np.sin(np.linspace(0.0, 12.0, 1000))
    play, spring = (
        run([fx.Backlash(gap=one(0.0), **STIFF)], tau)[0],
        run([fx.JointElasticity(**STIFF)], tau)[0],
    )
    np.testing.assert_allclose(play, spring, rtol=1e-12)
