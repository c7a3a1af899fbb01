"""The command that writes a learned feedforward as C."""

import re
import subprocess

import jax
import numpy as np
import pytest

from jaxidl.cli import main
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.models import ErrorModel, Training, start
from jaxidl.robot.folder import save
from jaxidl.robot.learned import Learned
from jaxidl.systems.mjcf import read_model
from tests.helpers.commands import refusal
from tests.helpers.compiled import STRICT, build, compiler
from tests.helpers.model_files import stored
from tests.helpers.paths import ROOT

GAINS = """law: pid
kp: 20
kd: [3, 2]
ki: 0.01
learner: {kp: 60, kd: 5, ki: 0.02}
smoothing: 0.2
"""


@pytest.fixture(scope="module")
def feedforward(tmp_path_factory):
    folder = tmp_path_factory.mktemp("learned")
    model, training = ErrorModel(layers=(5, 1)), Training()
    learner = start(training, model.init(jax.random.key(0)))
    plant = read_model(stored(folder, TWO_LINK, "two_link.xml"))
    limits = np.array([50.0, 30.0]), np.array([np.inf, 5.0])
    numbers = {"iteration": 3, "seed": 0, "kept": 0, "dt": 1e-3}
    learned = Learned(
        plant, model, learner, training, "joint", **numbers,
        torque_limit=limits[0], feedforward_limit=limits[1], motion="filtered",
    )  # fmt: skip
    return save(learned, folder / "left-arm 2")


def test_a_folder_becomes_two_files_that_compile(feedforward, tmp_path, capsys):
    assert main(["export", str(feedforward), "--c", "--out", str(tmp_path)]) == 0
    paths = [tmp_path / f"left_arm_2.{end}" for end in "hc"]
    assert capsys.readouterr().out == "".join(f"wrote {path}\n" for path in paths)
    subprocess.run([*compiler(), *STRICT, "-c", str(paths[1]), "-o", "/dev/null"], check=True)
    for path in paths:
        text = path.read_text()
        for said in ("two_link.xml (SHA-256 ", "iteration 3", "feedforward.json", "revision "):
            assert said in text
        assert str(feedforward.parent) not in text
    assert sorted(path.name for path in tmp_path.iterdir()) == ["left_arm_2.c", "left_arm_2.h"]


AROUND = """
#include "robot.h"
#include <math.h>
static int calls;
double wait_for_next_period(void) { return calls++ * ROBOT_DT; }
void read_encoders(double *q) { q[0] = 0.1 + 1e-4 * calls; q[1] = calls < 50 ? -0.2 : NAN; }
void send_torques(const double *tau) { if (calls < 50 ? !tau[0] : tau[0] || tau[1]) calls = -99; }
void plan(double t, double *q, double *qd, double *qdd)
{
    int j;
    for (j = 0; j < ROBOT_JOINTS; j++) q[j] = 0.1 * t, qd[j] = 0.1, qdd[j] = 0;
}
extern int control(void);
int main(void) { return control() != ROBOT_FAILED || calls != 50; }
"""


def test_the_control_loop_of_the_documentation_runs(feedforward, tmp_path):
    page = (ROOT / "docs" / "howto" / "export_c.md").read_text(encoding="utf-8")
    (loop,) = re.findall(r"```c\n(.*?)```", page, flags=re.S)
    (tmp_path / "control.c").write_text(loop)
    (tmp_path / "around.c").write_text(AROUND)
    assert main(["export", str(feedforward), "--c", "--out", str(tmp_path), "--name", "robot"]) == 0
    subprocess.run([str(build(compiler(), tmp_path, "loop"))], check=True, timeout=20)


def test_it_takes_the_feedback_law_of_a_file(feedforward, tmp_path):
    gains = tmp_path / "gains.yaml"
    gains.write_text(GAINS)
    words = ["--c", "--out", str(tmp_path), "--name", "arm", "--gains", str(gains)]
    assert main(["export", str(feedforward), *words, "--bands", "40", "20"]) == 0
    text = (tmp_path / "arm.c").read_text()
    assert "static const real kp[2] = {20.0, 20.0};" in text
    assert "of a new sample: 40 Hz" in text
    assert "Feedback law: of gains.yaml (SHA-256 " in text


def test_what_is_wrong_is_said_in_one_line(feedforward, tmp_path, capsys):
    for words, said in (
        ([feedforward], "add --c"),
        ([feedforward.parent, "--c"], "no feedforward.json"),
        ([feedforward, "--c", "--name", "3x"], "begins with a letter"),
        ([feedforward, "--c", "--bands", "0", "20"], "--bands > 0"),
    ):
        assert said in refusal(capsys, "export", *words, "--out", tmp_path)
    assert not list(tmp_path.iterdir())
