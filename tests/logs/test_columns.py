"""Logs of real robots: titles of every kind, units, clocks, rates and motors' data."""

import random

import numpy as np
import pytest

from jaxidl.errors import JaxidlError, LogError
from jaxidl.logs.header import read_title
from jaxidl.logs.log import read
from jaxidl.logs.motor_side import motor_side
from jaxidl.logs.words import factor
from tests.helpers.logs import (
    ARM,
    CURRENTS,
    DT,
    THREE,
    as_robots_do,
    check,
    each_joint,
    refuse,
    same,
    text,
    write,
)

UNDERSTOOD = {
    "actual": as_robots_do("t", q="actual_q_{}", tau="actual_torque_{}"),
    "words": as_robots_do("timestamp", q="joint_{n}_position", tau="Joint {n} Torque"),
    "ros": as_robots_do(
        "__time", q="/joint_states/{name}/position", tau="/joint_states/{name}/effort"
    ),
    "short names": as_robots_do(q="position_{short}", tau="{short}.effort"),
    "humps": as_robots_do("Time", q="jointPosition{}", tau="jointTorque{}"),
    "brackets": as_robots_do("time [s]", q="q[{}]", tau="tau[{n}]"),
    "another clock": as_robots_do("clock_of_plc", q="q{}", tau="tau{}"),
    "from one": as_robots_do(q="q{n}", tau="tau{n}"),
    "command": as_robots_do(q="pos{}", tau="torque_command_{}"),
    "units": as_robots_do("t (s)", q="pos{}_rad", tau="Torque {} (N m)"),
}


@pytest.mark.parametrize("ending", ["csv", "npz", "parquet"])
@pytest.mark.parametrize("name", UNDERSTOOD)
def test_titles_that_can_mean_one_thing_only_are_understood_with_a_note(tmp_path, name, ending):
    if ending == "npz" and "/" in "".join(UNDERSTOOD[name]):
        pytest.skip("no title of an array has a slash")
    path = write(tmp_path / f"a.{ending}", UNDERSTOOD[name])
    log = read(path, ARM)
    same(log)
    assert log.notes[0].startswith((f"q0 .. q2 of {path}: ", f"time of {path}: ")), log.notes
    if "name" not in name and name != "ros":
        same(read(path))  # by their numbers alone


def test_columns_by_name_are_brought_into_the_models_order(tmp_path):
    columns = UNDERSTOOD["short names"]
    path = write(tmp_path / "a.csv", dict(reversed(columns.items())))
    same(read(path, ARM))
    same(read(path, ARM[::-1]), joints=(2, 1, 0))


def test_a_hinges_torque_and_a_slides_force_are_of_one_kind(tmp_path):
    time = 0.01 * np.arange(600)
    q, tau = np.sin(3.0 * time), np.cos(3.0 * time)
    columns = {"time": time, "lift pos [mm]": 1e3 * q, "turn pos [rad]": q}
    columns |= {"lift force [N]": tau, "turn torque [Nm]": 2.0 * tau}
    log = read(write(tmp_path / "a.csv", columns), ("turn", "lift"))
    np.testing.assert_allclose(log.tau, np.outer(tau, [2.0, 1.0]), atol=1e-6)
    np.testing.assert_allclose(log.q, np.outer(q, [1.0, 1.0]), atol=1e-6)
    columns["lift torque [Nm]"] = 3.0 * tau  # either may be meant: those alike are taken
    log = read(write(tmp_path / "b.csv", columns), ("turn", "lift"))
    np.testing.assert_allclose(log.tau, np.outer(tau, [2.0, 3.0]), atol=1e-6)


def test_what_may_be_two_things_is_for_the_user_to_choose(tmp_path):
    columns = as_robots_do(q="pos_{}", tau="tau{}") | {
        f"angle_{j}": 2 * THREE[f"q{j}"] for j in range(3)
    }
    path = write(tmp_path / "a.csv", columns)
    refuse(
        lambda: read(path, ARM),
        "one set of columns for q",
        "pos_0 .. pos_2, angle_0 .. angle_2",
        "--columns 'q=pos_*'",
    )
    same(read(path, ARM, columns=["q=pos_*"]))
    np.testing.assert_allclose(read(path, ARM, columns=["q=angle_*"]).q[:, 1], 2 * THREE["q1"])


def test_what_was_asked_for_is_not_what_was_measured(tmp_path):
    wished = {f"target_q_{j}": THREE[f"q{j}"] + 0.1 for j in range(3)} | {
        f"target_moment_{j}": THREE[f"tau{j}"] for j in range(3)
    }
    same(
        read(write(tmp_path / "a.csv", wished | as_robots_do(q="actual_q_{}", tau="tau_J_{}")), ARM)
    )
    only = {key: column for key, column in THREE.items() if not key.startswith("tau")} | wished
    refuse(
        lambda: read(write(tmp_path / "b.csv", only), ARM),
        "positions and their targets only (target_q_0",
        "--torque-constant",
    )
    refuse(lambda: read(write(tmp_path / "b.csv", only)), "PWM * supply voltage * kt / R")


def test_letters_that_may_be_anything_are_not_guessed(tmp_path):
    refuse(
        lambda: read(write(tmp_path / "a.csv", as_robots_do(q="foo_{}_x", tau="bar_{}_u"))),
        "add a column q0",
        "--columns",
    )


def test_speeds_that_may_be_two_things_are_left_out(tmp_path):
    more = {f"{word}_{j}": THREE[f"q{j}"] for word in ("vel", "speed") for j in range(3)}
    log = read(write(tmp_path / "a.csv", THREE | more))
    assert log.qd is None
    assert any(
        "qd is left out: it may be vel_0 .. vel_2 or speed_0 .. speed_2" in note
        for note in log.notes
    )


MAPPED = as_robots_do("tick_of_plc", q="pv {} k", tau="m_{short}")


@pytest.mark.parametrize(
    "columns",
    [
        ["time=tick_of_plc", "q=pv * k", "tau=m_*"],
        [
            "time=TICK_OF_PLC",
            "q0=pv 0 k",
            "q1=pv 1 k",
            "q2=pv 2 k",
            "tau0=m_shoulder_pan",
            "tau1=m_elbow",
            "tau2=m_wrist_1",
        ],
        ["time=tick_of_plc", "q1=pv 0 k", "q2=pv 1 k", "q3=pv 2 k", "tau=m_*"],  # from one
        [
            "time=tick_of_plc",
            "q.shoulder_pan=pv 0 k",
            "q.elbow_joint=pv 1 k",
            "q.wrist_1=pv 2 k",
            "tau=m_*",
        ],
    ],
)
def test_columns_that_the_user_names_are_read(tmp_path, columns):
    same(read(write(tmp_path / "a.csv", MAPPED), ARM, columns=columns))


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (["q"], ["KEY=TITLE", "'q'", "q0=actual_q_0"]),
        (["foo=pv 0 k"], ["KEY=TITLE", "time, run, q"]),
        (["q0="], ["KEY=TITLE"]),
        (["q00=pv 0 k"], ["KEY=TITLE"]),
        (["q0=pv 7 k"], ["a column pv 7 k", "did you mean pv"]),
        (["q=pv ** k"], ["one * in a title"]),
        (["q=rv * k"], ["columns rv * k", "correct the pattern"]),
        (["q=pv *"], ["numbers or joints of the model for *", "0 k"]),
        (["q0=pv * k"], ["one column for q0", "3 that fit"]),
        (["q0=pv 0 k"], ["q of 3 joints", "1: pv 0 k", "without gaps"]),
        (["q0=pv 0 k", "q0=pv 1 k"], ["q of each joint once", "again"]),
        (["q.foot=pv 0 k"], ["a joint of the model", "foot", "shoulder_pan_joint"]),
        (["q=pv * k", "tau=m_*"], ["column time", "tick_of_plc"]),
    ],
)
def test_wrong_names_of_columns_are_refused(tmp_path, columns, words):
    refuse(lambda: read(write(tmp_path / "a.csv", MAPPED), ARM, columns=columns), *words)


def test_arrays_of_all_joints_are_read_by_other_names(tmp_path):
    q, tau = (each_joint(THREE, kind, range(3)) for kind in ("q", "tau"))
    for titles, columns in (
        (("t", "positions", "joint torques"), []),
        (("t", "state", "cmd"), ["q=state", "tau=cmd"]),
    ):
        path = write(tmp_path / "a.npz", dict(zip(titles, (THREE["time"], q, tau), strict=True)))
        for joints in (None, 3, ARM):
            same(read(path, joints, columns=columns))
        same(read(path, ARM[1:], robot=ARM, columns=columns), joints=(1, 2))
    path = write(tmp_path / "b.npz", {"time": THREE["time"], "position": q, "angle": q, "tau": tau})
    refuse(lambda: read(path, ARM), "position, angle", "--columns q=position")


def test_units_in_titles_are_converted(tmp_path):
    columns = {"time_ms": 1e3 * THREE["time"]}
    columns |= {f"q{j} [deg]": np.rad2deg(THREE[f"q{j}"]) for j in range(3)}
    columns |= {f"qd{j}_rpm": THREE[f"q{j}"] * 30 / np.pi for j in range(3)}
    columns |= {f"tau{j} [mN·m]": 1e3 * THREE[f"tau{j}"] for j in range(3)}
    log = read(write(tmp_path / "a.csv", columns))
    same(log)
    np.testing.assert_allclose(log.qd, log.q, rtol=1e-12)
    assert log.dt == pytest.approx(DT)
    assert sum("converted from" in note for note in log.notes) == 4
    mixed = {("q2 [mm]" if key == "q2 [deg]" else key): x for key, x in columns.items()}
    mixed["q2 [mm]"] = 1e3 * THREE["q2"]
    mixed = {key: x for key, x in mixed.items() if not key.startswith("qd")}
    log = read(write(tmp_path / "mixed.csv", mixed))
    same(log)
    assert any(note.endswith("converted from deg and mm") for note in log.notes)
    strange = {
        f"tau{j} [%]" if key == f"tau{j}" else key: THREE[key]
        for j in range(3)
        for key in THREE
        if "tau" not in key or key[-1] == str(j)
    }
    refuse(
        lambda: read(write(tmp_path / "b.csv", strange)),
        "a unit such as",
        "tau0 [%]",
        "convert the column",
    )


@pytest.mark.parametrize(
    ("title", "kind", "number", "unit"),
    [
        ("position_deg_1", "q", 1, np.pi / 180.0),
        ("joint1_angle_degrees", "q", 1, np.pi / 180.0),
        ("pos 1 / mm", "q", 1, 1e-3),
        ("torque_1_mNm", "tau", 1, 1e-3),
        ("moment_kNm", "tau", None, 1e3),
        ("current_2_mA", "i", 2, 1e-3),
        ("velocity_deg_s_1", "qd", 1, np.pi / 180.0),
        ("acc_deg_s2_1", "qdd", 1, np.pi / 180.0),
        ("time_ms", "time", None, 1e-3),
        ("q1_counts", "q", 1, None),
        ("torque_percent_1", "tau", 1, None),
    ],
)
def test_a_unit_is_understood_wherever_it_stands(title, kind, number, unit):
    """What no factor converts, such as counts, is refused when the log is read."""
    read_as = read_title(title)
    assert read_as is not None
    assert (read_as.kind, read_as.number) == (kind, number)
    factor_of = factor(kind, read_as.unit)
    assert factor_of is None if unit is None else factor_of == pytest.approx(unit)


@pytest.mark.parametrize(
    ("title", "joint", "kind"),
    [
        ("x_pos", 0, "q"),
        ("vel_Z", 1, "qd"),
        ("A1 position [deg]", 2, "q"),
        ("rev_mount_torque", 3, "tau"),
        ("x", None, "q"),
        ("a1", None, "qdd"),
        ("X actual [deg]", 0, "q"),
        ("A1 [rpm]", 2, "qd"),
        ("rev_mount measured (Nm)", 3, "tau"),
    ],
)
def test_names_of_joints_that_could_be_quantities_are_found_beside_one(title, joint, kind):
    read_as = read_title(title, ("X", "Z", "A1", "rev_mount"))
    assert read_as is not None
    assert (read_as.joint, read_as.kind) == (joint, kind)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"stamp": (1.7e18 + 1e9 * THREE["time"]).astype(np.int64)}, "a clock time in ns"),
        ({"timestamp": (1.7e12 + 1e3 * THREE["time"]).astype(np.int64)}, "a clock time in ms"),
        (
            {
                "secs": np.floor(1.7e9 + 0.3 + THREE["time"]),
                "nsecs": np.round((0.3 + THREE["time"]) % 1 * 1e9),
            },
            "nanoseconds",
        ),
        (
            {
                "header.stamp.sec": np.floor(5 + THREE["time"]),
                "header.stamp.nanosec": np.round(THREE["time"] % 1 * 1e9),
                "stamp": THREE["q0"],
            },
            "nanoseconds",
        ),
    ],
)
@pytest.mark.parametrize("ending", ["csv", "npz"])
def test_clocks_in_any_unit_become_seconds(tmp_path, columns, words, ending):
    log = read(
        write(tmp_path / f"a.{ending}", columns | {k: v for k, v in THREE.items() if k != "time"})
    )
    same(log)
    assert log.dt == pytest.approx(DT, rel=1e-4)
    assert any(words in note for note in log.notes), log.notes
    np.testing.assert_allclose(log.time, THREE["time"], atol=1e-5)


def test_repeated_rows_are_left_out(tmp_path):
    path = write(tmp_path / "a.csv", {key: np.repeat(column, 2) for key, column in THREE.items()})
    log = read(path)
    same(log)
    assert log.notes == (f"300 rows of {path} repeated the one before: left out",)
    twice = {key: np.repeat(column, 2) for key, column in THREE.items()}
    twice["tau1"][7::10] += 0.1
    refuse(lambda: read(write(tmp_path / "b.csv", twice)), "0.015 again in row 8 (line 9)")


def wave(time):
    return {"time": time, "q0": np.sin(3 * time), "tau0": np.cos(3 * time)}


@pytest.mark.parametrize("factor", [0.98, 1.05, 2.0, 3.7])
def test_runs_of_other_rates_are_brought_together(tmp_path, factor):
    a, b = (
        write(tmp_path / f"{n}.csv", wave(np.arange(0, 5, step)))
        for n, step in (("a", DT), ("b", DT * factor))
    )
    log = read([a, b])
    check(log)
    assert log.dt == pytest.approx(DT * max(1.0, factor))
    assert any("1 run resampled to" in note for note in log.notes), log.notes
    np.testing.assert_allclose(log.q[:, 0], np.sin(3 * log.time), atol=5e-4)
    # at the ends one step of it
    np.testing.assert_allclose(log.tau[:, 0], np.cos(3 * log.time), atol=2e-2)
    inner = np.concatenate([np.arange(s.start + 1, s.stop - 1) for s in log.segments()])
    np.testing.assert_allclose(log.tau[inner, 0], np.cos(3 * log.time[inner]), atol=5e-4)


def test_resampling_does_not_alias(tmp_path):
    """A wave at 7/8 of the slower rate would come out as one at 1/8 of it."""
    fast, slow = np.arange(0, 5, DT), np.arange(0, 5, 4 * DT)
    ripple = wave(fast) | {"tau0": np.cos(2 * np.pi * 0.875 / (4 * DT) * fast)}
    log = read([write(tmp_path / "a.csv", ripple), write(tmp_path / "b.csv", wave(slow))])
    assert log.tau[log.segments()[0]].std() < 0.2 < 0.7 < ripple["tau0"].std() + 0.01


def test_a_clock_that_jitters_is_resampled(tmp_path):
    time = np.sort(np.arange(1000) * DT + np.random.default_rng(0).uniform(-0.45, 0.45, 1000) * DT)
    # the first version gave up here
    assert np.mean(np.abs(np.diff(time) / np.median(np.diff(time)) - 1) > 0.5) > 0.1
    log = read(write(tmp_path / "a.csv", wave(time)))
    check(log)
    assert log.dt == pytest.approx(DT, rel=1e-3)
    np.testing.assert_allclose(log.q[:, 0], np.sin(3 * log.time), atol=2e-4)
    gap = np.r_[time[:500], time[500:] + 1.0]
    assert read(write(tmp_path / "b.csv", wave(gap))).runs == 2


# Motors' data.


def test_currents_become_torques(tmp_path):
    path = write(tmp_path / "a.csv", CURRENTS)
    refuse(
        lambda: read(path, ARM),
        "torques tau0..tau2",
        "currents (motor_current_0 ...)",
        "--torque-constant",
    )
    motor = motor_side(ARM, None, [0.1, 0.2, -0.3], [100.0])
    log = read(path, ARM, motor=motor)
    np.testing.assert_allclose(log.tau, each_joint(THREE, "tau", range(3)) * [10, 20, -30])
    assert "joint torque computed as current * torque constant * gear ratio" in log.notes
    torques = read(write(tmp_path / "b.csv", THREE), ARM, motor=motor_side(ARM, None, [], [2.0]))
    np.testing.assert_allclose(torques.tau, 2 * each_joint(THREE, "tau", range(3)))
    refuse(
        lambda: read(tmp_path / "b.csv", ARM, motor=motor), "currents i0..i2", "the log has torques"
    )


COUPLED = """
torque_constant: {shoulder_pan: 0.1, elbow_joint: 0.2, wrist_1: 0.3}
gear_ratio: [100, 50, -50]
coupling: [[1, 0, 0], [0, 1, 0], [0, 0.5, 1]]
offset: [0, 0.1, 0]
motor_positions: true
"""


def test_coupled_motors_keep_power(tmp_path):
    """The joints' power is the motors', and positions follow the kinematics."""
    (tmp_path / "m.yaml").write_text(COUPLED)
    motor = motor_side(ARM, tmp_path / "m.yaml")
    speeds = {f"qd{j}": np.gradient(THREE[f"q{j}"], DT) for j in range(3)}
    log = read(write(tmp_path / "a.csv", CURRENTS | speeds), ARM, motor=motor)
    turn = each_joint(speeds, "qd", range(3))
    push = each_joint(THREE, "tau", range(3)) * [0.1, 0.2, 0.3]
    np.testing.assert_allclose(
        np.sum(log.qd * log.tau, axis=1), np.sum(turn * push, axis=1), rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(log.q[:, 1], THREE["q1"] / 50 + 0.1)
    np.testing.assert_allclose(log.q[:, 2], 0.5 * THREE["q1"] / 50 - THREE["q2"] / 50)


def test_numbers_of_motors_may_be_given_by_joint(tmp_path):
    (tmp_path / "m.yaml").write_text(
        "joints: {elbow: {torque_constant: 2}, shoulder_pan: {torque_constant: 1}, wrist_1:"
        " {torque_constant: 3}}"
    )
    np.testing.assert_array_equal(motor_side(ARM, tmp_path / "m.yaml").torque_constant, [1, 2, 3])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["names and values", "NoneType"]),
        ("torque_constant: [0.1", ["readable YAML"]),
        ("- 1", ["names and values", "a list"]),
        ("torque: 1", ["torque_constant, gear_ratio", "'torque'"]),
        ("motor_positions: true", ["torque_constant or gear_ratio", "neither"]),
        ("torque_constant: [0.1, 0.2]", ["3 finite numbers as torque_constant", "[0.1, 0.2]"]),
        ("torque_constant: .nan", ["finite"]),
        ("torque_constant: yes", ["finite", "True"]),
        ("torque_constant: 0", ["other than zero", "shoulder_pan_joint"]),
        ("torque_constant: {elbow: 1}", ["torque_constant of joint shoulder_pan_joint", "elbow"]),
        ("gear_ratio: 1\ncoupling: [[1, 0], [0, 1]]", ["coupling of 3 x 3"]),
        ("gear_ratio: 1\ncoupling: [[1, 0, 0], [1, 0, 0], [0, 0, 1]]", ["can be inverted"]),
        ("gear_ratio: 1\noffset: 0.1", ["offset", "motor_positions: true"]),
        ("gear_ratio: 1\nmotor_positions: 3", ["true or false", "3"]),
        ("joints: [1]", ["joints in", "by name"]),
        ("joints: {elbow: {kt: 1}}", ["numbers of joint elbow", "'kt'"]),
        ("gear_ratio: 1\njoints: {elbow: {gear_ratio: 1}}", ["numbers of joint elbow", "once"]),
        ("!!python/object/apply:os.system ['true']", ["readable YAML"]),
        ("&a [*a, *a]", ["names and values"]),
        ("gear_ratio: &a [*a]", ["finite numbers"]),
        ("\0", ["readable YAML"]),
    ],
)
def test_wrong_descriptions_of_motors_are_refused(tmp_path, content, words):
    (tmp_path / "m.yaml").write_text(content)
    refuse(lambda: motor_side(ARM, tmp_path / "m.yaml"), *words)
    refuse(lambda: motor_side(ARM, tmp_path / "m.yaml", [1.0]), "both")
    refuse(lambda: motor_side(ARM, tmp_path / "gone.yaml"), "no such file")
    refuse(lambda: motor_side(ARM, tmp_path), "readable YAML")


def test_odd_headers_and_mappings_are_understood_or_refused(tmp_path):
    """Each of 400 logs with random titles is read in full or refused in one line."""
    parts = [
        "q",
        "tau",
        "actual",
        "target",
        "pos",
        "effort",
        "elbow",
        "joint",
        "_",
        " ",
        "/",
        "0",
        "1",
        "2",
        "[deg]",
        "(",
        "]",
        "time",
        "*",
        "=",
        "é",
        "\x1b",
        ".",
    ]
    outcomes, path = [0, 0], tmp_path / "a.csv"
    for seed in range(400):
        rng, columns = (
            random.Random(seed),
            dict(UNDERSTOOD[random.Random(seed).choice(list(UNDERSTOOD))]),
        )
        for _ in range(rng.randrange(4)):
            old, new = (
                rng.choice(list(columns)),
                "".join(rng.choice(parts) for _ in range(rng.randint(1, 6))),
            )
            columns = {(new if key == old else key): column for key, column in columns.items()}
        mapping = [
            "".join(rng.choice(parts) for _ in range(rng.randint(1, 6)))
            for _ in range(rng.randrange(-3, 3))
        ]
        mapping = [
            rng.choice(["q=", "q0=", "tau=", "tau.elbow=", "time=", ""]) + entry
            for entry in mapping
        ]
        path.write_text(text(columns), encoding="utf-8")
        try:
            log = read(path, ARM, columns=mapping)
            check(log)
            assert log.joints == 3
            assert all(note.isprintable() for note in log.notes), (seed, log.notes)
            outcomes[0] += 1
        except LogError as error:
            line = str(error)
            assert line.isprintable(), (seed, line)
            assert len(line) < 800, (seed, line)
            outcomes[1] += 1
        except JaxidlError as error:
            pytest.fail(f"{seed}: {error}")
    assert min(outcomes) > 50, outcomes


def test_fewer_numbered_columns_than_the_model_has_joints_name_the_way_out(tmp_path):
    columns = {"time": THREE["time"]}
    for j in range(3):
        columns |= {f"q[{j}]": THREE[f"q{j}"], f"torque[{j}]": THREE[f"tau{j}"]}
    path, names = write(tmp_path / "a.csv", columns), ("j1", "j2", "j3", "finger")
    refuse(lambda: read(path, names), "3 columns of positions", "--joints j1 j2 j3")
    same(read(path, names[:3], robot=names))


def test_what_is_missing_is_said_in_the_file_s_own_titles(tmp_path):
    columns = {"Zeit [s]": THREE["time"]}
    for name, joint in zip(ARM, range(3), strict=True):
        columns |= {f"{name} position [rad]": THREE[f"q{joint}"]}
        columns |= {f"{name} torque [Nm]": THREE[f"tau{joint}"]}
    log = write(tmp_path / "a.csv", columns)
    refuse(lambda: read(log, ARM), f"{ARM[1]} position [rad]", "Zeit [s]", "--columns time=")
    one_more = (*ARM, "finger")
    given = ["time=Zeit [s]", "q=* position [rad]", "tau=* torque [Nm]"]
    refuse(lambda: read(log, one_more, columns=given), "for q of 4 joints", "--joints")
