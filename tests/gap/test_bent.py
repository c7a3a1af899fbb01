"""Effects that follow another law than the one in the catalogue, which imitates them."""

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.logs.log import from_arrays
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

DT = 5e-3
T = DT * np.arange(6000)
EFFECTS = ["viscous_friction", "coulomb_friction", "inertia_error", "load_dependent_friction"]


def log_of(model, friction):
    """A log of two joints in varied motion, with friction by the size of the torque."""
    at = np.array([[0.9, 1.7], [1.3, 2.1]])
    size = np.array([[0.7, 0.4], [0.5, 0.6]])
    wave = lambda k: np.real(
        np.sum(size * (1j * at) ** k * np.exp(1j * (at * T[:, None, None] + size)), 2)
    )
    rigid = inverse_dynamics(model.plant.body, wave(0), wave(1), wave(2))
    tau = rigid
    for _ in range(50):
        tau = rigid + np.tanh(wave(1) / 1e-3) * friction(np.abs(tau))
    noise = 1e-5 * np.random.default_rng(0).standard_normal(rigid.shape)
    return from_arrays(T, wave(0) + noise, tau)


@pytest.mark.parametrize(
    ("friction", "right"),
    [
        pytest.param(lambda load: 0.1 * load, True, id="in proportion to the load"),
        pytest.param(lambda load: 0.2 * np.sqrt(load), False, id="with its square root"),
    ],
)
def test_friction_with_another_law_is_less_certain(tmp_path, friction, right):
    path = tmp_path / "model.xml"
    path.write_text(TWO_LINK)
    model = read_model(path)
    found = diagnose(log_of(model, friction), model, effects=EFFECTS, rollouts=False)
    of_load = [f for f in found.findings if f.name == "load_dependent_friction"]
    assert {f.joint for f in of_load} == {0, 1}
    assert all((f.signs["bent"] == 0.0) is right for f in of_load)
    assert all((f.confidence > 0.95) is right for f in of_load)
