"""One configuration: execution, sources, and learning on systems whose answer is known."""

import warnings
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lfilter

from jaxidl.control import Doomed, Filtered, PdPolicy, Pid, PidGains, lqr
from jaxidl.effects import ActuatorDelay, ConstantOffset, ViscousFriction
from jaxidl.learning.execute import Task, _warn_of_single_precision, desired_trajectory, execute
from jaxidl.learning.iterate import Setting, learn
from jaxidl.learning.sources import SOURCES, direct, indirect, joint, weighted
from jaxidl.models import ErrorModel, Training
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.systems import Plant, integrate, point_mass
from jaxidl.types import State

DT = 1e-3
CONDITION = Condition(jnp.array(0), jnp.array(5e-4), jnp.array(5.0), jnp.array(5.0))


def python_execution(setting, noise, torque_of=None):
    """Algorithm 1 as a plain Python loop over instants, without scan or jit."""
    task, plant, law = setting.task, setting.plant, setting.law
    true, hidden, sensed = task.start, plant.start(task.start.q), task.start
    memory, wanted = law.init(true.q), task.start
    rows = []
    for t in range(task.steps):
        qdd_d = task.policy(sensed.q, sensed.qd, t)
        feedback, memory = law.act(memory, wanted, sensed)
        rbd = setting.model.inverse_dynamics(sensed.q, sensed.qd, qdd_d)
        tau = rbd + feedback.applied + (torque_of(sensed, qdd_d) if torque_of else 0.0)
        rows.append((true.q, sensed.qd, tau, feedback.learning))
        true, hidden = plant.step(true, hidden, tau, task.dt)
        q = plant.sense(hidden, true.q, noise[t])
        qd = (q - sensed.q) / task.dt
        qdd_a = (qd - sensed.qd) / task.dt
        memory = law.observe(memory, qdd_d, qdd_a)
        sensed = State(q, qd)
        wanted = integrate(wanted, task.policy(wanted.q, wanted.qd, t), task.dt)
    return [jnp.stack(column) for column in zip(*rows, strict=True)]


def test_a_task_is_a_second_at_1_khz_and_its_length_is_part_of_its_form():
    start = State(jnp.zeros(2), jnp.zeros(2))
    task = Task(start, PdPolicy(jnp.zeros(2), 1.0, 1.0), 5.0)
    assert (task.dt, task.steps) == (1e-3, 1000)  # as in the paper
    form = jax.tree.structure(task)
    # none of them is traced: a scan needs its length when it is compiled
    for other in ({"steps": 1001}, {"dt": 1e-2}, {"world": lambda plant, now: plant}):
        assert jax.tree.structure(task.replace(**other)) != form
    assert len(jax.tree.leaves(task.replace(world=lambda plant, now: plant))) == len(
        jax.tree.leaves(task)
    )


@pytest.mark.parametrize("controller", ["pid", "doomed"])
def test_scan_vmap_and_a_python_loop_give_the_same_execution(controller):
    study = PaperStudy(steps=60)
    noise = jnp.asarray(draw_noise(3, 3, 60))
    setting = study.setting(controller, CONDITION)
    one = [execute(setting.plant, setting.model, setting.law, setting.task, z) for z in noise]
    many = jax.vmap(lambda z: execute(setting.plant, setting.model, setting.law, setting.task, z))(
        noise
    )
    for k, run in enumerate(one):
        own = [leaf[k] for leaf in jax.tree.leaves(many)]
        for a, b in zip(own, jax.tree.leaves(run), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-9)
    q, qd, tau, learning = python_execution(setting, noise[0])
    for got, wanted in (
        (one[0].q, q),
        (one[0].qd_sensing, qd),
        (one[0].tau, tau),
        (one[0].tau_feedback, learning),
    ):
        np.testing.assert_allclose(got, wanted, rtol=1e-12, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("kept", [0, 2])
def test_a_whole_learning_run_equals_its_steps_taken_one_by_one(small_study, kept):
    from jaxidl.models import draw_batches, fit, start

    study, key = small_study, jax.random.key(5)
    executions = 3 if kept == 0 else 5  # more than are kept
    noise = jnp.asarray(draw_noise(5, executions, study.steps))
    setting = study.setting("doomed", CONDITION)
    settings = {
        "source": "joint",
        "error_model": study.error_model,
        "training": study.training,
        "kept": kept,
    }
    metrics, learner, runs = jax.jit(lambda n, k: learn(setting, n, k, record=True, **settings))(
        noise, key
    )
    by_hand = start(study.training, study.error_model.init(jax.random.fold_in(key, 0)))
    torque_of, past = None, []  # the newest first
    for k in range(executions):
        if past:
            seen = [past[slot % min(k, 1 + kept)] for slot in range(1 + kept)]
            data = jax.tree.map(lambda *parts: jnp.concatenate(parts), *seen)
            rows = (1 + kept) * int(study.training.train_mask(len(past[0].x)).sum())
            batches = draw_batches(jax.random.fold_in(key, k), rows, study.training)
            by_hand, _ = fit(
                study.error_model, study.training, by_hand, data, batches, executions=1 + kept
            )
            torque_of = lambda s, a, now, p=by_hand.params: study.error_model.torque(p, s, a, now)
        run = execute(setting.plant, setting.model, setting.law, setting.task, noise[k], torque_of)
        past.insert(0, joint(run))
        # float32 training amplifies the rounding of differently fused programs
        np.testing.assert_allclose(runs.q[k], run.q, rtol=1e-3, atol=1e-5)
        np.testing.assert_allclose(
            metrics.q_error[k], jnp.abs(run.q - setting.reference).mean(), rtol=1e-3
        )
    jax.tree.map(
        lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-2, atol=1e-4),
        learner.params,
        by_hand.params,
    )


def test_everything_works_in_single_precision_without_x64(small_study):
    with jax.enable_x64(False):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the setting's own execution
            setting = small_study.setting("pid", Condition(1, 5e-4, 5.0, 5.0))
        noise = jnp.asarray(draw_noise(1, 2, small_study.steps), jnp.float32)
        how = {
            "source": "direct",
            "error_model": small_study.error_model,
            "training": small_study.training,
        }
        _warn_of_single_precision.cache_clear()
        with pytest.warns(UserWarning, match="jax_enable_x64") as said:
            metrics, _, _ = jax.jit(lambda n: learn(setting, n, jax.random.key(0), **how))(noise)
        assert len(said) == 1
        assert metrics.q_error.dtype == jnp.float32
        assert bool(metrics.finite.all())


def probe(plant, model, law, steps=400):
    """A task on a plant of its own, for any number of joints."""
    joints = model.mass.shape[0]
    rest = State(jnp.zeros(joints), jnp.zeros(joints))
    task = Task(rest, PdPolicy(jnp.ones(joints), 100.0, 20.0), 5000.0, dt=0.001, steps=steps)
    ideal = execute(
        Plant(plant.body), plant.body, Doomed(0.0, 0.0, 0.1), task, jnp.zeros((steps, joints))
    ).q
    return Setting(plant, model, law, task, ideal)


STIFF = Pid(PidGains(500.0, 50.0, 0.01), PidGains(500.0, 50.0, 0.01), 0.1)
PROBES = {
    "constant bias": (
        Plant(point_mass(2.0), (ConstantOffset(jnp.array([-30.0, 20.0])),)),
        point_mass(2.0),
    ),
    "viscous friction": (
        Plant(point_mass(2.0), (ViscousFriction(jnp.array([20.0, 30.0])),)),
        point_mass(2.0),
    ),
    "mass error": (Plant(point_mass(2.0)), point_mass(1.0)),
}


@pytest.mark.parametrize("name", PROBES)
def test_indirect_targets_equal_the_closed_form(name):
    """Indirect: what the true system needs beyond the model at the acceleration that happened."""
    plant, model = PROBES[name]
    setting = probe(plant, model, STIFF)
    run = execute(plant, model, setting.law, setting.task, jnp.zeros((400, 2)))
    missing = {
        "constant bias": lambda qd, qdd: jnp.broadcast_to(jnp.array([30.0, -20.0]), qd.shape),
        "viscous friction": lambda qd, qdd: jnp.array([[20.0, 30.0]]) * qd,
        "mass error": lambda qd, qdd: (2.0 - 1.0) * qdd,
    }[name]
    true_qdd = jnp.diff(run.qd, axis=0, append=run.qd[-1:]) / setting.task.dt
    data = indirect(run)
    # sensed velocities are one-sided differences: their acceleration is the mean of this step's and
    # the last one's
    sensed = np.asarray(run.qdd_actual)[1:-1]
    np.testing.assert_allclose(sensed, (true_qdd[1:-1] + true_qdd[:-2]) / 2, rtol=1e-6, atol=1e-6)
    slack = model.mass[None] * (true_qdd - run.qdd_actual)
    np.testing.assert_allclose(
        (data.y - slack)[1:-1], missing(run.qd, true_qdd)[1:-1], rtol=1e-6, atol=1e-5
    )


def test_direct_targets_equal_the_closed_form():
    """Direct, PID: the filtered high-gain feedback one step later, plus what the error model had
    given.
    """
    plant, model = PROBES["constant bias"]
    setting = probe(plant, model, STIFF)
    given = jnp.array([3.0, 4.0])
    run = execute(plant, model, STIFF, setting.task, jnp.zeros((400, 2)), lambda s, a, now: given)
    wanted = desired_trajectory(setting.task)
    e, rate = wanted.q - run.q_sensing, wanted.qd - run.qd_sensing
    integral = jnp.cumsum(0.01 * e, axis=0) - 0.01 * e
    filtered, rows = None, []
    for sample in np.asarray(500 * e + 50 * rate + 0.01 * e + integral):
        filtered = sample if filtered is None else 0.1 * sample + 0.9 * filtered
        rows.append(filtered)
    np.testing.assert_allclose(
        direct(run).y, np.stack(rows)[1:] + np.asarray(given), rtol=1e-10, atol=1e-9
    )
    np.testing.assert_allclose(direct(run).x[:, 4:], run.qdd_desired[:-1])


def test_weighted_data_keep_the_feedforward_and_correct_it_without_delay():
    """Both halves against SciPy's filter, run forwards and backwards over what was not filtered."""
    plant, model = PROBES["mass error"]
    setting = probe(plant, model, STIFF)
    noise = jnp.asarray(np.random.default_rng(4).normal(0.0, 1.0, (400, 2)))
    given = lambda state, qdd, now: 3.0 * state.qd + 0.2 * qdd
    run = execute(plant, model, STIFF, setting.task, noise, given)
    data = weighted(run, 0.1)

    def around(x):
        start = 0.9 * np.asarray(x)[:1]
        there, _ = lfilter([0.1], [1.0, -0.9], x, axis=0, zi=start)
        back, _ = lfilter([0.1], [1.0, -0.9], there[::-1], axis=0, zi=0.9 * there[-1:])
        return back[::-1]

    q, qd, qdd = run.q_sensing, run.qd_sensing, run.qdd_desired
    happened = run.tau_feedforward + around(run.tau - run.tau_feedforward - run.tau_inverse_actual)
    x = np.hstack([q, qd, qdd - around(qdd - run.qdd_actual)])
    np.testing.assert_allclose(data.x, np.vstack([x, np.hstack([q, qd, qdd])[:-1]]), atol=1e-9)
    np.testing.assert_allclose(data.y[:400], happened, rtol=1e-10, atol=1e-9)
    wanted = desired_trajectory(setting.task)
    e, rate = wanted.q - q, wanted.qd - qd
    unfiltered = 500 * e + 50 * rate + 0.01 * e + jnp.cumsum(0.01 * e, axis=0) - 0.01 * e
    asked = run.tau_feedforward[:-1] + around(unfiltered)[1:]
    np.testing.assert_allclose(data.y[400:], asked, rtol=1e-9, atol=1e-8)
    # no rule may look at what a robot does not have
    blind = replace(run, q=jnp.full_like(run.q, jnp.nan), qd=jnp.full_like(run.qd, jnp.nan))
    for one, other in zip(data, weighted(blind, 0.1), strict=True):
        np.testing.assert_array_equal(one, other)


QUICK = {("viscous friction", s) for s in SOURCES} | {(name, "joint") for name in PROBES}


@pytest.mark.parametrize(
    ("name", "source"),
    [
        pytest.param(name, s, marks=() if (name, s) in QUICK else pytest.mark.slow)
        for name in PROBES
        for s in SOURCES
    ],
)
def test_the_learner_removes_what_is_known_to_be_missing(name, source):
    plant, model = PROBES[name]
    error_model = ErrorModel(
        layers=(32, 16, 1),
        position_scale=1.0,
        velocity_scale=5.0,
        acceleration_scale=100.0,
        torque_scale=100.0,
    )
    training = Training(epochs=60, batch=32, learning_rate=3e-3)
    noise = jnp.zeros((6, 400, 2))
    how = {"source": source, "error_model": error_model, "training": training}
    metrics, _, _ = jax.jit(lambda s, n: learn(s, n, jax.random.key(1), **how))(
        probe(plant, model, STIFF), noise
    )
    assert bool(metrics.finite.all())
    assert metrics.q_error[-1] < 0.3 * metrics.q_error[0]
    # the direct target is the *filtered* feedback, ten steps late: where the missing torque changes
    # fast it contradicts the indirect target, and a network trained on both can only settle between
    # them
    left = {"indirect": 0.05, "direct": 0.35, "joint": 0.6, "weighted": 0.2}[source]
    assert metrics.feedback_applied[-1] < left * metrics.feedback_applied[0]


@pytest.mark.parametrize("joints", [1, 3])
def test_learning_works_for_any_number_of_joints(joints):
    plant = Plant(point_mass(2.0, joints), (ViscousFriction(jnp.full(joints, 20.0)),))
    model = ErrorModel(joints=joints, layers=(8, 1))
    how = {"source": "joint", "error_model": model, "training": Training(epochs=1)}
    metrics, learner, runs = learn(
        probe(plant, point_mass(1.0, joints), STIFF, 100),
        jnp.zeros((2, 100, joints)),
        jax.random.key(0),
        record=True,
        **how,
    )
    assert runs.q.shape == (2, 100, joints)
    assert learner.params["params"]["weights_0"].shape == (joints, 8, 3 * joints)
    assert bool(metrics.finite.all())


def test_training_on_the_sensed_state_changes_the_inputs_only():
    setting = PaperStudy(steps=50).setting("doomed", CONDITION)
    run = execute(
        setting.plant,
        setting.model,
        setting.law,
        setting.task,
        jnp.asarray(draw_noise(1, 1, 50)[0]),
    )
    true, sensed = (joint(run, train_on=which) for which in ("true_state", "sensed_state"))
    np.testing.assert_array_equal(true.y, sensed.y)
    np.testing.assert_array_equal(
        sensed.x[:50, :4], jnp.concatenate([run.q_sensing, run.qd_sensing], axis=1)
    )
    assert jnp.abs(true.x - sensed.x).max() > 1e-5


def test_a_training_that_fails_is_flagged_and_the_first_execution_is_not(small_study):
    wild = replace(small_study, training=replace(small_study.training, learning_rate=1e30))
    setting = wild.setting("pid", CONDITION)
    noise = jnp.asarray(draw_noise(1, 3, wild.steps))
    how = {"source": "joint", "error_model": wild.error_model, "training": wild.training}
    metrics, _, _ = jax.jit(lambda n: learn(setting, n, jax.random.key(0), **how))(noise)
    np.testing.assert_array_equal(metrics.finite, [True, False, False])


@pytest.mark.parametrize("horizon", [None, 1200])
def test_an_lqr_policy_takes_the_plant_to_its_target(horizon):
    policy = lqr(jnp.array([1.0, -0.5]), 1e-3, effort=1e-4, horizon=horizon)
    rest = State(jnp.zeros(2), jnp.zeros(2))
    task = Task(rest, policy, 5000.0, dt=1e-3, steps=1200)
    body = point_mass(2.0)
    run = execute(Plant(body), body, Doomed(0.0, 0.0, 0.1), task, jnp.zeros((1200, 2)))
    np.testing.assert_allclose(run.q[-1], [1.0, -0.5], atol=2e-2)


@pytest.mark.parametrize("delay", [0, 1])
def test_filtered_compares_with_what_was_wanted_when_the_estimate_was_true(delay):
    """What was wanted when the estimate was true is compared with the estimate.

    A plant that obeys at once, or one step late, then looks wrong to DOOMED by at most half a
    step's change of the desired acceleration. Its learning feedback is minus the error that it
    sees, here with a gain of one and no memory.
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


def test_a_start_other_than_the_tasks_is_seen_from_the_first_step_on():
    plant, seen, noise = Plant(point_mass(2.0)), jnp.array([0.1, -0.2]), jnp.zeros((20, 2))
    task = Task(
        State(seen, jnp.zeros(2)),
        PdPolicy(jnp.ones(2), 25.0, 7.0),
        100.0,
        estimator=Filtered(),
        dt=DT,
        steps=20,
    )
    off, same, default = (
        execute(plant, plant.body, Doomed(0.0, 0.0, 0.1), task, noise, start=s)
        for s in (seen + 1e-4, seen, None)
    )
    np.testing.assert_array_equal(off.q[0], seen + 1e-4)
    np.testing.assert_array_equal(off.q_sensing[0], seen)
    np.testing.assert_array_equal(off.q_sensing[1:], off.q[1:])
    np.testing.assert_array_equal(same.q, default.q)
