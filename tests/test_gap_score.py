"""The score of hand-made reports."""

import json
import math

import pytest

from jaxidl.gap.benchmark import judge
from jaxidl.gap.benchmark.score import confusion, quartiles, score, share


def hidden(effect="coulomb_friction", joint=0, **parameters):
    return {"effect": effect, "joint": joint, "parameters": parameters or {"level": 2.0}}


def case(*effects, mechanism="slider", severity="clear"):
    names = [effect["effect"] for effect in effects]
    family = "outside" if names == ["outside"] else ("none", "single", "pair")[len(names)]
    return {"mechanism": mechanism, "family": family, "severity": severity if effects else None, "hidden": list(effects)}


def report(*names, verdict=None, ambiguous=(), parameters=None, gap=None):
    """Names and candidates as (effect, joint)."""
    return {
        "verdict": verdict or ("named" if names else "nothing_missing"),
        "effects": [{"effect": effect, "joint": joint, "parameters": parameters or {}} for effect, joint in names],
        "ambiguous": [{"candidates": [{"effect": e, "joint": j} for e, j in group], "experiment": ""} for group in ambiguous],
        "gap": gap or {"before": {"torque_rms": [5.0, 3.0]}, "after": {"torque_rms": [2.0, 3.0]}, "noise_floor": [1.0, 1.0]},
    }


C, V = ("coulomb_friction", 0), ("viscous_friction", 0)


def test_wilson_interval_is_the_textbook_one():
    assert share([1.0] * 8 + [0.0] * 2) == pytest.approx({"share": 0.8, "n": 10, "low": 0.4902, "high": 0.9433}, abs=1e-4)
    assert share([0.0] * 10) == pytest.approx({"share": 0, "n": 10, "low": 0, "high": 0.2775}, abs=1e-4)
    assert share([0.5, 0.5])["share"] == 0.5
    assert math.isnan(share([])["share"])


def test_quartiles():
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


def test_payload_is_nowhere_in_particular():
    load = hidden("payload", None, mass=0.2, com=[0, 0, -0.3])
    assert judge.single_credit(load, report(("payload", None))) == judge.single_credit(load, report(("payload", 1))) == 1.0


def test_credits_of_a_pair():
    two = [hidden(), hidden("spring", 1, stiffness=3.0, rest=0.1)]
    assert judge.pair_credits(two, report(("spring", 1), C)) == [1.0, 1.0]
    assert judge.pair_credits(two, report(C, ambiguous=[[("spring", 1), ("torque_ripple", 1)]])) == [1.0, 0.5]
    assert judge.pair_credits(two, report(C, ("spring", 0))) == [1.0, 0.0]
    assert judge.pair_credits(two, None) == [0.0, 0.0]


def test_what_no_log_can_tell_apart():
    assert judge.tied(case(hidden("torque_scale", scale=1.2)))
    assert judge.tied(case(hidden("sensor_delay", delay=0.01), mechanism="pendulum"))
    assert not judge.tied(case(hidden("sensor_delay", delay=0.01), mechanism="two_link"))
    assert judge.tied(case(hidden("torque_scale", scale=0.8), mechanism="pendulum"))
    assert not judge.tied(case(hidden("torque_scale", scale=1.2), mechanism="pendulum"))
    assert judge.tied(case(hidden("inertia_error", extra=0.2, kind="mass"), mechanism="pendulum"))
    assert not judge.tied(case(hidden()))


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
def test_column_of_the_confusion_matrix(given, name):
    assert judge.column(case(hidden()), given) == name


def test_confusion_counts():
    pairs = [(case(hidden()), report(C)), (case(hidden()), report(V)), (case(hidden()), report(C)), (case(), report())]
    assert confusion(pairs) == {"coulomb_friction": {"coulomb_friction": 2, "viscous_friction": 1}, "none": {"none": 1}}


def test_parameter_errors():
    def errors(truth, **reported):
        return judge.parameter_errors(truth, {"parameters": reported})

    level = {"value": 2.2, "unit": "N", "stderr": 0.05}
    assert errors(hidden(), level=level, other=level)["level"] == pytest.approx((0.1, 4.0))
    assert errors(hidden(joint=1), level={"value": [9.0, 2.2]})["level"] == (pytest.approx(0.1), None)
    assert errors(hidden("torque_scale", scale=0.8), scale={"value": 0.82})["scale"][0] == pytest.approx(0.1)
    turn = errors(hidden("torque_ripple", phase=6.2), phase={"value": 0.1})["phase"]
    assert turn[0] == pytest.approx((0.1 - 6.2 + 2 * math.pi) / math.pi)
    load = hidden("payload", None, com=[0.0, 0.0, -0.5])
    assert errors(load, com={"value": [0.03, 0.0, -0.54]})["com"] == (pytest.approx(0.1), None)
    assert errors(hidden("inertia_error", extra=0.2, kind="mass"), extra={"value": 0.01}) == {}
    assert errors(hidden(), speed=level) == {}


def test_share_of_the_gap_removed():
    assert judge.removed(case(hidden()), report(C)) == pytest.approx(0.75)
    whole = case(hidden("payload", None, mass=1.0))
    assert judge.removed(whole, report(("payload", None))) == pytest.approx((34**0.5 - 13**0.5) / (34**0.5 - 2**0.5))
    assert judge.removed(case(hidden()), report()) is None
    flat = {"before": {"torque_rms": [1.0]}, "after": {"torque_rms": [1.0]}, "noise_floor": [1.0]}
    assert judge.removed(case(hidden()), report(C, gap=flat)) is None


def test_whole_score():
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
    assert result["cases"] == {"single": 3, "none": 3, "outside": 2, "pair": 2}
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
    assert result["parameters"]["by_effect"]["coulomb_friction"]["level"]["median"] == pytest.approx(0.1)
    assert result["parameters"]["within_two_stderr"]["share"] == 1.0
    assert result["gap_removed"]["single"]["n"] == 2
    assert result["gap_removed"]["single_right"]["median"] == pytest.approx(0.75)
    assert result["confusion"]["outside"] == {"viscous_friction": 2}
    assert result["confusion"]["torque_scale"] == {"ambiguous": 1}
