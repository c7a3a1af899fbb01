"""Plants against closed forms, for any number of joints."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import ConstantOffset, PaperFriction, SensingNoise, ViscousFriction, paper_stiction
from jaxidl.systems import Plant, point_mass
from jaxidl.types import State


def roll(plant, state, tau, dt, steps):
    """Positions after ``steps`` under constant torque."""
    return jax.lax.fori_loop(0, steps, lambda _, s: plant.step(s, tau, dt), state)


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
    np.testing.assert_allclose(plant.acceleration(moving, jnp.array([4.0, 4.0])), (4 + 1 - 1.5) / 2)
    rest = State(jnp.zeros(2), jnp.zeros(2))
    sticky = Plant(point_mass(2.0), (offset, paper_stiction(5.0)))
    np.testing.assert_allclose(sticky.acceleration(rest, jnp.array([499.0, 251.0])), [0.0, 126.0])


def test_sensing_does_not_touch_the_true_state():
    quiet = Plant(point_mass(5.0), (PaperFriction(jnp.array(5.0)),))
    noisy = Plant(quiet.body, (*quiet.effects, SensingNoise(jnp.array(0.1))))
    state, tau = State(jnp.array([0.1, 0.3]), jnp.ones(2)), jnp.array([10.0, 20.0])
    np.testing.assert_array_equal(quiet.step(state, tau, 1e-3).q, noisy.step(state, tau, 1e-3).q)
    assert jnp.abs(noisy.sense(state.q, jnp.ones(2)) - state.q).min() > 0.09
