"""Which body carries a payload: the last that moves, or the one that is named."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.errors import ModelError
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.gap.result.notes import notes_of
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.systems.export import write_patched
from jaxidl.systems.mjcf import read_model

ARM = """<body name="{0}1" pos="0 {1} 0"><joint name="{0}_shoulder" axis="0 1 0"/>
  <inertial pos="0 0 -0.1" mass="2" diaginertia="0.02 0.02 0.01"/>
  <body name="{0}2" pos="0 0 -0.3"><joint name="{0}_elbow" axis="0 1 0"/>
    <inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.005"/></body></body>"""
TREE = f"""<mujoco><worldbody><body name="stand">
  <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>
  {ARM.format("left", 0.2)}{ARM.format("right", -0.2)}</body></worldbody></mujoco>"""


@pytest.fixture
def tree(tmp_path):
    path = tmp_path / "tree.xml"
    path.write_text(TREE)
    return path


Q = jnp.array([0.3, -0.2, 0.1, 0.4])
LOAD = fx.Payload(jnp.array(0.5), jnp.array([0.05, 0.0, -0.1]))


def weight(body):
    """Return the torques (J,) that a body's weight needs."""
    return np.asarray(body.equation_of_motion(Q, 0.0 * Q)[1])


def of_load(model):
    return weight(LOAD.alter(model.plant.body)) - weight(model.plant.body)


@pytest.mark.parametrize(("flange", "turned"), [(None, (2, 3)), ("left2", (0, 1)), ("left1", (0,))])
def test_a_load_turns_the_joints_that_carry_it(tree, flange, turned):
    model = read_model(tree, flange=flange)
    assert model.plant.body.carrier == (flange or "right2")
    assert set(np.flatnonzero(np.abs(of_load(model)) > 1e-9)) == set(turned)


def test_the_corrected_model_has_the_load_where_it_was_found(tree, tmp_path):
    model = read_model(tree, flange="left2")
    path, _ = write_patched(model, [LOAD], tmp_path / "out")
    again = read_model(path)  # its file names the flange
    added = weight(again.plant.body) - weight(model.plant.body)
    np.testing.assert_allclose(added, of_load(model), atol=1e-6)
    assert again.plant.body.carrier == "left2"
    assert read_model(path, flange="right1").plant.body.carrier == "right1"


@pytest.mark.parametrize("name", ["hand", "world", "stand"])
def test_a_flange_is_a_body_that_moves(tree, name):
    with pytest.raises(ModelError, match="left1, left2, right1, right2") as error:
        read_model(tree, flange=name)
    assert repr(name) in error.value.got


def test_a_diagnosis_of_several_ends_says_where_it_looks_for_a_load(tree):
    time = 5e-3 * np.arange(2400)
    q = np.sin(time[:, None] * [1.1, 1.7, 2.3, 2.9])
    for flange, said in ((None, ["right2"]), ("left2", [])):
        model = read_model(tree, flange=flange)
        rows = rows_of(prepare(from_arrays(time, q, np.cos(q)), model.plant.body))
        found = [n for n in notes_of(rows, model) if "several ends" in n]
        assert len(found) == len(said)
        assert all(name in note for name, note in zip(said, found, strict=True))
