"""A log and a model that do not have the same joints."""

import json

import numpy as np
import pytest

from jaxidl.errors import LogError
from jaxidl.gap import diagnose
from jaxidl.gap.inputs import read_again, read_inputs, words
from jaxidl.logs.joint_names import misspelt
from tests.helpers.logs import ARM, SAMPLES, THREE, each_joint, robot, same, write


@pytest.mark.parametrize("titles", ["names", "numbers", "array", "part"])
def test_joints_that_are_not_asked_for_are_locked_where_the_log_has_them(tmp_path, titles):
    still = THREE | {"q1": np.full(SAMPLES, 0.4)}
    if titles == "names":
        path = write(
            tmp_path / "a.csv",
            {(f"{ARM[int(k[-1])]}.{k[:-1]}" if k != "time" else k): v for k, v in still.items()},
        )
    elif titles == "array":
        both = {kind: each_joint(still, kind, range(3)) for kind in ("q", "tau")}
        path = write(tmp_path / "a.npz", {"time": still["time"]} | both)
    elif titles == "part":
        path = write(
            tmp_path / "a.csv", {k.replace("2", "1"): v for k, v in still.items() if k[-1] != "1"}
        )
    else:
        path = write(tmp_path / "a.csv", still)
    log, model = read_inputs([path], robot(tmp_path), joints=["wrist_1", "shoulder_pan_joint"])
    assert model.names == ("shoulder_pan_joint", "wrist_1_joint")
    same(log, joints=(0, 2))
    if titles == "part":  # nobody knows where the elbow was
        assert log.still == ()
        return
    assert log.still == (("elbow_joint", pytest.approx(0.4)),)
    assert log.stray == ()
    assert any("elbow_joint at 0.4" in note for note in model.notes)
    moving = write(tmp_path / "b.csv", THREE)
    assert any(
        "elbow_joint is locked" in n
        for n in read_inputs(
            [moving], robot(tmp_path), joints=["wrist_1", "shoulder_pan"]
        ).log.notes
    )


def test_of_a_robot_the_joints_that_the_log_names_are_taken(tmp_path):
    part = {
        f"{ARM[int(k[-1])]}.{k[:-1]}" if k != "time" else k: v
        for k, v in THREE.items()
        if k[-1] != "1"
    }
    log, model = read_inputs([write(tmp_path / "a.csv", part)], robot(tmp_path))
    assert model.names == ("shoulder_pan_joint", "wrist_1_joint")
    same(log, joints=(0, 2))
    assert any("elbow_joint" in note for note in model.notes)
    found = diagnose(tmp_path / "a.csv", robot(tmp_path), effects=["spring"], rollouts=False)
    assert found.model.names == ("shoulder_pan_joint", "wrist_1_joint")
    with pytest.raises(LogError, match="those of shoulder_pan_joint, wrist_1_joint"):
        read_inputs([write(tmp_path / "a.csv", part)], robot(tmp_path), joints=["elbow", "wrist_1"])
    numbered = {k: v for k, v in THREE.items() if k[-1] != "2"}
    with pytest.raises(LogError, match="--joints NAME"):
        read_inputs([write(tmp_path / "b.csv", numbered)], robot(tmp_path))


def test_a_joint_whose_titles_are_misspelt_is_not_locked(tmp_path):
    names = ("shoulder_pan_joint", "elbw_joint", "wrist_1_joint")
    titles = {k: f"{names[int(k[-1])]}.{k[:-1]}" for k in THREE if k != "time"}
    path = write(tmp_path / "a.csv", {titles.get(k, k): v for k, v in THREE.items()})
    with pytest.raises(LogError, match=r"elbow_joint.*elbw.*--joints shoulder_pan_joint wrist_1"):
        read_inputs([path], robot(tmp_path))
    log, _ = read_inputs([path], robot(tmp_path), joints=["shoulder_pan", "wrist_1"])
    same(log, joints=(0, 2))


def test_a_joint_with_a_torque_and_no_position_is_not_locked(tmp_path):
    titles = {k: f"{ARM[int(k[-1])]}.{k[:-1]}" for k in THREE if k != "time"} | {"q1": "bow"}
    path = write(tmp_path / "a.csv", {titles.get(k, k): v for k, v in THREE.items()})
    with pytest.raises(LogError, match=r"beside the torque of elbow_joint.*--joints shoulder_pan"):
        read_inputs([path], robot(tmp_path))
    log, _ = read_inputs([path], robot(tmp_path), joints=["shoulder_pan", "wrist_1"])
    same(log, joints=(0, 2))


@pytest.mark.parametrize(
    ("words", "name", "almost"),
    [
        (("elbw", "position"), "elbow_joint", True),
        (("left", "hip", "pich", "torque"), "left_hip_pitch", True),
        (("elbow", "position"), "elbow", False),  # right
        (("wrist", "2"), "wrist_1_joint", False),  # another joint
        (("left", "knee"), "right_knee", False),
        (("position",), "shoulder_pan", False),
        (("joint", "3"), "joint", False),
    ],
)
def test_what_is_almost_a_name(words, name, almost):
    assert misspelt(words, name) is almost


def test_a_joint_that_moves_without_torque_puts_all_that_follows_in_doubt(tmp_path):
    titles = {k: f"{ARM[int(k[-1])]}.{k[:-1]}" for k in THREE if k not in ("time", "tau1")}
    path = write(tmp_path / "a.csv", {titles.get(k, k): v for k, v in THREE.items() if k != "tau1"})
    log, model = read_inputs([path], robot(tmp_path))
    assert log.stray == ("elbow_joint",)
    found = diagnose(log, model, effects=["viscous_friction"], rollouts=False)
    assert found.summary.startswith("First of all, elbow_joint moved, but is locked in the model")
    assert "and the log has only 1.5 s" in found.summary


def test_a_log_is_read_again_as_it_was_read(tmp_path):
    titles = {"q2": "x17", "tau2": "c17"}
    path = write(tmp_path / "a.csv", {titles.get(k, k): v for k, v in THREE.items()})
    with pytest.raises(LogError):
        read_again([path], robot(tmp_path), {})
    given = {
        "joints": ["wrist_1"],
        "columns": ["q0=x17", "i0=c17"],
        "torque_constant": [0.5],
        "gear_ratio": [2.0],
    }
    first = read_inputs([path], robot(tmp_path), **given)
    again = read_again([path], robot(tmp_path), json.loads(json.dumps(first.log.reading)))
    assert again.model.names == ("wrist_1_joint",)
    np.testing.assert_array_equal(again.log.tau, first.log.tau)
    said = words(first.log.reading)
    assert said.startswith("--joints wrist_1 --columns q0=x17 i0=c17 --torque-constant 0.5")
    assert words(read_inputs([write(tmp_path / "b.csv", THREE)], robot(tmp_path)).log.reading) == ""
