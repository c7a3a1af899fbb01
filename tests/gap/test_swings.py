"""What remains swings at a frequency that the motion does not have."""

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.logs.log import from_arrays
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

DT = 4e-3
T = DT * np.arange(5000)


@pytest.mark.parametrize(("hertz", "said"), [(1.7, True), (0.3, False)])
def test_a_torque_in_time_is_told_from_one_of_the_motion(tmp_path, hertz, said):
    """At the motion's own frequency it may as well be an effect of the state."""
    path = tmp_path / "slider.xml"
    path.write_text(MECHANISMS["slider"])
    omega = 2.0 * np.pi * np.array([0.3, 0.47])
    model, wave = read_model(path), np.exp(1j * T[:, None] * omega)
    q, qd, qdd = (np.imag(wave * (1j * omega) ** k).sum(1, keepdims=True) for k in range(3))
    draw = np.random.default_rng(0).standard_normal((2, len(T)))
    outside = 2.0 * np.sin(2.0 * np.pi * hertz * T + 0.4) + 0.01 * draw[0]
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + outside[:, None]
    log = from_arrays(T, q + 1e-5 * draw[1][:, None], tau)
    found = diagnose(log, model, effects=["viscous_friction"], rollouts=False)
    notes = [note for note in found.notes if "swings at" in note]
    assert bool(notes) is said
    if said:
        assert "swings at 1.7 Hz" in notes[0]
