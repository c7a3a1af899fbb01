"""A table's columns as numbers of the same joints, in order of time.

What a user has to correct is a `LogError` that names column and row.
"""

import re
from dataclasses import replace
from typing import Any

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.families import INSTANTS
from jaxidl.logs.mending import Samples, advancing, complete, distinct, unwrapped, wraps
from jaxidl.logs.missing import count_joints
from jaxidl.logs.motor_side import MotorSide
from jaxidl.logs.table import Table, shown
from jaxidl.logs.words import CONTROL, CURRENT, KINDS

MOVES = 0.02  # [m or rad] motion of a locked joint that is reported
LARGEST = 1e9  # no position, speed or torque in SI units is larger
# least value of a Unix time in each unit, and the unit [s]
UNIX = {"ns": (1e17, 1e-9), "us": (1e14, 1e-6), "ms": (1.2e12, 1e-3)}


def numbers(table: Table, key: str) -> np.ndarray:
    """Return a column (T,) as finite float64.

    Raises:
        LogError: on text, empty cells, complex numbers or objects; on NaN and infinity; on values
            larger than SI units ever give.
    """
    column, where = table.columns[key], f"column {table.called(key)} of {table.name}"
    if isinstance(column, list):
        values = _parsed(table, key, column)
    elif column.dtype.kind not in "fiu":
        got = f"{column.dtype}, {shown(column[:1].tolist()[0])} in {table.row(0)}"
        raise LogError(f"real numbers in {where}", got, "store the column as float64")
    else:
        with np.errstate(over="ignore"):  # more than 64 bits: infinite, reported below
            values = column.astype(np.float64)
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        got = f"{values[bad[0]]} in {table.row(int(bad[0]))}" + (
            f" and in {bad.size - 1} more" if bad.size > 1 else ""
        )
        remedy = "interpolate them, or cut those rows out and start a new `run` after them"
        raise LogError(f"finite numbers in {where}", got, remedy)
    values = values * table.factors.get(key, 1.0)
    big = np.flatnonzero(np.abs(values) > LARGEST) if key not in INSTANTS else bad
    if big.size:
        got = f"{values[big[0]]:g} in {table.row(int(big[0]))}"
        raise LogError(
            f"SI units (m or rad, N or N m) in {where}",
            got,
            "convert the column, or remove that row",
        )
    return values


def _parsed(table: Table, key: str, cells: list[str]) -> np.ndarray:
    try:
        if "_" not in "".join(cells):  # Python reads 1_000 as a number; here it is an error
            return np.fromiter(map(float, cells), np.float64, len(cells))
    except ValueError:
        pass
    for i, cell in enumerate(cells):
        text = cell.strip()
        try:
            if "_" not in text:
                float(text)
                continue
        except ValueError:
            pass
        got, remedy = f"{shown(text)} in {table.row(i)}", "write a number there, or remove the row"
        if not text:
            got, remedy = f"an empty cell in {table.row(i)}", "fill it, or remove the row"
        elif re.fullmatch(r"[-+]?[0-9]+,[0-9]+", text):
            remedy = "write decimals with a point, not a comma"
        raise LogError(f"numbers in column {table.called(key)} of {table.name}", got, remedy)
    raise AssertionError("a cell that is not a number")


def samples(
    table: Table, joints: int | None, motor: MotorSide | None = None, *, exact: bool = False
) -> Samples:
    """Return a file's columns as numbers, complete, of equal length, and in order.

    Args:
        table: the file's columns.
        joints: number of the model's joints; None takes that of the log.
        motor: how joints follow from motors, if the log has motors' data.
        exact: refuse faults that are repaired otherwise: a few damaged rows, angles that wrap.

    Raises:
        LogError: naming column and row.
    """
    current = motor is not None and motor.torque_constant is not None
    if "nanosec" in table.columns and "time" not in table.columns:
        table = replace(table, columns={"time": table.columns["sec"], **table.columns})
    count = count_joints(table, joints, current)
    lengths = {key: len(column) for key, column in table.columns.items()}
    for key, length in lengths.items():
        if length != lengths["time"]:
            got = f"{length} in {key} and {lengths['time']} in time"
            raise LogError(
                f"equally many rows in every column of {table.name}",
                got,
                "store all columns at the same instants",
            )
    if not lengths["time"]:
        raise LogError(
            f"rows of data in {table.name}",
            "none below the header",
            "record the motion again, or export it completely",
        )
    notes = list(table.notes)
    table = table if exact else complete(table, notes)
    time = instants(table, notes)
    every = (*KINDS, *[CURRENT] * current, *CONTROL)
    kinds = [kind for kind in every if f"{kind}0" in table.columns]
    signals = {
        kind: np.stack([numbers(table, f"{kind}{j}") for j in range(count)], axis=1)
        for kind in kinds
    }
    run = labels(table) if "run" in table.columns else np.zeros(len(time), int)
    found = distinct(Samples(table, time, signals, run, {}, notes))
    if motor is not None:
        if current and "tau" in signals:
            notes.append(f"tau of {table.name} is ignored: torques are computed from currents")
        found = found._replace(signals=motor.joint_side(found.signals))
    found = found if exact else unwrapped(advancing(found))
    in_order(found)
    return found._replace(still=others(table, notes))


def instants(table: Table, notes: list[str]) -> np.ndarray:
    """Return the time (T,) [s] of a table.

    A time in seconds and nanoseconds, or with a clock's large numbers, begins at zero.

    Raises:
        LogError: as :func:`numbers`.
    """
    time = numbers(table, "time")
    if "nanosec" in table.columns:
        notes.append(
            f"time of {table.name} from its seconds and nanoseconds, counted from the first row"
        )
        part = numbers(table, "nanosec")
        return (time - time[0]) + 1e-9 * (part - part[0])
    for unit, (least, scale) in UNIX.items():
        middle = float(np.median(time))
        if "time" not in table.factors and least < middle < 1e3 * least:
            notes.append(
                f"time of {table.name} is a clock time in {unit}: converted, and counted from the"
                " first row"
            )
            return (time - time[0]) * scale
    return time


def others(table: Table, notes: list[str]) -> dict[str, tuple[float, bool]]:
    """Return mean positions [m or rad] of joints that are not used, by name, and whether they move.

    Columns that cannot be read are left out.
    """
    found = {}
    for key in [key for key in table.columns if key.startswith("q@")]:
        try:
            values = numbers(table, key)
        except LogError:
            continue
        found[key[2:]] = float(values.mean()), bool(np.ptp(values) > MOVES)
        if np.ptp(values) > MOVES:
            what = (
                f"{key[2:]} is locked in the model, but moves by {np.ptp(values):.3g} in"
                f" {table.name}"
            )
            notes.append(f"{what}: its effect on the others looks like a missing effect")
    return found


def labels(table: Table) -> np.ndarray:
    """Return the column ``run`` (T,) as numbers 0, 1, 2, ... in order of appearance.

    Its labels may be anything.

    Raises:
        LogError: on an empty label, and on a run whose rows are not contiguous.
    """
    column, codes, run = table.columns["run"], {}, []
    labels: list[Any] = column if isinstance(column, list) else column.tolist()
    for i, label in enumerate(labels):
        key = label.strip() if isinstance(label, str) else label
        if not (
            (isinstance(key, str | bytes) and key) or (isinstance(key, int | float) and key == key)
        ):
            got = f"{shown(key)} in {table.row(i)}"
            raise LogError(
                f"a label in column run of {table.name}", got, "number the runs 0, 1, 2, ..."
            )
        if codes.setdefault(key, len(codes)) != len(codes) - 1:
            got = f"{shown(key)} again in {table.row(i)}, after other runs"
            raise LogError(
                f"the rows of each run together in {table.name}",
                got,
                "sort by run, or give that part its own label",
            )
        run.append(codes[key])
    return np.array(run, int)


def in_order(found: Samples) -> None:
    """Raise LogError where time does not increase within a run, or a position jumps by a turn."""
    table, time = found.table, found.time
    with np.errstate(over="ignore"):
        step = np.diff(time)
    within = np.diff(found.run) == 0
    bad = np.flatnonzero(within & (step <= 0)) + 1
    if bad.size:
        i = int(bad[0])
        before = float(time[i - 1])
        expected = f"time in {table.name} to increase from row to row"
        if before == time[i]:
            got, remedy = (
                f"{time[i]:.9g} again in {table.row(i)}",
                "remove the repeated row, or write time with more digits",
            )
        else:
            got = f"{time[i]:.9g} after {before:.9g} in {table.row(i)}"
            remedy = (
                "sort the rows by time, or give the rows from there on another label in column run"
            )
            if i > 1 and time[i] > time[i - 2]:
                remedy = "correct the time of one of the two rows, or sort by time"
            elif "run" not in table.columns and time[i] <= time[0] + 0.1 * (before - time[0]):
                got, remedy = (
                    got + ", as if it started again",
                    "add a column run that numbers the runs 0, 1, 2, ...",
                )
        raise LogError(expected, got, remedy)
    for j, q in enumerate(found.signals["q"].T):
        jump = np.flatnonzero(wraps(q, within)) + 1
        if jump.size:
            got = (
                f"a jump from {q[jump[0] - 1]:.4g} to {q[jump[0]]:.4g} in {table.row(int(jump[0]))}"
            )
            raise LogError(
                f"q{j} in {table.name} to be continuous", got, "unwrap the angle (numpy.unwrap)"
            )
