"""A detector of pushes: the observer against its textbook form, thresholds against chance."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.control import Filtered
from jaxidl.effects import ViscousFriction
from jaxidl.errors import ConfigurationError
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.learning.detector import Detector, Observer, calibrate, prediction_limit
from jaxidl.systems import Plant, PointMass, integrate
from jaxidl.systems.mjcf import read_model
from jaxidl.types import State
from tests.helpers.studies import run_of

GAIN, STEPS = 100.0, 500  # of the observer [1/s]


@pytest.fixture(scope="module")
def two_link(tmp_path_factory):
    file = tmp_path_factory.mktemp("model") / "two_link.xml"
    file.write_text(TWO_LINK)
    return read_model(file).plant.body


def moving(dt):
    """A smooth motion of two joints, and a command that does not quite explain it."""
    t = dt * np.arange(STEPS)[:, None]
    phase = np.array([6.0, 9.0]) * t + np.array([0.3, 1.0])
    q, qd = np.sin(phase), np.array([6.0, 9.0]) * np.cos(phase)
    return State(jnp.asarray(q), jnp.asarray(qd)), jnp.asarray(4.0 * np.cos(5.0 * t) * [1.0, -0.5])


def stepped(observer, states, tau):
    """The residual after every step (T, J)."""

    def step(memory, now):
        memory = observer.update(memory, *now)
        return memory, memory.residual

    before, after = (State(*(x[at] for x in states)) for at in (slice(-1), slice(1, None)))
    start = observer.start(State(states.q[0], states.qd[0]))
    return jax.lax.scan(step, start, (before, after, tau[:-1]))[1]


def textbook(body, states, tau, dt):
    """r = K (p - integral of (tau + dT/dq - g + r)), p = M qd, T = qd M qd/2: De Luca's form."""
    zero = jnp.zeros(2)
    gravity = lambda q: body.inverse_dynamics(q, zero, zero)
    momentum = lambda q, qd: body.inverse_dynamics(q, zero, qd) - gravity(q)
    energy = lambda q, qd: 0.5 * qd @ momentum(q, qd)

    def step(integral, now):
        q, qd, tau, q_next, qd_next = now
        integral = integral + dt * (
            tau + jax.grad(energy)(q, qd) - gravity(q) + GAIN * (momentum(q, qd) - integral)
        )
        return integral, GAIN * (momentum(q_next, qd_next) - integral)

    (q, qd), first = states, momentum(states.q[0], states.qd[0])
    return jax.lax.scan(step, first, (q[:-1], qd[:-1], tau[:-1], q[1:], qd[1:]))[1]


@pytest.mark.slow
def test_the_observer_is_that_of_the_generalised_momentum(two_link):

    @jax.jit
    def both(states, tau, dt):
        ours = stepped(Observer(two_link, dt, GAIN * dt), states, tau)
        return ours, textbook(two_link, states, tau, dt)

    off = {}
    for dt in (1e-3, 5e-4):
        ours, theirs = both(*moving(dt), dt)
        off[dt] = float(jnp.abs(ours - theirs).max() / jnp.abs(theirs).max())
    assert off[1e-3] < 0.02
    assert off[5e-4] < 0.6 * off[1e-3]  # they differ by the time step alone


def test_the_residual_is_the_torque_from_outside():
    body, outside = PointMass(jnp.array([2.0, 3.0])), jnp.array([1.5, -0.7])
    plant = Plant(body, (ViscousFriction(jnp.array([4.0, 2.0])),))
    tau = jnp.tile(jnp.array([3.0, 1.0]), (200, 1))

    def step(state, tau):
        state, _ = plant.step(state, plant.start(state.q), tau + outside, 1e-3)
        return state, state

    start = State(jnp.zeros(2), jnp.zeros(2))
    later = jax.lax.scan(step, start, tau[:-1])[1]
    states = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), start, later)
    found = stepped(Observer(plant, 1e-3), states, tau)
    # the low pass has its value but for 0.9^200, and from the first step on comes closer
    np.testing.assert_allclose(found[-1], outside, atol=1e-3)
    np.testing.assert_allclose(found[9], (1.0 - 0.9**10) * outside, atol=1e-3)
    rigid = stepped(Observer(body, 1e-3), states, tau)
    assert np.abs(rigid[-1] - outside).max() > 0.1  # it takes friction for a push


def test_a_velocity_that_lags_does_not_look_like_a_push():
    body, dt, band = PointMass(jnp.array([2.0, 3.0])), 1e-3, 80.0
    estimator = Filtered(band)
    t = dt * jnp.arange(400)[:, None]
    # a square wave on one joint: jumps of the command as a change of the goal makes them
    jumps = jnp.where(jnp.sin(40.0 * t) > 0.0, 10.0, -10.0)
    tau = jnp.concatenate([jumps, jnp.zeros_like(jumps)], axis=1)
    start = State(jnp.zeros(2), jnp.zeros(2))

    def step(carry, tau):
        true, sensed, memory = carry
        after = integrate(true, body.forward_dynamics(*true, tau), dt)
        motion, memory = estimator.update(memory, sensed, after.q, jnp.zeros(2), dt)
        return (after, motion.sensed, memory), sensed

    states = jax.lax.scan(step, (start, start, estimator.start(start)), tau)[1]
    found = {
        lag: np.abs(stepped(Observer(body, dt, lag=lag), states, tau)).max()
        for lag in (0.0, estimator.lag(dt))
    }
    assert found[estimator.lag(dt)] < 0.2 * found[0.0]


def test_along_an_execution_what_was_learned_counts_as_explained():
    run = run_of("pid", "high", 5.0, 5.0)
    learned = replace(run, tau=run.tau + 1.0, tau_feedforward=jnp.ones_like(run.tau))
    observer = Observer(PointMass(jnp.array([0.5, 0.5])), 1e-3)
    found = jax.jit(observer.along)(run)
    np.testing.assert_allclose(jax.jit(observer.along)(learned), found, rtol=1e-9, atol=1e-9)
    assert (found[0] == 0.0).all()
    states = State(run.q_sensing, run.qd_sensing)
    np.testing.assert_allclose(found[1:], stepped(observer, states, run.tau), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("executions", "share"), [(5, 0.1), (10, 0.02)])
def test_a_new_value_exceeds_the_prediction_limit_as_often_as_it_should(executions, share):
    drawn = 7.0 + 3.0 * np.random.default_rng(5).gumbel(size=(100_000, executions + 1))
    known, new = drawn[:, :-1], drawn[:, -1]
    limit = known.mean(1) + prediction_limit(executions, share) * known.std(1, ddof=1)
    assert np.mean(new > limit) == pytest.approx(share, rel=0.1)


def test_false_alarms_come_as_often_as_asked():
    steps, dt, asked = 50, 1e-3, 0.2  # alarms in an execution
    rng = np.random.default_rng(3)
    scale = np.array([1.0, 20.0, 0.1])
    alarms = []
    for _ in range(60):
        quiet = scale * rng.standard_normal((110, steps, 3))
        detector = calibrate(jnp.asarray(quiet[:10]), dt, asked * 3600.0 / (steps * dt))
        alarms.append(np.asarray(detector.feels(jnp.asarray(quiet[10:]))).any(1).mean())
    # the largest of 50 normal values is nearly one of Gumbel's
    assert np.mean(alarms) == pytest.approx(asked, rel=0.25)


def test_each_joint_has_its_own_threshold_in_both_directions():
    felt = Detector(jnp.array([1.0, 5.0])).feels(
        jnp.array([[0.9, 4.9], [-1.1, 0.0], [0.0, 5.1], [0.0, -4.9]])
    )
    assert felt.tolist() == [False, True, True, False]


def test_more_executions_give_a_lower_threshold():
    assert prediction_limit(10, 1e-3) < 0.7 * prediction_limit(5, 1e-3)


@pytest.mark.parametrize(
    ("residuals", "rate", "says"),
    [
        (np.zeros((2, 10, 1)), 1.0, "expected 3 executions without a push; got 2"),
        (np.full((3, 10, 1), np.nan), 1.0, "finite residuals"),
        (np.zeros((3, 10, 1)), 0.0, "more than 0"),
        (np.zeros((3, 1000, 1)), 3600.0, "fewer than 3600 alarms an hour"),
    ],
)
def test_what_cannot_be_calibrated_is_refused(residuals, rate, says):
    with pytest.raises(ConfigurationError, match=says):
        calibrate(jnp.asarray(residuals), 1e-3, rate)
