"""The robot loop: a robot in a process of its own, and a controller in C."""

import contextlib
import importlib.util
import json
import os
import re
import socket
import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest

from jaxidl.errors import LogError
from jaxidl.robot.execution import read_execution
from jaxidl.systems.arm import arm, torque_limits
from tests.helpers.compiled import STRICT, compiler
from tests.helpers.paths import ROOT
from tests.helpers.process import python

LOOP = ROOT / "experiments" / "robot_loop"
STEPS = 400
_spec = importlib.util.spec_from_file_location("packets", LOOP / "packets.py")
packets = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(packets)
# of the loop's own clock: what is not the same in every run
TIMES = ("interval_us", "step_us")


def build(folder: Path, out: Path, task: Path | None = None) -> Path:
    """Compile the controller, any warning being an error."""
    include = [f"-I{path}" for path in (task or folder, folder / "0", folder, LOOP)]
    files = [str(LOOP / "controller.c"), str(folder / "0" / "arm.c")]
    subprocess.run(
        [*compiler(), *STRICT, "-O1", *include, *files, "-lm", "-o", str(out)], check=True
    )
    return out


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """The folder of a short task, with the controller before any learning."""
    compiler()
    folder = tmp_path_factory.mktemp("loop")
    done = python(LOOP / "prepare.py", folder, "--seconds-each", 0.1)
    assert done.returncode == 0, done.stderr
    build(folder, folder / "controller")
    return folder


def execute(loop, log, *options, controller=None):
    """Run the task in lock-step; return the summary, the log's columns and what truly happened."""
    truth = log.with_suffix(".npz")
    done = python(
        LOOP / "execute.py",
        loop,
        controller or loop / "controller",
        log,
        "--lock-step",
        f"--truth={truth}",
        *options,
    )
    summary = json.loads(done.stdout)
    assert done.returncode == (summary["controller"] != "finished"), done.stderr
    return summary, np.genfromtxt(log, delimiter=",", names=True), dict(np.load(truth))


@pytest.fixture(scope="module")
def undisturbed(loop):
    return execute(loop, loop / "undisturbed.csv")


def read(log):
    with jax.enable_x64(True):
        return read_execution(log, arm(), torque_limit=torque_limits())


def test_an_execution_is_logged_as_learn_reads_it(loop, undisturbed):
    summary, log, truth = undisturbed
    assert summary["controller"] == "finished"
    execution = read(loop / "undisturbed.csv")
    assert execution.run.q.shape == (STEPS, 7)
    assert execution.desired is not None
    away = np.abs(np.asarray(execution.run.q) - execution.desired)
    moved = np.ptp(execution.desired, axis=0)
    assert away.max() < 0.5 * moved.max()
    assert moved.max() > 0.05
    # encoders are read before the step, and commands act one step after they were asked for
    np.testing.assert_allclose(truth["q"][:STEPS], execution.run.q, atol=1e-4)
    np.testing.assert_allclose(truth["tau"][1:STEPS], execution.run.tau[:-1], rtol=1e-6)
    assert (log["command_age"] == 1).all()


@pytest.mark.slow
def test_lock_step_gives_the_same_numbers_again(loop, undisturbed):
    _, log, _ = undisturbed
    _, again, _ = execute(loop, loop / "again.csv")
    for name in log.dtype.names:
        if name not in TIMES:
            np.testing.assert_array_equal(log[name], again[name], name)


@pytest.mark.parametrize("flags", [0, packets.BRAKED], ids=["repeated", "braked"])
def test_a_robot_that_repeats_its_last_reading_is_no_sign_of_life(loop, tmp_path, flags):
    """The controller says stop while packets still come; of a brake's flag it hears at once."""
    home = json.loads((loop / "robot.json").read_text())["home"]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))
        robot.settimeout(30.0)
        port = str(robot.getsockname()[1])
        words = [loop / "controller", port, tmp_path / "log.csv", "200"]
        with subprocess.Popen(list(map(str, words))) as controller:
            _, peer = robot.recvfrom(1024)
            for tick in range(3):
                robot.sendto(packets.reading(0, tick, -1, 1e-3 * tick, np.array(home)), peer)
            last = packets.reading(flags, 2, -1, 2e-3, np.array(home))
            for _ in range(30_000):
                if controller.poll() is not None:
                    break
                robot.sendto(last, peer)
                time.sleep(1e-3)
            else:
                controller.kill()
        said = []
        robot.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                said.append(packets.command(robot.recvfrom(1024)[0], 7).flags)
    assert controller.returncode == (7 if flags else 3)
    assert said[-1] == packets.STOP


@pytest.mark.parametrize(
    "fault",
    [
        ("--lose=0.03",),
        pytest.param(("--late=0.1", "--late-by=3"), marks=pytest.mark.slow),
        pytest.param(("--double=0.5",), marks=pytest.mark.slow),
    ],
    ids=["lost", "late", "doubled"],
)
def test_lost_late_and_doubled_packets_do_not_stop_the_task(loop, tmp_path, undisturbed, fault):
    summary, log, _ = execute(loop, tmp_path / "log.csv", *fault)
    assert summary["controller"] == "finished"
    np.testing.assert_allclose(np.diff(log["time"]), 1e-3, atol=1e-9)
    read(tmp_path / "log.csv")
    if "double" in fault[0]:  # no difference at all
        names = [name for name in log.dtype.names if name not in TIMES]
        assert all((log[name] == undisturbed[1][name]).all() for name in names)
    else:
        assert log["made_up"].sum() > 0
        assert log["command_age"].max() > 1
        assert abs(log["q0"] - undisturbed[1]["q0"]).max() < 0.01


STOPS = {
    "NaN from a sensor": (("--nan-at=0.2", "--nan-joint=3"), "a number that is not finite"),
    "a silent robot": (("--silent-at=0.2",), "silent robot"),
    "a robot that repeats its last reading": (("--repeat-at=0.2",), "silent robot"),
    "most packets lost": (("--lose=0.8", "--since=0.2"), ""),
    "all packets too late": (("--late=1", "--late-by=30", "--since=0.2"), "the robot braked"),
    "a controller killed": (("--kill-at=0.2",), "killed"),
}


QUICK = ("NaN from a sensor", "a controller killed")


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in STOPS],
)
def test_the_robot_stops_safely_and_the_next_execution_runs(loop, tmp_path, undisturbed, name):
    options, why = STOPS[name]
    summary, log, truth = execute(loop, tmp_path / "log.csv", *options)
    assert summary["controller"] == why or (not why and summary["controller"] != "finished")
    check_stop(truth)
    text = (tmp_path / "log.csv").read_text()
    assert text.endswith("\n")
    assert not re.search("nan|inf", text)
    if log.size >= 100:
        read(tmp_path / "log.csv")
    else:
        with pytest.raises(LogError, match="at least 100 rows"):
            read(tmp_path / "log.csv")
    _, after, _ = execute(loop, tmp_path / "after.csv")
    np.testing.assert_array_equal(after["q3"], undisturbed[1]["q3"])


def check_stop(truth):
    """The robot came to rest behind its brakes: no torque, no falling."""
    braked = np.flatnonzero(truth["braked"])
    moving = np.flatnonzero(~truth["braked"])
    if not moving.size:  # it never began
        return
    after = braked[braked > moving[-1]]
    assert (truth["tau"][after] == 0.0).all()
    speed = np.abs(truth["qd"]).max(1)
    assert speed[after[0]] <= speed[moving].max() + 0.1
    assert speed[after[50] :].max() < 0.01
    assert np.abs(np.diff(truth["q"][after[50] :], axis=0)).max() < 1e-5
    assert np.abs(truth["q"][-1] - truth["q"][after[0]]).max() < 0.05


def limited(loop, tmp_path, name, limit):
    """Return a controller whose limit of that name is another one."""
    text = re.sub(
        rf"(double {name}\[7\] = {{)[^}}]*", rf"\g<1>{limit}", (loop / "task.h").read_text()
    )
    assert text != (loop / "task.h").read_text()
    (tmp_path / "task.h").write_text(text)
    return build(loop, tmp_path / "controller", tmp_path)


def test_too_fast_a_joint_is_a_stop(loop, tmp_path):
    controller = limited(loop, tmp_path, "speed_limit", ", ".join(["0.3"] * 7))
    summary, log, truth = execute(loop, tmp_path / "log.csv", controller=controller)
    assert summary["controller"] == "beyond limits"
    assert max(abs(log[f"qd{j}"]).max() for j in range(7)) <= 0.3
    check_stop(truth)


@pytest.mark.slow
def test_no_command_is_beyond_the_drives_limit(loop, tmp_path, undisturbed):
    assert abs(undisturbed[1]["tau1"]).max() > 12.0
    controller = limited(loop, tmp_path, "drive_limit", "176, 12, 100, 100, 100, 38, 38")
    _, log, truth = execute(loop, tmp_path / "log.csv", controller=controller)
    assert abs(log["tau1"]).max() == pytest.approx(12.0)
    assert abs(truth["tau"][:, 1]).max() == pytest.approx(12.0)


def test_run_says_early_that_there_is_no_compiler(tmp_path):
    done = subprocess.run(
        ["sh", LOOP / "run.sh", tmp_path / "work"],
        env=os.environ | {"PYTHON": sys.executable, "CC": "no-such-compiler"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.startswith("run.sh: expected a C compiler; got no no-such-compiler")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "work").exists()


@pytest.mark.slow
def test_feedback_falls_by_one_learning_iteration(tmp_path):
    command = compiler()
    if len(command) > 1:
        pytest.skip("run.sh takes a compiler of one word")
    work = tmp_path / "work"
    subprocess.run(
        ["sh", LOOP / "run.sh", work],
        env=os.environ
        | {
            "PYTHON": sys.executable,
            "CC": command[0],
            "MODE": "lock-step",
            "EXECUTIONS": "2",
            "LEARN": "--guard --layers 32 16 1 --epochs 10",
            "MORE": "no",
        },
        check=True,
    )
    first, second = json.loads((work / "robot_loop.json").read_text())["executions"]
    assert second["feedback_mse"] < 0.3 * first["feedback_mse"]
    assert second["path_error"] < first["path_error"]
