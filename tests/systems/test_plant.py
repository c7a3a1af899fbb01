"""Plants against closed forms, for any number of joints."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import (
    ActuatorLag,
    ConstantOffset,
    CoulombFriction,
    InertiaError,
    SensingNoise,
    ViscousFriction,
)
from jaxidl.paper.effects import PaperFriction, paper_stiction
from jaxidl.systems import Plant, point_mass
from jaxidl.types import State


def roll(plant, state, tau, dt, steps):
    """Positions after ``steps`` under constant torque."""
    return jax.lax.fori_loop(
        0, steps, lambda _, carry: plant.step(*carry, tau, dt), (state, plant.start(state.q))
    )[0]


@pytest.mark.parametrize("joints", [1, 2, 7])
def test_constant_torque_gives_a_parabola(joints):
    plant = Plant(point_mass(2.0, joints))
    tau = jnp.arange(1.0, joints + 1)
    end = roll(plant, State(jnp.zeros(joints), jnp.zeros(joints)), tau, 1e-3, 1000)
    np.testing.assert_allclose(end.q, tau / 2 / 2, rtol=1e-11)
    np.testing.assert_allclose(end.qd, tau / 2, rtol=1e-11)


def test_viscous_friction_decays_exponentially_and_converges_in_first_order():
    plant = Plant(point_mass(2.0, 1), (ViscousFriction(jnp.array([4.0])),))
    errors = []
    for steps in (100, 200, 400):
        end = roll(plant, State(jnp.zeros(1), jnp.ones(1)), jnp.zeros(1), 1.0 / steps, steps)
        errors.append(abs(float(end.qd[0]) - np.exp(-2.0)))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.05)


def test_effects_add_up_and_stiction_has_the_last_word():
    offset, viscous = ConstantOffset(jnp.array([1.0, 1.0])), ViscousFriction(jnp.array([3.0, 3.0]))
    moving = State(jnp.array([0.1, 0.1]), jnp.array([0.5, 0.5]))
    plant = Plant(point_mass(2.0), (offset, viscous))
    np.testing.assert_allclose(
        plant.acceleration(moving, jnp.array([4.0, 4.0]), 1e-3), (4 + 1 - 1.5) / 2
    )
    rest = State(jnp.zeros(2), jnp.zeros(2))
    sticky = Plant(point_mass(2.0), (offset, paper_stiction(5.0)))
    np.testing.assert_allclose(
        sticky.acceleration(rest, jnp.array([499.0, 251.0]), 1e-3), [0.0, 126.0]
    )


def test_sensing_does_not_touch_the_true_state():
    quiet = Plant(point_mass(5.0), (PaperFriction(jnp.array(5.0)),))
    noisy = Plant(quiet.body, (*quiet.effects, SensingNoise(jnp.array(0.1))))
    state, tau = State(jnp.array([0.1, 0.3]), jnp.ones(2)), jnp.array([10.0, 20.0])
    moved = [plant.step(state, plant.start(state.q), tau, 1e-3)[0].q for plant in (quiet, noisy)]
    np.testing.assert_array_equal(*moved)
    assert jnp.abs(noisy.sense(noisy.start(state.q), state.q, jnp.ones(2)) - state.q).min() > 0.09


def test_inertia_error_is_the_body_it_makes():
    wrong = Plant(point_mass(0.5), (InertiaError(jnp.array([4.5, 4.5])),))
    state, tau = State(jnp.zeros(2), jnp.ones(2)), jnp.array([3.0, -2.0])
    np.testing.assert_allclose(
        wrong.acceleration(state, tau, 1e-3), Plant(point_mass(5.0)).acceleration(state, tau, 1e-3)
    )


def test_actuator_lag_follows_a_step_exponentially():
    plant = Plant(point_mass(1.0, 1), (ActuatorLag(jnp.array([0.05])),))
    state, hidden, tau = State(jnp.zeros(1), jnp.zeros(1)), plant.start(jnp.zeros(1)), jnp.ones(1)
    for _ in range(100):
        state, hidden = plant.step(state, hidden, tau, 1e-3)
    np.testing.assert_allclose(hidden[0], 1 - np.exp(-100e-3 / 0.05), rtol=1e-12)


def test_stiction_feels_the_delivered_torque_not_the_command():
    lag, stick = ActuatorLag(jnp.array([0.1, 0.1])), paper_stiction(5.0)
    plant = Plant(point_mass(5.0), (lag, stick))
    rest = State(jnp.zeros(2), jnp.zeros(2))
    # delivered: 6 N at first
    after, _ = plant.step(rest, plant.start(rest.q), jnp.array([600.0, 600.0]), 1e-3)
    np.testing.assert_array_equal(after.qd, 0.0)


def test_friction_that_no_effect_has_is_not_solved_for():
    """The paper's stiction holds, and has no dry friction: its step needs no rounds of a solver."""
    state, tau = State(jnp.zeros(2), jnp.zeros(2)), jnp.ones(2)

    def loops(*effects):
        plant = Plant(point_mass(2.0, 2), effects)
        step = jax.make_jaxpr(lambda: plant.step(state, plant.start(state.q), tau, 1e-3))()
        return str(step).count("scan[")

    assert loops(paper_stiction(jnp.array(5.0)), PaperFriction(jnp.array(5.0))) == 0
    assert loops(CoulombFriction(jnp.ones(2))) == 1
