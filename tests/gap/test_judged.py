"""What hardly anything speaks for is no finding."""

from dataclasses import replace

import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import simulate
from jaxidl.gap.benchmark.mechanisms import PENDULUM
from jaxidl.gap.result import judged
from jaxidl.logs.log import from_arrays
from jaxidl.systems.mjcf import read_model


@pytest.mark.slow
def test_an_effect_that_is_hardly_likely_is_not_suspected(tmp_path, monkeypatch):
    hidden = [
        make("viscous_friction", 0, {"coefficient": 0.4}),
        make("coulomb_friction", 0, {"level": 0.5}),
    ]
    columns = simulate(PENDULUM, hidden, 5, duration=12.0)
    path = tmp_path / "model.xml"
    path.write_text(PENDULUM)
    log = from_arrays(columns["time"], columns["q0"][:, None], columns["tau0"][:, None])
    before = judged.findings
    monkeypatch.setattr(
        judged,
        "findings",
        lambda *given: tuple(
            replace(f, confidence=0.05) if f.name == "coulomb_friction" else f
            for f in before(*given)
        ),
    )
    found = diagnose(log, read_model(path), rollouts=False)
    assert [f.name for f in found.findings] == ["viscous_friction"]
    assert [r.reason for r in found.rivals if r.name == "coulomb_friction"] == [judged.UNLIKELY]
