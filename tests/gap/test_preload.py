"""A gas spring is relaxed far outside of the range in which its joint moves."""

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.logs.log import from_arrays
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

STIFFNESS, REST = 187.0, 2.1  # N/m, m
T = np.arange(5000) / 250.0


@pytest.mark.slow
def test_a_preloaded_spring_is_found_beside_friction(tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(MECHANISMS["slider"])
    model = read_model(path)
    waves = [(0.15, 0.2, 0.3), (0.08, 0.7, 1.1), (0.03, 1.6, 2.0)]
    phase = lambda f, shift: 2.0 * np.pi * f * T + shift
    q = sum(a * np.sin(phase(f, s)) for a, f, s in waves)
    qd = sum(a * 2.0 * np.pi * f * np.cos(phase(f, s)) for a, f, s in waves)
    qdd = sum(-a * (2.0 * np.pi * f) ** 2 * np.sin(phase(f, s)) for a, f, s in waves)
    rigid = inverse_dynamics(model.plant.body, q[:, None], qd[:, None], qdd[:, None])[:, 0]
    noise = np.random.default_rng(0).normal(0.0, 1.0, len(T))
    tau = rigid + 40.0 * qd + 12.0 * np.sign(qd) + STIFFNESS * (q - REST) + noise
    found = diagnose(from_arrays(T, q, tau), model, rollouts=False)
    spring = next(f for f in found.findings if f.name == "spring")
    assert spring.sure
    assert spring.parameters["stiffness"].value == pytest.approx(STIFFNESS, rel=0.05)
    assert spring.parameters["rest"].value == pytest.approx(REST, rel=0.05)
    assert "viscous_friction" in {f.name for f in found.findings if f.sure}
