"""A diagnosis in doubt: its explanations, and the motion that tells them apart."""

import json

import numpy as np
import pytest

from jaxidl.errors import ConfigurationError
from jaxidl.excite.contest import pairs
from jaxidl.excite.doubt import candidates, read_report, titles
from jaxidl.excite.run import Request, excite
from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import PENDULUM
from jaxidl.gap.inputs import read_inputs
from jaxidl.report import save


def report(effects, ambiguous=(), nearest=None):
    entry = lambda key: {"effect": key[0], "joint": key[1]}
    return {
        "effects": [entry(k) | {"confidence": c, "nearest": nearest} for *k, c in effects],
        "ambiguous": [{"candidates": [entry(k) for k in group]} for group in ambiguous],
    }


def test_explanations_are_what_was_found_with_others_in_its_place():
    found = report(
        [("spring", 0, 0.5), ("payload", None, 0.9)], [(("spring", 0), ("com_error", 0))]
    )
    assert candidates(found) == [
        (("spring", 0), ("payload", None)),
        (("payload", None), ("com_error", 0)),
    ]
    both = report([("a", 0, 0.5), ("b", 0, 0.5)], [(("a", 0), ("b", 0))])
    assert candidates(both) == [(("a", 0), ("b", 0)), (("a", 0),), (("b", 0),)]


def test_without_a_set_an_unsure_effect_competes_with_none_and_with_the_nearest():
    found = report([("a", 1, 0.5), ("b", 0, 0.9)], nearest={"effect": "c", "joint": 1})
    assert candidates(found) == [
        (("a", 1), ("b", 0)),
        (("b", 0),),
        (("b", 0), ("c", 1)),
    ]
    assert titles(candidates(found), ("x", "y")) == ["a on y", "no more", "c on y"]
    # nothing more is imitated by anything more
    assert pairs(candidates(found)) == ((0, 1), (0, 2), (2, 0), (2, 1))


def test_a_folder_without_a_diagnosis_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="no such file"):
        read_report(tmp_path)
    for text in ("{", "[]", "{}"):
        (tmp_path / "report.json").write_text(text)
        with pytest.raises(ConfigurationError, match="the folder of a diagnosis"):
            read_report(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("other", ["com_error", "joint_elasticity"])
def test_a_diagnosis_in_doubt_is_continued(other, tmp_path):
    model = tmp_path / "model.xml"
    model.write_text(PENDULUM)
    hidden = [make("spring", 0, {"stiffness": 0.85, "rest": -0.2})]
    columns = simulate(PENDULUM, hidden, 3, duration=12.0)
    columns["x17"] = columns.pop("q0")  # which only --columns says
    np.savez(tmp_path / "log.npz", **columns)
    inputs = read_inputs([tmp_path / "log.npz"], model, columns=["q0=x17"])
    found = diagnose(*inputs, rollouts=False)
    save(found, tmp_path / "gap")
    path = tmp_path / "gap" / "report.json"
    content = json.loads(path.read_text())
    keys = [("spring", 0), (other, 0)]  # whatever it found, these two are in question
    content["effects"] = [e for e in content["effects"] if (e["effect"], e["joint"]) in keys][:1]
    content["ambiguous"] = [
        {"candidates": [{"effect": name, "joint": joint} for name, joint in keys]}
    ]
    path.write_text(json.dumps(content))
    result = excite(model, Request(seconds=8.0, starts=1, steps=10), diagnosis=tmp_path / "gap")
    assert result.apart
    # below the floor nothing is gained; an elastic drive is simulated, and must stay finite
    assert all(np.inf > pair["after"] >= pair["before"] >= 0.0 for pair in result.apart)
    reached = result.doubt.reached()
    assert result.found.q.max() <= reached["upper"][0]
    assert np.abs(result.found.qd).max() <= reached["speed"][0]
    assert any("jaxidl gap" in n and n.endswith("--columns q0=x17") for n in result.notes())
