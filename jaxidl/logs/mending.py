"""Repair small recording faults: leave out a few damaged rows, with a note, and unwrap angles.

A row is damaged if it has no number in a column that is used, if it repeats the one before, or if
it has to be left out for time to increase. If more than one row in a hundred is damaged, the checks
refuse the file. Learning from executions needs every row, so it repairs nothing.
"""

from bisect import bisect_left
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jaxidl.logs.table import Table

FEW = 0.01  # share of a file's rows
NOTHING = {"", "nan", "inf", "null", "none", "na", "n/a"}  # that recorders write for no number
TURN = 2 * np.pi  # [rad]


class Samples(NamedTuple):
    """The contents of one file, as numbers and in order."""

    table: Table
    time: np.ndarray  # (T,) [s], strictly increasing within a run
    signals: dict[str, np.ndarray]  # each (T, J): q and tau, and qd and qdd where the file has them
    run: np.ndarray  # (T,) 0, 1, 2, ... in order of appearance
    # mean positions [m or rad] of the robot's joints that are not used, by name; whether they move
    still: dict[str, tuple[float, bool]]
    notes: list[str]

    def without(self, rows: np.ndarray) -> "Samples":
        """Return the samples without the rows flagged in ``rows`` (T,)."""
        keep = np.flatnonzero(~rows)
        numbers = keep if self.table.rows is None else self.table.rows[keep]
        signals = {kind: signal[keep] for kind, signal in self.signals.items()}
        return self._replace(
            table=replace(self.table, rows=numbers),
            time=self.time[keep],
            run=self.run[keep],
            signals=signals,
        )


def complete(table: Table, notes: list[str]) -> Table:
    """Return a table without its few rows that lack a number."""
    lengths = {len(column) for column in table.columns.values()}
    spoilt = {
        key: _lacking(column)
        for key, column in table.columns.items()
        if key != "run" and not key.startswith("q@") and len(lengths) == 1
    }
    rows = np.any(list(spoilt.values()), axis=0) if spoilt else np.zeros(0, bool)
    if not _few(rows):
        return table
    first = int(np.argmax(rows))
    key = next(key for key, flags in spoilt.items() if flags[first])
    notes.append(
        f"{_counted(rows)} of {table.name} without a number, first {table.called(key)} in"
        f" {table.row(first)}: left out"
    )
    keep = np.flatnonzero(~rows)
    columns = {
        key: [column[i] for i in keep] if isinstance(column, list) else column[keep]
        for key, column in table.columns.items()
    }
    return replace(table, columns=columns, rows=keep)


def distinct(found: Samples) -> Samples:
    """Return the samples without rows that repeat the one before, time included.

    Some robots log every row twice, so this may be any number of rows.
    """
    every = np.column_stack([found.time, found.run, *found.signals.values()])
    same = np.concatenate([[False], (every[1:] == every[:-1]).all(axis=1)])
    if not same.any():
        return found
    found.notes.append(f"{_counted(same)} of {found.table.name} repeated the one before: left out")
    return found.without(same)


def advancing(found: Samples) -> Samples:
    """Return the samples without the few rows that have to go for time to increase in each run."""
    rows = np.zeros(len(found.time), bool)
    edges = np.flatnonzero(np.diff(found.run)) + 1
    for part in np.split(np.arange(len(found.time)), edges):
        rows[part] = ~_increasing(found.time[part])
    if not _few(rows):
        return found
    found.notes.append(
        f"{_counted(rows)} of {found.table.name} with a time that does not fit between the rows"
        f" around, first {found.table.row(int(np.argmax(rows)))}: left out"
    )
    return found.without(rows)


def unwrapped(found: Samples) -> Samples:
    """Return the samples with every angle continuous that stays within a turn and jumps by one."""
    within = np.diff(found.run) == 0
    q = found.signals["q"].copy()
    for j, angle in enumerate(q.T):
        jump = wraps(angle, within)
        if jump.any():
            count = int(jump.sum())
            found.notes.append(
                f"q{j} of {found.table.name} jumps by a turn {count} time{'s' * (count > 1)}:"
                " unwrapped"
            )
            turns = np.concatenate([[0], np.cumsum(np.rint(np.diff(angle) / TURN) * jump)])
            # whichever turn the joint is in most of the time is the one around zero
            angle -= TURN * turns
            angle -= TURN * np.rint(np.median(angle) / TURN)
    return found._replace(signals=found.signals | {"q": q})


def wraps(angle: np.ndarray, within: np.ndarray) -> np.ndarray:
    """Return where ``angle`` (T,) [rad], which never leaves one turn, jumps by a turn, (T - 1,).

    Args:
        angle: positions of a joint.
        within: (T - 1,) whether a row and the next are of one run.
    """
    return within & (np.abs(np.diff(angle)) > 0.9 * TURN) & bool(np.ptp(angle) <= 1.005 * TURN)


def _lacking(column: np.ndarray | list[str]) -> np.ndarray:
    """Return which cells (T,) hold no finite number where a recorder had none to write."""
    if not isinstance(column, list):
        return ~np.isfinite(column) if column.dtype.kind == "f" else np.zeros(len(column), bool)
    try:
        return ~np.isfinite(np.fromiter(map(float, column), float, len(column)))
    except ValueError:
        return np.array([cell.strip().lower().lstrip("+-") in NOTHING for cell in column], bool)


def _increasing(time: np.ndarray) -> np.ndarray:
    """Return the rows (T,) of a longest strictly increasing part of ``time`` (T,).

    A wrong instant, too early or too late, is then the row that goes, and not all rows after it.
    """
    if (np.diff(time) > 0).all():
        return np.ones(len(time), bool)
    ends: list[float] = []  # least end of an increasing part of each length
    last: list[int] = []  # the row of that end
    before = np.full(len(time), -1)
    for i, instant in enumerate(time.tolist()):
        place = bisect_left(ends, instant)
        if ends[place : place + 1] == [instant]:  # of two rows with one instant, the first stays
            continue
        before[i] = last[place - 1] if place else -1
        ends[place : place + 1], last[place : place + 1] = [instant], [i]
    rows, i = np.zeros(len(time), bool), last[-1]
    while i >= 0:
        rows[i], i = True, int(before[i])
    return rows


def _few(rows: np.ndarray) -> bool:
    return bool(0 < rows.sum() <= FEW * len(rows))


def _counted(rows: np.ndarray) -> str:
    count = int(rows.sum())
    return f"{count} row{'s' * (count > 1)}"
