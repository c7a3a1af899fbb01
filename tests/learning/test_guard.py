"""A guard for learned torques: where it lets a model drive, and what a bad model can do then."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.errors import ConfigurationError
from jaxidl.learning.execute import desired_trajectory, execute
from jaxidl.learning.guard import Guard, Strayed, distance
from jaxidl.learning.iterate import learn
from jaxidl.models import ErrorModel
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.types import Dataset, State
from tests.helpers.studies import SMALL_STUDY

CONDITION = Condition(jnp.array(1), jnp.array(5e-4), jnp.array(5.0), jnp.array(5.0))
MODEL = ErrorModel(layers=(8, 1))
REACH = 0.3


def region_of(x, y, reach=REACH):
    return Guard().region(
        Dataset(jnp.asarray(x), jnp.asarray(y)), Strayed(*jnp.array([reach, reach, 0.1]))
    )


@pytest.fixture(scope="module")
def data():
    rng = np.random.default_rng(0)
    return rng.uniform(-1.0, 1.0, (50, 6)), rng.uniform(-5.0, 5.0, (50, 2))


def test_inside_its_data_a_model_is_what_it_is_and_outside_it_does_not_extrapolate(data):
    x, y = data
    params = MODEL.init(jax.random.key(0))
    wide = region_of(x, 1e6 * y).feedforward(MODEL, params)  # torques of any size

    def parts(row):
        row = jnp.asarray(row)
        return State(row[:2], row[2:4]), row[4:], None

    inside = 0.9 * x[3]
    np.testing.assert_array_equal(wide(*parts(inside)), MODEL.torque(params, *parts(inside)[:2]))
    far = x[3].copy()
    far[[0, 3, 5]] = [9.0, -1e6, np.inf]
    at_border = x[3].copy()
    at_border[[0, 3, 5]] = [x[:, 0].max(), x[:, 3].min(), x[:, 5].max()]
    np.testing.assert_array_equal(wide(*parts(far)), wide(*parts(at_border)))
    narrow = region_of(x, 1e-6 * y).feedforward(MODEL, params)
    np.testing.assert_array_equal(
        narrow(*parts(inside)),
        np.clip(wide(*parts(inside)), 1e-6 * y.min(0), 1e-6 * y.max(0)),
    )


def test_circumstances_are_inputs_like_any_other(data):
    model = ErrorModel(layers=(8, 1), circumstance_scales=(2.0,))
    params = model.init(jax.random.key(0))
    x = np.column_stack([data[0], np.linspace(0.0, 1.0, 50)])
    torque = region_of(x, 1e6 * data[1]).feedforward(model, params)
    state = State(jnp.zeros(2), jnp.zeros(2)), jnp.zeros(2)
    most, more, less = (torque(*state, jnp.array([load])) for load in (1.0, 3.0, 0.5))
    np.testing.assert_array_equal(most, more)
    assert not np.array_equal(most, less)


@pytest.mark.parametrize(
    ("strayed", "share"), [(0.0, 1.0), (1.2, 1.0), (1.8, 0.5), (2.4, 0.0), (50.0, 0.0)]
)
def test_torque_fades_with_the_distance_from_the_desired_trajectory(data, strayed, share):
    region, still = region_of(*data), jnp.zeros(2)
    away = REACH * strayed * jnp.array([0.6, -0.8])
    got = region.fade(State(away, still), State(still, still))
    np.testing.assert_allclose(got, share, atol=1e-12)


def test_nothing_that_never_strayed_may_stray():
    region = region_of(np.zeros((2, 6)), np.zeros((2, 2)), reach=0.0)
    still = jnp.zeros(2)
    assert float(region.fade(State(still + 1e-6, still), State(still, still))) == 0.0
    assert float(region.fade(State(still, still), State(still, still))) == 1.0


def test_the_reach_is_that_of_the_first_and_the_best_execution():
    """The best is the one that strays least on average."""
    first = Strayed.of(jnp.array([0.0, 1.0, 8.0]))
    assert first == (8.0, 8.0, 3.0)
    assert float(first.reach) == 8.0
    better = first.after(jnp.array([0.0, 0.0, 2.0]))
    np.testing.assert_allclose(better, (8.0, 2.0, 2 / 3))
    np.testing.assert_allclose(better.reach, 4.0)
    assert better.after(jnp.array([0.9, 0.9, 0.9])) == better
    assert better.after(jnp.array([0.0, jnp.nan, 0.0])) == better


def test_a_model_that_leads_astray_is_left_alone_with_its_torque():
    """It pushes with ten times what any data said; feedback alone goes on where it fades."""
    study = replace(SMALL_STUDY, steps=400)
    setting = study.setting("pid", CONDITION)
    task = setting.task
    draws = jnp.asarray(draw_noise(1, 1, study.steps)[0])
    once = lambda *how, **more: execute(
        setting.plant, setting.model, setting.law, task, draws, *how, **more
    )
    first, desired = once(), desired_trajectory(task).q
    strayed = distance(first.q_sensing, desired)
    rows = Dataset(
        jnp.concatenate([first.q, first.qd, first.qdd_actual], 1), first.tau_feedback_applied
    )
    region = Guard().region(rows, Strayed.of(strayed))
    bad = lambda state, qdd, now: jnp.full(2, 4000.0)
    unguarded = distance(once(bad).q, desired)
    faded = once(bad, fade=region.fade)
    assert float(unguarded.max()) > 10.0 * float(strayed.max())
    gone = distance(faded.q_sensing, desired) > 2.4 * strayed.max()
    assert bool(gone.any())
    assert float(jnp.abs(faded.tau_feedforward[gone]).max()) == 0.0
    assert float(distance(faded.q, desired).max()) < 0.3 * float(unguarded.max())

    # its torque in the range of its data, too
    class Bad(ErrorModel):
        def torque(self, params, state, qdd, circumstances=None):
            return bad(state, qdd, circumstances)

    guarded = once(region.feedforward(Bad(), None), fade=region.fade)
    assert float(jnp.abs(guarded.tau_feedforward).max()) <= float(jnp.abs(rows.y).max())
    assert float(distance(guarded.q, desired).max()) < 2.5 * float(strayed.max())


@pytest.mark.slow
def test_learning_goes_on_under_a_guard_and_can_be_differentiated():
    noise = jnp.asarray(draw_noise(2, 3, SMALL_STUDY.steps))

    def final(width, derivative=None):
        condition = CONDITION._replace(friction=width)
        metrics, _, runs = learn(
            SMALL_STUDY.setting("pid", condition),
            noise,
            jax.random.key(2),
            source="joint",
            error_model=SMALL_STUDY.error_model,
            training=SMALL_STUDY.training,
            guard=Guard(),
            record=True,
            derivative=derivative,
        )
        return metrics.q_error, (metrics, runs)

    (value, slope, (metrics, runs)) = jax.jit(
        lambda x: (*jax.jvp(lambda y: final(y, "forward")[0], (x,), (1.0,)), final(x)[1])
    )(5.0)
    np.testing.assert_allclose(value, metrics.q_error, rtol=1e-3)
    assert bool(metrics.finite.all())
    assert np.isfinite(slope).all()
    assert float(slope[0]) != 0.0
    # targets of the first execution bound the torque of the second
    tau = runs.tau_feedforward[1]
    rows = jnp.concatenate(
        [
            runs.tau[0] - runs.tau_inverse_actual[0],
            runs.tau_feedback[0][1:] + runs.tau_feedforward[0][:-1],
        ]
    )
    assert bool(jnp.all((tau >= rows.min(0)[None] - 1e-9) & (tau <= rows.max(0)[None] + 1e-9)))


def test_a_study_without_a_guard_is_the_one_from_before_there_was_one():
    assert "guard" not in PaperStudy().to_dict()
    assert PaperStudy(guard="on").to_dict()["guard"] == "on"
    with pytest.raises(ConfigurationError, match="guard to be one of off, on"):
        PaperStudy(guard="of")


@pytest.mark.parametrize("bounds", [(0.0, 1.0), (2.0, 1.0), (1.0, 1.0), (1.0, np.nan)])
def test_a_guard_that_is_none_is_refused(bounds):
    with pytest.raises(ConfigurationError, match="0 < near < far"):
        Guard(*bounds)
