"""Runs of a log resampled to one uniform time grid, whatever their clocks."""

from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.low_pass import at_instants
from jaxidl.logs.mending import Samples

LATEST = 1e10  # [s]; a Unix time is smaller
LEAST_RATE = 20.0  # [Hz]
ROUNDED = 0.05  # share by which a clock may miss it
LEAST_RUN = 50  # samples
BRIDGED = 5  # up to this many consecutive missing samples are interpolated; more split the run
UNIFORM = 0.02  # samples this close to a uniform grid, in intervals, are left unchanged
IRREGULAR = 0.1  # share of intervals off by half an interval; more is jitter
SAME_RATE = 0.01  # relative difference; a larger one is a different rate
# times slower from which on samples are averaged, otherwise there would be aliasing
AVERAGED = 1.25
MOST_APART = 5.0  # ratio of rates that are not resampled to one
MOST_GAPS = 0.5  # share of the time in intervals at least 1.5 times the usual one


class Piece(NamedTuple):
    """A stretch without gaps."""

    samples: Samples
    where: slice  # rows of the stretch
    # (n,) index of each sample on a uniform grid from the first on; missing ones leave gaps
    number: np.ndarray
    step: float  # [s] interval of that grid


class Even(NamedTuple):
    """A piece on a uniform grid."""

    time: np.ndarray  # (n,) [s]
    signals: dict[str, np.ndarray]  # each (n, J)
    missing: int  # number of samples that were not measured
    # largest deviation of an interval from the nominal one, relative to it; 0 if no sample was
    # moved
    uneven: float
    slowed: bool  # true if resampled to the rate of another run


def pieces(found: Samples, notes: list[str]) -> list[Piece]:
    """Return a file's runs, split where many samples are missing.

    Runs that are too short are left out. What was done is added to the notes.

    Raises:
        LogError: if time is too irregular for a sampled log.
    """
    table, result, short = found.table, [], 0
    edges = np.flatnonzero(np.diff(found.run)) + 1
    for start, stop in pairwise([0, *edges.tolist(), len(found.run)]):
        counts = _counts(found, start, stop)
        gaps = (np.flatnonzero(counts > BRIDGED + 1) + start + 1).tolist()
        for gap in gaps[:3]:
            length = found.time[gap] - found.time[gap - 1]
            notes.append(
                f"a gap of {length:.3g} s after {table.row(gap - 1)} of {table.name}: the run is"
                " split there"
            )
        if len(gaps) > 3:
            notes.append(f"{len(gaps) - 3} more such gaps in that run of {table.name}")
        for a, b in pairwise([start, *gaps, stop]):
            if b - a < LEAST_RUN:
                short += 1
            else:
                number = np.concatenate([[0], np.cumsum(counts[a - start : b - start - 1])])
                result.append(Piece(found, slice(a, b), number, _slope(number, found.time[a:b])))
    if short:
        notes.append(
            f"{short} run{'s' * (short > 1)} of fewer than {LEAST_RUN} samples left out of"
            f" {table.name}"
        )
    return result


def _counts(found: Samples, start: int, stop: int) -> np.ndarray:
    """Return the number of sampling intervals between the rows of one run, (stop - start - 1,).

    It is 1 where no sample is missing. A clock that jitters misses none, except for gaps; if more
    time is in gaps than between samples, the log is not sampled.
    """
    if stop - start < LEAST_RUN:
        return np.ones(stop - start - 1, int)
    with np.errstate(over="ignore"):
        step = np.diff(found.time[start:stop])
        relative = step / np.median(step)
    counts = np.clip(np.rint(relative), 1, 1e6).astype(int)
    off = np.flatnonzero(np.abs(relative - 1) > 0.5)
    if off.size <= IRREGULAR * step.size:
        return counts
    long = relative > 1.5
    share = float(step[long].sum() / step.sum())
    if not share <= MOST_GAPS:
        first = int(np.flatnonzero(long)[0]) if long.any() else int(off[0])
        where = (
            f"{found.table.row(start + first)} with {step[first]:.3g} s instead of"
            f" {np.median(step):.3g} s"
        )
        got = f"{share:.0%} of the time in longer intervals, first after {where}"
        remedy = "record at a constant rate, or write time with more digits"
        raise LogError(f"a constant sampling interval in {found.table.name}", got, remedy)
    return np.where(counts > BRIDGED + 1, counts, 1)


def _slope(number: np.ndarray, time: np.ndarray) -> float:
    """Return the interval [s] that fits all samples best.

    The median alone would drift where time is written with few digits.
    """
    centred = number - number.mean()
    return float(centred @ (time - time[0]) / (centred @ centred))


def interval(cut: Iterable[Piece]) -> float:
    """Return the sampling interval [s] of all pieces.

    Raises:
        LogError: if time cannot be in seconds, or the pieces differ.
    """
    cut = list(cut)
    steps = np.array([piece.step for piece in cut])
    same = steps.max() <= (1 + SAME_RATE) * steps.min()
    # slower pieces contain no faster motion
    dt = float(np.quantile(steps, 0.5, method="nearest") if same else steps.max())
    name, time = cut[0].samples.table.name, cut[0].samples.time
    if dt > (1 + ROUNDED) / LEAST_RATE:
        got = f"{1 / dt:.3g}, one every {dt:.3g} s"
        if dt > 0.25 or np.all(time == np.rint(time)):
            remedy = "give time in seconds: it looks like milliseconds or sample numbers"
        else:
            remedy = "record faster, or convert time to seconds if it is in another unit"
        raise LogError(f"at least {LEAST_RATE:g} samples a second in {name}", got, remedy)
    for piece in cut:
        table = piece.samples.table
        if abs(piece.samples.time[piece.where][[0, -1]]).max() > LATEST:
            got = f"{piece.samples.time[piece.where.start]:g} in {table.row(piece.where.start)}"
            raise LogError(
                f"time in seconds in {table.name}", got, "convert it, or subtract the first instant"
            )
        if piece.step > MOST_APART * min(p.step for p in cut):
            where = f"{table.row(piece.where.start)} of {table.name}"
            got = (
                f"{1 / piece.step:.6g} Hz from {where} on, and {1 / min(p.step for p in cut):.6g}"
                " Hz elsewhere"
            )
            raise LogError(
                f"sampling rates within a factor of {MOST_APART:g}",
                got,
                "use the logs one at a time",
            )
    return dt


def resample(piece: Piece, dt: float) -> Even:
    """Return a piece on a uniform grid.

    Samples that are on the grid already stay unchanged, but for rounding.
    """
    time, signals = (
        piece.samples.time[piece.where],
        {kind: s[piece.where] for kind, s in piece.samples.signals.items()},
    )
    # clocks of two recordings differ by parts per million
    step = piece.step if abs(piece.step / dt - 1) < 1e-4 else dt
    grid = (time - time[0]) / step
    if abs(piece.step / dt - 1) > SAME_RATE:
        return Even(
            time[0] + step * np.arange(int(grid[-1] + 1e-6) + 1),
            _slower(grid, signals, piece.step / dt),
            0,
            0.0,
            True,
        )
    offset = grid - piece.number
    missing = int(piece.number[-1]) + 1 - len(time)
    uneven = float(np.abs(np.diff(offset)).max()) if np.ptp(offset) > 2 * UNIFORM else 0.0
    if not missing and not uneven:
        return Even(time, signals, 0, 0.0, False)
    places = np.arange(int(grid[-1] + 1e-6) + 1) if uneven else np.arange(piece.number[-1] + 1)
    at = grid if uneven else piece.number
    filled = {kind: _taken(signal, at, places) for kind, signal in signals.items()}
    return Even(time[0] + step * places, filled, missing, uneven, False)


def _taken(signal: np.ndarray, at: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return a signal (n, J), stamped ``at`` (n,), as it is at the ``places`` (m,).

    By splines, but by straight lines if stamps are closer together than half an interval: a sample
    that was stamped late would make a spline swing.
    """
    if (apart := np.diff(at)).min() < 0.5 * np.median(apart):
        return np.stack([np.interp(places, at, each) for each in signal.T], axis=1)
    return at_instants(signal, at, places)


def _slower(grid: np.ndarray, signals: dict[str, np.ndarray], step: float) -> dict[str, np.ndarray]:
    """Return signals resampled at 0, 1, 2, ...

    They are given as (n, J) at ``grid`` (n,), ``step`` < 1 apart. If that is much finer, each
    sample is the mean over one new interval around it, torques as well as positions: a filter
    without phase.
    """
    places = np.arange(int(grid[-1] + 1e-6) + 1)
    if step * AVERAGED > 1.0:
        return {kind: _taken(signal, grid, places) for kind, signal in signals.items()}
    # narrower at the ends, to stay centred
    half = np.minimum(0.5, np.minimum(places, np.maximum(grid[-1] - places, 0.0)))
    half = np.maximum(half, 1e-3)
    found = {}
    for kind, signal in signals.items():
        padded = np.concatenate([grid[:1] - 1, grid, grid[-1:] + 1])
        held = np.concatenate([signal[:1], signal, signal[-1:]])
        area = np.concatenate(
            [
                np.zeros((1, signal.shape[1])),
                np.cumsum(0.5 * np.diff(padded)[:, None] * (held[1:] + held[:-1]), 0),
            ]
        )

        def integral(
            x: np.ndarray,
            padded: np.ndarray = padded,
            held: np.ndarray = held,
            area: np.ndarray = area,
        ) -> np.ndarray:
            i = np.clip(np.searchsorted(padded, x, side="right") - 1, 0, len(padded) - 2)
            share = ((x - padded[i]) / (padded[i + 1] - padded[i]))[:, None]
            width = (padded[i + 1] - padded[i])[:, None]
            return area[i] + width * share * (held[i] + 0.5 * share * (held[i + 1] - held[i]))

        found[kind] = (integral(places + half) - integral(places - half)) / (2 * half)[:, None]
    return found
