"""Motions that make hidden effects visible.

They include reversals, standstill under load, slow and fast motion, both directions, the whole
range.
"""

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]

# s; every round has every kind of motion, so that a held-out part contains them all
ROUND = 12.0
SHARES = (("multisine", 0.34), ("slow", 0.21), ("points", 0.30), ("fast", 0.15))
REST, MOVE = 0.4, 0.5  # s; standstill at the start, and move to a segment's centre
# s; averaging a ramp over the first makes its speed a trapezoid, over the second its acceleration
BOXES = (0.2, 0.1)


def reference(
    rng: np.random.Generator, span: Array, duration: float, rate: float
) -> tuple[Array, Array, Array]:
    """Return positions, speeds and accelerations, each (T, J), from rest.

    They stay within about ± ``span`` (J,) [m or rad]. All joints move at the same time with their
    own amplitudes, frequencies and phases; standstill is shared by all.
    """
    time = np.arange(round(duration * rate)) / rate
    x = np.zeros((len(time), len(span)))
    knots: list[tuple[float, Array]] = [(0.0, rng.uniform(-0.3, 0.3, len(span)))]
    for name, start, end in _segments(duration):
        centre = rng.uniform(-0.45, 0.45, len(span))
        knots += [(start, knots[-1][1]), (start + MOVE, centre)]
        if name == "points":
            knots += _points(rng, start + MOVE, end, centre)
        else:
            inside = (time >= start) & (time < end)
            x[inside] += _oscillation(rng, name, time[inside] - start, end - start, len(span))
    base = np.stack(
        [
            np.interp(time, [t for t, _ in knots], column)
            for column in np.array([p for _, p in knots]).T
        ],
        axis=1,
    )
    for width in BOXES:
        base, x = (
            _box(base, round(width * rate)),
            x if width == BOXES[0] else _box(x, round(width * rate)),
        )
    q = (base + x) * span
    qd = np.gradient(q, 1 / rate, axis=0)
    return q, qd, np.gradient(qd, 1 / rate, axis=0)


def _segments(duration: float) -> list[tuple[str, float, float]]:
    """Return names, starts and ends [s] of the kinds of motion, round after round."""
    rounds = max(1, round(duration / ROUND))
    length, segments, start = (duration - REST) / rounds, [], REST
    for _ in range(rounds):
        for name, share in SHARES:
            segments.append((name, start, start + share * length))
            start += share * length
    return segments


def _points(
    rng: np.random.Generator, start: float, end: float, position: Array
) -> list[tuple[float, Array]]:
    """Return moves from point to point with dwells, as knots.

    Some are long and some so short that the joint just creeps.
    """
    knots = []
    while start + 0.9 < end:
        dwell, move = rng.uniform(0.35, 0.6), rng.uniform(0.3, 0.5)
        target = np.clip(
            position + rng.choice([-1, 1], len(position)) * rng.uniform(0.15, 1.0, len(position)),
            -0.9,
            0.9,
        )
        knots += [(start + dwell, position), (start + dwell + move, target)]
        start, position = start + dwell + move, target
    return knots


def _oscillation(
    rng: np.random.Generator, name: str, time: Array, length: float, joints: int
) -> Array:
    """Return (T, J) an oscillation that starts and ends at rest, in shares of the span."""
    low, high, count, peak = {
        "multisine": (0.1, 1.5, 8, 0.62),
        "slow": (0.3, 0.7, 2, 0.18),
        "fast": (1.5, 3.0, 3, 0.14),
    }[name]
    window = np.sin(np.pi / 2 * np.clip(np.minimum(time, length - time) / 0.5, 0, 1)) ** 2
    columns = []
    for _ in range(joints):
        f, phase = rng.uniform(low, high, count), rng.uniform(0, 2 * np.pi, count)
        wave = (np.sin(2 * np.pi * f * time[:, None] + phase) / (0.4 + f)).sum(axis=1)
        columns.append(peak * rng.uniform(0.7, 1.2) * wave / np.abs(wave).max() * window)
    return np.stack(columns, axis=1)


def _box(x: Array, width: int) -> Array:
    """Return the running mean over ``width`` samples with the ends held."""
    padded = np.pad(x, ((width // 2, width - 1 - width // 2), (0, 0)), mode="edge")
    total = np.cumsum(np.vstack([np.zeros((1, x.shape[1])), padded]), axis=0)
    return (total[width:] - total[:-width]) / width
