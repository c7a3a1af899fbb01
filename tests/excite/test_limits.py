"""Limits: where they come from, and what is wrong with a file."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from jaxidl.excite.limits import limits_of
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.systems.bounds import Bounds, Shapes, bounds
from jaxidl.systems.mjcf import read_model
from tests.helpers.commands import refusal

NAMES = ("shoulder", "elbow")
NONE = Bounds(*(side * np.full(2, np.inf) for side in (-1, 1, 1, 1)))
GOOD = "position: [-2, 2]\nspeed: 2\nacceleration: 8\n"
WRONG = {
    "spede: 2": "speed",
    "speed: -1": "above zero",
    "speed: fast": "a number",
    "speed: .nan": "a number",
    "position: 3": r"\[lower, upper\]",
    "position: [2, -2]": r"\[lower, upper\]",
    "margin: 1.5": "margin",
    "joints: {elbwo: {speed: 1}}": "elbow",
    "joints: {elbow: {sped: 1}}": "speed",
    "joints: 3": "by joint",
    "- 1": "keys and values",
    "speed: [": "YAML",
    "start: 3": "a list",
    "start: [0]": "2 numbers",
    "start: [0, 1.95]": "a start of elbow",
    "position: [-0.0005, 0.0005]": "noise",
    "torque: 0.01": "a start that",
}


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.xml"
    bent = TWO_LINK.replace('gravity="0 0 -9.81"', 'gravity="-9.81 0 0"')
    path.write_text(bent)
    return path


@pytest.mark.parametrize("content", WRONG)
def test_a_wrong_limits_file_gets_one_line_and_writes_nothing(content, model, capsys):
    key = content.partition(":")[0]
    lines = [line for line in GOOD.splitlines() if not line.startswith(key)]
    text = content if content in ("- 1", "speed: [") else "\n".join([*lines, content])
    model.with_name("limits.yaml").write_text(text)
    out = model.with_name("motion.csv")
    words = ("--model", model, "--limits", model.with_name("limits.yaml"), "--out", out)
    line = refusal(capsys, "excite", *words)
    assert re.search(WRONG[content], line)
    assert not out.exists()


def test_a_limit_that_nobody_gives_is_asked_for(model, capsys):
    assert "a limit of the speed of shoulder" in refusal(
        capsys, "excite", "--model", model, "--limits", _file(model, "position: [-1, 1]")
    )
    assert "no such file" in refusal(
        capsys, "excite", "--model", model, "--limits", model.with_name("none.yaml")
    )
    assert "the folder of a diagnosis" in refusal(
        capsys, "excite", "--model", model, "--for", model.parent
    )
    assert "leave out --joints" in refusal(
        capsys, "excite", "--model", model, "--for", model.parent, "--joints", "elbow"
    )
    limits = _file(model, "{position: [-1, 1], acceleration: 2.0, torque: 30}")
    given = ["excite", "--model", model, "--joints", "elbow", "--limits", limits]
    assert "a limit of the speed of elbow" in refusal(capsys, *given)
    assert ".csv" in refusal(capsys, "excite", "--model", model, "--out", "motion.txt")


def _file(model, text):
    path = model.with_name("limits.yaml")
    path.write_text(text)
    return path


def test_a_file_comes_before_the_model_and_the_model_before_the_log(tmp_path):
    path = tmp_path / "limits.yaml"
    path.write_text("speed: 2\nmargin: 0.2\njoints: {elbow: {speed: 1, position: [-1, 0.5]}}\n")
    file = NONE._replace(lower=np.full(2, -3.0), upper=np.full(2, 3.0), speed=np.full(2, 9.0))
    reached = {"acceleration": np.full(2, 7.0), "torque": np.full(2, 5.0), "speed": np.ones(2)}
    limits = limits_of(NAMES, file, path, reached)
    assert_allclose(limits.speed, [2, 1])
    assert_allclose(limits.lower, [-3, -1])
    assert_allclose(limits.acceleration, 7)
    assert_allclose(limits.start, [0, -0.25])
    plan = limits.planned()
    assert_allclose(plan.speed, [1.6, 0.8])
    assert_allclose(plan.upper, [2.4, 0.35])
    assert_allclose(plan.torque, 4.0)


def test_limits_and_shapes_of_a_file_are_found(tmp_path):
    path = tmp_path / "model.xml"
    path.write_text("""<mujoco><compiler angle="radian"/><worldbody>
      <geom name="floor" type="plane" size="2 2 0.1"/>
      <body name="upper" pos="0 0 0.5"><joint name="a" axis="0 1 0" range="-2 1"
        actuatorfrcrange="-7 7"/><geom type="capsule" size="0.02" fromto="0 0 0.05 0 0 0.3"/>
        <body name="fore" pos="0 0 0.3"><joint name="b" axis="0 1 0"/>
          <geom type="capsule" size="0.02" fromto="0 0 0.05 0 0 0.6"/></body></body>
    </worldbody></mujoco>""")
    model = read_model(path)
    found = bounds(model)
    assert_allclose(found.lower, [-2, -np.inf])
    assert_allclose(found.torque, [7, np.inf])
    shapes = Shapes(model, 0.1)
    assert shapes.any
    q = np.array([[0.0, 0.0], [1.0, 1.9], [1.0, 1.9 + 1e-4]])
    near = shapes.near(q)
    assert set(near.row) == {1, 2}
    assert "fore" in near.bodies[0]
    change = near.distance[near.row == 2] - near.distance[near.row == 1]
    assert_allclose(change, 1e-4 * near.slope[near.row == 1][:, 1], rtol=1e-2)
