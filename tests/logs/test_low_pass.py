"""The band of a log."""

import numpy as np
import pytest

from jaxidl.logs.low_pass import (
    BAND,
    HIGHEST_BAND,
    band_limited,
    bands,
    choose_band,
    heard_to,
)

DT = 1e-3
T = DT * np.arange(20_000)
WHOLE = (slice(0, len(T)),)
MOTION = 5.0 * np.sin(2 * np.pi * 0.5 * T) + 2.0 * np.sin(2 * np.pi * 7.0 * T)


def torque(size, noise=0.05):
    """Commands (T, 2), the second one without the fast part; the first has noise of ``size``."""
    rng = np.random.default_rng(0)
    slow = 5.0 * np.sin(2 * np.pi * 0.5 * T)
    scatter = np.array([size, noise]) * rng.standard_normal((len(T), 2))
    return np.stack([MOTION, slow], 1) + scatter


CLEAN = torque(0.0, 0.0)


def test_a_command_is_heard_up_to_where_it_stands_out_of_its_noise():
    assert heard_to(torque(0.05), WHOLE, DT) == pytest.approx(7.0, abs=2.0)
    # noise that drowns the fast part leaves the slow one
    assert heard_to(torque(20.0), WHOLE, DT) == pytest.approx(0.5, abs=3.0)


def test_the_longest_run_is_listened_to():
    runs = (slice(0, 2000), slice(2000, len(T)))
    late = torque(0.05)
    late[:2000] = 0.0
    assert heard_to(late, runs, DT) == pytest.approx(7.0, abs=2.0)


@pytest.mark.parametrize(
    ("noise", "band"), [(0.05, 1.5 * 7.0), (0.0, BAND[1])], ids=["noisy", "clean"]
)
def test_noise_of_the_command_ends_the_band(noise, band):
    """Encoders without noise would allow the widest one."""
    quiet = np.zeros(2)
    clean = torque(noise, noise)
    # what jumps is heard at all frequencies
    clean[:, 0] += 3.0 * np.sign(np.sin(2 * np.pi * 0.5 * T)) if noise == 0.0 else 0.0
    assert BAND[1] < HIGHEST_BAND / DT
    assert choose_band(quiet, clean, clean, WHOLE, DT) == pytest.approx(band, abs=3.0)


def test_encoder_noise_ends_the_band_where_it_comes_first():
    reach = np.full(2, 1e-4)
    wide, narrow = (choose_band(k * reach, CLEAN, CLEAN, WHOLE, DT) for k in (1.0, 8.0))
    assert narrow == pytest.approx(wide / 8.0**0.4, rel=1e-6)


def test_a_joint_without_a_drive_is_heard_by_its_motion():
    slow = torque(0.05)[:, 1:]
    swinging = MOTION[:, None] + 0.01 * np.random.default_rng(1).standard_normal((len(T), 1))
    q, tau = np.concatenate([slow, swinging], 1), np.concatenate([slow, 0.0 * slow], 1)
    both = choose_band(np.zeros(2), q, tau, WHOLE, DT)
    assert 1.5 * 7.0 <= both < 3.0 * 7.0
    assert choose_band(np.zeros(1), q[:, :1], slow, WHOLE, DT) < 6.0


def test_each_joint_is_compared_where_its_own_command_stands_out():
    commands = torque(0.05)
    fast, slow = bands(commands, commands, WHOLE, DT, 60.0)
    assert fast == pytest.approx(1.5 * 7.0, abs=3.0)
    assert slow < 6.0
    # none is wider than that of all joints
    assert np.all(bands(commands, commands, WHOLE, DT, 5.0) <= 5.0)
    # a joint without a drive shows in its positions how fast it moves
    passive = commands * np.array([0.0, 1.0])
    np.testing.assert_allclose(bands(commands, passive, WHOLE, DT, 60.0), [fast, slow])


def test_what_is_above_a_band_is_taken_away():
    within_it, above = np.cos(2 * np.pi * 2.0 * T), np.cos(2 * np.pi * 30.0 * T)
    kept = band_limited(np.stack([within_it, above]), 1.0 / DT, 10.0)
    np.testing.assert_allclose(kept[0], within_it, atol=2e-3)
    assert np.abs(kept[1]).max() < 0.03
