"""Positions that a recorder repeated or interpolated between those that were measured."""

import numpy as np
import pytest

from jaxidl import gap

EVERY, DT = 8, 2e-3
SAMPLES = 400 * EVERY
TIME = DT * np.arange(SAMPLES)
RUN = (np.arange(SAMPLES) >= 1803).astype(int)  # the second one begins between fresh positions


def motion(time):
    return np.stack([np.sin(3.0 * time) + 0.3 * np.sin(8.1 * time), np.cos(2.0 * time)], axis=1)


def recorded(how, every=EVERY, run=0 * RUN):
    """Return a log of positions that were measured every few samples, the first on the third."""
    draw = np.random.default_rng(0)
    fresh = DT * np.arange(2.0, SAMPLES, every)
    q = motion(fresh) + draw.normal(0.0, 1e-4, (len(fresh), 2))
    if how == "repeated":
        q = q[np.maximum(np.searchsorted(fresh, TIME + 1e-9) - 1, 0)]
    else:
        q = np.stack([np.interp(TIME, fresh, each) for each in q.T], axis=1)
    tau = np.cos(TIME)[:, None] * [1.0, 2.0] + draw.normal(0.0, 1e-4, (SAMPLES, 2))
    return gap.from_arrays(TIME, q, tau, run=run)


@pytest.mark.parametrize("every", [EVERY, 9.6])
@pytest.mark.parametrize("how", ["repeated", "interpolated by straight lines"])
def test_only_fresh_positions_are_used(how, every):
    log = recorded(how, every)
    (note,) = [note for note in log.notes if "between samples" in note]
    assert f"are {how} between samples {every * DT:.3g} s apart" in note
    assert log.dt == pytest.approx(every * DT, rel=1e-5)
    # a position that is repeated may be up to half a sample off, otherwise it is exact
    off = 2.5e-3 if how == "repeated" and every % 1.0 else 0.0
    assert np.abs(log.q - motion(log.time)).max() < 5e-4 + off  # as recorded: up to 0.06
    # torques were recorded every time: averaging makes their noise smaller
    noise = log.tau - np.cos(log.time)[:, None] * [1.0, 2.0]
    assert np.std(noise[10:-10]) < 0.6e-4


def test_each_run_has_its_own_first_fresh_position():
    log = recorded("interpolated by straight lines", run=RUN)
    assert log.runs == 2
    assert np.abs(log.q - motion(log.time)).max() < 5e-4


def test_one_quick_move_in_a_long_rest_is_no_rhythm():
    q = motion(np.clip(TIME - 3.0, 0.0, 0.1))
    log = gap.from_arrays(TIME, q, np.cos(TIME)[:, None] * [1.0, 2.0])
    assert log.samples == SAMPLES


@pytest.mark.parametrize("tick", [0.0, 2 * np.pi / 4096, 2 * np.pi / 200], ids=str)
def test_other_logs_stay_as_they_are(tick):
    """Coarse encoders repeat positions, too, but not in a rhythm."""
    q = motion(TIME)
    q = np.rint(q / tick) * tick if tick else q
    log = gap.from_arrays(TIME, q, np.cos(TIME)[:, None] * [1.0, 2.0])
    assert log.samples == SAMPLES
    assert not [note for note in log.notes if "between samples" in note]


def test_torques_of_the_same_rhythm_are_not_averaged():
    """A recorder that repeats positions repeats torques as well: their mean would be late."""
    first = (np.arange(SAMPLES) // EVERY) * EVERY
    tau = np.sin(5.0 * TIME)[:, None] * [1.0, 2.0]
    log = gap.from_arrays(TIME, motion(TIME)[first], tau[first])
    np.testing.assert_allclose(log.tau, np.sin(5.0 * log.time)[:, None] * [1.0, 2.0], atol=1e-9)
