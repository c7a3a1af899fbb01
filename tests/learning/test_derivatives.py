"""Derivatives from end to end: controllers, sources, executions and whole learning runs, forward =
reverse = numeric.

Those of single effects are in effects/test_catalogue.py, those of the arm in arm/test_study.py.
"""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import jaxidl.effects as fx
from jaxidl.control import (
    Doomed,
    Filtered,
    FiniteDifference,
    LqrPolicy,
    PdPolicy,
    Pid,
    PidGains,
    Sequence,
)
from jaxidl.effects import SensingNoise
from jaxidl.learning.execute import Task, execute
from jaxidl.learning.iterate import learn
from jaxidl.learning.sources import SOURCES, rows
from jaxidl.models import ErrorModel, Training, start
from jaxidl.paper.effects import PaperFriction, paper_stiction
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.paper.vary import varied
from jaxidl.scan import scan
from jaxidl.systems import Plant, PointMass
from jaxidl.types import State
from tests.helpers.effects import pair
from tests.helpers.numeric import compare, quick

STEPS, DT = 60, 2e-3
NOISE = jnp.asarray(draw_noise(1, 1, STEPS)[0])
MODEL = ErrorModel(layers=(6, 4, 1), velocity_scale=2.0, acceleration_scale=50.0, torque_scale=20.0)
WEIGHTS = jax.tree.map(lambda leaf: leaf.astype(jnp.float64), MODEL.init(jax.random.key(3)))

LAWS = {
    "pid": Pid(PidGains(25.0, 2.5, 0.005), PidGains(500.0, 50.0, 0.01), 0.1),
    "pid, gains of each joint": Pid(
        PidGains(pair(25.0, 30.0), pair(2.5, 3.0), 0.005),
        PidGains(500.0, pair(40.0, 50.0), 0.01),
        0.2,
    ),
    "doomed": Doomed(0.01, 0.5, 0.1, limit=50.0),
    "doomed, rates of each joint": Doomed(pair(0.01, 0.02), pair(0.5, 0.4), 0.1, 0.7, 50.0),
}
POLICIES = {
    "pd": PdPolicy(pair(1.0, 0.8), 100.0, 10.0),
    "lqr": LqrPolicy(pair(1.0, 0.8), jnp.array([[90.0, 14.0], [100.0, 15.0]])),
    "sequence": Sequence(
        jnp.array([[1.0, 0.8], [0.3, 0.4]]), jnp.array([0, 30]), jnp.array([[90.0, 14.0]])
    ),
}
ESTIMATORS = {"differences": FiniteDifference(), "low passes": Filtered(80.0, 30.0)}
EFFECTS = (
    fx.ViscousFriction(pair(3.0, 2.0)),
    fx.CoulombFriction(pair(1.0, 0.6)),
    SensingNoise(jnp.array(1e-6)),
)


def split(tree):
    """The continuous leaves of a tree, and a function that makes the tree of them."""
    leaves, structure = jax.tree.flatten(tree)
    free = [
        jnp.issubdtype(jnp.result_type(leaf), jnp.floating) and bool(np.isfinite(leaf).all())
        for leaf in leaves
    ]

    def rebuild(values):
        values = iter(values)
        return structure.unflatten(
            [next(values) if is_free else leaf for leaf, is_free in zip(leaves, free, strict=True)]
        )

    return [
        jnp.asarray(leaf, float) for leaf, is_free in zip(leaves, free, strict=True) if is_free
    ], rebuild


def execution(
    law,
    policy=POLICIES["pd"],
    estimator=ESTIMATORS["differences"],
    effects=EFFECTS,
    start=(0.3, 0.5),
    rest=False,
):
    """Everything continuous that an execution depends on."""
    begin = State(pair(*start), jnp.zeros(2) if rest else pair(0.5, -0.4))
    task = Task(begin, policy, pair(4000.0, 5000.0), 300.0, estimator, dt=DT, steps=STEPS)
    return Plant(PointMass(pair(2.0, 2.5)), effects), PointMass(pair(0.5, 0.7)), law, task, WEIGHTS


def outcome(of, values, noise, checkpoint=False):
    """The whole trajectory, thinned out, and the data of all sources."""
    plant, model, law, task, weights = of(values)
    run = execute(
        plant, model, law, task, noise, partial(MODEL.torque, weights), checkpoint=checkpoint
    )
    data = [leaf[::7] for source in SOURCES for leaf in rows(source, run, law)]
    scale = 1e-2 * jnp.ones(())  # compared relative to 1e-3 of it
    return ravel_pytree(
        (
            run.q[::7],
            scale * run.tau[::7],
            scale * run.tau_feedback[::7],
            jax.tree.map(lambda x: scale * x, data),
        )
    )[0]


CASES = {f"law {name}": execution(law) for name, law in LAWS.items()}
CASES |= {f"policy {name}": execution(LAWS["pid"], policy) for name, policy in POLICIES.items()}
CASES |= {
    f"estimator {name}": execution(LAWS["doomed"], estimator=e) for name, e in ESTIMATORS.items()
}
SMOOTH = (
    PaperFriction(jnp.array(3.0), 0.05),
    paper_stiction(0.02, 0.1),
    SensingNoise(jnp.array(1e-6)),
)
CASES |= {"the paper's effects, blurred": execution(LAWS["pid"], effects=SMOOTH, start=(0.1, 0.15))}


@pytest.mark.parametrize("case", CASES)
def test_derivatives_of_an_execution_and_its_data(case):
    """By every number of plant, model, law, policy, estimator, bounds and network weights."""
    values, of = split(CASES[case])
    slopes = compare(partial(outcome, of), (values,), NOISE)
    moved = np.abs(slopes).max(axis=0)
    assert np.isfinite(slopes).all()
    assert (moved > 0.0).mean() > 0.9  # torque limits that are not reached have none


KINKS = (
    *EFFECTS,
    fx.StribeckFriction(pair(1.0, 1.0), pair(0.5, 0.5), pair(0.1, 0.1)),
    fx.Backlash(*(pair(x, x) for x in (1e-3, 4e3, 20.0, 0.3))),
    fx.LoadDependentFriction(pair(0.1, 0.1)),
    PaperFriction(jnp.array(3.0)),
)
STICTIONS = {
    "signed": paper_stiction(0.01),
    "signed, blurred": paper_stiction(0.01, 0.1),
    "unsigned": fx.Stiction(pair(1.0, 1.0), jnp.array(1e-4), jnp.array(5.0)),
}
PLACES = {
    "at rest": ((0.0, 0.0), True, POLICIES["pd"]),
    "at the target": ((1.0, 0.8), True, POLICIES["pd"]),
    "turning round": ((0.9, 0.7), False, PdPolicy(pair(0.9, 0.7), 400.0, 0.0)),
    "sticking": ((0.1, 0.1), True, PdPolicy(pair(0.1005, 0.1), 1.0, 1.0)),
    "on a border": ((0.2, 0.4), True, POLICIES["pd"]),
}


@pytest.mark.parametrize(
    ("law", "stiction"),
    [
        ("pid", "signed"),
        pytest.param("doomed", "signed, blurred", marks=pytest.mark.slow),
        ("pid", "unsigned"),
    ],
)
def test_no_derivative_is_nan_where_effects_have_kinks(law, stiction):
    """Many effects of a joint at once, from places where several of them switch, without noise."""
    cases = [
        split(execution(LAWS[law], p, effects=(*KINKS, STICTIONS[stiction]), start=q, rest=r))
        for q, r, p in PLACES.values()
    ]
    function = partial(outcome, cases[0][1])  # one program for all places: they differ in numbers
    for values, _ in cases:
        compare(function, (values,), 0.0 * NOISE, smooth=False)


@pytest.mark.slow
def test_checkpoints_change_neither_values_nor_derivatives():
    values, of = split(CASES["law doomed"])
    plain, kept = (partial(outcome, of, checkpoint=on) for on in (False, True))
    np.testing.assert_array_equal(jax.jit(plain)(values, NOISE), jax.jit(kept)(values, NOISE))
    grads = [
        quick(jax.grad(lambda v, f=f: jnp.sum(f(v, NOISE) ** 2)))(values) for f in (plain, kept)
    ]
    for a, b in zip(*grads, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("length", [1, 2, 7, 16, 23])
def test_a_checkpointed_scan_is_the_scan(length):
    step = lambda carry, x: (carry * jnp.cos(x["a"]) + x["b"], (carry, x["a"] * carry))
    xs = {"a": jnp.linspace(0.0, 1.0, length), "b": jnp.linspace(1.0, 2.0, length)}
    plain, kept = (scan(step, jnp.array(0.5), xs, checkpoint=on) for on in (False, True))
    jax.tree.map(np.testing.assert_array_equal, plain, kept)


@pytest.mark.slow
def test_a_checkpointed_execution_takes_a_fraction_of_the_memory():
    """Reverse mode's temporary memory, as compiled, of 2000 steps."""
    values, of = split(CASES["law pid"])

    def error(values, checkpoint):
        plant, model, law, task, weights = of(values)
        task = task.replace(steps=2000)
        run = execute(
            plant,
            model,
            law,
            task,
            jnp.zeros((2000, 2)),
            partial(MODEL.torque, weights),
            checkpoint=checkpoint,
        )
        return jnp.mean(run.q**2)

    sizes = [
        quick(jax.grad(partial(error, checkpoint=on)))
        .lower(values)
        .compile()
        .memory_analysis()
        .temp_size_in_bytes
        for on in (False, True)
    ]
    assert sizes[1] < 0.5 * sizes[0]


# --- smooth forms
# --------------------------------------------------------------------------------------------------


def stuck_then_moving(level=0.3, gain=1500.0, friction=3.0, widths=(0.0, 0.0), steps=400):
    """Positions (T, J) of a point mass that PID with an integral breaks away after a while;
    ``level`` of stiction.
    """
    law = Pid(PidGains(gain, 20.0, 1.0), PidGains(500.0, 50.0, 0.01), 0.1)
    effects = (
        PaperFriction(jnp.asarray(friction, float), widths[0]),
        paper_stiction(jnp.asarray(level, float), widths[1]),
    )
    rest = State(jnp.zeros(2), jnp.zeros(2))
    task = Task(rest, PdPolicy(pair(0.05, 0.05), 20.0, 9.0), 5000.0, dt=1e-3, steps=steps)
    return execute(
        Plant(PointMass(pair(5.0, 5.0)), effects),
        PointMass(pair(0.5, 0.5)),
        law,
        task,
        jnp.zeros((steps, 2)),
    ).q


def test_smooth_forms_converge_to_the_sharp_ones_in_values():
    sharp = stuck_then_moving()
    errors = [
        float(jnp.abs(stuck_then_moving(widths=(w, w)) - sharp).max())
        for w in (0.1, 0.03, 0.01, 0.003, 0.001)
    ]
    assert errors[0] > errors[-1]
    assert errors[-1] < 0.03 * errors[0]
    assert all(b < 1.05 * a for a, b in pairwise(errors))


def test_a_width_of_zero_is_the_paper_to_the_bit():
    q = jnp.asarray(np.random.default_rng(0).uniform(-0.2, 1.4, (200, 2)))
    # borders are strict
    q = q.at[:5].set(jnp.array([[0.2, 0.2], [0.2, 0.4], [0.1, 1.2], [0.0, 0.0], [0.3, 0.2]]))

    def reference(q):
        q0, q1 = q
        c0, c1 = (
            (10 * np.exp(5.0) * np.sin(q0) ** 2 if q0 < 0.2 else 0.0),
            (50 * np.cos(q1) ** 2 if q1 < 0.2 else 0.0),
        )
        c1 = -25 * np.sin(q1) ** 2 if 0.2 < q1 < 0.4 else c1
        return (5 * np.sin(q1) ** 2 if 0.4 < q1 < 1.2 else c0), c1

    got = jax.vmap(PaperFriction(jnp.array(5.0)).coefficient)(q)
    np.testing.assert_allclose(got, [reference(row) for row in np.asarray(q)], rtol=1e-12)
    assert paper_stiction(5.0).holds(*[jnp.zeros(2)] * 3).dtype == bool


def test_where_the_sharp_form_misleads_and_the_smooth_one_does_not():
    """More stiction means a later break-away.

    The sharp form's derivative is 0, the smooth form's is that of the difference.
    """
    late = lambda level, widths: jnp.mean(
        jnp.abs(stuck_then_moving(level, widths=widths)[:, 0] - 0.05)
    )
    sharp, smooth = ((partial(late, widths=w)) for w in ((0.0, 0.0), (0.02, 0.05)))
    seen = (sharp(0.33) - sharp(0.27)) / 0.06
    assert seen > 1e-3
    assert jax.jvp(sharp, (0.3,), (1.0,))[1] == 0.0
    slope = jax.jvp(smooth, (0.3,), (1.0,))[1]
    np.testing.assert_allclose(slope, (smooth(0.3 + 1e-5) - smooth(0.3 - 1e-5)) / 2e-5, rtol=1e-4)
    np.testing.assert_allclose(slope, seen, rtol=0.3)


def test_stiction_that_holds_a_share_withstands_a_share_of_the_torque():
    """The unsigned form, blurred, between sticking and not.

    At infinite and zero borders nothing is NaN.
    """
    q, zero = pair(0.0, 0.1), jnp.zeros(2)
    for below in (jnp.inf, 0.1, 0.0):
        effect = fx.Stiction(pair(2.0, 0.0), pair(1e-3, 0.0), jnp.array(below), width=0.1)
        level = effect.dry(q, zero, zero, zero)
        assert (level >= 0.0).all()
        assert (level <= 2.0).all()
        slopes = jax.grad(lambda e, q: jnp.sum(e.dry(q, zero, zero, zero)), argnums=(0, 1))(
            effect, q
        )
        assert all(bool(jnp.isfinite(leaf).all()) for leaf in jax.tree.leaves(slopes))
    sharp = fx.Stiction(pair(2.0, 2.0), jnp.array(1e-3), jnp.array(0.05))
    np.testing.assert_array_equal(sharp.dry(q, zero, zero, zero), [2.0, 0.0])
    close = sharp.replace(width=1e-3)
    np.testing.assert_allclose(close.dry(q, zero, zero, zero), [2.0, 0.0], atol=1e-9)


# --- through learning
# --------------------------------------------------------------------------------------------------

NAMES = {
    "learner_gain": 300.0,
    "alpha": 0.2,
    "prior_mass": 0.7,
    "learning_rate": 2e-3,
    "applied_gain": 100.0,
    "policy_gains.0": 90.0,
}
SMALL = PaperStudy(
    steps=100,
    target=(0.05, 0.05),
    error_model=ErrorModel(
        layers=(5, 1),
        velocity_scale=1.0,
        acceleration_scale=20.0,
        torque_scale=50.0,
        activation_width=0.5,
    ),
    training=Training(epochs=2, batch=16),
    friction_width=0.05,
    stiction_width=0.1,
)


def learned(values, seed, *, controller, source, derivative, study=SMALL, executions=3):
    """Log of each execution's tracking error and feedback, in float64 throughout."""
    study = varied(study, dict(zip(NAMES, values, strict=True)))
    weights = jax.tree.map(
        lambda leaf: leaf.astype(jnp.float64), study.error_model.init(jax.random.key(7))
    )
    noise = jnp.asarray(draw_noise(3, executions, study.steps))
    setting = study.setting(controller, Condition(0, 1e-7, 2.0, 0.05))
    metrics, _, _ = learn(
        setting,
        noise,
        jax.random.key(seed),
        source=source,
        error_model=study.error_model,
        training=study.training,
        learner=start(study.training, weights),
        derivative=derivative,
    )
    return jnp.log(jnp.stack([metrics.q_error, metrics.feedback_applied])).ravel()


def both_ways(run, x):
    """Derivatives of ``run`` by ``x``, forward and reverse."""
    forward = quick(jax.jacfwd(partial(run, derivative="forward")))(x, 5)
    reverse = quick(jax.jacrev(partial(run, derivative="reverse")))(x, 5)
    return np.asarray(forward), np.asarray(reverse)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("controller", "source"), [("pid", "direct"), ("doomed", "joint"), ("doomed", "indirect")]
)
def test_derivatives_through_learning(controller, source):
    """Error and feedback of three executions with two trainings between them, by gains, filter,
    prior mass and learning rate.
    """
    x = np.array(list(NAMES.values()))
    run = partial(learned, controller=controller, source=source)
    value = quick(partial(run, derivative=None))
    forward, reverse = both_ways(run, x)
    np.testing.assert_allclose(reverse * x, forward * x, rtol=1e-7, atol=1e-9)
    steps = np.diag(1e-5 * x)
    numeric = np.stack(
        [np.asarray(value(x + step, 5) - value(x - step, 5)) / (2 * step.sum()) for step in steps],
        axis=1,
    )
    np.testing.assert_allclose(numeric * x, forward * x, rtol=2e-4, atol=2e-6)
    learns = np.abs(forward * x).max(axis=0)
    assert (learns[[1, 3]] > 0).all() if source != "indirect" else learns[3] > 0
    if source == "indirect":  # which the learning feedback is not part of
        assert (forward[:, :2] == 0).all()


@pytest.mark.slow
def test_asking_for_derivatives_changes_no_value():
    x, run = np.array(list(NAMES.values())), partial(learned, controller="doomed", source="joint")
    sharp = replace(SMALL, error_model=replace(SMALL.error_model, activation_width=0.0))
    plain, forward, reverse = (
        quick(partial(run, derivative=d, study=sharp))(x, 5) for d in (None, "forward", "reverse")
    )
    np.testing.assert_allclose(forward, plain, rtol=1e-12)
    np.testing.assert_allclose(reverse, plain, rtol=1e-12)


@pytest.mark.slow
def test_sharp_activations_have_the_derivative_between_two_jumps():
    """At PReLU's kinks the trained weights jump. Between two jumps the derivative is right."""
    x = np.array(list(NAMES.values()))
    study = replace(SMALL, error_model=replace(SMALL.error_model, activation_width=0.0))
    run = partial(learned, controller="pid", source="joint", study=study)
    along = 1e-8 * x * (np.arange(6) == 3)
    slope = quick(
        lambda x: jax.jvp(
            partial(run, derivative="forward"), (x, 5), (along, np.zeros((), jax.dtypes.float0))
        )
    )(x)[1]
    value = quick(partial(run, derivative=None))
    np.testing.assert_allclose(
        np.asarray(value(x + along, 5) - value(x - along, 5)) / 2, slope, rtol=1e-3, atol=1e-14
    )


def test_rounded_activations_converge_to_sharp_ones():
    from jaxidl.models.mlp import prelu, smooth_prelu

    z, slopes = jnp.linspace(-3.0, 3.0, 61)[None], jnp.array([[0.25]])
    errors = [
        float(jnp.abs(smooth_prelu(z, slopes, w) - prelu(z, slopes)).max())
        for w in (1.0, 0.1, 0.01)
    ]
    np.testing.assert_allclose(errors, 0.75 * np.log(2.0) * np.array([1.0, 0.1, 0.01]), rtol=1e-9)


def test_weights_that_have_not_moved_have_a_finite_derivative():
    """A unit that no sample reaches has gradient and moment 0, and √0 an infinite slope."""
    from jaxidl.models.training import adam

    def after(rate, g):
        optimiser = adam(rate)
        return optimiser.update(g, optimiser.init(g))[0]

    for f in (jax.jacfwd, jax.jacrev):
        by_rate, by_gradient = f(after, argnums=(0, 1))(jnp.array(1e-3), jnp.zeros(3))
        assert bool(jnp.isfinite(by_rate).all())
        assert bool(jnp.isfinite(by_gradient).all())


def test_an_unknown_mode_is_refused(small_study):
    from jaxidl.errors import ConfigurationError

    with pytest.raises(ConfigurationError, match="forward"):
        learned(
            np.array(list(NAMES.values())),
            0,
            controller="pid",
            source="joint",
            derivative="backward",
        )
