"""A log that is sampled far faster than its band is read at fewer instants, and says the same."""

import jax
import numpy as np
import pytest

from jaxidl.effects import CATALOGUE, searched
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.gap.evidence.items import columns_of
from jaxidl.gap.evidence.rows import instants_of, rows_of
from jaxidl.gap.evidence.shape import shapes_of
from jaxidl.gap.fit.library import scales
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import INSTANTS_PER_HERTZ, prepare
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

DT, SECONDS = 1e-3, 8.0
SAME, MOST = 0.03, 0.2  # relative difference of columns: median of an effect's shapes, and largest


@pytest.fixture(scope="module")
def signals(tmp_path_factory):
    path = tmp_path_factory.mktemp("thinned") / "model.xml"
    path.write_text(TWO_LINK)
    model = read_model(path)
    t = DT * np.arange(round(SECONDS / DT))
    run = (np.arange(len(t)) >= 3001).astype(int)  # no multiple of anything

    at = 2.0 * np.pi * np.array([[0.37, 1.1], [0.53, 1.7]])
    wave = lambda k: np.real(
        np.sum([[0.4, 0.1]] * (1j * at) ** k * np.exp(1j * (at * t[:, None, None] + at)), 2)
    )
    q, qd, qdd = (wave(k) for k in range(3))
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + 0.2 * np.tanh(qd / 0.01)
    draw = np.random.default_rng(0)
    noise = lambda size: size * draw.standard_normal(q.shape)
    log = from_arrays(t, q + noise(2e-5), tau + noise(1e-2), run=run)
    with jax.enable_x64(True):
        return prepare(log, model.plant.body)


def test_it_keeps_the_rows_and_what_is_known_there(signals):
    few = signals.thinned()
    assert signals.every == 3
    assert len(few.q) == sum(-(-len(signals.q[s]) // signals.every) for s in signals.slices)
    assert 1.0 / few.dt >= INSTANTS_PER_HERTZ * few.band
    assert few.every == 1
    assert few.thinned() is few
    assert few.interval == signals.interval == pytest.approx(DT)
    for a, b in ((few.q, signals.q), (few.qdd, signals.qdd), (few.moving, signals.moving)):
        np.testing.assert_array_equal(a[few.rows], b[signals.rows])


def test_commands_are_those_of_all_samples(signals):
    few = signals.thinned()
    all_of_it, some = (s.command(s.tau)[s.rows] for s in (signals, few))
    np.testing.assert_allclose(some, all_of_it, atol=2e-3 * np.std(all_of_it))


def test_encoder_noise_does_the_same_to_the_motion(signals):
    noise = [(s.read_again().qdd - s.qdd)[s.rows] for s in (signals, signals.thinned())]
    few, all_of_it = (np.std(x) for x in reversed(noise))
    assert few == pytest.approx(all_of_it, rel=0.15)


@pytest.mark.parametrize("name", searched())
def test_effects_add_the_same_torque(signals, name):
    with jax.enable_x64(True):
        rows = [rows_of(s) for s in (signals, signals.thinned())]
        cls = CATALOGUE[name]
        shapes = [shape for scale in scales(rows[0]) for shape in shapes_of(cls, scale, {}, False)]
        both = [columns_of(shapes, r, r.tau) for r in rows]
    np.testing.assert_array_equal(rows[0].block, rows[1].block)
    size = lambda x: np.linalg.norm(x * rows[0].used)
    # without rests there is no stiction: nothing is nothing in both
    off = [size(b - a) / max(size(a), 1e-6) for a, b in zip(*both, strict=True)]
    assert np.median(off) < SAME
    assert max(off) < MOST


def test_held_out_instants_of_all_samples_are_those_of_the_rows(signals):
    with jax.enable_x64(True):
        rows = rows_of(signals.thinned())
    aside = instants_of(signals, ~rows.training)
    np.testing.assert_array_equal(aside[signals.rows], ~rows.training)
