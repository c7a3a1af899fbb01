"""Damping in steps that are too long for an explicit integrator."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import CoulombFriction, ViscousFriction
from jaxidl.systems import Plant, PointMass
from jaxidl.types import State

MASS, DAMPING, DT = 0.01, 5.0, 0.008  # four time constants in one step


def moved(tau, steps, *effects, implicit=True, dt=DT):
    plant = Plant(PointMass(jnp.array([MASS])), (ViscousFriction(jnp.array([DAMPING])), *effects))
    state, hidden = State(jnp.zeros(1), jnp.array([0.3])), plant.start(jnp.zeros(1))
    for _ in range(steps):
        state, hidden = plant.step(state, hidden, jnp.array([tau]), dt, implicit=implicit)
    return float(state.qd[0])


def test_a_strongly_damped_joint_reaches_its_speed_where_explicit_steps_diverge():
    assert moved(2.0, 30) == pytest.approx(2.0 / DAMPING, rel=1e-6)
    assert abs(moved(2.0, 30, implicit=False)) > 1e6


def test_dry_friction_beside_it_takes_its_level_and_no_more():
    dry = CoulombFriction(jnp.array([0.5]))
    assert moved(2.0, 30, dry) == pytest.approx(1.5 / DAMPING, rel=1e-6)
    assert moved(0.4, 30, dry) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_in_short_steps_both_are_the_same_motion():
    short = 1e-6
    explicit, implicit = (moved(2.0, 400, implicit=x, dt=short) for x in (False, True))
    exact = 0.4 - 0.1 * np.exp(-DAMPING / MASS * 400 * short)
    assert explicit == pytest.approx(exact, rel=1e-4)
    assert implicit == pytest.approx(exact, rel=1e-4)
