"""Learning from logs is learning in simulation."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.arm.setup import ArmStudy, learn_arm
from jaxidl.errors import ConfigurationError
from jaxidl.learning.guard import Guard
from jaxidl.models import ErrorModel, Training
from jaxidl.robot import folder
from jaxidl.robot.execution import read_execution
from jaxidl.robot.held_out import held_out_rows
from jaxidl.robot.learn import learn_from, program, scaled, sensible
from jaxidl.robot.settings import Wish
from jaxidl.systems.arm import arm
from jaxidl.systems.mjcf import read_model
from jaxidl.types import Dataset, State
from tests.helpers.executions import NETWORKS, SMOOTHING, TRAINING, columns_of
from tests.helpers.logs import write
from tests.robot.conftest import SEED

WISH = Wish(smoothing=SMOOTHING, seed=SEED, guard=Guard(), motion="finite_difference")


def read(path, model, **more):
    return read_execution(path, model, motion="finite_difference", **more)


@pytest.fixture(scope="module")
def iterations(logs, gantry, tmp_path_factory):
    """Three iterations, each from one log and the folder of the last one."""
    found, previous, out = [], None, tmp_path_factory.mktemp("learned") / "out"
    for log in logs[:3]:
        now = learn_from(
            [read(log, gantry)], gantry, WISH, previous, error_model=NETWORKS, training=TRAINING
        )
        folder.save(now, out)
        previous = folder.load(out)
        found.append(previous)
    return found


def assert_same(one, other, rtol):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        a, b = np.asarray(a), np.asarray(b)
        np.testing.assert_allclose(a, b, rtol=0, atol=rtol * max(np.abs(b).max(), 1e-30))


def test_logs_give_the_weights_of_learn_to_rounding(iterations, learned_in_simulation):
    _, learner, _ = learned_in_simulation
    assert (iterations[-1].iteration, iterations[-1].source) == (3, "weighted")
    assert_same(iterations[-1].learner, learner, 1e-5)
    # without the optimiser's state they would differ by far more
    moved = jax.tree.map(lambda a, b: a - b, iterations[-1].learner, iterations[-2].learner)
    assert max(float(jnp.abs(x).max()) for x in jax.tree.leaves(moved.params)) > 1e-2


def test_the_guard_is_that_of_learn(iterations, learned_in_simulation):
    """The feedforward of the fourth execution follows from the third folder."""
    desired, _, runs = learned_in_simulation
    last, run = iterations[-1], jax.tree.map(lambda x: x[3], runs)
    drive = last.region.feedforward(last.error_model, last.learner.params)
    for t in (0, 5, 100, 599):
        state = State(run.q_sensing[t], run.qd_sensing[t])
        share = last.region.fade(state, State(desired.q[t], desired.qd[t]))
        np.testing.assert_allclose(
            share * drive(state, run.qdd_desired[t], None), run.tau_feedforward[t], atol=1e-4
        )


def test_the_exported_file_gives_both_parts_of_the_command(iterations, learned_in_simulation):
    desired, _, runs = learned_in_simulation
    run = jax.tree.map(lambda x: x[3], runs)
    exported = jax.export.deserialize(bytearray(program(iterations[-1])))
    for t in (3, 300):
        row = (run.q_sensing[t], run.qd_sensing[t], run.qdd_desired[t], desired.q[t])
        rigid, learned = exported.call(*(x.astype(np.float32) for x in row))
        np.testing.assert_allclose(rigid, run.tau_inverse_desired[t], atol=1e-3)
        np.testing.assert_allclose(learned, run.tau_feedforward[t], atol=1e-3)


def test_errors_are_known_for_each_iteration(iterations):
    one, two, three = iterations[-1].history
    assert [h["iteration"] for h in (one, two, three)] == [1, 2, 3]
    assert one["left_by_previous"] is None
    assert np.all(np.array(three["left"]) < np.array(three["lacking"]))
    assert np.all(np.array(three["left_by_previous"]) > 0)
    assert all(len(h["held_out_left"]) == 2 for h in (one, two, three))


def test_what_does_not_fit_the_last_iteration_is_refused(iterations, logs, gantry, tmp_path):
    first, newest = (read(log, gantry) for log in logs[::3])
    with pytest.raises(ConfigurationError, match="learned from before"):
        learn_from([first], gantry, WISH, iterations[0])
    with pytest.raises(ConfigurationError, match="twice"):
        learn_from([newest, newest], gantry, WISH, iterations[0])
    with pytest.raises(ConfigurationError, match="2 logs for --kept 1"):
        learn_from([newest], gantry, replace(WISH, kept=1), iterations[0])
    with pytest.raises(ConfigurationError, match="q_desired0"):
        learn_from([newest._replace(desired=None)], gantry, WISH, iterations[0])
    with pytest.raises(ConfigurationError, match="control rate"):
        learn_from([newest._replace(dt=0.004)], gantry, WISH, iterations[0])
    other = tmp_path / "other.xml"
    other.write_bytes(gantry.files[gantry.path.name].replace(b'"1.5"', b'"1.6"'))
    with pytest.raises(ConfigurationError, match="model of the last iteration"):
        learn_from([newest], read_model(other), WISH, iterations[0])
    with pytest.raises(ConfigurationError, match="at least one log"):
        learn_from([], gantry, WISH)


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        (Wish(source="jiont"), "did you mean joint"),
        (Wish(source="weighted"), "--smoothing for --source weighted; got none"),
        (Wish(smoothing=0.0), "0 < --smoothing <= 1; got 0"),
        (Wish(smoothing=float("nan")), "0 < --smoothing <= 1; got nan"),
        (Wish(kept=-1), "--kept >= 0"),
        (Wish(torque_limit=(1.0, 2.0, 3.0)), "one --torque-limit > 0, or 2"),
        (Wish(feedforward_limit=(-1.0,)), "one --feedforward-limit > 0"),
        (Wish(layers=(8, 2)), "end in 1"),
        (Wish(epochs=0), "--epochs"),
    ],
)
def test_wishes_that_cannot_be_met_are_refused(wish, words, logs, gantry):
    with pytest.raises(ConfigurationError, match=words):
        learn_from([read(logs[0], gantry)], gantry, wish)


def test_scales_and_batches_follow_from_the_data():
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (500, 6)) * np.array([1, 2, 30, 40, 500, 600])
    data = Dataset(jnp.asarray(x), jnp.asarray(rng.uniform(-7, 7, (500, 2))))
    m = scaled(data, (4, 1))
    scales = (m.position_scale, m.velocity_scale, m.acceleration_scale, m.torque_scale)
    np.testing.assert_allclose(scales, (2.0, 40.0, 600.0, 7.0), rtol=0.02)
    assert scaled(jax.tree.map(jnp.zeros_like, data)).torque_scale == 1.0
    for rows in (40, 500, 5000):
        training = sensible(rows)
        assert training.batch <= 256
        assert training.steps(rows) >= 8 * training.epochs


@pytest.mark.parametrize(("rows", "sources"), [(200, 1), (199, 1), (399, 2)])
def test_stretches_are_held_out_and_their_edges_not_trained_on(rows, sources):
    time = np.concatenate([np.arange(200), np.arange(199)])[-rows if sources == 1 else 0 :][:rows]
    data = Dataset(jnp.asarray(time[:, None] * 1.0), jnp.zeros((rows, 1)))
    kept, held = (np.asarray(part.x[:, 0]) for part in held_out_rows(data, 200))
    assert 0.25 < len(held) / rows < 0.35
    gaps = np.abs(kept[:, None] - held[None])
    if sources == 2:
        assert gaps.min() >= 2
        assert len(np.unique(held)) < len(held)  # the same stretches of both sources


@pytest.mark.slow
def test_logs_of_the_arm_give_the_weights_of_learn(tmp_path, optimised):
    """Seven joints, a delayed and noisy encoder, filtered accelerations as logged."""
    networks = ErrorModel(7, (40, 20, 1), 1.0, 1.0, 10.0, 10.0)
    study = replace(ArmStudy(), error_model=networks, training=Training(epochs=5, batch=256))
    key = jax.random.key(3)
    learner, runs, finite = jax.jit(lambda: learn_arm(study, "joint", jnp.asarray(1e-5), key, 4))()
    assert finite.all()
    model, previous = arm(), None
    wish = Wish(source="joint", seed=3, motion="finite_difference")
    for k in range(3):
        run = jax.tree.map(lambda x, k=k: x[k], runs)
        log = write(tmp_path / f"{k}.npz", columns_of(run, study.dt))
        read = read_execution(log, model, torque_limit=np.asarray(study.task().torque_limit))
        previous = learn_from(
            [read], model, wish, previous, error_model=networks, training=study.training
        )
        folder.save(previous, tmp_path / "out")
        previous = folder.load(tmp_path / "out")
    # MuJoCo's torques in another program differ by rounding, which training amplifies
    assert_same(previous.learner.params, learner.params, 1e-3)
