"""Wrong logs of executions end in one line and status 2, and nothing is written."""

import numpy as np
import pytest

from tests.helpers.commands import refusal
from tests.helpers.logs import text, write

QUICK, ALL = 40, 500
PARTS = ("q", "qdd_desired", "tau", "tau_feedback", "tau_feedback_applied")
USED = (*PARTS, "tau_feedforward", "qd", "q_desired")


def without(columns, *keys):
    return {key: column for key, column in columns.items() if key not in keys}


def changed(columns, key, column):
    return columns | {key: column}


def spoiled(columns, key, row, value):
    column = columns[key].copy()
    column[row] = value
    return changed(columns, key, column)


def one_of_the_joints(rng, parts=PARTS):
    return f"{rng.choice(parts)}{rng.integers(2)}"


def dropped(rng, c):
    return without(c, rng.choice(["time", one_of_the_joints(rng, (*PARTS, "tau_feedforward"))]))


def dropped_for_all_joints(rng, c):
    part = rng.choice(PARTS)
    return without(c, f"{part}0", f"{part}1")


def renamed(rng, c):
    old = rng.choice(["time", one_of_the_joints(rng)])
    new = rng.choice(["foo", "x" * 80, "colour"])
    return {(new if k == old else k): v for k, v in c.items()}


def not_a_number(rng, c):
    key = rng.choice(["time", one_of_the_joints(rng, USED)])
    return spoiled(c, key, rng.integers(len(c["time"])), rng.choice([np.nan, np.inf, -np.inf]))


def huge(rng, c):
    return spoiled(c, one_of_the_joints(rng), rng.integers(len(c["time"])), 1e12)


def time_reversed(rng, c):
    return changed(c, "time", c["time"][::-1])


def shuffled(rng, c):
    order = rng.permutation(len(c["time"]))
    return {key: column[order] for key, column in c.items()}


def another_clock(rng, c):
    return changed(c, "time", c["time"] * rng.choice([0.0, -1.0, 1e3, 1e-3, 1e9]))


def unequal_steps(rng, c):
    return changed(c, "time", np.cumsum(rng.exponential(0.002, len(c["time"]))))


def rows_lost(rng, c):
    at = rng.integers(5, len(c["time"]) - 50)
    lost = slice(at, at + rng.integers(1, 40))
    return {key: np.delete(x, lost) for key, x in c.items()}


def too_short(rng, c):
    rows = rng.integers(0, 90)
    return {key: column[:rows] for key, column in c.items()}


def swapped(rng, c):
    part = rng.choice(["tau", "qdd_desired"])
    return c | {f"{part}0": c[f"{part}1"], f"{part}1": c[f"{part}0"]}


def other_signs(rng, c):
    key = one_of_the_joints(rng, ("tau", "tau_feedback_applied", "qdd_desired"))
    return changed(c, key, -c[key])


def in_degrees(rng, c):
    part = rng.choice(["q", "qd", "qdd_desired"])
    return c | {f"{part}{j}": np.rad2deg(c[f"{part}{j}"]) for j in range(2)}


def other_units(rng, c):
    key = one_of_the_joints(rng, ("tau", "qdd_desired"))
    return changed(c, key, c[key] * rng.choice([1e3, 1e-3, 2.0, 0.5]))


def constant(rng, c):
    part = rng.choice(["q", "tau", "qdd_desired"])
    return c | {f"{part}{j}": np.full(len(c["time"]), 0.0) for j in range(2)}


def other_joints(rng, c):
    if rng.integers(2):
        return c | {f"{part}2": c[f"{part}1"] for part in USED}
    return without(c, *(f"{part}1" for part in USED))


def several_runs(rng, c):
    first = rng.integers(50, len(c["time"]) - 50)
    return changed(c, "run", np.repeat([0.0, 1.0], [first, len(c["time"]) - first]))


def a_part_not_logged(rng, c):
    return without(c, "tau_feedforward0", "tau_feedforward1")


def a_jump(rng, c):
    key = one_of_the_joints(rng, ("tau", "tau_feedback_applied"))
    row = rng.integers(len(c["time"]))
    return spoiled(c, key, row, c[key][row] + 1.5 * np.abs(c["tau" + key[-1]]).max())


def time_repeated(rng, c):
    row = rng.integers(1, len(c["time"]))
    return spoiled(c, "time", row, c["time"][row - 1])


def text_in_numbers(rng, c):
    key = rng.choice(["time", one_of_the_joints(rng)])
    words = [repr(x) for x in c[key].tolist()]
    words[rng.integers(len(words))] = rng.choice(["abc", "", "1,5;", "1_000", "0x1f", "--1"])
    return {k: (words if k == key else v) for k, v in c.items()}


COLUMNS = (
    dropped,
    dropped_for_all_joints,
    renamed,
    not_a_number,
    huge,
    time_reversed,
    shuffled,
    another_clock,
    unequal_steps,
    rows_lost,
    too_short,
    swapped,
    other_signs,
    in_degrees,
    other_units,
    constant,
    other_joints,
    several_runs,
    a_part_not_logged,
    a_jump,
    time_repeated,
)


def damaged_file(rng, path, columns):
    """A file that is no log at all."""
    kind = rng.integers(10)
    plain = text(columns)
    if kind < 4:  # cut or overwritten, in any format
        path = write(path.with_suffix(rng.choice([".npz", ".parquet", ".csv"])), columns)
        content = path.read_bytes()
        if path.suffix == ".csv":
            lines = content.split(b"\n")
            row = rng.integers(1, len(lines) - 2)
            cells = lines[row].split(b",")
            lines[row] = b",".join(cells[: rng.integers(1, len(cells))])
            content = b"\n".join(lines[: row + 1] if rng.integers(2) else lines)
        else:
            content = content[: rng.integers(1, len(content) // 2)]
        path.write_bytes(content)
        return path
    contents = {
        4: b"",
        5: plain.encode("utf-16"),
        6: plain.replace("time", "zeit\xe9").encode("latin-1"),
        7: rng.bytes(rng.integers(1, 5000)),
        8: plain.partition("\n")[2].encode(),  # no header
        9: plain.partition("\n")[0].encode(),  # nothing else
    }
    path = path.with_suffix(rng.choice([".csv", ".txt"]) if kind != 4 else ".csv")
    path.write_bytes(contents[int(kind)])
    return path


def malformed(seed, folder, columns):
    """A wrong log, and what is wrong with it."""
    rng = np.random.default_rng(seed)
    which = seed % (len(COLUMNS) + 2)
    path = folder / "log"
    if which == len(COLUMNS):
        return damaged_file(rng, path, columns), "the file"
    if which == len(COLUMNS) + 1:
        path = path.with_suffix(".csv")
        path.write_text(text(text_in_numbers(rng, columns), ","))
        return path, "text"
    suffix = (".csv", ".npz", ".parquet")[int(rng.integers(3))]
    return write(path.with_suffix(suffix), COLUMNS[which](rng, columns)), COLUMNS[which].__name__


def check(seed, folder, columns, gantry, capsys):
    path, what = malformed(seed, folder, columns)
    there = sorted(folder.iterdir())
    line = refusal(capsys, "learn", path, "--model", gantry.path, "--out", folder / "out")
    assert len(line) < 700, (what, line)
    assert sorted(folder.iterdir()) == there, what
    path.unlink()


@pytest.mark.parametrize("start", range(4))
def test_malformed_logs_end_in_one_line(start, columns, gantry, tmp_path, capsys):
    for seed in range(start, QUICK, 4):
        check(seed, tmp_path, columns, gantry, capsys)


@pytest.mark.slow
def test_500_malformed_logs_end_in_one_line(columns, gantry, tmp_path, capsys):
    for seed in range(QUICK, QUICK + ALL):
        check(seed, tmp_path, columns, gantry, capsys)


def test_without_damage_the_log_is_read(columns, gantry, tmp_path):
    """What is refused above is refused for the damage."""
    from jaxidl.robot.execution import read_execution

    for suffix in (".csv", ".npz", ".parquet"):
        execution = read_execution(write(tmp_path / f"log{suffix}", columns), gantry)
        assert execution.run.tau.shape == (600, 2)
        assert not execution.notes
