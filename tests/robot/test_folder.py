"""The folder of a learned feedforward: whole or not there, checked when read."""

import shutil
from dataclasses import replace

import jax
import numpy as np
import pytest

from jaxidl.errors import ModelError, StoreError
from jaxidl.models import start
from jaxidl.robot.folder import check_folder, load, save
from jaxidl.robot.learned import Learned
from jaxidl.systems.mjcf import read_model
from tests.helpers.executions import NETWORKS, TRAINING


@pytest.fixture(scope="module")
def learned(gantry):
    learner = start(TRAINING, NETWORKS.init(jax.random.key(0)))
    limits = np.array([np.inf, 3.0]), np.array([1.0, np.inf])
    settings = "joint", 2, 1, 0, 0.002, *limits, "offline", ("a",)
    return Learned(gantry, NETWORKS, learner, TRAINING, *settings, smoothing=0.1)


@pytest.fixture(scope="module")
def saved(learned, tmp_path_factory):
    """The folder, for tests that copy it."""
    return save(learned, tmp_path_factory.mktemp("saved") / "out")


def test_what_is_saved_comes_back(learned, tmp_path):
    save(learned, tmp_path / "a" / "out", {"figures/x.png": b"x"})
    back = load(tmp_path / "a" / "out")
    jax.tree.map(np.testing.assert_array_equal, back.learner, learned.learner)
    same = "error_model training source smoothing iteration seed kept dt logs"
    for name in same.split():
        assert getattr(back, name) == getattr(learned, name)
    np.testing.assert_array_equal(back.torque_limit, learned.torque_limit)
    np.testing.assert_array_equal(back.feedforward_limit, learned.feedforward_limit)
    assert back.model.names == learned.model.names
    save(learned, tmp_path / "a" / "out")  # replaced as a whole
    assert not (tmp_path / "a" / "out" / "figures").exists()
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["out"]


def cut(path):
    path.write_bytes(path.read_bytes()[:-9])


@pytest.mark.parametrize(
    ("name", "damage", "words"),
    [
        ("weights.npz", cut, "damaged weights.npz"),
        ("weights.npz", lambda path: path.unlink(), "no weights.npz"),
        ("model.xml", lambda path: path.write_text(path.read_text() + " "), "damaged model.xml"),
        ("feedforward.json", cut, "jaxidl learn wrote"),
        ("feedforward.json", lambda path: path.unlink(), "no feedforward.json"),
        (
            "feedforward.json",
            lambda path: path.write_text(path.read_text().replace('"joint"', '"direct"')),
            "damaged feedforward.json",
        ),
        (
            "feedforward.json",
            lambda path: path.write_text(path.read_text().replace('"format": 1', '"format": 9')),
            "format 9",
        ),
        ("feedforward.json", lambda path: path.write_text("[]"), "jaxidl learn wrote"),
    ],
)
def test_a_damaged_folder_is_refused(name, damage, words, saved, tmp_path):
    shutil.copytree(saved, tmp_path / "out")
    damage(tmp_path / "out" / name)
    with pytest.raises(StoreError, match=words) as caught:
        load(tmp_path / "out")
    assert "\n" not in str(caught.value)


def test_folders_of_others_are_left_alone(learned, saved, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(StoreError, match=r"notes\.txt"):
        check_folder(tmp_path)
    shutil.copytree(saved, tmp_path / "out")
    check_folder(tmp_path / "out")
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(StoreError, match=r"mine\.txt"):
        save(learned, tmp_path / "out")
    with pytest.raises(StoreError, match="a file"):
        check_folder(tmp_path / "notes.txt")


def test_a_failure_leaves_the_older_folder(learned, saved, tmp_path, monkeypatch):
    shutil.copytree(saved, tmp_path / "out")
    monkeypatch.setattr("jaxidl.robot.folder._check_copy", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        save(learned, tmp_path / "out", {"x": b"new"})
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert load(tmp_path / "out").iteration == 2


def test_a_model_of_several_files_is_refused(learned, gantry, tmp_path):
    inner = gantry.files[gantry.path.name].decode()
    (tmp_path / "inner.xml").write_text(inner)
    (tmp_path / "outer.xml").write_text('<mujoco><include file="inner.xml"/></mujoco>')
    model = read_model(tmp_path / "outer.xml")
    with pytest.raises(ModelError, match="whole model by itself"):
        save(replace(learned, model=model), tmp_path / "out")
    assert not (tmp_path / "out").exists()
