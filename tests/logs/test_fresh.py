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


def recorded(how, run=0 * RUN):
    """Return a log of positions that were measured every ``EVERY`` samples, from the third on."""
    noise = np.random.default_rng(0).normal(0.0, 1e-4, (SAMPLES, 2))
    q = motion(TIME) + noise
    fresh = np.arange(2, SAMPLES, EVERY)
    if how == "repeated":
        q = q[np.maximum(2, (np.arange(SAMPLES) - 2) // EVERY * EVERY + 2)]
    else:
        q = np.stack([np.interp(TIME, TIME[fresh], q[fresh, j]) for j in range(2)], axis=1)
    return gap.from_arrays(TIME, q, np.cos(TIME)[:, None] * [1.0, 2.0] + noise, run=run)


@pytest.mark.parametrize("how", ["repeated", "interpolated by straight lines"])
def test_only_fresh_positions_are_used(how):
    log = recorded(how)
    (note,) = [note for note in log.notes if "between samples" in note]
    assert f"are {how} between samples 0.016 s apart" in note
    assert log.dt == pytest.approx(EVERY * DT)
    assert np.abs(log.q - motion(log.time)).max() < 5e-4  # repeated: up to 0.06
    # torques were recorded every time: averaging makes their noise smaller
    off = log.tau - np.cos(log.time)[:, None] * [1.0, 2.0]
    assert np.std(off[10:-10]) < 0.6e-4


def test_each_run_has_its_own_first_fresh_position():
    log = recorded("interpolated by straight lines", RUN)
    assert log.runs == 2
    assert np.abs(log.q - motion(log.time)).max() < 5e-4


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
