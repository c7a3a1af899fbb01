"""Logs, models and motors that do not fit: ``jaxidl gap`` refuses them in one line, with status 2,
and writes nothing.
"""

import pytest

from tests.helpers.commands import refusal
from tests.helpers.logs import CURRENTS, THREE, robot, write

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
def test_what_does_not_fit_is_refused_in_one_line(tmp_path, capsys, words, said):
    log, model = write(tmp_path / "a.csv", THREE), robot(tmp_path)
    (tmp_path / "text.yaml").write_text("text")
    before = sorted(tmp_path.iterdir())
    words = [word.format(d=tmp_path) for word in words]
    files = "gap", log, "--model", model, "--out", tmp_path / "out"
    assert said in refusal(capsys, *files, *words)
    assert sorted(tmp_path.iterdir()) == before


def test_currents_without_a_constant_name_the_argument(tmp_path, capsys):
    log, model = write(tmp_path / "a.csv", CURRENTS), robot(tmp_path)
    line = refusal(capsys, "gap", log, "--model", model, "--out", tmp_path / "out")
    assert "give --torque-constant" in line
    assert not (tmp_path / "out").exists()


def test_a_log_without_torques_is_refused_in_one_line(tmp_path, capsys):
    columns = {key: column for key, column in THREE.items() if not key.startswith("tau")}
    log, model = write(tmp_path / "a.csv", columns), robot(tmp_path)
    line = refusal(capsys, "gap", log, "--model", model, "--out", tmp_path / "out")
    assert "add a column tau0" in line
    assert not (tmp_path / "out").exists()
