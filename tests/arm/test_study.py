"""The seven-joint arm: derivatives of an execution, loads, and what learning makes of it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

from jaxidl.arm.setup import ArmStudy, feedback_mse, learn_arm
from jaxidl.arm.smoothing import zero_phase
from jaxidl.control import Doomed, Filtered, LqrPolicy, PdPolicy, lqr
from jaxidl.effects import CoulombFriction, InertiaError, Payload, ViscousFriction
from jaxidl.learning.execute import Task, execute
from jaxidl.learning.sources import SOURCES
from jaxidl.models import ErrorModel, Training
from jaxidl.systems import Plant, point_mass
from jaxidl.systems.arm import JOINTS, arm, torque_limits
from jaxidl.types import State, Trajectory
from tests.helpers.estimates import estimated
from tests.helpers.numeric import quick

DT = 1e-3
BENT, MOVING, STILL = (
    jnp.linspace(0.9, -0.4, JOINTS),
    jnp.linspace(-1.0, 2.0, JOINTS),
    jnp.zeros(JOINTS),
)
COM, LIMITS = jnp.array([0.02, 0.0, 0.1]), jnp.asarray(torque_limits())


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
    driven = quick(drive)
    run = driven(ones)
    assert (run.qd * jnp.sign(speed)[None]).min() > 0.1
    assert (jnp.abs(run.tau).max(axis=0) < LIMITS).all()

    forward, reverse = map(np.asarray, quick(derivatives)(ones))
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
    """Each recorded step is repeated by an arm that always carries the load and by one that never
    does.
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
    once = quick(lambda key: learn_arm(study, source, jnp.array(1e-5), key, 2))
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
