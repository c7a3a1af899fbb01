"""A motion that is repeated: it is found, and its repetitions are no further evidence."""

from itertools import pairwise

import numpy as np
import pytest

from jaxidl.effects import CATALOGUE
from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.mechanisms import TWO_LINK
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.gap.evidence.samples import copies, returns
from jaxidl.gap.evidence.shape import present
from jaxidl.gap.fit.library import library
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

DT, CYCLE = 5e-3, 6.0
VISCOUS, DRY = 0.4, 0.3
# what the catalogue lacks: it swings with the place, as no effect does
STRANGE = 0.3


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("recurrence") / "model.xml"
    path.write_text(TWO_LINK)
    return read_model(path)


def log(model, seconds, harmonics, still=False):
    """A log of a sum of waves, whose frequencies are ``harmonics`` of the cycle."""
    t = DT * np.arange(round(seconds / DT))
    at = 2.0 * np.pi / CYCLE * np.array(harmonics)
    size = np.array([[0.5, 0.4], [0.4, 0.5]])
    wave = lambda k: np.real(
        np.sum(size * (1j * at) ** k * np.exp(1j * (at * t[:, None, None] + size)), 2)
    )
    q, qd, qdd = (wave(k) * [1.0, not still] for k in range(3))
    tau = inverse_dynamics(model.plant.body, q, qd, qdd) + VISCOUS * qd + DRY * np.tanh(qd / 0.01)
    tau += STRANGE * np.sin(9.0 * q) * np.cos(5.0 * q[:, ::-1])
    draw = np.random.default_rng(0)
    noise = lambda size: size * draw.standard_normal(q.shape)
    return from_arrays(t, q + noise(1e-5), tau + noise(1e-2))


REPEATED, EVER_NEW = [[1.0, 2.0], [2.0, 3.0]], [[1.0, 2.236], [1.732, 3.142]]


@pytest.mark.parametrize("still", [False, True])
def test_repetitions_are_found(model, still):
    lags = returns(prepare(log(model, 5 * CYCLE, REPEATED, still), model.plant.body))
    np.testing.assert_allclose(np.array(lags) * DT, CYCLE * np.arange(1, 5), atol=2 * DT)


@pytest.mark.parametrize(("seconds", "waves"), [(5 * CYCLE, EVER_NEW), (CYCLE, REPEATED)])
def test_a_motion_that_is_ever_new_has_none(model, seconds, waves):
    assert returns(prepare(log(model, seconds, waves), model.plant.body)) == ()


def test_pauses_of_any_length_do_not_hide_repetitions(model):
    """Four moves, six times; after each the robot waits as long as it likes."""
    draw = np.random.default_rng(4)
    corners = np.array([[0.0, 0.0], [0.6, -0.4], [-0.5, 0.7], [0.9, 0.5], [0.0, 0.0]])
    share = np.linspace(0.0, 1.0, 200)[:, None]
    smooth = 10.0 * share**3 - 15.0 * share**4 + 6.0 * share**5
    moves = [a + (b - a) * smooth for a, b in pairwise(corners)]
    pause = lambda q: np.repeat(q[-1:], int(draw.integers(40, 160)), axis=0)
    q = np.concatenate([x for _ in range(6) for move in moves for x in (move, pause(move))])
    qd = np.gradient(q, DT, axis=0)
    tau = inverse_dynamics(model.plant.body, q, qd, np.gradient(qd, DT, axis=0))
    noise = 1e-6 * draw.standard_normal(q.shape)
    signals = prepare(from_arrays(DT * np.arange(len(q)), q + noise, tau), model.plant.body)
    cycle = (~signals.resting.all(1)).sum() / 6.0
    np.testing.assert_allclose(returns(signals), cycle * np.arange(1, 6), atol=0.05 * cycle)


@pytest.mark.parametrize(("noise", "alike"), [(0.0, 6.0), (1.0, 3.5), (1e3, 1.0)])
def test_repetitions_count_as_far_as_they_differ(noise, alike):
    """1 + (M - 1) c, where c is the share of the variance that is there again."""
    draw = np.random.default_rng(1)
    left = np.tile(draw.standard_normal(2000), 6) + noise * draw.standard_normal(12_000)
    found, repeated = copies(range(2000, 12_000, 2000), left, np.arange(12_000))
    assert (found, repeated) == pytest.approx((alike, 6.0), abs=0.2)


@pytest.mark.slow
def test_a_motion_that_is_repeated_is_hardly_more_evidence(model):
    def effective(seconds, waves):
        rows = rows_of(prepare(log(model, seconds, waves), model.plant.body))
        names = [name for name, cls in CATALOGUE.items() if cls.common]
        return library(rows, names, present(())).score.effective

    assert np.all(effective(16 * CYCLE, REPEATED) < 1.5 * effective(4 * CYCLE, REPEATED))
    assert np.all(effective(16 * CYCLE, EVER_NEW) > 2.0 * effective(4 * CYCLE, EVER_NEW))


def test_a_user_learns_that_the_motion_is_repeated(model):
    found = diagnose(
        log(model, 5 * CYCLE, REPEATED), model, effects=["viscous_friction"], rollouts=False
    )
    (note,) = [
        n for n in found.notes if "a motion of 6 s, without its pauses, is there 5 times" in n
    ]
    assert "record other postures" in note
