"""Where a residual lies: regimes of a joint's motion, and one moment of a log."""

import numpy as np
import pytest

from jaxidl.gap.evidence.localise import localise
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.systems.point import point_mass

DT, RUN = 5e-3, 4000
T = DT * np.arange(2 * RUN)


@pytest.fixture(scope="module")
def rows():
    q = np.stack([np.sin(2.1 * T) + 0.5 * np.sin(5.3 * T), np.cos(1.7 * T)], 1)
    tau = np.stack([np.cos(2.1 * T), np.sin(1.7 * T)], 1)
    time = T + 100.0 * (np.arange(2 * RUN) >= RUN)  # two runs
    return rows_of(prepare(from_arrays(time, q, tau), point_mass(1.0)))


def places(rows, residual, joint=0):
    return {p.regime: p for p in localise(rows, residual, ("a", "b")) if p.joint == joint}


def test_a_hit_is_a_moment_of_one_run(rows):
    signals = rows.signals
    since = (signals.rows - signals.slices[1].start) * signals.dt  # the second run began [s]
    residual = 0.01 * np.random.default_rng(0).standard_normal(rows.gap.shape)
    residual[np.abs(since - 7.5) < 0.15, 0] = 1.0
    hit = places(rows, residual)["moment"]
    assert hit.share > 0.9
    assert hit.time < 0.05
    assert "within 0.5 s around 7.5 s of run 2" in hit.sentence
    assert "moment" not in places(rows, residual, 1)


def test_what_returns_is_no_moment(rows):
    speed = np.abs(rows.signals.qd[rows.signals.rows])
    found = places(rows, (speed > np.quantile(speed, 0.8, axis=0)).astype(float))
    assert "moment" not in found
    assert found["high speed"].share > 0.99
