"""Model files that are refused in one line, and damaged ones, which are read or refused."""

import copy
import json
import random

import mujoco
import numpy as np
import pytest

from jaxidl.effects import CATALOGUE, from_dict
from jaxidl.errors import ModelError
from jaxidl.gap.benchmark.mechanisms import MECHANISMS, TWO_LINK
from jaxidl.systems.mjcf import names_of, read_model
from tests.helpers.effects import EXAMPLES
from tests.helpers.model_files import (
    CHAIN,
    FLAT,
    MIMIC,
    RICH,
    SHAPES,
    complaint,
    damaged,
    scene,
    stored,
    urdf,
)

REFUSED = {
    "at least one joint": "<mujoco><worldbody><body><geom size='0.1'/></body></worldbody></mujoco>",
    "slide and hinge joints": scene(inside='<body><joint type="ball"/><geom size="0.1"/></body>'),
    "free or ball": (
        "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>"
    ),
    "equality": scene(' name="a"', after='<equality><joint joint1="a"/></equality>'),
    "tendons": scene(
        ' name="a"', after='<tendon><fixed><joint joint="a" coef="1"/></fixed></tendon>'
    ),
    "polynomial": scene(' damping="1 2"'),
    "springdamper": scene(' springdamper="0.1 1"'),
    "actuator with armature": scene(
        ' name="a"', after='<actuator><motor joint="a" armature="0.1"/></actuator>'
    ),
    "gravity compensation": scene().replace("<body>", '<body gravcomp="1">', 1),
    "fluid": scene(option='<option density="1000"/>'),
    "flag": scene(option='<option><flag damper="disable"/></option>'),
    "possible friction": scene(' damping="-1"'),
    "inertia at every joint": scene(' armature="-100"'),
    "MJCF or URDF": "<mujoco><worldbody>",
    "gone.stl": scene(
        inside='<geom type="mesh" mesh="m"/>',
        after='<asset><mesh name="m" file="gone.stl"/></asset>',
    ),
    "to compile": scene(inside='<geom size="-1"/>'),
    "must load it": b"\x00\x01\xff\xfe" * 100,
    "below 1e+30": scene().replace('size="0.1"', 'size="0.1" mass="1e40"', 1),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_would_be_dropped_in_silence_is_refused(words, tmp_path):
    assert words in complaint(stored(tmp_path, REFUSED[words]))


def test_missing_files_and_folders_are_refused(tmp_path):
    assert "no such file" in complaint(tmp_path / "gone.xml")
    assert "a folder" in complaint(tmp_path)


def read_or_refused(path):
    """The model and "", or None and why it is refused; any other error is a failure."""
    try:
        return read_model(path), ""
    except ModelError as error:
        return None, str(error)


@pytest.mark.parametrize("name", [*MECHANISMS, "chain", "rich"])
def test_a_damaged_model_is_read_or_refused(name, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    text, ending = {"chain": (CHAIN, "urdf"), "rich": (RICH, "xml")}.get(name) or (
        MECHANISMS[name],
        "xml",
    )
    path, refused = tmp_path / f"model.{ending}", 0
    for seed in range(60):
        model, said = read_or_refused(
            stored(tmp_path, damaged(text, random.Random(f"{name} {seed}")), path.name)
        )
        refused += model is None
        if model is None:
            assert len(said.splitlines()) == 1
            continue
        source = model.plant.body.source
        data, inertia = mujoco.MjData(source), np.zeros((source.nv, source.nv))
        mujoco.mj_forward(source, data)
        mujoco.mj_fullM(source, data, inertia)
        assert np.isfinite(inertia).all()
        assert (
            np.linalg.eigvalsh(
                inertia / np.sqrt(np.outer(inertia.diagonal(), inertia.diagonal()))
            ).min()
            > 0.0
        )
    assert 10 < refused < 60
    assert [file.name for file in tmp_path.iterdir()] == [path.name]  # MuJoCo has left no log
    assert capfd.readouterr() == ("", "")


def spots(value, path=()):
    """Paths to everything inside a JSON value."""
    inside = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, part in inside:
        yield (*path, key)
        yield from spots(part, (*path, key))


@pytest.mark.slow
def test_a_damaged_record_of_effects_is_read_or_refused(tmp_path):
    path = stored(tmp_path, TWO_LINK)
    known = (effect for name, effect in EXAMPLES.items() if name in CATALOGUE)
    entries = [{**effect.to_dict(), "in_mjcf": False, "mjcf": None} for effect in known]
    odd = [
        None,
        True,
        [],
        {},
        "x",
        "nan",
        -1,
        3,
        1e308,
        [1, 2, 3],
        [[1], [2]],
        "inf",
        10**400,
        2.5,
        10**9,
        {"value": 1},
    ]
    for seed in range(150):
        rng = random.Random(seed)
        record = {"model": path.name, "effects": [copy.deepcopy(rng.choice(entries))]}
        *way, last = rng.choice([*spots(record)][1:])
        inner = record
        for key in way:
            inner = inner[key]
        if rng.random() < 0.3:
            del inner[last]
        else:
            inner[last] = rng.choice(odd)
        raw = json.dumps(record).encode()
        (tmp_path / "effects.json").write_bytes(
            raw[: rng.randrange(len(raw))] if rng.random() < 0.1 else raw
        )
        model, said = read_or_refused(path)
        assert len(said.splitlines()) == (model is None)
        for effect in model.plant.effects if model else ():
            assert from_dict(effect.to_dict()).to_dict() == effect.to_dict()


def test_effects_that_do_not_fit_the_model_are_refused(tmp_path):
    path = stored(tmp_path, TWO_LINK)
    three = {
        "effect": "viscous_friction",
        "parameters": {"coefficient": {"value": 1.0}},
        "joint": 2,
        "joints": 3,
    }
    for entry, words in (
        (three, "one of 2 joints"),
        (
            {**three, "joint": None, "parameters": {"coefficient": {"value": [1, 2, 3]}}},
            "each of 2 joints",
        ),
        (
            {**EXAMPLES["coupled_friction"].to_dict(), "options": {"joint": 0, "other": 2}},
            "option other",
        ),
        ({**EXAMPLES["actuator_delay"].to_dict(), "options": {"steps": 10**12}}, "option steps"),
    ):
        stored(tmp_path, json.dumps({"model": path.name, "effects": [entry]}), "effects.json")
        assert words in complaint(path)
    stored(tmp_path, json.dumps({"model": "another.xml", "effects": [three]}), "effects.json")
    assert read_model(path).plant.effects == ()


def test_damaged_urdf_of_robots_is_read_or_refused(tmp_path, capfd):
    """Missing meshes, mimics, links without mass and impossible inertias, with one more damage, as
    a whole or in part.
    """
    text = urdf(shapes=SHAPES, mimic=MIMIC, inside={2: "", 3: FLAT.format(0.01, 0.01, 0.04, 0)})
    outcomes = [0, 0]
    for seed in range(120):
        rng = random.Random(seed)
        (tmp_path / "robot.urdf").write_bytes(damaged(text, rng))
        part = rng.choice([None, None, ["j1"], ["j2", "j3"]])
        try:
            model = read_model(
                tmp_path / "robot.urdf", joints=part, locked={"j1": 0.3} if seed % 3 else None
            )
            assert np.isfinite(model.plant.body.source.body_mass).all()
            outcomes[0] += 1
        except ModelError as error:
            outcomes[1] += len(str(error).splitlines())
    assert sum(outcomes) == 120  # one line each
    assert min(outcomes) > 15, outcomes
    assert capfd.readouterr() == ("", "")


def test_effects_of_the_whole_robot_are_not_those_of_a_part(tmp_path):
    stored(tmp_path, urdf(), "robot.urdf")
    entry = {
        "effect": "viscous_friction",
        "parameters": {"coefficient": {"value": 1.0}},
        "joint": 2,
        "joints": 4,
    }
    stored(
        tmp_path,
        f'{{"model": "robot.urdf", "effects": [{entry}]}}'.replace("'", '"'),
        "effects.json",
    )
    assert len(read_model(tmp_path / "robot.urdf").plant.effects) == 1
    with pytest.raises(ModelError, match=r"move effects\.json away"):
        read_model(tmp_path / "robot.urdf", joints=["j1", "j2"])


def test_a_model_without_joints_is_refused_in_one_line(tmp_path):
    links = '<robot name="r"><link name="base"/></robot>', "<mujoco><worldbody/></mujoco>"
    for text, name in zip(links, ("robot.urdf", "robot.xml"), strict=True):
        with pytest.raises(ModelError, match="a slide or a hinge in robot") as refused:
            names_of(stored(tmp_path, text, name))
        assert "\n" not in str(refused.value)


def test_a_log_in_the_model_s_place_is_recognised_by_its_ending(tmp_path):
    with pytest.raises(ModelError, match=r"got a file that ends in '\.csv'; name the robot's"):
        names_of(stored(tmp_path, "time,q0,tau0\n0,0,0\n", "log.csv"))
