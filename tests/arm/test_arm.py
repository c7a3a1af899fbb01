"""The seven-joint arm: its body against MuJoCo in C, derivatives of an execution, and what
estimates and learning make of it.
"""

import copy

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

from jaxidl.arm.setup import ArmStudy, feedback_mse, learn_arm
from jaxidl.arm.smoothing import zero_phase
from jaxidl.control import Doomed, Filtered, FiniteDifference, LqrPolicy, PdPolicy, lqr
from jaxidl.effects import ActuatorDelay, CoulombFriction, InertiaError, Payload, ViscousFriction
from jaxidl.errors import ConfigurationError
from jaxidl.learning.execute import Task, execute
from jaxidl.learning.sources import SOURCES
from jaxidl.models import ErrorModel, Training
from jaxidl.systems import Plant, point_mass
from jaxidl.systems.arm import JOINTS, arm, compiled, flange, reach, torque_limits
from jaxidl.types import State, Trajectory

QUICK = {"xla_backend_optimization_level": 0}  # these programs take longer to compile than to run
DT = 1e-3
BENT, MOVING, STILL = (
    jnp.linspace(0.9, -0.4, JOINTS),
    jnp.linspace(-1.0, 2.0, JOINTS),
    jnp.zeros(JOINTS),
)
COM, LIMITS = jnp.array([0.02, 0.0, 0.1]), jnp.asarray(torque_limits())


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
        return jax.jit(
            lambda s: jax.lax.scan(step, s, None, length=steps)[0], compiler_options=QUICK
        )(State(BENT, MOVING))

    before = energy(State(BENT, MOVING))
    coarse, fine = (energy(swing(DT / n, 300 * n)) - before for n in (1, 2))
    assert coarse[0] < -10.0  # height
    assert abs(coarse.sum()) < 0.015
    assert coarse.sum() / fine.sum() == pytest.approx(2.0, rel=0.01)


@pytest.mark.slow
def test_derivatives_of_an_execution_forward_reverse_and_numeric():
    """Of where the arm is after 150 steps, by all that the true arm has and by what DOOMED and the
    policy are tuned with.

    Each parameter has a factor, and derivatives are by the factors: one step for all in the
    differences. All joints slide from the first to the last instant: where one comes to rest, there
    is no derivative by friction.
    """
    start, goal = (
        jnp.array([0.0, 0.7, 0.0, 1.4, 0.0, -0.7, 0.0]),
        jnp.array([0.6, 0.9, -0.3, 1.2, 0.4, -0.5, 0.5]),
    )
    speed = jnp.sign(goal - start) * jnp.array([0.8, 0.5, 0.6, 0.5, 0.7, 0.5, 0.8])
    body, law, steps = arm().plant.body, ArmStudy().law(), 150
    tuned = {
        "mass": jnp.array([0.1, 0.3, -0.2, 0.25, 0.2, -0.15, 0.1]),
        "viscous": jnp.array([4.0, 4.0, 2.5, 2.5, 1.2, 0.6, 0.4]),
        "coulomb": jnp.array([2.0, 2.0, 1.2, 1.2, 0.6, 0.4, 0.3]),
        "payload": jnp.array(1.0),
        "rate": law.rate,
        "gains": lqr(goal, DT, effort=0.0016).gains,
    }
    flat, unravel = ravel_pytree(tuned)

    def drive(factors):
        x = unravel(factors * flat)
        heavier = InertiaError(STILL, x["mass"]), Payload(x["payload"], COM)
        plant = Plant(
            body, (*heavier, ViscousFriction(x["viscous"]), CoulombFriction(x["coulomb"]))
        )
        task = Task(
            State(start, speed),
            LqrPolicy(goal, x["gains"]),
            LIMITS,
            estimator=Filtered(),
            dt=DT,
            steps=steps,
        )
        return execute(plant, body, law.replace(rate=x["rate"]), task, jnp.zeros((steps, JOINTS)))

    def final(run):
        return jnp.concatenate([run.q[-1], run.qd[-1]])

    def derivatives(factors):
        _, push = jax.linearize(lambda x: final(drive(x)), factors)  # traced once for both modes
        return jax.lax.map(push, jnp.eye(len(factors))).T, jax.linear_transpose(push, factors)(way)[
            0
        ]

    ones, way = jnp.ones_like(flat), jnp.asarray(np.random.default_rng(0).normal(size=2 * JOINTS))
    driven = jax.jit(drive, compiler_options=QUICK)
    run = driven(ones)
    assert (run.qd * jnp.sign(speed)[None]).min() > 0.1
    assert (jnp.abs(run.tau).max(axis=0) < LIMITS).all()

    forward, reverse = map(np.asarray, jax.jit(derivatives, compiler_options=QUICK)(ones))
    np.testing.assert_allclose(way @ forward, reverse, rtol=1e-9)
    numeric = np.stack(
        [
            (final(driven(ones + h)) - final(driven(ones - h))) / 2e-3
            for h in 1e-3 * np.eye(len(flat))
        ],
        axis=-1,
    )
    largest = np.abs(forward).max(axis=0)
    # nothing is without consequence; least: the mass of the first link, about its own axis
    assert largest.min() > 1e-6
    np.testing.assert_allclose(forward / largest, numeric / largest, atol=1e-5)


def estimated(estimator, q, wanted):
    """All motions (T - 1) that an estimator makes of readings ``q`` (T, J), one desired
    acceleration for each step.
    """

    def step(carry, inputs):
        motion, memory = estimator.update(carry[1], carry[0], *inputs, DT)
        return (motion.sensed, memory), motion

    q, wanted = jnp.asarray(q), jnp.asarray(wanted)
    start = State(q[0], (q[1] - q[0]) / DT)
    return jax.lax.scan(step, (start, estimator.start(start)), (q[1:], wanted))[1]


def test_filtered_estimates_are_the_truth_a_known_time_ago():
    """A low pass of band f and a difference over the last step are late by 1/(2πf) in all, the
    second difference by dt/2 more.

    A lag wrong by one step would be an error of 6e-3 of the amplitude.
    """
    t, wave = DT * np.arange(2000)[:, None], 2.0 * np.pi * np.array([[1.0, 0.7]])
    motion = estimated(Filtered(80.0, 30.0), np.sin(wave * t), np.zeros((1999, 2)))
    late, later = (t - 1 / (2 * np.pi * 80.0))[1:], (t - 1 / (2 * np.pi * 30.0) - DT / 2)[1:]
    settled = slice(200, None)
    np.testing.assert_array_equal(motion.sensed.q, np.sin(wave * t)[1:])
    np.testing.assert_allclose(
        (motion.sensed.qd / wave)[settled], np.cos(wave * late)[settled], atol=1e-3
    )
    np.testing.assert_allclose(
        (motion.qdd / wave**2)[settled], -np.sin(wave * later)[settled], atol=1e-3
    )


@pytest.mark.parametrize("delay", [0, 1])
def test_filtered_compares_with_what_was_wanted_when_the_estimate_was_true(delay):
    """An obedient plant, prompt or one step late, looks at most half a step's change of the desired
    acceleration wrong to DOOMED.

    Its learning feedback is minus the error that it was told of, here with a gain of one and no
    memory.
    """
    wanted, rest = (
        10.0 * jnp.sin(2.0 * jnp.pi * jnp.arange(1000)[:, None] * DT),
        State(jnp.zeros(1), jnp.zeros(1)),
    )
    plant = Plant(point_mass(1.0, 1), (ActuatorDelay(jnp.array([delay * DT]), steps=2),))
    task = Task(
        rest, lambda q, qd, t: wanted[t], 400.0, estimator=Filtered(80.0, 30.0), dt=DT, steps=1000
    )
    run = execute(plant, plant.body, Doomed(0.0, 1.0, 1.0), task, jnp.zeros((1000, 1)))
    half_a_step = jnp.abs(jnp.diff(wanted, axis=0)).max() / 2
    assert 0.9 * half_a_step < jnp.abs(run.tau_feedback)[100:].max() < 1.01 * half_a_step
    assert jnp.abs(run.qdd_actual - run.qdd_desired)[100:].max() > 9 * half_a_step


def test_finite_differences_are_those_of_readings_and_of_velocities():
    q, wanted = np.random.default_rng(1).normal(size=(2, 6, 3))
    motion, qd = estimated(FiniteDifference(), q, wanted[1:]), np.diff(q, axis=0) / DT
    np.testing.assert_allclose(motion.sensed.qd, qd, rtol=1e-12)
    np.testing.assert_allclose(
        motion.qdd, np.diff(qd, axis=0, prepend=qd[:1]) / DT, rtol=1e-9, atol=1e-9
    )
    np.testing.assert_array_equal(motion.qdd_desired, wanted[1:])


def test_an_acceleration_made_afterwards_has_no_lag_and_a_causal_one_has():
    wave, t, none = (
        2.0 * np.pi * np.array([[2.0, 3.0]]),
        DT * np.arange(2001)[:, None],
        jnp.zeros((2000, 2)),
    )
    causal = estimated(Filtered(), np.sin(wave * t), none).qdd
    q, qd, qdd = (
        jnp.asarray(x[:-1])
        for x in (np.sin(wave * t), wave * np.cos(wave * t), -(wave**2) * np.sin(wave * t))
    )
    run = Trajectory(none, none, q, qd, none, causal, *[none] * 6)
    task = Task(State(q[0], qd[0]), PdPolicy(jnp.zeros(2), 1.0, 1.0), 400.0, dt=DT, steps=2000)
    smooth, middle = zero_phase(run, point_mass(2.0), task, 30.0), slice(500, 1500)  # whole periods

    def lag(x, j):
        return max(
            range(-20, 21), key=lambda k: float(np.roll(x[:, j], -k)[middle] @ qdd[middle, j])
        )

    assert [lag(smooth.qdd_actual, j) for j in (0, 1)] == [0, 0]
    # 1/(2π·30 Hz) less half a step: a row's reading is that after its step
    assert [lag(causal, j) for j in (0, 1)] == [5, 5]
    # 1/(1 + (3/30)²)
    np.testing.assert_allclose(
        (smooth.qdd_actual / wave**2)[middle], (qdd / wave**2)[middle], atol=0.012
    )
    np.testing.assert_allclose(
        smooth.tau_inverse_actual, jnp.clip(2.0 * smooth.qdd_actual, -400.0, 400.0), rtol=1e-12
    )
    assert jnp.abs(2.0 * smooth.qdd_actual).max() > 400.0
    # in motion at both ends
    steady = run.replace(q_sensing=jnp.asarray(t[:-1] * np.array([[1.0, -2.0]])))
    assert jnp.abs(zero_phase(steady, point_mass(2.0), task, 30.0).qdd_actual).max() < 1e-6


@pytest.mark.slow
def test_a_load_is_there_just_while_the_circumstances_say_so():
    """Each recorded step is taken again by an arm that always carries the load, and by one that
    never does.
    """
    steps, plant = 60, Plant(arm().plant.body, (Payload(jnp.array(0.0), COM),))
    carried = jnp.where((jnp.arange(steps) >= 20) & (jnp.arange(steps) < 40), 2.0, 0.0)[:, None]
    world = lambda plant, now: plant.replace(effects=(Payload(now[0], COM),))
    how = {"circumstances": carried, "world": world, "dt": DT, "steps": steps}
    task = Task(State(BENT, STILL), lqr(BENT + 0.3, DT), LIMITS, **how)

    def step(now, q, qd, tau):
        return world(plant, now).step(State(q, qd), ((),), tau, DT)[0].qd

    @jax.jit
    def both():
        run = execute(plant, plant.body, Doomed(0.0, 0.0, 0.1), task, jnp.zeros((steps, JOINTS)))
        always = jax.vmap(jax.vmap(step, (None, 0, 0, 0)), (0, None, None, None))
        return run, always(jnp.array([[0.0], [2.0]]), run.q, run.qd, run.tau)

    run, (empty, loaded) = both()
    np.testing.assert_array_equal(run.circumstances, carried)
    np.testing.assert_allclose(
        run.qd[1:], jnp.where(carried > 0.0, loaded, empty)[:-1], rtol=0, atol=1e-12
    )
    assert jnp.abs(empty - loaded).max(axis=1).min() > 1e-3


def test_where_the_mechanism_truly_begins_is_seen_from_the_first_reading_on():
    plant, seen, noise = Plant(point_mass(2.0)), jnp.array([0.1, -0.2]), jnp.zeros((20, 2))
    task = Task(
        State(seen, jnp.zeros(2)),
        PdPolicy(jnp.ones(2), 25.0, 7.0),
        100.0,
        estimator=Filtered(),
        dt=DT,
        steps=20,
    )
    off, same, told = (
        execute(plant, plant.body, Doomed(0.0, 0.0, 0.1), task, noise, start=s)
        for s in (seen + 1e-4, seen, None)
    )
    np.testing.assert_array_equal(off.q[0], seen + 1e-4)
    np.testing.assert_array_equal(off.q_sensing[0], seen)
    np.testing.assert_array_equal(off.q_sensing[1:], off.q[1:])
    np.testing.assert_array_equal(same.q, told.q)


@pytest.mark.slow
@pytest.mark.parametrize("source", SOURCES)
def test_the_arm_learns_what_its_model_lacks(source):
    """Two goals of 0.2 s and small networks: one iteration takes away about 90 % of the feedback's
    mean square.
    """
    networks, training = (
        ErrorModel(JOINTS, (32, 16, 1), 1.0, 1.0, 10.0, 10.0),
        Training(40, 32, 3e-3),
    )
    study = ArmStudy(
        goals=ArmStudy().goals[:2], seconds_each=0.2, error_model=networks, training=training
    )
    once = jax.jit(
        lambda key: learn_arm(study, source, jnp.array(1e-5), key, 2), compiler_options=QUICK
    )
    first, again, other = (once(jax.random.key(seed)) for seed in (0, 0, 1))
    for one, two in zip(jax.tree.leaves(first), jax.tree.leaves(again), strict=True):
        assert jnp.isfinite(one).all()
        np.testing.assert_array_equal(one, two)
    noises = [
        (run.q_sensing - run.q)[k].ravel()
        for run, k in ((first[1], 0), (first[1], 1), (other[1], 0))
    ]
    # another draw for each execution and each key
    assert np.abs(np.corrcoef(noises) - np.eye(3)).max() < 0.1
    before, after = feedback_mse(first[1])
    assert after < 0.3 * before


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
