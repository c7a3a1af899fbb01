"""The feedforward as a file gives the torques of Python, in a process without this package."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.arm.real_time import RealTimeError, latency
from jaxidl.arm.setup import ArmStudy
from jaxidl.files import write_bytes
from jaxidl.learning.deploy import export_feedforward, feedforward
from jaxidl.learning.execute import Task, execute
from jaxidl.models import ErrorModel
from jaxidl.paper.study import Condition
from jaxidl.systems import point_mass
from jaxidl.systems.arm import JOINTS, arm
from jaxidl.types import State
from tests.helpers.process import script

STUDY = ArmStudy()
TOLERANCE = 1e-3  # of torques up to 200 Nm, in single precision [Nm]

ROBOT = """
    import sys
    from pathlib import Path
    import jax
    import numpy as np

    exported = jax.export.deserialize(bytearray(Path("feedforward.jaxexport").read_bytes()))
    torque = jax.jit(exported.call).lower(*exported.in_avals).compile()
    np.save("torques.npy", [np.asarray(torque(*row)) for row in np.load("states.npy")])
    there = {name.partition(".")[0] for name in sys.modules}
    assert not there & {"jaxidl", "mujoco", "flax", "optax"}, there
"""


@pytest.fixture(scope="module")
def parts():
    """Task, body, error model and weights.

    The weights are three times those at the start, so that torques reach their bound.
    """
    params = jax.tree.map(lambda x: 3.0 * x, STUDY.error_model.init(jax.random.key(0)))
    return STUDY.task(), arm().plant.body, STUDY.error_model, params


@pytest.fixture(scope="module")
def on_the_robot(parts, tmp_path_factory):
    """States (N, 3, 7) -> torques (N, 7) by the file alone."""
    folder = tmp_path_factory.mktemp("robot")
    write_bytes(folder / "feedforward.jaxexport", export_feedforward(*parts))

    def torques(states):
        np.save(folder / "states.npy", states.astype(np.float32))
        script(ROBOT, cwd=folder)
        return np.load(folder / "torques.npy")

    return torques


@pytest.mark.slow
def test_the_file_gives_the_torques_of_python_in_a_process_without_this_package(
    parts, on_the_robot
):
    states = (
        np.random.default_rng(0).normal(size=(300, 3, JOINTS)) * np.array([1.0, 2.0, 20.0])[:, None]
    )
    states = states.astype(np.float32)
    # in double precision
    expected = jax.jit(jax.vmap(feedforward(*parts)))(*jnp.moveaxis(states.astype(float), 1, 0))
    np.testing.assert_allclose(on_the_robot(states), expected, atol=TOLERANCE, rtol=0)


def test_python_gives_the_torques_of_an_execution_and_keeps_to_its_bounds(small_study):
    setting = small_study.setting(
        "pid", Condition(jnp.array(0), jnp.array(5e-4), jnp.array(5.0), jnp.array(5.0))
    )
    task = setting.task.replace(torque_limit=jnp.full(2, 50.0), feedforward_limit=15.0)
    params = small_study.error_model.init(jax.random.key(0))
    noise = jnp.asarray(np.random.default_rng(0).normal(size=(small_study.steps, 2)))
    run = execute(
        setting.plant,
        setting.model,
        setting.law,
        task,
        noise,
        partial(small_study.error_model.torque, params),
    )
    torque = jax.vmap(feedforward(task, setting.model, small_study.error_model, params))
    found = torque(run.q_sensing, run.qd_sensing, run.qdd_desired)
    np.testing.assert_allclose(
        found, run.tau_inverse_desired + run.tau_feedforward, atol=TOLERANCE, rtol=0
    )
    for part, bound in ((run.tau_inverse_desired, 50.0), (run.tau_feedforward, 15.0)):
        at_the_bound = jnp.abs(part) == bound
        assert at_the_bound.any()
        assert not at_the_bound.all()


def test_the_file_is_for_cpu_and_gpu_in_full_single_precision(parts):
    exported = jax.export.deserialize(bytearray(export_feedforward(*parts)))
    assert exported.platforms == ("cpu", "cuda")
    assert [(x.shape, x.dtype) for x in (*exported.in_avals, *exported.out_avals)] == [
        ((JOINTS,), jnp.float32)
    ] * 4
    products = [
        line for line in exported.mlir_module().splitlines() if "stablehlo.dot_general" in line
    ]
    assert len(products) > 10
    assert all("precision = [HIGHEST, HIGHEST]" in line for line in products)


def test_exported_feedforward_takes_circumstances_as_an_input():
    error_model = ErrorModel(2, (8, 1), circumstance_scales=(2.0,))
    task = Task(
        State(jnp.zeros(2), jnp.zeros(2)), lambda q, qd, t: -q, torque_limit=jnp.full(2, 800.0)
    )
    given = task, point_mass(105.0), error_model, error_model.init(jax.random.key(1))
    exported = jax.export.deserialize(bytearray(export_feedforward(*given, platforms=("cpu",))))
    state = np.random.default_rng(0).normal(size=(3, 2)).astype(np.float32)
    loaded, empty = (
        np.asarray(exported.call(*state, np.full(1, load, np.float32))) for load in (1.5, 0.0)
    )
    np.testing.assert_allclose(
        loaded,
        feedforward(*given)(*jnp.asarray(state, float), jnp.full(1, 1.5)),
        rtol=1e-5,
        atol=1e-4,
    )
    assert np.abs(loaded - empty).min() > 1e-3


@pytest.mark.slow
def test_latency_is_measured_in_a_process_of_its_own(parts, tmp_path):
    write_bytes(tmp_path / "good.jaxexport", export_feedforward(*parts))
    rows = latency(tmp_path / "good.jaxexport", 30)
    assert [row["of"] for row in rows] == [90, 30, 30, 30]
    assert all(0.0 < row["median [us]"] <= row["99.9 %"] <= row["max"] for row in rows[1:])
    (tmp_path / "bad.jaxexport").write_bytes(b"nothing")
    with pytest.raises(RealTimeError, match="run it again"):
        latency(tmp_path / "bad.jaxexport", 30)
