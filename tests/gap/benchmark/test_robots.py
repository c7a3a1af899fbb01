"""Whole robots of the benchmark: the recorded truth is right, roots are independent, and the score
allows for what a log cannot show.
"""

import copy
import csv
import json

import numpy as np
import pytest

from jaxidl.errors import ConfigurationError
from jaxidl.gap.benchmark import robot_judge
from jaxidl.gap.benchmark.arms import JOINTS, excitation, random_arm
from jaxidl.gap.benchmark.believed import inverse_dynamics
from jaxidl.gap.benchmark.catalogue import INJECTED, make
from jaxidl.gap.benchmark.exotic import EXOTIC
from jaxidl.gap.benchmark.links import Links, load
from jaxidl.gap.benchmark.robots import Robot, robots, store, truth
from jaxidl.gap.benchmark.run import chosen, generate, make_case, training_table
from jaxidl.gap.benchmark.score import score
from jaxidl.gap.benchmark.translate import errors, expected
from jaxidl.gap.benchmark.worth import Motion, altered, columns, inertial, rms

SMALL = 3  # number of a robot of three joints that runs for half a minute
COMMON = (
    "viscous_friction",
    "coulomb_friction",
    "inertia_error",
    "com_error",
    "inertia_tensor_error",
)


@pytest.fixture(scope="module")
def measured():
    robot = robots(2026, SMALL + 1)[SMALL]
    drawn, run = robot.measure()
    return robot, drawn, run, truth(robot, drawn, run)


def entry(hidden):
    """A perfect report's entry for a hidden effect."""
    given = {}
    for name, value in expected(hidden).items():
        table = value(np.linspace(-1, 1, 30)) if callable(value) else np.asarray(value)
        given[name] = {
            "value": table.tolist(),
            "stderr": np.full(table.shape, 0.01 * np.linalg.norm(table) + 1e-9).tolist(),
        }
    given |= {"lower": {"value": -1.0}, "upper": {"value": 1.0}}
    options = {key: hidden["parameters"][key] for key in ("other",) if key in hidden["parameters"]}
    return {
        "effect": hidden["effect"],
        "joint": hidden["joint"],
        "parameters": given,
        "options": options,
        "confidence": 0.95,
    }


def report(*effects):
    gap = {"before": {"torque_rms": [1.0]}, "after": {"torque_rms": [1.0]}, "noise_floor": [0.1]}
    return {"verdict": "named", "effects": list(effects), "ambiguous": [], "gap": gap}


def test_random_arms_have_the_joints_and_masses_that_are_recorded():
    rng = np.random.default_rng(1)
    arms = [random_arm(rng) for _ in range(40)]
    assert {len(arm.masses) for arm in arms} == set(range(JOINTS[0], JOINTS[1] + 1))
    for arm in arms:
        model = altered(arm.xml, [])
        assert model.nv == model.njnt == len(arm.masses)
        assert model.body_mass[1:] == pytest.approx(arm.masses, rel=1e-4)
    assert {bool(altered(arm.xml, []).dof_armature.any()) for arm in arms} == {False, True}


def test_motion_starts_and_ends_at_rest_within_its_limits():
    q, qd, _ = excitation(np.random.default_rng(3), 5, 40.0, 100.0)
    assert np.abs(qd[[0, 1, -2, -1]]).max() < 1e-9
    assert (np.abs(qd).max(axis=0) <= 2.2).all()
    assert (np.ptp(q, axis=0) > 0.2).all()


def test_everything_common_is_hidden_on_every_joint(measured):
    robot, _, run, record = measured
    joints = record["joints"]
    names = [(h["effect"], h["joint"]) for h in record["hidden"]]
    assert len(names) == len(set(names))
    assert {(name, j) for name in COMMON for j in range(joints)} <= set(names)
    assert record["remainder"]
    assert all(h["effect"] == "outside" for h in record["remainder"])
    assert json.loads(json.dumps(record)) == record
    small = [h for h in record["hidden"] if h["effect"] == "presliding_friction"]
    rest = np.sqrt(sum(np.square(part["worth"]) for part in small + record["remainder"]))
    assert ((rest > 0.003) & (rest < 0.06)).all()
    assert run.q.shape == run.tau.shape == (len(run.time), joints)
    counts = run.q / robot.draw().sensors.quantum
    assert np.abs(counts - np.round(counts)).max() < 1e-4
    assert np.abs(run.q - run.clean).max() < 0.001


def test_hidden_torques_are_the_gap(measured):
    """The believed model lacks the torques that the hidden effects recorded, and those of its wrong
    links.
    """
    _, drawn, run, _ = measured
    bodies = [
        make(*part)
        for part in drawn.hidden
        if part.effect in ("inertia_error", "com_error", "inertia_tensor_error")
    ]
    step = run.time[1]
    qdd = np.gradient(run.speed, step, axis=0)
    need = inverse_dynamics(altered(drawn.arm.xml, bodies), run.clean, run.speed, qdd)
    found = need - run.command - sum(run.acts)
    moving = (np.abs(run.speed) > 0.05) & (np.abs(np.gradient(np.sign(run.speed), axis=0)) == 0)
    moving[:50] = moving[-50:] = False
    for j in range(run.q.shape[1]):
        assert rms(found[moving[:, j]])[j] < 0.06 * rms(run.command)[j]


@pytest.mark.slow
def test_cases_do_not_depend_on_each_other(measured):
    robot = measured[0]
    assert robots(2026, 3) == robots(2026, 9)[:3]
    assert (
        robot.draw().hidden == Robot(2026, SMALL).draw().hidden != Robot(2027, SMALL).draw().hidden
    )
    assert len({one.id for one in robots(1, 50) + robots(2, 50)}) == 100
    assert set(EXOTIC) < set(INJECTED)
    assert [case.id for case in chosen(("robot",), (), 20, 7)] == [
        one.id for one in robots(7, 60)[::20]
    ]


@pytest.mark.slow
def test_worn_robots_hide_more():
    drawn = [(Robot(2026, n).draw(), Robot(2026, n, family="worn").draw()) for n in range(3)]
    off = lambda d: np.std([p.parameters["scale"] for p in d.hidden if p.effect == "torque_scale"])
    assert np.mean([off(w) for _, w in drawn]) > 2.0 * np.mean([off(r) for r, _ in drawn])
    loaded = [p for _, w in drawn for p in w.hidden if p.effect == "load_dependent_friction"]
    joints = sum(len(w.arm.masses) for _, w in drawn)
    assert 0.25 * joints < len(loaded) < 0.75 * joints
    assert len({one.id for one in robots(1, 50) + robots(1, 50, "worn")}) == 100
    assert [case.id for case in chosen(("worn",), (), 20, 7)] == [
        o.id for o in robots(7, 60, "worn")[::20]
    ]


def test_regressor_of_links_is_their_torque():
    arm = random_arm(np.random.default_rng(5))
    motion = excitation(np.random.default_rng(6), len(arm.masses), 10.0, 10.0)
    names, table = columns(
        arm.xml, Motion(np.arange(len(motion[0])) / 10, *motion, np.zeros_like(motion[0]))
    )
    hidden = [
        make("inertia_error", 1, {"extra": 0.1, "mass": 0.5}),
        make("com_error", 2, {"moment": [0.02, -0.01, 0.03]}),
        make(
            "payload",
            None,
            {
                "mass": 1.0,
                "com": [0.0, 0.02, 0.1],
                "inertia": [0.002, 0.003, 0.004, 0.0005, 0.0, 0.0],
            },
        ),
    ]
    true, believed = altered(arm.xml, hidden), altered(arm.xml, [])
    difference = inertial(true) - inertial(believed)
    wanted = inverse_dynamics(true, *motion) - inverse_dynamics(believed, *motion)
    assert len(names) == table.shape[2] == difference.size
    assert table @ difference.ravel() == pytest.approx(wanted, abs=1e-8)
    ten = load(
        {
            "mass": np.array([1.0]),
            "com": np.array([0.0, 0.02, 0.1]),
            "inertia": np.array([0.002, 0.003, 0.004, 0.0005, 0, 0]),
        }
    )
    assert difference[-1, :10] == pytest.approx(ten, abs=1e-9)


def test_perfect_report_is_perfect(measured):
    record = measured[3]
    result = score({"r": record}, {"r": report(*map(entry, record["hidden"]))})["robots"]
    json.dumps(result)
    assert result["precision"]["share"] == result["recall"]["share"] == 1.0
    assert result["parameters"]["within_two_stderr"]["share"] > 0.98
    assert result["parameters"]["by_effect"]["coulomb_friction"]["level"]["median"] < 1e-6
    assert result["links"]["median"] < 1e-3


def test_wrong_names_lower_precision_and_missing_ones_recall(measured):
    record = measured[3]
    good = [entry(h) for h in record["hidden"]]
    spring = {"effect": "spring", "joint": 0, "parameters": {}, "confidence": 0.9}
    scale = {
        "effect": "torque_scale",
        "joint": 0,
        "parameters": {"scale": {"value": 2.5}},
        "confidence": 0.9,
    }
    absurd = {
        "effect": "payload",
        "joint": None,
        "parameters": {"mass": {"value": 50.0}},
        "confidence": 0.9,
    }
    rest = [e for e in good if (e["effect"], e["joint"]) != ("torque_scale", 0)]
    result = score({"r": record}, {"r": report(*rest, spring, scale, absurd)})
    assert result["robots"]["precision"]["share"] == pytest.approx(len(rest) / (len(rest) + 3))
    assert result["calibration"]["robot"]["0.9-1.0"]["n"] == len(rest) + 3
    suspicion = score({"r": record}, {"r": report(*good, spring | {"confidence": 0.4})})
    assert suspicion["robots"]["precision"]["share"] == 1.0
    assert suspicion["calibration"]["robot"]["0.0-0.5"] == pytest.approx(
        {"share": 0.0, "n": 1, "low": 0.0, "high": 0.7935}, abs=1e-3
    )
    few = score(
        {"r": record}, {"r": report(*[e for e in good if e["effect"] != "coulomb_friction"])}
    )["robots"]
    assert few["recall_by_effect"]["coulomb_friction"]["share"] == 0.0
    assert few["recall"]["share"] < 1.0
    assert score({"r": record}, {"r": None})["robots"]["recall"]["share"] == 0.0


def test_scale_of_the_log_is_no_error(measured):
    """Seen through a motor constant that is 10 % too small, Coulomb friction is 10 % larger, unless
    the constant is named.
    """
    record = copy.deepcopy(measured[3])
    scale = next(h for h in record["hidden"] if (h["effect"], h["joint"]) == ("torque_scale", 1))
    scale["parameters"]["scale"] = 0.9
    dry = next(h for h in record["hidden"] if (h["effect"], h["joint"]) == ("coulomb_friction", 1))
    alone, seen = entry(dry), entry(dry)
    seen["parameters"]["level"]["value"] /= 0.9
    assert robot_judge.parameter_errors(record, report(seen), seen)["level"][0] == pytest.approx(
        0, abs=1e-9
    )
    assert robot_judge.parameter_errors(record, report(alone), alone)["level"][0] == pytest.approx(
        0.1
    )
    assert robot_judge.parameter_errors(record, report(alone, entry(scale)), alone)["level"][
        0
    ] == pytest.approx(0, abs=1e-9)


def test_an_effect_that_a_named_one_contains_counts_as_found(measured):
    record = copy.deepcopy(measured[3])
    dry = next(h for h in record["hidden"] if (h["effect"], h["joint"]) == ("coulomb_friction", 0))
    record["hidden"] = [h for h in record["hidden"] if h["effect"] != "torque_scale"]
    level = dry["parameters"]["level"]
    stribeck = {
        "effect": "stribeck_friction",
        "joint": 0,
        "parameters": {"sliding": 0.3, "excess": 1.0, "speed": 0.1},
        "worth": [0.1] * 3,
    }
    record["hidden"].append(stribeck)
    said = entry(stribeck)
    said["parameters"]["level"]["value"] = 0.3 + level
    given = report(said)
    assert robot_judge.found(record, given, dry)
    assert robot_judge.parameter_errors(record, given, said)["level"][0] == pytest.approx(
        0, abs=1e-9
    )
    assert robot_judge.parameter_errors(record, report(said, entry(dry)), said)["level"][0] > 0.1


def said(effect, joint, **parameters):
    given = {name: {"value": value, "stderr": 0.0 * value} for name, value in parameters.items()}
    return {"effect": effect, "joint": joint, "parameters": given}


def test_rank_decides_which_link_errors_are_one():
    """About its own vertical axis, a first link's inertia is its rotor's; on joint 1 it is not.

    A load is the same as a wrong last link.
    """
    xml = random_arm(np.random.default_rng(7)).xml
    joints = altered(xml, []).nv
    motion = Motion(
        np.arange(200) / 10,
        *excitation(np.random.default_rng(8), joints, 20.0, 10.0),
        np.ones((200, joints)),
    )
    names, table = columns(xml, motion)
    axis = np.array(altered(xml, []).jnt_axis[0])
    axial = ("xx", "yy", "zz")[int(np.argmax(np.abs(axis)))]
    flat = table.reshape(-1, len(names))
    gram = flat.T @ flat / 200
    error = np.zeros(len(names))
    error[names.index(f"link 0 {axial}")] = 1.0
    record = {
        "names": names,
        "gram": gram[np.tril_indices(len(names))],
        "error": error,
        "believed": inertial(altered(xml, [])).ravel(),
    }
    links = Links(record)
    whole = links.left(error, [])
    assert whole > 0.1
    assert links.left(error, [("inertia_error", 0)]) < 1e-6 * whole
    assert links.left(error, [("inertia_error", 1)]) > 0.1 * whole
    assert links.left(error, [("payload", None)]) > 0.1 * whole
    rotor = said("inertia_error", 0, extra=1.0)
    fitted = links.fitted([rotor])["inertia_error", 0]
    assert fitted["extra"] == pytest.approx([1.0], rel=1e-6)
    assert np.isnan(fitted["mass"]).all()
    tensor = said("inertia_tensor_error", 0, tensor=np.ones(6))
    assert np.isnan(links.fitted([rotor, tensor])["inertia_error", 0]["extra"]).all()
    # a component that the report leaves at zero has no part in the fit
    others = np.array([part != axial for part in ("xx", "yy", "zz", "xy", "xz", "yz")], float)
    tensor = said("inertia_tensor_error", 0, tensor=others)
    assert links.fitted([rotor, tensor])["inertia_error", 0]["extra"] == pytest.approx([1.0])
    shift = np.zeros(len(names))
    shift[names.index(f"link {joints - 1} mx")] = 1.0
    assert links.left(shift, [("payload", None)]) < 1e-6 * links.left(shift, [])


@pytest.mark.slow
def test_a_robots_folder_holds_log_and_model_and_is_made_once(measured, tmp_path):
    robot, _, run, record = measured
    make_case(robot, tmp_path)
    folder = tmp_path / "cases" / robot.id
    assert sorted(path.name for path in folder.iterdir()) == sorted([robot.log, "model.xml"])
    assert json.loads((tmp_path / "truth" / f"{robot.id}.json").read_text()) == record
    table = np.genfromtxt(folder / robot.log, delimiter=",", names=True)
    assert np.allclose(table["q1"], run.q[:, 1], atol=1e-7)
    assert "friction" not in (folder / "model.xml").read_text()
    before = (folder / "model.xml").stat().st_mtime_ns
    make_case(robot, tmp_path)
    assert (folder / "model.xml").stat().st_mtime_ns == before


@pytest.mark.slow
def test_folder_belongs_to_one_root(tmp_path):
    made = generate(tmp_path, ("none",), every=200, root=5)
    assert len(made) == 1
    assert json.loads((tmp_path / "truth.json").read_text())[made[0].name]["family"] == "none"
    with pytest.raises(ConfigurationError, match="root 5"):
        generate(tmp_path, ("none",), every=200, root=6)
    with pytest.raises(ConfigurationError, match="a family of cases"):
        chosen(("robots",), (), 1)


def test_training_table_has_every_number_and_whether_it_is_right(measured, tmp_path):
    robot, _, _, record = measured
    with pytest.raises(ConfigurationError, match=r"no truth\.json"):
        training_table(tmp_path)
    dry = next(h for h in record["hidden"] if h["effect"] == "coulomb_friction")
    wrong = {
        "effect": "spring",
        "joint": 0,
        "parameters": {},
        "confidence": 0.4,
        "gain": 0.1,
        "features": {"seen": True},
    }
    store(tmp_path / "truth.json", {robot.id: record, "robot-unfinished": record})
    store(tmp_path / "reports" / f"{robot.id}.json", report(entry(dry), wrong))
    rows = list(csv.DictReader(training_table(tmp_path).read_text().splitlines()))
    assert [(row["family"], row["effect"], row["joint"], row["right"]) for row in rows] == [
        ("robot", "coulomb_friction", str(dry["joint"]), "1"),
        ("robot", "spring", "0", "0"),
    ]
    assert float(rows[0]["parameters.level.value"]) == pytest.approx(dry["parameters"]["level"])
    assert (rows[1]["gain"], rows[1]["features.seen"], rows[0]["gain"]) == ("0.1", "1.0", "")


def test_what_a_motion_leaves_open_is_not_scored():
    reported = {"moment": {"value": [0.11, 5.0, 0.3], "stderr": [0.01, 0.01, 0.1]}}
    error, deviations = errors({"moment": np.array([0.1, np.nan, 0.3])}, reported, 0)["moment"]
    assert error == pytest.approx(0.01 / np.hypot(0.1, 0.3))
    assert deviations == pytest.approx([1.0, 0.0])
    assert errors({"moment": np.full(3, np.nan)}, reported, 0) == {}
