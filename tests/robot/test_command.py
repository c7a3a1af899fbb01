"""The command: two iterations, as a user makes them."""

import json

import pytest

from jaxidl.cli import main
from jaxidl.robot.folder import load
from tests.helpers.commands import refusal
from tests.helpers.executions import GAINS

SMALL = ["--layers", "8", "1", "--epochs", "2"]


def learn(*words):
    return main(["learn", *map(str, words)])


@pytest.mark.slow
def test_two_iterations_from_the_command_line(logs, gantry, tmp_path, capsys):
    one, two = tmp_path / "1", tmp_path / "2"
    given = ["--model", gantry.path, "--smoothing", "0.1", "--guard", "--feedforward-limit", "20"]
    assert learn(logs[0], *given, "--out", one, *SMALL) == 0
    assert "bridge: lacked" in capsys.readouterr().out
    assert learn(logs[1], "--continue", one, "--out", two) == 0
    record = json.loads((two / "feedforward.json").read_text())
    assert record["iteration"] == 2
    assert (record["source"], record["smoothing"]) == ("weighted", 0.1)
    assert record["guard"] == {"near": 1.2, "far": 2.4}
    assert len(record["logs"]) == len(record["history"]) == 2
    names = {str(path.relative_to(two)) for path in two.rglob("*") if path.is_file()}
    assert names == {*record["files"], "feedforward.json"}
    assert {"report.md", "figures/torque.png", "figures/progress.png"} <= names
    assert str(tmp_path) not in (two / "report.md").read_text()
    assert load(two).feedforward_limit.tolist() == [20.0, 20.0]


@pytest.mark.slow
def test_a_gripper_that_is_not_logged_is_left_out(logs, gantry, tmp_path, capsys):
    finger = (
        '<body pos="0 0 0.1"><joint name="finger" type="slide"/>'
        '<inertial pos="0 0 0" mass="1e-4" diaginertia="1e-6 1e-6 1e-6"/></body>'
    )
    text = gantry.path.read_text()
    at = text.index("</body>")
    model = tmp_path / "model.xml"
    model.write_text(text[:at] + finger + text[at:])
    given = ["--model", model, "--smoothing", "0.1", "--out", tmp_path / "1", *SMALL]
    assert "--joints NAME" in refusal(capsys, "learn", logs[0], *given)
    assert learn(logs[0], *given, "--joints", *gantry.names) == 0
    assert load(tmp_path / "1").model.names == gantry.names
    again = ["--continue", tmp_path / "1", "--model", model, "--out", tmp_path / "2"]
    assert learn(logs[1], *again) == 0
    assert load(tmp_path / "2").model.names == gantry.names


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--out", "{d}/out"], "--model"),
        (["--out", "{d}/out", "--continue", "{d}/none"], "no such folder"),
        (["--out", "{d}/out", "--continue", "{d}"], "no feedforward.json"),
        (["--out", "{d}", "--model", "{m}"], "empty folder"),
        (["--out", "{d}/out", "--model", "{m}", "--source", "jiont"], "did you mean joint"),
        (["--out", "{d}/out", "--model", "{m}", "--motion", "ofline"], "did you mean offline"),
        (["--out", "{d}/out", "--model", "{m}", "--source", "weighted"], "--smoothing"),
        (["--out", "{d}/out", "--model", "{m}", "--smoothing", "2"], "0 < --smoothing <= 1"),
        (
            ["--out", "{d}/out", "--model", "{m}", "--smoothing", "1", "--gains", "{d}/gains.yaml"],
            "smoothing 0.2 as in --gains",
        ),
        (["--out", "{d}/out", "--model", "{m}", "--torque-limit", "-1"], "--torque-limit"),
        (["--out", "{d}/out", "--model", "{m}", "--gains", "{d}/no.yaml"], "no such file"),
        (["--out", "{d}/out", "--model", "{d}/notes.txt"], "MJCF or URDF"),
    ],
)
def test_wrong_wishes_end_in_one_line(words, said, logs, gantry, tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "gains.yaml").write_text(GAINS)
    words = [word.format(d=tmp_path, m=gantry.path) for word in words]
    assert said in refusal(capsys, "learn", logs[1], *words)
    assert {path.name for path in tmp_path.iterdir()} == {"notes.txt", "gains.yaml"}
