"""What hardly anything speaks for is no finding, and hides none that is sure."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import PENDULUM
from jaxidl.gap.result import judged, weight
from jaxidl.logs.log import from_arrays
from jaxidl.report.matrix import DRY, matrix
from jaxidl.systems.mjcf import read_model


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    hidden = [
        make("viscous_friction", 0, {"coefficient": 0.4}),
        make("spring", 0, {"stiffness": 2.0, "rest": 0.3}),
    ]
    columns = simulate(PENDULUM, hidden, 5, duration=12.0)
    path = tmp_path_factory.mktemp("pendulum") / "model.xml"
    path.write_text(PENDULUM)
    log = from_arrays(columns["time"], columns["q0"][:, None], columns["tau0"][:, None])
    return log, read_model(path)


@pytest.mark.slow
def test_an_effect_that_is_hardly_likely_is_not_suspected(measured, monkeypatch):
    before = judged.findings
    monkeypatch.setattr(
        judged,
        "findings",
        lambda *given: tuple(
            replace(f, confidence=0.05) if f.name == "spring" else f for f in before(*given)
        ),
    )
    found = diagnose(*measured, rollouts=False)
    assert "spring" not in [f.name for f in found.findings]
    assert [r.reason for r in found.rivals if r.name == "spring"] == [judged.UNLIKELY]


@pytest.mark.slow
@pytest.mark.parametrize("likely", [0.4, 0.9])
def test_what_is_not_sure_does_not_take_the_name_of_its_part(tmp_path, monkeypatch, likely):
    hidden = make("stribeck_friction", 0, {"sliding": 0.5, "excess": 0.4, "speed": 0.2})
    columns = simulate(PENDULUM, [hidden], 5, duration=20.0)
    (tmp_path / "model.xml").write_text(PENDULUM)
    log = from_arrays(columns["time"], columns["q0"][:, None], columns["tau0"][:, None])
    before, whole = judged.findings, "stribeck_friction"

    def doubted(*given):
        return tuple(
            replace(f, confidence=likely) if f.name == whole else f for f in before(*given)
        )

    monkeypatch.setattr(judged, "findings", doubted)
    found = diagnose(log, read_model(tmp_path / "model.xml"), rollouts=False)
    named = {f.name: f for f in found.findings}
    excess = named[whole].parameters
    assert excess["excess"].value == pytest.approx(0.4, rel=0.1)
    assert ("level" in excess) == (likely > 0.8)
    assert ("coulomb_friction" in named) == (likely < 0.8)
    cell = matrix(found).rows[0][DRY]
    if likely < 0.8:
        assert named["coulomb_friction"].sure
        assert named["coulomb_friction"].parameters["level"].value == pytest.approx(0.5, rel=0.1)
        assert [entry.own for entry in cell] == [True]
    else:
        assert [entry.own for entry in cell] == [False]  # it refers to the other column


@pytest.mark.parametrize("own", [1.0, 0.01])
@pytest.mark.parametrize("share", [-0.5, -2.0])
def test_a_joint_without_weight_of_its_own_carries_no_less(monkeypatch, own, share):
    turning = np.sin(np.arange(200.0))[:, None]
    links = weight.Weight(own * turning, share * own * turning - (own < 0.1) * turning, set())
    monkeypatch.setattr(weight, "weight_of", lambda found: links)
    rows = SimpleNamespace(used=np.ones((200, 1), bool), spread=np.ones(1))
    found = SimpleNamespace(score=SimpleNamespace(anchor=None), library=SimpleNamespace(rows=rows))
    said = weight.balanced(found, ["wrist"])
    assert len(said) == (own == 1.0 and share == -0.5)


@pytest.mark.slow
@pytest.mark.parametrize("stray", [2.0, 0.5])
def test_a_rare_effect_that_leads_the_simulation_astray_is_left_out(measured, monkeypatch, stray):
    """The model as it was strays by 1.0, with the spring by ``stray``, and without it by 0.7."""

    def errors(plant, motion, aside):
        names = [type(getattr(e, "effect", e)).name for e in plant.effects]
        error = stray if "spring" in names else 0.7 if names else 1.0
        return {"0.5": np.array([error])}

    monkeypatch.setattr(judged, "rollout_errors", errors)
    found = diagnose(*measured)
    named = [f.name for f in found.findings]
    assert "viscous_friction" in named
    assert ("spring" in named) == (stray < 1.0)
    assert judged.ASTRAY not in {r.reason for r in found.rivals} or stray > 1.0
