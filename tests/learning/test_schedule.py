"""A schedule of gains: how far they fall, that they return, and that it changes nothing else."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.control import Doomed, Pid, PidGains
from jaxidl.errors import ConfigurationError
from jaxidl.learning.execute import desired_trajectory
from jaxidl.learning.guard import Strayed, distance
from jaxidl.learning.iterate import learn
from jaxidl.learning.schedule import Schedule
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.types import State
from tests.helpers.studies import SMALL_STUDY

CONDITION = Condition(jnp.array(1), jnp.array(5e-4), jnp.array(5.0), jnp.array(5.0))


def test_gains_fall_while_tracking_is_good_and_rise_when_it_is_not():
    good, bad = jnp.full(5, 0.1), jnp.full(5, 0.12)
    past, schedule = Strayed.of(good), Schedule()
    for before, away, after in (
        (1.0, good, 0.8),
        (0.8, 1.09 * good, 0.64),
        (0.3, good, 0.25),
        (0.5, bad, 0.8),
        (0.8, bad, 1.0),
        (0.5, jnp.nan * good, 0.8),
    ):
        found = schedule.after(jnp.array(before), away, past.after(away))
        np.testing.assert_allclose(found, after, rtol=1e-12)
    # a new best one is good however bad the others were
    np.testing.assert_allclose(
        schedule.after(jnp.array(1.0), 0.1 * good, past.after(0.1 * good)), 0.8
    )


@pytest.mark.parametrize(("strayed", "share"), [(0.0, 0.5), (0.12, 0.5), (0.18, 0.75), (9.0, 1.0)])
def test_gains_return_as_the_robot_strays(strayed, share):
    gains = Schedule().gains(jnp.array(0.5), Strayed.of(jnp.full(3, 0.1)))
    desired = State(jnp.array([0.3, 0.4]), jnp.zeros(2))
    sensed = State(desired.q + strayed * jnp.array([0.6, 0.8]), jnp.zeros(2))
    np.testing.assert_allclose(gains(sensed, desired), share, rtol=1e-9)


def test_a_scaled_law_applies_less_and_teaches_the_same():
    gains, learner = PidGains(25.0, 2.5, 0.005), PidGains(500.0, 50.0, 0.01)
    desired, sensed = State(jnp.ones(2), jnp.zeros(2)), State(jnp.zeros(2), jnp.zeros(2))
    pid = Pid(gains, learner, 0.1)
    whole, _ = pid.act(pid.init(sensed.q), desired, sensed)
    half, _ = pid.scaled(jnp.array([0.5, 1.0])).act(pid.init(sensed.q), desired, sensed)
    np.testing.assert_allclose(half.applied, whole.applied * jnp.array([0.5, 1.0]))
    np.testing.assert_array_equal(half.learning, whole.learning)
    doomed, wanted, actual = Doomed(0.2, 0.5, 0.1), jnp.ones(2), jnp.zeros(2)
    after = [
        law.observe(doomed.init(sensed.q), wanted, actual) for law in (doomed, doomed.scaled(0.5))
    ]
    np.testing.assert_allclose(after[1].offset, 0.5 * after[0].offset)
    np.testing.assert_array_equal(after[1].filtered.value, after[0].filtered.value)


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["pid", "doomed"])
def test_a_run_applies_what_the_executions_before_allow(controller):
    """The third execution's gains, from what the first two recorded."""
    study = replace(SMALL_STUDY, steps=200)
    setting = study.setting(controller, CONDITION)
    draws = jnp.asarray(draw_noise(1, 3, study.steps))
    how = {
        "source": "weighted",
        "error_model": study.error_model,
        "training": study.training,
        "record": True,
    }
    run = jax.jit(
        lambda schedule: learn(setting, draws, jax.random.key(1), schedule=schedule, **how),
        static_argnums=0,
    )
    plain, scheduled, idle = run(None), run(Schedule()), run(Schedule(least=1.0))
    for one, other in zip(jax.tree.leaves(plain[2]), jax.tree.leaves(idle[2]), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
    runs = scheduled[2]
    np.testing.assert_allclose(runs.tau_feedback_applied[0], plain[2].tau_feedback_applied[0])
    if controller == "doomed":
        return
    desired = desired_trajectory(setting.task)
    away = jax.vmap(lambda q: distance(q, desired.q))(runs.q_sensing)
    past = Strayed.of(away[0]).after(away[1])
    gains = Schedule().gains(Schedule().after(jnp.array(1.0), away[1], past), past)
    share = jax.vmap(gains)(State(runs.q_sensing[2], runs.qd_sensing[2]), desired)[:, None]
    e, rate = desired.q - runs.q_sensing[2], desired.qd - runs.qd_sensing[2]
    kp, kd, ki = study.pid_gains[1]
    integral = jnp.cumsum(share * ki * e, axis=0)
    np.testing.assert_allclose(
        runs.tau_feedback_applied[2], share * (kp * e + kd * rate) + integral, rtol=1e-9, atol=1e-9
    )
    assert float(share.min()) < 0.9  # it did fall


@pytest.mark.parametrize(
    "wrong", [{"least": 0.0}, {"least": 2.0}, {"slack": 0.9}, {"up": 0.5}, {"near": 3.0}]
)
def test_a_schedule_out_of_bounds_is_refused(wrong):
    with pytest.raises(ConfigurationError, match="0 < least <= 1 <= slack"):
        Schedule(**wrong)


def test_a_study_without_a_schedule_is_what_it_was():
    assert "schedule" not in PaperStudy().to_dict()
    assert PaperStudy(schedule="on").to_dict()["schedule"] == "on"
    with pytest.raises(ConfigurationError, match="schedule"):
        PaperStudy(schedule="steep")
