"""The score of hand-made reports."""

import json
import math

import pytest

from jaxidl.gap.benchmark import judge, run
from jaxidl.gap.benchmark.believed import Diverged
from jaxidl.gap.benchmark.calibration import calibration, is_right
from jaxidl.gap.benchmark.cases import all_cases
from jaxidl.gap.benchmark.score import confusion, quartiles, score, share


def hidden(effect="coulomb_friction", joint=0, **parameters):
    return {"effect": effect, "joint": joint, "parameters": parameters or {"level": 2.0}}


def case(*effects, mechanism="slider", severity="clear"):
    names = [effect["effect"] for effect in effects]
    family = "outside" if names == ["outside"] else ("none", "single", "pair")[len(names)]
    return {
        "mechanism": mechanism,
        "family": family,
        "severity": severity if effects else None,
        "hidden": list(effects),
    }


def report(*names, verdict=None, ambiguous=(), parameters=None, gap=None):
    """Names and candidates as (effect, joint)."""
    return {
        "verdict": verdict or ("named" if names else "nothing_missing"),
        "effects": [
            {"effect": effect, "joint": joint, "parameters": parameters or {}}
            for effect, joint in names
        ],
        "ambiguous": [
            {"candidates": [{"effect": e, "joint": j} for e, j in group], "experiment": ""}
            for group in ambiguous
        ],
        "gap": gap
        or {
            "before": {"torque_rms": [5.0, 3.0]},
            "after": {"torque_rms": [2.0, 3.0]},
            "noise_floor": [1.0, 1.0],
        },
    }


C, V = ("coulomb_friction", 0), ("viscous_friction", 0)


def test_wilson_interval_is_the_textbook_one():
    assert share([1.0] * 8 + [0.0] * 2) == pytest.approx(
        {"share": 0.8, "n": 10, "low": 0.4902, "high": 0.9433}, abs=1e-4
    )
    assert share([0.0] * 10) == pytest.approx(
        {"share": 0, "n": 10, "low": 0, "high": 0.2775}, abs=1e-4
    )
    assert share([0.5, 0.5])["share"] == 0.5
    assert math.isnan(share([])["share"])


def test_quartiles_are_the_textbook_ones():
    assert quartiles([4.0, 1.0, 2.0, 3.0, 5.0]) == {"n": 5, "q25": 2.0, "median": 3.0, "q75": 4.0}
    assert math.isnan(quartiles([])["median"])


@pytest.mark.parametrize(
    ("given", "credit"),
    [
        (report(C), 1.0),
        (report(), 0.0),
        (None, 0.0),
        (report(V), 0.0),
        (report(("coulomb_friction", 1)), 0.0),
        (report(C, V), 0.0),
        (report(verdict="ambiguous", ambiguous=[[C, V]]), 0.5),
        (report(C, verdict="ambiguous", ambiguous=[[C, V]]), 0.5),
        (report(V, verdict="ambiguous", ambiguous=[[C, V]]), 0.5),
        (report(("spring", 0), verdict="ambiguous", ambiguous=[[C, V]]), 0.0),
        (report(verdict="ambiguous", ambiguous=[[("spring", 0), V]]), 0.0),
        (report(verdict="unexplained"), 0.0),
    ],
)
def test_credit_of_a_single_effect(given, credit):
    assert judge.single_credit(hidden(), given) == credit


def test_a_payload_counts_on_any_joint():
    load = hidden("payload", None, mass=0.2, com=[0, 0, -0.3])
    assert (
        judge.single_credit(load, report(("payload", None)))
        == judge.single_credit(load, report(("payload", 1)))
        == 1.0
    )


def test_the_sum_of_others_is_the_effect_and_its_parts_may_stand_beside_it():
    """Directional friction under load is the same as plain friction under load and a motor
    constant.
    """
    gear = hidden("directional_load_friction", 0, driving=0.3, driven=0.1)
    load, motor, itself, mass = (
        (n, 0) for n in ("load_dependent_friction", "torque_scale", gear["effect"], "inertia_error")
    )
    assert (
        judge.single_credit(gear, report(load, motor))
        == judge.single_credit(gear, report(itself, load))
        == 1.0
    )
    assert (
        judge.single_credit(
            gear, report(load, mass, verdict="ambiguous", ambiguous=[[mass, itself]])
        )
        == 0.5
    )
    assert (
        judge.single_credit(gear, report(load))
        == judge.single_credit(gear, report(load, mass))
        == 0.0
    )
    assert judge.single_credit(hidden(), report()) == 0.0
    assert judge.pair_credits([gear, hidden()], report(load, motor)) == [1.0, 0.0]
    assert judge.tied(gear, "slider")
    for effect in (load, motor):
        assert is_right(case(gear), report(load, motor), {"effect": effect[0], "joint": 0})
    assert not is_right(case(gear), report(load, motor), {"effect": "inertia_error", "joint": 0})


def test_each_effect_of_a_pair_has_its_own_credit():
    two = [hidden(), hidden("spring", 1, stiffness=3.0, rest=0.1)]
    assert judge.pair_credits(two, report(("spring", 1), C)) == [1.0, 1.0]
    assert judge.pair_credits(
        two, report(C, ambiguous=[[("spring", 1), ("torque_ripple", 1)]])
    ) == [1.0, 0.5]
    assert judge.pair_credits(two, report(C, ("spring", 0))) == [1.0, 0.0]
    assert judge.pair_credits(two, None) == [0.0, 0.0]


def test_effects_that_no_log_can_tell_apart_are_tied():
    assert judge.tied(hidden("torque_scale", scale=1.2), "slider")
    assert judge.tied(hidden("sensor_delay", delay=0.01), "pendulum")
    assert not judge.tied(hidden("sensor_delay", delay=0.01), "two_link")
    assert judge.tied(hidden("torque_scale", scale=0.8), "pendulum")
    assert not judge.tied(hidden("torque_scale", scale=1.2), "pendulum")
    assert judge.tied(hidden("inertia_error", extra=0.2, kind="mass"), "pendulum")
    assert not judge.tied(hidden(), "slider")
    late, early = ("sensor_delay", 0), ("actuator_delay", 0)
    truth = {"pair": case(hidden(), hidden(late[0], delay=0.01))}
    pairs = score(truth, {"pair": report(C, ambiguous=[[late, early]])})["pairs"]
    assert (pairs["found"]["share"], pairs["found_or_tied"]["share"]) == (0.75, 1.0)


@pytest.mark.parametrize(
    ("given", "name"),
    [
        (report(C), "coulomb_friction"),
        (report(V, C), "viscous_friction"),
        (report(("coulomb_friction", 1)), "other joint"),
        (report(), "none"),
        (report(verdict="unexplained"), "unexplained"),
        (report(C, verdict="unexplained"), "coulomb_friction"),
        (report(C, verdict="ambiguous", ambiguous=[[C, V]]), "ambiguous"),
        (None, "failed"),
    ],
)
def test_a_report_has_one_column_of_the_confusion_matrix(given, name):
    assert judge.column(case(hidden()), given) == name


def test_the_confusion_matrix_counts_reports():
    pairs = [
        (case(hidden()), report(C)),
        (case(hidden()), report(V)),
        (case(hidden()), report(C)),
        (case(), report()),
    ]
    assert confusion(pairs) == {
        "coulomb_friction": {"coulomb_friction": 2, "viscous_friction": 1},
        "none": {"none": 1},
    }


def test_findings_of_low_confidence_are_not_names():
    doubtful = report(C, V)
    doubtful["effects"][1]["confidence"] = 0.79
    assert judge.single_credit(hidden(), doubtful) == 1.0
    doubtful["effects"][0]["confidence"] = 0.3
    assert judge.named(doubtful) == []
    assert judge.column(case(hidden()), doubtful) == "none"


@pytest.mark.parametrize(
    ("given", "joints", "wrong"),
    [
        (report(C), None, True),
        (report(C, verdict="unexplained"), None, False),
        (report(C, verdict="unexplained"), [0], False),
        (report(C, verdict="unexplained"), [1], True),
        (report(C, ("spring", 1), verdict="unexplained"), [1], True),
        (report(("payload", None), verdict="unexplained"), [1], False),
        (report(C, verdict="ambiguous"), None, False),
        (
            report(C, verdict="ambiguous", ambiguous=[[("spring", 1), ("torque_ripple", 1)]]),
            None,
            True,
        ),
        (report(C, verdict="ambiguous", ambiguous=[[C, V]]), None, False),
        (report(), None, False),
        (None, None, False),
    ],
)
def test_misnamed_with_confidence(given, joints, wrong):
    if joints is not None:
        given = given | {"unexplained_joints": joints}
    assert judge.misnamed(given) == wrong


def test_calibration_counts_by_confidence_and_family():
    def sure(confidence, *names):
        made = report(*names)
        for effect in made["effects"]:
            effect["confidence"] = confidence
        return made

    pairs = [
        (case(hidden()), sure(0.95, C, V)),
        (case(hidden()), sure(0.8, C)),
        (case(), sure(0.2, V)),
        (case(), report(V)),
    ]
    curve = calibration(pairs, share)
    assert {name: (bin["share"], bin["n"]) for name, bin in curve.items() if bin["n"]} == {
        "0.0-0.5": (0.0, 1),
        "0.8-0.9": (1.0, 1),
        "0.9-1.0": (pytest.approx(1 / 3), 3),
    }


def test_errors_of_parameters_are_relative_with_deviations_in_standard_errors():
    def errors(truth, **reported):
        return judge.parameter_errors(truth, {"parameters": reported}, "pendulum")

    level = {"value": 2.2, "unit": "N", "stderr": 0.05}
    assert errors(hidden(), level=level, other=level)["level"] == (
        pytest.approx(0.1),
        pytest.approx([4.0]),
    )
    assert errors(hidden(joint=1), level={"value": [9.0, 2.2]})["level"] == (pytest.approx(0.1), [])
    assert errors(hidden("torque_scale", scale=0.8), scale={"value": 0.82})["scale"][
        0
    ] == pytest.approx(0.1)
    load = hidden("payload", None, com=[0.0, 0.0, -0.5])
    found = errors(load, com={"value": [0.03, 0.0, -0.54], "stderr": [0.01, 0.01, 0.02]})["com"]
    assert found == (pytest.approx(0.1), pytest.approx([3.0, 0.0, 2.0]))
    heavier = hidden("inertia_error", extra=0.2, kind="mass")
    assert errors(heavier, extra={"value": 0.01}) == {}
    assert errors(heavier, mass={"value": 0.18})["mass"][0] == pytest.approx(0.1)
    assert errors(hidden(), speed=level) == {}


def test_parameters_that_go_by_another_name():
    def errors(truth, **values):
        return judge.parameter_errors(
            truth,
            {"parameters": {k: {"value": v, "stderr": 0.1} for k, v in values.items()}},
            "pendulum",
        )

    stribeck = hidden("stribeck_friction", sliding=2.0, excess=1.0, speed=0.1)
    assert errors(stribeck, level=2.2, excess=1.0, speed=0.1)["level"][0] == pytest.approx(0.1)
    ripple = hidden("torque_ripple", amplitude=2.0, period=0.3, phase=math.pi / 2)
    found = errors(ripple, sine=0.2, cosine=2.0, period=0.3)
    # of the wave's amplitude, though the true sine is zero
    assert found["sine"][0] == pytest.approx(0.1)
    assert found["cosine"][0] == pytest.approx(0, abs=1e-12)
    wave = hidden(
        "position_dependent_friction",
        level=1.0,
        variation=0.5,
        period=1.0,
        phase=0.0,
        kind="coulomb",
    )
    positions = [-0.5 + k / 10 for k in range(11)]
    table = [1 + 0.5 * math.sin(2 * math.pi * q) for q in positions]
    right = errors(wave, level=table, lower=-0.5, upper=0.5)["level"]
    assert right[0] == pytest.approx(0, abs=1e-9)
    assert len(right[1]) == 11
    off = errors(wave, level=[1.1 * value for value in table], lower=-0.5, upper=0.5)["level"]
    assert off[0] == pytest.approx(0.1)
    assert errors(wave, level=table) == {}  # a table without its ends has no positions


def test_the_removed_share_of_the_gap_is_that_above_the_noise():
    assert judge.removed(case(hidden()), report(C)) == pytest.approx(0.75)
    whole = case(hidden("payload", None, mass=1.0))
    assert judge.removed(whole, report(("payload", None))) == pytest.approx(
        (34**0.5 - 13**0.5) / (34**0.5 - 2**0.5)
    )
    assert judge.removed(case(hidden()), report()) is None
    flat = {"before": {"torque_rms": [1.0]}, "after": {"torque_rms": [1.0]}, "noise_floor": [1.0]}
    assert judge.removed(case(hidden()), report(C, gap=flat)) is None


def test_the_whole_score_of_made_up_reports_is_as_they_were_made():
    truth = {
        "s1": case(hidden(), severity="weak"),
        "s2": case(hidden(), mechanism="pendulum"),
        "s3": case(hidden("torque_scale", scale=1.2)),
        "n1": case(),
        "n2": case(),
        "n3": case(),
        "o1": case(hidden("outside", kind="disturbance", amplitude=1.0)),
        "o2": case(hidden("outside", kind="disturbance", amplitude=1.0)),
        "p1": case(hidden(), hidden("spring", stiffness=3.0)),
        "p2": case(hidden(), hidden("spring", stiffness=3.0)),
    }
    level = {"level": {"value": 2.2, "unit": "N", "stderr": 0.2}}
    tie = report(verdict="ambiguous", ambiguous=[[("torque_scale", 0), ("inertia_error", 0)]])
    reports = {
        "s1": report(C, parameters=level),
        "s2": report(V),
        "s3": tie,
        "n1": report(),
        "n2": report(C),
        "o1": report(V),
        "o2": report(V, verdict="unexplained"),
        "p1": report(C, ("spring", 0)),
        "p2": report(C, ambiguous=[[("spring", 0), ("torque_ripple", 0)]]),
    }
    result = score(truth, reports)
    json.dumps(result)
    assert result["cases"] == {
        "single": 3,
        "none": 3,
        "outside": 2,
        "pair": 2,
        "robot": 0,
        "worn": 0,
    }
    assert result["failed"] == 1
    singles = result["singles"]
    assert singles["right"]["share"] == pytest.approx(0.5)
    assert singles["right_or_tied"]["share"] == pytest.approx(2 / 3)
    assert singles["by_severity"]["weak"]["share"] == 1.0
    assert singles["by_mechanism"]["pendulum"]["share"] == 0.0
    assert singles["by_effect"]["torque_scale"]["share"] == 0.5
    assert result["none"]["false_alarm"]["share"] == pytest.approx(1 / 3)
    assert result["none"]["not_nothing"]["share"] == pytest.approx(2 / 3)
    assert result["none"]["verdicts"] == {"nothing_missing": 1, "named": 1, "failed": 1}
    assert result["outside"]["misnamed"]["share"] == 0.5
    assert result["pairs"]["both"]["share"] == pytest.approx((1 + 0.75) / 2)
    assert result["pairs"]["exact"]["share"] == 0.5
    assert result["parameters"]["by_effect"]["coulomb_friction"]["level"][
        "median"
    ] == pytest.approx(0.1)
    assert result["parameters"]["within_two_stderr"]["share"] == 1.0
    assert result["calibration"]["single"]["0.9-1.0"]["share"] == 0.5
    assert result["gap_removed"]["single"]["n"] == 2
    assert result["gap_removed"]["single_right"]["median"] == pytest.approx(0.75)
    assert result["confusion"]["outside"] == {"viscous_friction": 2}
    assert result["confusion"]["torque_scale"] == {"ambiguous": 1}


def test_a_mechanism_that_diverges_is_recorded_as_lost(tmp_path, monkeypatch):
    def lost(case, out):
        raise Diverged("joint 1 reads 2 where 0 is wanted")

    monkeypatch.setattr(run, "make_case", lost)
    case = all_cases()[0]
    run.judge_case(case, tmp_path)
    assert json.loads((tmp_path / "reports" / f"{case.id}.json").read_text()) == {
        "lost": "joint 1 reads 2 where 0 is wanted"
    }
