"""A controller in C computes what JAX computes, instant by instant and along an execution."""

import re
from dataclasses import replace
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.arm.setup import ArmStudy
from jaxidl.control import Filtered, FiniteDifference, PdPolicy
from jaxidl.errors import ConfigurationError
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.learning.detector import Observer
from jaxidl.learning.execute import Task, desired_trajectory, execute
from jaxidl.learning.guard import Region
from jaxidl.models import ErrorModel
from jaxidl.paper.study import Condition, PaperStudy, draw_noise
from jaxidl.robot.c import Controller, generate
from jaxidl.systems import Plant, PointMass, point_mass
from jaxidl.systems.arm import arm
from jaxidl.systems.mjcf import read_model
from jaxidl.types import State
from tests.helpers.compiled import InC
from tests.helpers.effects import EXAMPLES
from tests.helpers.model_files import CHAIN, RICH, stored
from tests.helpers.numeric import quick
from tests.helpers.paths import UR10E

PAIR = ErrorModel(layers=(13, 6, 1))
CONDITION = Condition(jnp.array(1), jnp.array(5e-4), jnp.array(5.0), jnp.array(5.0))


def double(params):
    return jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), params)


def task_of(joints, **rest):
    still = jnp.zeros(joints)
    return Task(State(still, still), PdPolicy(still, 1.0, 1.0), jnp.inf, **rest)


def states(joints, count=200, seed=0):
    """Random positions, velocities and accelerations (count, J) each."""
    return np.random.default_rng(seed).normal(size=(3, count, joints)) * [
        [[2.0]],
        [[3.0]],
        [[30.0]],
    ]


def robot(name, folder):
    """The plant of a model file."""
    text = {"two_link": TWO_LINK, "rich": RICH, "urdf": CHAIN}.get(name)
    if text:
        path = stored(folder, text, "model.urdf" if name == "urdf" else "model.xml")
        return read_model(path)
    if name == "ur10e" and not UR10E.is_file():
        pytest.skip(f"no model of the UR10e at {UR10E}: name it in JAXIDL_UR10E")
    return read_model(UR10E) if name == "ur10e" else arm()


def late(*values):
    """A case of a slow test."""
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize("name", ["urdf", *map(late, ("arm", "two_link", "rich", "ur10e"))])
def test_rigid_bodies_and_the_effects_of_their_files(name, tmp_path):
    model = robot(name, tmp_path)
    joints = len(model.names)
    own = Controller.of(task_of(joints), model.plant, None, model.names)
    motions = states(joints)
    expected = np.asarray(quick(jax.vmap(model.plant.inverse_dynamics))(*motions))
    for options, tolerance in (
        ((), 1e-9),
        (("-ffast-math",), 1e-9),
        (("-DROBOT_SINGLE",), 1e-5 * np.abs(expected).max()),
    ):
        in_c = InC(own, tmp_path, *options)
        found = [in_c.torque("inverse_dynamics", *m) for m in zip(*motions, strict=True)]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance)


def test_what_accelerates_rotors_is_no_load_of_their_gears(tmp_path):
    model = robot("urdf", tmp_path)
    joints = len(model.names)
    rotors, shares = jnp.linspace(0.1, 0.3, joints), jnp.linspace(0.3, 0.1, joints)
    effects = fx.InertiaError(rotors), fx.LoadDependentFriction(shares)
    plant, motions = model.plant.replace(effects=effects), states(joints)
    in_c = InC(Controller.of(task_of(joints), plant, None, model.names), tmp_path)
    found = [in_c.torque("inverse_dynamics", *m) for m in zip(*motions, strict=True)]
    expected = np.asarray(quick(jax.vmap(plant.inverse_dynamics))(*motions))
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


class Wave(fx.Effect):
    """A user's effect with operations that none of the catalogue has."""

    size: jax.Array
    name: ClassVar[str] = "wave"
    sentence: ClassVar[str] = "a wave /* of */ a user"
    parameters: ClassVar = {"size": fx.Parameter("N", 0.0, 10.0, "the size")}

    def torque(self, q, qd, tau):
        first, second = jnp.split(jnp.log1p(jnp.abs(qd)), 2)
        both = jnp.concatenate([jnp.clip(second, 0.1, 0.5), first**3])
        slow = jnp.where((jnp.abs(qd) < 1.0) | (q > 0.3), both, jnp.sum(q) / (1.0 + qd**2))
        return self.size * jnp.arctan2(slow, q) * jax.nn.sigmoid(jnp.max(q)) ** -2


class Counting(fx.Effect):
    """A user's effect whose formula has no C."""

    name: ClassVar[str] = "counting"

    def torque(self, q, qd, tau):
        return jax.lax.fori_loop(0, 3, lambda _, x: jnp.sin(x), q)


def refusal(own):
    """Why a controller has no C; None if it has."""
    try:
        generate(own, "robot", "")
    except ConfigurationError as error:
        return str(error)
    return None


def test_every_effect_is_computed_or_refused(tmp_path):
    """Alone on one joint, on both, and all that can be computed together."""
    body, kept, refused = point_mass(2.0), [], set()
    for name, effect in {**EXAMPLES, "wave": Wave(jnp.array(1.5))}.items():
        own = Controller.of(task_of(2), Plant(body, (effect,)), None, ("a", "b"))
        said = refusal(own)
        if said is None:
            kept.append(effect)
        else:
            refused.add(name)
            assert re.fullmatch(rf"expected .+; got .*{name}.*; .+", said)
    assert refused == {
        "thermal_friction", "torque_scale", "torque_curve", "motor_coupling", "torque_saturation",
        "actuator_lag", "actuator_delay", "joint_elasticity", "backlash",
        "presliding_friction", "position_bias",
        "sensor_delay", "sensing_noise", "encoder_quantisation",
    }  # fmt: skip
    alone = fx.OnJoint(EXAMPLES["stribeck_friction"].replace(**_first("stribeck_friction")), 1, 2)
    plant = Plant(body, (*kept, alone))
    in_c = InC(Controller.of(task_of(2), plant, None, ("a", "b")), tmp_path)
    for scale in (1.0, 0.1):
        q, qd, qdd = scale * states(2)
        qd[::3, 0], qdd[::6, 0] = 0.0, 0.0  # friction of a joint at rest
        expected = quick(jax.vmap(plant.inverse_dynamics))(q, qd, qdd)
        found = [in_c.torque("inverse_dynamics", *m) for m in zip(q, qd, qdd, strict=True)]
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-9)


def _first(name):
    effect = EXAMPLES[name]
    return {key: getattr(effect, key)[:1] for key in effect.parameters}


class Holding(fx.Effect):
    """A user's effect that holds a joint."""

    name: ClassVar[str] = "holding"

    def holds(self, q, qd, tau):
        return q > 0.0


def test_an_effect_that_holds_joints_is_refused_in_one_line():
    for effect in (Holding(), EXAMPLES["stiction"].replace(signed=True)):
        own = Controller.of(task_of(2), Plant(point_mass(1.0), (effect,)), None, ("a", "b"))
        assert f"{effect.name}, which keeps joints from accelerating" in str(refusal(own))


def test_an_effect_without_a_formula_is_refused_in_one_line():
    own = Controller.of(task_of(2), Plant(point_mass(1.0), (Counting(),)), None, ("a", "b"))
    with pytest.raises(ConfigurationError, match=r"counting .*got JAX's operation .*; take it out"):
        generate(own, "robot", "")


@pytest.mark.parametrize("width", [0.0, late(0.5)])
def test_networks_within_the_range_of_their_data(width, tmp_path):
    model = replace(PAIR, activation_width=width, circumstance_scales=(2.0,))
    params = double(model.init(jax.random.key(1)))
    region = Region(*(jnp.linspace(*ends, 7) for ends in ((-2.0, -9.0), (2.0, 8.0))),
                    jnp.array([-150.0, -90.0]), jnp.array([120.0, 170.0]),
                    0.3, 1.2, 2.4)  # fmt: skip
    rows = states(2)
    load = np.random.default_rng(5).normal(size=(200, 1)) * 5.0
    for given, folder in ((region, "guarded"), (None, "free")):
        (tmp_path / folder).mkdir()
        parts = Controller.of(task_of(2), point_mass(1.0), None, ("a", "b"), model, params, given)
        in_c = InC(parts, tmp_path / folder)

        def torque(q, qd, qdd, load, given=given):
            free = lambda state, *rest: model.torque(params, state, *rest)
            return (given.feedforward(model, params) if given else free)(State(q, qd), qdd, load)

        expected = np.asarray(quick(jax.vmap(torque))(*rows, load))
        found = [in_c.torque("learned", *row) for row in zip(*rows, load, strict=True)]
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)
        at_bounds = np.isin(expected, [-150.0, -90.0, 120.0, 170.0]).mean()
        assert 0.02 < at_bounds < 0.98 if given else at_bounds == 0.0


def replayed(in_c, run, desired, tolerance):
    """Assert that a program gives an execution's torques from its sensed positions alone."""
    dt, worst = 1e-3, 0.0
    own = in_c.controller
    observer = Observer(own.model, dt, lag=own.estimator.lag(dt))
    outside = np.asarray(quick(observer.along)(run))
    in_c.init(run.q_sensing[0])
    names = {
        "qd": "qd_sensing", "qdd_desired": "qdd_desired", "tau": "tau",
        "tau_feedback": "tau_feedback_applied", "tau_learning": "tau_feedback",
        "tau_learned": "tau_feedforward", "tau_rigid_body": "tau_inverse_desired",
    }  # fmt: skip
    arrays = {theirs: np.asarray(getattr(run, theirs)) for theirs in names.values()}
    actual = np.asarray(run.qdd_actual)
    for t in range(len(run.q_sensing)):
        motion = desired.q[t], desired.qd[t], run.qdd_desired[t]
        status, tau = in_c.step(run.q_sensing[t], t * dt, *motion)
        assert status == 0
        np.testing.assert_array_equal(tau, in_c["tau"])
        for ours, theirs in names.items():
            size = np.abs(arrays[theirs]).max() + 1.0
            worst = max(worst, np.abs(in_c[ours] - arrays[theirs][t]).max() / size)
        size = np.abs(arrays["tau"]).max() + 1.0
        worst = max(worst, np.abs(in_c["tau_outside"] - outside[t]).max() / size)
        if t:  # known one reading later
            size = np.abs(actual).max() + 1.0
            worst = max(worst, np.abs(in_c["qdd"] - actual[t - 1]).max() / size)
    assert worst < tolerance


@pytest.mark.parametrize(
    ("controller", "filtered"),
    [("pid", False), ("doomed", True), late("pid", True), late("doomed", False)],
)
def test_an_execution_of_the_papers_plant_is_replayed(controller, filtered, tmp_path):
    study = PaperStudy(steps=400)
    estimator = Filtered() if filtered else FiniteDifference()
    task = study.task().replace(
        estimator=estimator,
        torque_limit=jnp.array([300.0, 250.0]),
        feedforward_limit=jnp.array([40.0, jnp.inf]),
    )
    law, params = study.law(controller, 1), double(PAIR.init(jax.random.key(2)))
    bound = jnp.array([1.5, 1.5, 12.0, 12.0, 500.0, 500.0])
    region = Region(-bound, bound, *jnp.array([[-70.0, -60.0], [65.0, 75.0]]), 0.2, 0.3, 2.4)
    desired, noise = desired_trajectory(task), jnp.asarray(draw_noise(3, 1, 400)[0])
    model = point_mass(study.modelled_mass)
    run = quick(
        lambda noise: execute(
            study.plant(CONDITION), model, law, task, noise,
            region.feedforward(PAIR, params), fade=region.fade,
        )
    )(noise)  # fmt: skip
    shares = np.asarray(jax.vmap(region.fade)(State(run.q_sensing, run.qd_sensing), desired))
    assert shares.min() < 0.9 < shares.max()
    assert (np.abs(run.tau_feedforward) > 39.9).any()
    in_c = InC(Controller.of(task, model, law, ("x", "y"), PAIR, params, region), tmp_path)
    replayed(in_c, run, desired, 1e-9)


class Corrected(PointMass):
    """A corrected model as a rigid body."""

    plant: Plant

    def inverse_dynamics(self, q, qd, qdd):
        return self.plant.inverse_dynamics(q, qd, qdd)


@pytest.mark.slow
def test_an_execution_of_the_arm_is_replayed_with_the_weights_as_trained(tmp_path):
    """DOOMED, filters, seven networks; with weights in double precision within 1e-9."""
    study = ArmStudy()
    setting, task = study.setting(1e-4), replace(study.task(), steps=1500)
    error_model = replace(study.error_model, layers=(40, 20, 1))
    trained = error_model.init(jax.random.key(3))
    desired, noise = desired_trajectory(task), jax.random.normal(jax.random.key(0), (1500, 7))
    corrected = Plant(setting.model, study.effects(0.0)[:6])
    body = Corrected(jnp.ones(7), corrected)
    for params, tolerance in ((trained, 1e-5), (double(trained), 1e-9)):
        torque = lambda state, qdd, _, p=params: error_model.torque(p, state, qdd)
        run = quick(
            lambda noise, f=torque: execute(setting.plant, body, setting.law, task, noise, f)
        )(noise)
        own = Controller.of(task, corrected, setting.law, arm().names, error_model, params)
        replayed(InC(own, tmp_path), run, desired, tolerance)
    # the weights as trained, computed in double precision
    own = Controller.of(task, corrected, setting.law, arm().names, error_model, trained)
    replayed(InC(own, tmp_path, "-DROBOT_DOUBLE_NETWORKS"), run, desired, 1e-9)
