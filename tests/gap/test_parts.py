"""Logs whose parts differ."""

import numpy as np
import pytest

from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.logs.log import from_arrays
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

TIME = 4e-3 * np.arange(7500)


@pytest.mark.parametrize("since", [13.0, np.inf], ids=["changed", "the same"])
def test_a_log_is_said_to_differ_before_and_after_friction_changes(tmp_path, since):
    path = tmp_path / "model.xml"
    path.write_text(TWO_LINK)
    model = read_model(path)
    at, size = np.array([[0.9, 1.7], [1.3, 2.1]]), np.array([[0.7, 0.4], [0.5, 0.6]])
    q, qd, qdd = (
        np.real(np.sum(size * (1j * at) ** k * np.exp(1j * (at * TIME[:, None, None] + size)), 2))
        for k in range(3)
    )
    draw = np.random.default_rng(3).standard_normal((2, *q.shape))
    drag = np.where((since <= TIME)[:, None], [2.0, 0.4], 0.4)
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + drag * qd
    log = from_arrays(TIME, q + 1e-5 * draw[0], tau + 0.02 * draw[1])
    names = ["viscous_friction", "coulomb_friction", "inertia_error"]
    found = diagnose(log, model, effects=names, rollouts=False)
    said = [note for note in found.notes if note.startswith("the log differs")]
    assert len(said) == (since < TIME[-1])
    if said:
        second = float(said[0].split(" about ")[1].split()[0])
        assert abs(second - since) < 2.0
