"""What ``jaxidl gap`` says of logs, models and motors that do not fit: one line, status 2, nothing
written.
"""

import random

import numpy as np
import pytest

from jaxidl.cli import main
from jaxidl.errors import ModelError
from jaxidl.systems.mjcf import read_model
from tests.logs.test_columns import CURRENTS, THREE, robot
from tests.logs.test_log import write
from tests.systems.test_refused_files import damaged
from tests.systems.test_robot_files import FLAT, MIMIC, SHAPES, stored, urdf

WRONG = [
    (["--joints", "foot"], "choose among shoulder_pan_joint, elbow_joint, wrist_1_joint"),
    (["--joints", "elbow", "elbow_joint"], "elbow_joint twice"),
    (["--columns", "q"], "KEY=TITLE"),
    (["--columns", "q=zz_*"], "correct the pattern"),
    (["--torque-constant", "1"], "currents i0..i2"),
    (["--torque-constant", "1", "2"], "3 finite numbers as torque_constant"),
    (["--torque-constant", "x"], "--torque-constant"),
    (["--gear-ratio", "0"], "other than zero"),
    (["--gear-ratio", "nan"], "finite"),
    (["--motor", "{d}/gone.yaml"], "no such file"),
    (["--motor", "{d}/text.yaml"], "names and values"),
    (["--motor", "{d}/text.yaml", "--gear-ratio", "1"], "both"),
]


@pytest.mark.parametrize(("words", "said"), WRONG)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path, capsys, monkeypatch, words, said):
    log, model = write(tmp_path / "a.csv", THREE), robot(tmp_path)
    (tmp_path / "text.yaml").write_text("text")
    before = sorted(tmp_path.iterdir())
    words = [word.format(d=tmp_path) for word in words]
    monkeypatch.setattr("sys.argv", ["jaxidl"])
    try:
        status = main(
            ["gap", str(log), "--model", str(model), "--out", str(tmp_path / "out"), *words]
        )
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert said in lines[-1]
    assert sum("jaxidl:" in line for line in lines) == 1
    assert sorted(tmp_path.iterdir()) == before


def test_currents_without_a_constant_name_the_argument(tmp_path, capsys):
    log, model = write(tmp_path / "a.csv", CURRENTS), robot(tmp_path)
    try:
        status = main(["gap", str(log), "--model", str(model), "--out", str(tmp_path / "out")])
    except SystemExit as stop:
        status = stop.code
    assert status == 2
    assert "give --torque-constant" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_damaged_urdf_of_robots_is_read_or_refused(tmp_path, capfd):
    """Missing meshes, mimics, links without mass and impossible inertias, with something broken on
    top, whole or in part.
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
