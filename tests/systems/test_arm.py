"""The seven-joint arm's body against MuJoCo in C, and the place of its tool."""

import copy

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from jaxidl.errors import ConfigurationError
from jaxidl.systems import Plant
from jaxidl.systems.arm import JOINTS, arm, compiled, flange, reach
from jaxidl.types import State
from tests.helpers.numeric import quick

DT = 1e-3
BENT, MOVING, STILL = (
    jnp.linspace(0.9, -0.4, JOINTS),
    jnp.linspace(-1.0, 2.0, JOINTS),
    jnp.zeros(JOINTS),
)


def in_c(**state):
    """The file in C without its joint limits, which are no part of the rigid body."""
    model = copy.copy(compiled())
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    for name, value in state.items():
        getattr(data, name)[:] = value
    return model, data


def test_a_second_of_free_swing_is_mujocos():
    """Semi-implicit Euler on both sides; measured: 6e-15 rad."""
    body, (model, data) = arm().plant.body, in_c(qpos=BENT, qvel=MOVING)

    def step(state, _):
        inertia, bias = body.equation_of_motion(*state)
        after = state.qd - DT * jnp.linalg.solve(inertia, bias)
        return State(state.q + DT * after, after), state.q

    positions = jax.jit(lambda s: jax.lax.scan(step, s, None, length=1001)[1])(State(BENT, MOVING))
    mujoco.mj_step(model, data, 1000)
    assert data.time == pytest.approx(1.0)
    assert np.ptp(positions, axis=0).min() > 0.5
    np.testing.assert_allclose(positions[-1], data.qpos, atol=1e-10)


def test_torques_and_inertia_are_mujocos_in_any_state():
    body, states = arm().plant.body, np.random.default_rng(3).uniform(-2.0, 2.0, (20, 3, JOINTS))
    ask = jax.jit(
        jax.vmap(lambda s: (body.equation_of_motion(s[0], s[1])[0], body.inverse_dynamics(*s)))
    )
    for (q, qd, qdd), inertia, torque in zip(states, *ask(states), strict=True):
        (model, data), expected = in_c(qpos=q, qvel=qd, qacc=qdd), np.zeros((JOINTS, JOINTS))
        mujoco.mj_inverse(model, data)
        mujoco.mj_fullM(model, data, expected)
        np.testing.assert_allclose(inertia, expected, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(torque, data.qfrc_inverse, rtol=1e-10, atol=1e-11)


def test_energy_is_kept_but_for_the_integrator():
    """0.3 s turn 10.6 J of height into motion; the drift is 1.1e-2 J at 1 ms, half of it at 0.5 ms:
    first order, as it should.
    """
    plant = Plant(arm().plant.body)

    def energy(state):
        model, data = in_c(qpos=state.q, qvel=state.qd)
        mujoco.mj_forward(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        return data.energy.copy()

    def swing(dt, steps):
        step = lambda state, _: (plant.step(state, (), STILL, dt)[0], None)
        return quick(lambda s: jax.lax.scan(step, s, None, length=steps)[0])(State(BENT, MOVING))

    before = energy(State(BENT, MOVING))
    coarse, fine = (energy(swing(DT / n, 300 * n)) - before for n in (1, 2))
    assert coarse[0] < -10.0  # height
    assert abs(coarse.sum()) < 0.015
    assert coarse.sum() / fine.sum() == pytest.approx(2.0, rel=0.01)


NEAR = np.array([0.0, -0.6, 0.0, 1.5, 0.0, -1.04, 0.0])


@pytest.mark.parametrize("place", [(0.5, 0.2, 0.3), (0.4, -0.3, 0.2), (0.6, 0.0, 0.4)])
def test_the_flange_is_where_it_is_asked_to_be_and_points_down(place):
    q = reach(np.array(place), NEAR)
    model, data = in_c(qpos=q)
    mujoco.mj_kinematics(model, data)
    tool = data.xmat[-1].reshape(3, 3)[:, 2]
    end = data.geom_xpos[-1] + model.geom_size[-1, 1] * tool  # of the last cylinder
    np.testing.assert_allclose(end, place, atol=1e-4)
    np.testing.assert_allclose(flange(q), end, atol=1e-12)
    np.testing.assert_allclose(tool, [0.0, 0.0, -1.0], atol=1e-4)
    assert ((q >= model.jnt_range[:, 0]) & (q <= model.jnt_range[:, 1])).all()


@pytest.mark.parametrize(
    "place", [(2.0, 0.0, 0.3), (0.0, 0.0, 1.2)], ids=["too far", "only with the tool up"]
)
def test_a_place_out_of_reach_is_refused(place):
    with pytest.raises(ConfigurationError, match="reaches with its tool pointing down"):
        reach(np.array(place), NEAR)


def test_a_tool_that_points_up_is_no_answer():
    upright = np.zeros(7)
    with pytest.raises(ConfigurationError, match="reaches with its tool pointing down"):
        reach(flange(upright), upright)
