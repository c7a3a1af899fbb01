"""What is read of an execution's log, and what is said about a wrong one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import ViscousFriction
from jaxidl.errors import ConfigurationError
from jaxidl.learning.execute import desired_trajectory, execute
from jaxidl.logs import read
from jaxidl.robot.execution import read_execution
from jaxidl.robot.gains import read_gains
from jaxidl.robot.motion import moved
from tests.helpers.executions import DT, GAINS, columns_of, draws_of, setting_of
from tests.helpers.logs import refuse, write

SIGNALS = ("tau", "tau_feedback", "tau_feedback_applied", "tau_feedforward", "qdd_desired")


@pytest.fixture(scope="module")
def by_pid():
    """An execution with PID feedback, and the desired states."""
    setting = setting_of("pid")
    run = jax.jit(execute)(setting.plant, setting.model, setting.law, setting.task, draws_of(1)[0])
    return run, desired_trajectory(setting.task)


def assert_read(execution, run, names, tolerance=1e-12):
    for name in names:
        got, wanted = (np.asarray(getattr(x, name)) for x in (execution.run, run))
        np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_every_signal_comes_back(by_pid, gantry, tmp_path, suffix):
    run, desired = by_pid
    log = write(tmp_path / f"log{suffix}", columns_of(run, DT, desired))
    execution = read_execution(log, gantry)
    assert_read(execution, run, (*SIGNALS, "q_sensing", "qd_sensing", "qdd_actual"))
    assert_read(execution, run, ("tau_inverse_desired", "tau_inverse_actual"), 1e-9)
    np.testing.assert_allclose(execution.desired, desired.q)
    assert execution.dt == pytest.approx(DT)
    assert not execution.notes


def test_a_bag_of_ros2_control_has_every_signal(by_pid, gantry, tmp_path):
    pytest.importorskip("rosbags")
    from tests.helpers import bags

    run, desired = by_pid
    columns = columns_of(run, DT, desired)
    values = [
        {name[:-1]: x for name, x in columns.items() if name.endswith(str(j))} for j in range(2)
    ]
    folder = bags.dynamic_bag(tmp_path / "bag", columns["time"], gantry.names, values)
    execution = read_execution(folder, gantry)
    assert_read(execution, run, SIGNALS)
    np.testing.assert_allclose(execution.desired, desired.q)
    assert execution.dt == pytest.approx(DT)
    assert execution.sha == read_execution(folder, gantry, topic="/dynamic_joint_states").sha
    refuse(lambda: read_execution(folder, gantry, topic="/other"), "a topic /other")
    short = [{name: x for name, x in joint.items() if name != "qdd_desired"} for joint in values]
    wrong = bags.dynamic_bag(tmp_path / "short", columns["time"], gantry.names, short)
    refuse(lambda: read_execution(wrong, gantry), "qdd_desired0")


def test_npz_may_hold_all_joints_in_one_array(by_pid, gantry, tmp_path):
    run, _ = by_pid
    path = tmp_path / "log.npz"
    parts = {"q": run.q_sensing, "qd": run.qd_sensing, "qdd": run.qdd_actual}
    parts |= {name: getattr(run, name) for name in SIGNALS}
    np.savez(path, time=np.arange(len(run.tau)) * DT, **parts)
    assert_read(read_execution(path, gantry), run, SIGNALS)


def test_other_titles_and_units_are_understood(by_pid, gantry, tmp_path):
    run, desired = by_pid
    titles = {
        "qdd_desired": "{0}/target_acceleration [mm/s^2]",
        "tau": "{0}/effort",
        "q": "{0}/position",
        "tau_feedback": "{0}/learning_feedback",
        "tau_feedback_applied": "{0}/applied_fb",
        "tau_feedforward": "{0}/tau_ff",
    }
    columns = columns_of(run, DT, desired)
    renamed = {"time": columns["time"]}
    for name, title in titles.items():
        for j, joint in enumerate(gantry.names):
            renamed[title.format(joint)] = columns[f"{name}{j}"]
    renamed = {key.replace(" [mm/s^2]", ""): value for key, value in renamed.items()}
    execution = read_execution(write(tmp_path / "log.csv", renamed), gantry)
    assert_read(execution, run, SIGNALS, 1e-9)
    assert any("target_acceleration" in note for note in execution.notes)


def test_positions_alone_are_differentiated(by_pid, gantry, tmp_path):
    run, desired = by_pid
    log = write(tmp_path / "log.csv", columns_of(run, DT, desired, derivatives=False))
    differences = read_execution(log, gantry, motion="finite_difference")
    assert_read(differences, run, ("qd_sensing", "qdd_actual", *SIGNALS), 1e-8)
    offline = read_execution(log, gantry)
    assert offline.run.tau.shape == (len(run.tau) + 1, 2)
    middle, truth = slice(50, -50), np.gradient(run.qd, DT, axis=0)
    error = lambda qdd: np.sqrt(np.mean((np.asarray(qdd)[: len(truth)] - truth)[middle] ** 2))
    assert error(offline.run.qdd_actual) < 0.5 * error(differences.run.qdd_actual)
    filtered = read_execution(log, gantry, motion="filtered")
    assert filtered.run.tau.shape == run.tau.shape


def test_feedback_follows_from_gains(by_pid, gantry, tmp_path):
    run, desired = by_pid
    columns = columns_of(run, DT, desired)
    short = {key: x for key, x in columns.items() if "feedback" not in key}
    gains = tmp_path / "gains.yaml"
    gains.write_text(GAINS)
    law = read_gains(gains, 2)
    log = write(tmp_path / "log.csv", short)
    assert_read(read_execution(log, gantry, law=law), run, SIGNALS, 1e-9)
    refuse(lambda: read_execution(log, gantry), "tau_feedback_applied0", "--gains")
    without = {key: x for key, x in short.items() if not key.startswith("q_desired")}
    wrong = write(tmp_path / "wrong.csv", without)
    refuse(lambda: read_execution(wrong, gantry, law=law), "q_desired0")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("law: lqr", "law: pid or law: doomed"),
        ("[1, 2]", "law: pid"),
        ("law: pid\nkp: 1", "no kd"),
        (GAINS.replace("kd: [2.0", "kd: [-2.0").replace("12.0", "-12.0"), "kd >= 0"),
        (GAINS.replace("smoothing: 0.2", "smoothing: 2"), "0 < smoothing <= 1"),
        (GAINS + "kx: 3\n", "'kx'"),
        ("law: doomed\nrate: [1, 2, 3]\nlearner_gain: 1\nsmoothing: 0.1", "one rate >= 0, or 2"),
        ("{", "YAML"),
    ],
)
def test_wrong_gains_are_refused(text, words, tmp_path):
    path = tmp_path / "gains.yaml"
    path.write_text(text)
    with pytest.raises(ConfigurationError, match=words):
        read_gains(path, 2)


def test_gains_of_doomed(tmp_path):
    path = tmp_path / "gains.yaml"
    path.write_text("law: doomed\nrate: 0.5\nlearner_gain: [1, 2]\nsmoothing: 0.1")
    law = read_gains(path, 2)
    np.testing.assert_array_equal(law.rate, [0.5, 0.5])
    np.testing.assert_array_equal(law.learner_gain, [1.0, 2.0])
    assert np.isinf(law.limit).all()


def test_the_same_log_is_one_for_the_gap_finder(by_pid, gantry, tmp_path):
    run, desired = by_pid
    log = write(tmp_path / "log.csv", columns_of(run, DT, desired))
    found = read(log, gantry.names)
    np.testing.assert_array_equal(found.tau, run.tau)
    np.testing.assert_array_equal(found.qdd, run.qdd_actual)
    ignored = [note for note in found.notes if "ignored" in note]
    assert "tau_feedback0" in ignored[0]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.pop("qdd_desired1"), ["qdd_desired0..qdd_desired1", "the model's 2 joints"]),
        (
            lambda c: c.update({"qdd_desird0": c.pop("qdd_desired0")}) or c.pop("qdd_desired1"),
            ["rename column 'qdd_desird0' to qdd_desired0"],
        ),
        (lambda c: c.update(time=c["time"][::-1]), ["time", "to increase"]),
        (lambda c: c["time"].__setitem__(slice(50, None), c["time"][50:] + 0.01), ["row 51"]),
        (
            lambda c: c.update({f"q{j}": np.rad2deg(c[f"q{j}"]) for j in (0, 1)}),
            ["change", "as fast"],
        ),
        (lambda c: c["tau1"].__setitem__(70, 90.0), ["row 71", "instead of", "for carriage"]),
        (lambda c: c.update(q2=c["q1"]), ["the model's 2 joints"]),
        (lambda c: c["tau_feedback0"].__setitem__(3, np.nan), ["tau_feedback0", "row 4"]),
    ],
)
def test_what_is_wrong_is_said(change, words, by_pid, gantry, tmp_path):
    columns = {key: x.copy() for key, x in columns_of(*by_pid[:1], DT, by_pid[1]).items()}
    change(columns)
    log = write(tmp_path / "log.csv", columns)
    refuse(lambda: read_execution(log, gantry), *words)


def test_effects_of_the_model_are_part_of_the_command(by_pid, gantry, tmp_path):
    """The model's file may have friction; a robot that does not command it is not that model's."""
    run, desired = by_pid
    log = write(tmp_path / "log.csv", columns_of(run, DT, desired))
    rubbing = gantry.plant.replace(effects=(ViscousFriction(jnp.array([50.0, 50.0])),))
    refuse(
        lambda: read_execution(log, gantry._replace(plant=rubbing)), "inverse dynamics", "--model"
    )


def test_degrees_without_velocities_are_noticed(by_pid, gantry, tmp_path):
    run, desired = by_pid
    columns = columns_of(run, DT, desired, derivatives=False)
    for j in (0, 1):
        columns[f"qdd_desired{j}"] = np.rad2deg(columns[f"qdd_desired{j}"])
    log = write(tmp_path / "log.csv", columns)
    refuse(lambda: read_execution(log, gantry), "both in rad", "qdd_desired", "degrees")


def test_an_unknown_motion_is_refused(gantry):
    with pytest.raises(ConfigurationError, match="did you mean offline"):
        moved("ofline", {}, gantry, DT)
