"""Samples that were taken evenly, but stamped late."""

import numpy as np
import pytest

from jaxidl import gap

DT, SAMPLES = 0.01, 3000
rng = np.random.default_rng(0)
LATE = {
    "a little, every sample": rng.uniform(0.0, 0.3, SAMPLES) * DT,
    "some, up to an interval": rng.uniform(0.0, 1.0, SAMPLES) * DT * (rng.random(SAMPLES) < 0.2),
    "in pairs": np.where(np.arange(SAMPLES) % 2, 0.0, 0.98) * DT,
    "in bursts": np.repeat(rng.exponential(2.0 * DT, 300) * (rng.random(300) < 0.2), 10),
}


def motion(time):
    return np.sin(np.pi * time) + 0.3 * np.sin(3.4 * np.pi * time)


def stamped(late):
    """Stamps that increase a little between samples which come together."""
    return np.maximum.accumulate(np.arange(SAMPLES) * DT + late) + 1e-7 * np.arange(SAMPLES)


def worst(log, share=1.0):
    """The largest error of a share of the positions, apart from one shift of all stamps."""
    inner, shifts = slice(30, -30), np.linspace(-0.5 * DT, 0.5 * DT, 101)
    errors = [np.abs(log.q[inner, 0] - motion(log.time[inner] + s)) for s in shifts]
    return min(np.quantile(error, share) for error in errors)


@pytest.mark.parametrize("late", LATE.values(), ids=list(LATE))
def test_samples_stamped_late_are_counted(late):
    true = np.arange(SAMPLES) * DT
    log = gap.from_arrays(stamped(late), motion(true)[:, None], np.cos(true)[:, None])
    assert any("samples are counted instead" in note for note in log.notes)
    assert log.samples == SAMPLES
    assert log.dt == pytest.approx(DT, rel=1e-4)
    assert worst(log) < 2e-3  # as stamped 6e-3 and more


def test_lost_samples_and_pauses_are_found_between_late_ones():
    true = np.arange(SAMPLES) * DT
    kept = rng.random(SAMPLES) > 0.005
    kept[1500:1700] = False
    time = stamped(LATE["some, up to an interval"])[kept]
    log = gap.from_arrays(time, motion(true)[kept, None], np.cos(true)[kept, None])
    assert any("samples are counted instead" in note for note in log.notes)
    assert len(log.segments()) == 2
    assert log.samples == pytest.approx(SAMPLES - 200, abs=3)
    # where the sample before a lost one was late, too, it may take that one's place
    assert worst(log, 0.99) < 2e-3


def test_many_lost_samples_are_found_between_stamps_that_are_a_little_off():
    """With six in a hundred lost, no stretch is without one."""
    true = np.arange(SAMPLES) * DT
    kept = rng.random(SAMPLES) > 0.06
    time = (true + rng.uniform(-0.2, 0.2, SAMPLES) * DT)[kept]
    log = gap.from_arrays(time, motion(true)[kept, None], np.cos(true)[kept, None])
    assert any("samples are counted instead" in note for note in log.notes)
    assert log.samples == SAMPLES
    assert worst(log) < 2e-3


def test_samples_taken_unevenly_keep_their_stamps():
    time = stamped(LATE["a little, every sample"])
    noise = rng.normal(0.0, 1e-4, (SAMPLES, 1))
    log = gap.from_arrays(time, motion(time)[:, None] + noise, np.cos(time)[:, None])
    assert not any("counted" in note for note in log.notes)
    assert worst(log) < 1e-3


def test_without_motion_stamps_are_kept():
    time = stamped(LATE["a little, every sample"])
    q = np.stack([np.zeros(SAMPLES), rng.normal(0.0, 1e-4, SAMPLES)], axis=1)
    try:
        notes = gap.from_arrays(time, q, np.cos(time)[:, None] * [1.0, 1.0]).notes
    except gap.LogError as error:
        notes = (str(error),)
    assert not any("counted" in note for note in notes)
