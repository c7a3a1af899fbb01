"""Friction of gears and couplings of motors against their formulas."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.effects import OnJoint, Scale, placed
from jaxidl.systems import Plant, point_mass
from jaxidl.types import State
from tests.helpers.effects import DT, one, pair

ZERO, AT = jnp.zeros(1), jnp.zeros(2)


@pytest.mark.parametrize(
    ("tau", "direction", "level"),
    [(4.0, 1.0, 0.8), (4.0, -1.0, 0.2), (-4.0, -1.0, 0.8), (-4.0, 1.0, 0.2)],
)
def test_friction_of_a_gear_depends_on_which_side_drives(tau, direction, level):
    effect = fx.DirectionalLoadFriction(one(0.2), one(0.05))
    np.testing.assert_allclose(effect.dry(ZERO, one(0.0), one(tau), one(direction)), level)
    same = fx.DirectionalLoadFriction(one(0.3), one(0.3)).dry(ZERO, ZERO, one(tau), one(direction))
    np.testing.assert_allclose(
        same, fx.LoadDependentFriction(one(0.3)).dry(ZERO, ZERO, one(tau), one(direction))
    )


def test_cold_friction_decays_exponentially():
    effect = fx.ThermalFriction(one(0.5), one(2.0), one(0.7))
    memory, speed, delivered = effect.start(ZERO), one(3.0), []
    for _ in range(1000):
        torque, memory = effect.actuate(memory, ZERO, speed, one(0.0), DT)
        delivered.append(float((torque + effect.torque(ZERO, speed, torque))[0]))
    t = DT * np.arange(1000)
    np.testing.assert_allclose(delivered, -(0.5 + 2.0 * np.exp(-t / 0.7)) * 3.0, rtol=1e-9)
    with_memory = Plant(point_mass(2.0, 1), (effect,))
    late = with_memory.step(State(ZERO, speed), (one(7.0),), one(0.0), DT)[0].qd
    np.testing.assert_allclose(
        (late - speed) / DT, -(0.5 + 2.0 * np.exp(-10.0)) * 3.0 / 2.0, rtol=1e-9
    )


def test_sublinear_friction_bends_a_line_and_leaves_the_line_as_it_is():
    """A line fitted to it up to full speed is zero.

    At rest and at full speed it is ``bend`` less.
    """
    effect, speeds = fx.SublinearFriction(one(2.0), one(0.5)), np.linspace(0.0, 0.5, 4001)
    levels = np.array([effect.dry(ZERO, one(s), ZERO, one(1.0))[0] for s in speeds[::100]])
    np.testing.assert_allclose(
        levels,
        -2.0 * np.polynomial.Legendre([0.0, 0.0, 1.0])(speeds[::100] / 0.25 - 1.0),
        atol=1e-12,
    )
    np.testing.assert_allclose(levels[[0, 20, -1]], [-2.0, 1.0, -2.0])
    # faster: as at full speed
    np.testing.assert_allclose(effect.dry(ZERO, one(-3.0), ZERO, one(-1.0)), -2.0)
    slack = Plant(point_mass(2.0, 1), (effect, fx.CoulombFriction(one(5.0)))).grip(
        ZERO, one(0.25), ZERO, one(1.0)
    )
    np.testing.assert_allclose(slack, 6.0)  # together with other friction


@pytest.mark.parametrize("difference", [False, True])
def test_friction_of_two_joints_takes_power_from_their_common_speed(difference):
    effect = fx.CoupledJointFriction(
        jnp.array(2.0), jnp.array(0.5), jnp.array(0.01), joint=0, other=2, difference=difference
    )
    sign, qd = -1.0 if difference else 1.0, jnp.array([0.7, 5.0, 0.4])
    speed = 0.7 + sign * 0.4
    expected = -2.0 * speed - 0.5 * np.tanh(speed / 0.01)
    np.testing.assert_allclose(effect.torque(qd, qd, qd), [expected, 0.0, sign * expected])
    together = jnp.array([0.3, 0.0, -sign * 0.3])  # no speed that it rubs on
    np.testing.assert_allclose(effect.torque(qd, together, qd), 0.0)


def test_a_coupled_motor_turns_a_second_joint():
    effect = fx.MotorCoupling(jnp.array(-0.5), joint=1, other=0)
    np.testing.assert_allclose(effect.actuate((), AT, AT, pair(1.0, 4.0), DT)[0], [-1.0, 4.0])


def test_a_motors_torque_curve_bends_and_ends_at_half():
    effect = fx.TorqueCurve(one(0.05))
    for command, delivered in ((2.0, 2.0 * 0.9), (-4.0, -4.0 * 0.8), (30.0, 15.0)):
        np.testing.assert_allclose(effect.actuate((), ZERO, ZERO, one(command), DT)[0], delivered)


def test_ripple_with_harmonics_is_the_sum_of_ripples():
    many = fx.TorqueRipple(
        jnp.array([[0.5, 0.2, 0.0], [0.1, 0.0, 0.3]]),
        jnp.array([[0.0, -0.4, 0.1], [0.2, 0.2, 0.0]]),
        pair(0.2, 0.3),
    )
    q, at = pair(0.07, -0.31), pair(0.0, 0.0)
    parts = (
        fx.TorqueRipple(many.sine[:, h], many.cosine[:, h], many.period / (h + 1)).torque(q, at, at)
        for h in range(3)
    )
    np.testing.assert_allclose(many.torque(q, at, at), sum(parts))
    own = OnJoint(fx.TorqueRipple(many.sine[1:], many.cosine[1:], many.period[1:]), 1, 2)
    np.testing.assert_allclose(own.torque(q, at, at)[1], many.torque(q, at, at)[1])
    assert fx.from_dict(own.to_dict()).to_dict() == own.to_dict()


def test_couplings_are_looked_for_between_neighbours():
    scale = Scale(9.0, 1.0, -1.0, 1.0, 1.0, 0.1, 10.0, DT, 1, 4, (-1.0,) * 4, (1.0,) * 4)
    # each pair once
    assert {v.options["other"] for v in fx.CoupledJointFriction.variants(scale)} == {2}
    assert {v.options["other"] for v in fx.MotorCoupling.variants(scale)} == {0, 2}
    effect = placed(fx.MotorCoupling, fx.MotorCoupling.variants(scale)[0], 1, 4)
    assert (effect.joint, effect.other) == (1, 0)
    # what connects joints that move in turn looks like what each has alone
    in_turn = scale._replace(apart=(2,))
    assert fx.CoupledJointFriction.variants(in_turn) == []
    assert {v.options["other"] for v in fx.MotorCoupling.variants(in_turn)} == {0}
