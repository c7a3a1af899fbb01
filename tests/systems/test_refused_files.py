"""Model files that are refused in one line, and damaged ones that are read or refused, whatever the
damage.
"""

import copy
import json
import random
import re

import mujoco
import numpy as np
import pytest

from jaxidl.effects import from_dict
from jaxidl.errors import ModelError
from jaxidl.gap.benchmark.mechanisms import MECHANISMS, TWO_LINK
from jaxidl.systems.mjcf import read_model
from tests.effects.test_catalogue import EXAMPLES
from tests.systems.test_mjcf import RICH, URDF, stored

BODY = '<body><joint axis="0 1 0"{}/><geom size="0.1"/>{}</body>'


def scene(joint="", inside="", after="", option=""):
    bodies = BODY.format(joint, inside) + BODY.format(' name="b"', "")
    return f"<mujoco>{option}<worldbody>{bodies}</worldbody>{after}</mujoco>"


REFUSED = {
    "at least one joint": "<mujoco><worldbody><body><geom size='0.1'/></body></worldbody></mujoco>",
    "slide and hinge joints": scene(inside='<body><joint type="ball"/><geom size="0.1"/></body>'),
    "free or ball": (
        "<mujoco><worldbody><body><freejoint/><geom size='0.1'/></body></worldbody></mujoco>"
    ),
    "equality": scene(' name="a"', after='<equality><joint joint1="a" joint2="b"/></equality>'),
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


def complaint(path):
    """The one line with which a file is refused."""
    with pytest.raises(ModelError) as caught:
        read_model(path)
    (line,) = str(caught.value).splitlines()
    assert re.fullmatch("expected .+; got .+; .+", line)
    return line


@pytest.mark.parametrize("words", REFUSED)
def test_what_would_be_dropped_in_silence_is_refused(words, tmp_path):
    assert words in complaint(stored(tmp_path, REFUSED[words]))


def test_missing_files_and_folders_are_refused(tmp_path):
    assert "no such file" in complaint(tmp_path / "gone.xml")
    assert "a folder" in complaint(tmp_path)


ODD = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e300",
    "1e18",
    "0",
    "-1",
    "1e-320",
    "",
    "x",
    "1 2 3 4 5 6 7 8 9",
    "99999999999999999999",
]


def damaged(text, rng):
    """The text with flipped bytes, its end cut off, or attributes and elements deleted, doubled,
    swapped or made odd.
    """
    kind, attributes = rng.randrange(12), list(re.finditer(r'\s\w+="[^"]*"', text))
    numbers, elements = (
        list(re.finditer(pattern, text)) for pattern in (r"-?\d*\.?\d+", r"<[^>]*/>")
    )
    if kind == 0:
        raw = bytearray(text.encode())
        for _ in range(rng.randint(1, 6)):
            raw[rng.randrange(len(raw))] = rng.randrange(256)
        return bytes(raw)
    if kind == 1:
        return text[: rng.randrange(len(text))].encode()
    a, b = (rng.choice(attributes if kind < 6 else elements) for _ in range(2))
    if kind < 8:
        put = ("", a.group() * 2, b.group())[kind % 3]
    else:
        a, put = rng.choice(numbers), rng.choice(ODD)
    return (text[: a.start()] + put + text[a.end() :]).encode()


def read_or_refused(path):
    """The model and nothing said, or no model and why; whatever else is raised is a failure."""
    try:
        return read_model(path), ""
    except ModelError as error:
        return None, str(error)


@pytest.mark.parametrize("name", [*MECHANISMS, "chain", "rich"])
def test_a_damaged_model_is_read_or_refused(name, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    text, ending = {"chain": (URDF, "urdf"), "rich": (RICH, "xml")}.get(name) or (
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


def test_a_damaged_record_of_effects_is_read_or_refused(tmp_path):
    path = stored(tmp_path, TWO_LINK)
    entries = [{**effect.to_dict(), "in_mjcf": False, "mjcf": None} for effect in EXAMPLES.values()]
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
