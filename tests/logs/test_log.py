"""Measured logs in three formats.

Each possible mistake has a message, and damaged files are read or refused.
"""

import dataclasses
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from jaxidl.errors import LogError
from jaxidl.logs.log import from_arrays, read
from tests.helpers.logs import DT, SAMPLES, arrays, check, each_joint, good, refuse, text, write

GAPS = np.cumsum(np.tile([1, 1, 4], 100)) * DT  # times at which samples are taken
FORMATS = ["csv", "npz", "parquet"]


def changed(key, row, value, **options):
    """A good log with one number changed."""
    columns = good(**options)
    columns[key] = columns[key].copy()
    columns[key][row] = value
    return columns


def without(*keys):
    return {key: column for key, column in good().items() if key not in keys}


def renamed(**names):
    return {names.get(key, key): column for key, column in good().items()}


# What is read.


@pytest.mark.parametrize("ending", FORMATS)
def test_a_log_comes_back_from_every_format(tmp_path, ending):
    columns = good(qd0=np.ones(SAMPLES), qd1=np.arange(SAMPLES) * 1.0)
    log = read([write(tmp_path / f"a.{ending}", columns)], joints=2)
    check(log)
    np.testing.assert_array_equal(log.time, columns["time"])
    for kind in ("q", "tau", "qd"):
        np.testing.assert_array_equal(getattr(log, kind), each_joint(columns, kind, (0, 1)))
    assert log.qdd is None
    assert log.dt == pytest.approx(DT, rel=1e-12)
    assert log.runs == 1
    assert log.notes == ()


def test_arrays_of_all_joints_and_of_one_are_read(tmp_path):
    columns = good()
    q, tau = (each_joint(columns, kind, (0, 1)) for kind in ("q", "tau"))
    np.savez(tmp_path / "a.npz", time=columns["time"][:, None], q=q, tau=tau)
    for log in (
        read(tmp_path / "a.npz"),
        from_arrays(columns["time"], q, tau),
        from_arrays(columns["time"].tolist(), q, tau),
    ):
        np.testing.assert_array_equal(log.q, q)
        np.testing.assert_array_equal(log.tau, tau)
    assert from_arrays(columns["time"], q[:, 0], tau[:, 0], joints=1).joints == 1


@pytest.mark.parametrize(
    "edit",
    [
        lambda s: s.replace(",", ";"),
        lambda s: s.replace(",", "\t"),
        lambda s: "\ufeff" + s,
        lambda s: "# a drive\n\n# at 200 Hz\n" + s,
        lambda s: "# " + s,  # as numpy.savetxt writes a header
        lambda s: s.replace("\n", "\r\n"),
        lambda s: s.replace("\n", "\n\n").rstrip(),
        lambda s: s.replace("time,q0", " Time , Q0"),
        lambda s: s.replace("time,q0", '"time", "q0"'),
        lambda s: s.replace("\n", ",\n"),  # a column without a name
    ],
)
def test_dialects_of_csv_are_understood(tmp_path, edit):
    (tmp_path / "a.csv").write_bytes(edit(text(good())).encode())
    log = read(tmp_path / "a.csv", joints=2)
    assert dataclasses.replace(arrays(good()), notes=log.notes).q.tobytes() == log.q.tobytes()


def test_runs_come_from_labels_and_from_files(tmp_path):
    label = np.repeat(["up", "down"], 150)
    a = write(tmp_path / "a.csv", good(run=label))
    b = write(tmp_path / "b.npz", good(run=np.repeat([7.0, 3.0, 5.0], 100)))
    log = read([a, b, write(tmp_path / "c.csv", good(qd0=np.ones(SAMPLES), qd1=np.ones(SAMPLES)))])
    check(log)
    assert [s.stop - s.start for s in log.segments()] == [150, 150, 100, 100, 100, 300]
    assert log.qd is None
    assert log.notes == ("qd ignored: not every log has it",)


def test_parquet_with_integers_and_labels_is_read(tmp_path):
    columns = good(run=np.repeat(["a", "b"], 150).tolist())
    columns["tau1"] = np.arange(SAMPLES)
    log = read(write(tmp_path / "a.parquet", columns))
    assert log.runs == 2
    np.testing.assert_array_equal(log.tau[:, 1], np.arange(SAMPLES))


# What is repaired, with a note.


def notes_of(columns):
    log = arrays(columns)
    check(log)
    return log, " | ".join(log.notes)


def test_missing_samples_are_interpolated():
    keep = np.setdiff1d(np.arange(SAMPLES), [10, 50, 51, 52])
    log, notes = notes_of({key: column[keep] for key, column in good().items()})
    assert notes == "4 missing samples were interpolated"
    np.testing.assert_allclose(log.time, good()["time"], atol=1e-12)
    # what was measured stays
    np.testing.assert_allclose(log.q[keep, 0], good()["q0"][keep], rtol=1e-14)
    np.testing.assert_allclose(log.q[:, 0], good()["q0"], atol=1e-6)


def test_a_long_gap_splits_the_run():
    keep = np.setdiff1d(np.arange(SAMPLES), np.arange(100, 120))
    log, notes = notes_of({key: column[keep] for key, column in good().items()})
    assert notes == "a gap of 0.105 s after row 100 of the arrays: the run is split there"
    assert [s.stop for s in log.segments()] == [100, 280]


def test_jitter_is_resampled_and_digits_are_not():
    columns = good(samples=1000)
    true = columns["time"]
    jitter = true + np.random.default_rng(0).uniform(-0.1, 0.1, 1000) * DT
    q, tau = np.sin(20.0 * jitter), np.cos(20.0 * jitter)
    log, notes = notes_of({"time": jitter, "q0": q, "tau0": tau})
    assert "resampled every 0.00" in notes
    # far below any encoder's noise, as it is differentiated twice
    np.testing.assert_allclose(log.q[2:-2, 0], np.sin(20.0 * log.time[2:-2]), atol=2e-7)
    third = np.arange(3000) / 300
    # samples that were stamped late are close to the next ones: nothing swings
    late = true + 0.99 * DT * (np.random.default_rng(1).uniform(size=1000) < 0.05)
    log, notes = notes_of({"time": late, "q0": np.sin(late), "tau0": np.cos(true)})
    np.testing.assert_allclose(log.q[:, 0], np.sin(log.time), atol=1e-4)
    assert np.abs(log.tau).max() <= 1.0
    log, notes = notes_of({"time": third.round(6), "q0": np.sin(third), "tau0": np.cos(third)})
    assert notes == ""
    assert log.dt == pytest.approx(1 / 300, rel=1e-6)
    np.testing.assert_array_equal(log.q[:, 0], np.sin(third))
    log, notes = notes_of({"time": third.round(3), "q0": np.sin(third), "tau0": np.cos(third)})
    assert "samples are counted instead" in notes
    assert log.dt == pytest.approx(1 / 300, rel=1e-4)  # the median would say 3 ms
    assert log.samples == 3000


def test_short_runs_are_left_out():
    log, notes = notes_of(good(run=np.repeat([0, 1, 2], [270, 20, 10])))
    assert log.samples == 270
    assert notes == "2 runs of fewer than 50 samples left out of the arrays"


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (changed("tau1", 20, np.nan), "1 row of the arrays without a number, first tau1 in row 21"),
        (
            changed("q0", [0, 20], np.inf),
            "2 rows of the arrays without a number, first q0 in row 1",
        ),
        (changed("time", 20, np.nan), "first time in row 21"),
        (changed("time", 20, 19 * DT), "1 row of the arrays with a time that does not fit"),
        (changed("time", 20, 700.0), "first row 21: left out"),
        (changed("time", 20, -1.0), "first row 21: left out"),
    ],
)
def test_a_few_spoilt_rows_are_left_out(spoilt, words):
    log, notes = notes_of(spoilt)
    assert words in notes
    true = good()
    rows = np.rint(log.time / DT).astype(int)
    assert set(range(1, SAMPLES)) <= set(rows.tolist())
    for kind in ("q", "tau"):
        wanted = each_joint(true, kind, (0, 1))[rows]
        np.testing.assert_allclose(getattr(log, kind), wanted, atol=1e-3)


def test_rows_keep_their_numbers_when_others_were_left_out(tmp_path):
    columns = changed("tau1", 20, np.nan) | {"run": np.ones(SAMPLES, int).astype(str)}
    columns["run"][100] = ""
    refuse(lambda: read(write(tmp_path / "a.csv", columns)), "row 101 (line 102)")


@pytest.mark.parametrize("least", [0.0, -np.pi])
def test_angles_that_wrap_are_unwrapped(least):
    angle = 2.5 * np.sin(np.arange(SAMPLES) * 0.03) + 1.0
    log, notes = notes_of(good(q0=(angle - least) % (2 * np.pi) + least))
    assert "q0 of the arrays jumps by a turn" in notes
    np.testing.assert_allclose(log.q[:, 0], angle, atol=1e-12)


def test_a_last_row_that_was_cut_off_is_left_out(tmp_path):
    whole = text(good())
    (tmp_path / "a.csv").write_text(whole[: -len(whole.split("\n")[-2]) // 2 - 1])
    log = read(tmp_path / "a.csv")
    assert log.notes == (f"the last row of {tmp_path / 'a.csv'} is cut off: left out",)
    assert log.samples == SAMPLES - 1


def test_decimals_may_follow_a_comma_where_a_semicolon_separates(tmp_path):
    (tmp_path / "a.csv").write_text(text(good()).replace(",", ";").replace(".", ","))
    np.testing.assert_array_equal(read(tmp_path / "a.csv").q, arrays(good()).q)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (good(q1=np.ones(SAMPLES)), "q1 is constant"),
        (good(tau1=np.zeros(SAMPLES)), "tau1 is zero throughout"),
        (good(tau1=np.full(SAMPLES, 2.5)), "tau1 is constant at 2.5"),
        (good(tau1=np.clip(good()["tau1"], -9, 2)), "tau1 sits at its limit 2 for"),
        (changed("q1", 123, 9.0), "q1 jumps at 0.61 s"),
    ],
)
def test_oddities_are_noted(columns, words):
    assert words in notes_of(columns)[1]


def test_ignored_columns_are_noted(tmp_path):
    path = write(tmp_path / "a.csv", good(q_reference0=["x"] * SAMPLES))
    assert read(path).notes == (f"column q_reference0 of {path} ignored",)


# What is wrong with the numbers, in every format.

NAN, SPOILT = float("nan"), slice(6, 10)  # one row more than is mended
SWAPPED = np.r_[np.arange(100), np.arange(100, SAMPLES).reshape(-1, 2)[:, ::-1].ravel()]
COMPLAINTS = {
    "not a number": (changed("tau1", SPOILT, NAN), ["tau1", "nan in row 7", "interpolate"]),
    "infinite": (changed("q0", SPOILT, np.inf), ["q0", "inf in row 7", "interpolate"]),
    "huge": (changed("q1", 3, -2e9), ["q1", "-2e+09 in row 4", "SI units"]),
    "no time": (without("time"), ["column time", "q0, q1, tau0, tau1", "add a column time"]),
    "two clocks": (
        renamed(time="t") | {"stamp": good()["time"]},
        ["one set of columns for time", "t, stamp", "--columns time=t"],
    ),
    "timestamp in ms, not s": (renamed(time="Timestamp [ms]"), ["over 0.0015 s", "seconds"]),
    "tiem": (renamed(time="tiem"), ["rename column 'tiem' to time"]),
    "no q": (without("q0", "q1"), ["q0..q1", "add a column q0"]),
    "pos1_rad": (renamed(q1="pos1_rad"), ["q0..q1", "rename column 'pos1_rad' to q1"]),
    "torque": (
        renamed(tau0="Torque 0 (N m)"),
        ["tau0..tau1", "rename column 'Torque 0 (N m)' to tau0"],
    ),
    "no tau1": (without("tau1"), ["tau0..tau1", "add a column tau1"]),
    "numbering": (
        renamed(q1="q2", tau1="tau2"),
        ["q0..q2 without gaps", "got q0, q2;", "add a column q1"],
    ),
    "half of qd": (good(qd1=np.ones(SAMPLES)), ["qd0..qd1", "add a column qd0"]),
    "repeated time": (
        changed("time", slice(9, 13), 8 * DT),
        ["time", "0.04 again in row 10", "more digits"],
    ),
    "time back": (
        {k: v[SWAPPED] for k, v in good().items()},
        ["time", "0.5 after 0.505 in row 102", "sort"],
    ),
    "time far off": (
        changed("time", slice(9, 49, 10), 700.0),
        ["time", "0.05 after 700 in row 11", "correct the time"],
    ),
    "restart": (
        good(time=np.tile(np.arange(150) * DT, 2)),
        ["0 after 0.745 in row 151", "add a column run"],
    ),
    "restart in a run": (
        good(time=np.tile(np.arange(150) * DT, 2), run=np.ones(SAMPLES)),
        ["row 151", "another label"],
    ),
    "run apart": (good(run=np.repeat([1, 2, 1], 100)), ["run", "again in row 201", "sort by run"]),
    "run empty": (
        good(run=np.r_[NAN, np.ones(SAMPLES - 1)]),
        ["run", "nan in row 1", "number the runs"],
    ),
    "milliseconds": (good(dt=5.0), ["every 5 s", "milliseconds", "seconds"]),
    "sample numbers": (good(dt=1.0), ["every 1 s", "sample numbers"]),
    "slow": (good(dt=0.11), ["20 samples a second", "every 0.11 s", "record faster"]),
    "irregular": (
        good(time=GAPS, q0=np.sin(2 * GAPS), q1=np.sin(3 * GAPS)),
        ["constant sampling interval", "67% of the time", "row 2"],
    ),
    "wide time": (
        good(time=1e12 + np.arange(SAMPLES) / 128),
        ["time in seconds", "1e+12 in row 1"],
    ),
    "few": (good(samples=150, dt=0.02), ["200 samples", "150 samples over 3 s", "record longer"]),
    "brief": (good(dt=0.001), ["1 s of motion", "over 0.3 s", "record longer"]),
    "short runs": (good(run=np.repeat(np.arange(10), 30)), ["run of at least 50", "record longer"]),
    "still": (good(q0=np.ones(SAMPLES), q1=np.zeros(SAMPLES)), ["nothing moved", "q0, q1"]),
    "no torque": (
        good(tau0=np.zeros(SAMPLES), tau1=np.zeros(SAMPLES)),
        ["no torque acted", "tau0, tau1"],
    ),
}


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("name", COMPLAINTS)
def test_wrong_numbers_are_refused_with_their_place(tmp_path, name, ending):
    columns, words = COMPLAINTS[name]
    if ending == "csv" and name == "run empty":
        columns = columns | {"run": [""] + ["1"] * (SAMPLES - 1)}
        words = ["run", "'' in row 1 (line 2)", "number the runs"]
    path = write(tmp_path / f"a.{ending}", columns)
    refuse(lambda: read([path]), *words)


def test_a_log_must_have_the_models_joints(tmp_path):
    path = write(tmp_path / "a.csv", good())
    refuse(
        lambda: read(path, joints=7),
        "q0..q6 for the model's 7 joints",
        "got q0, q1;",
        "add a column q2",
    )
    refuse(
        lambda: read(path, joints=1), "column q0 for the model's 1 joint ", "remove q1 and above"
    )
    one = write(tmp_path / "one.csv", {k: v for k, v in good().items() if not k.endswith("1")})
    refuse(lambda: read([path, one]), "same number of joints", "2 in", "1 in")


def test_a_file_given_twice_is_refused(tmp_path):
    path = write(tmp_path / "a.csv", good())
    refuse(lambda: read([path, tmp_path / "." / "a.csv"]), "a.csv twice")
    refuse(lambda: read([]), "at least one log")


def test_a_logger_of_20_hz_may_miss_it_a_little(tmp_path):
    assert read(write(tmp_path / "a.csv", good(dt=0.0505))).dt == pytest.approx(0.0505)


def test_files_of_very_different_rates_are_refused(tmp_path):
    a, b = write(tmp_path / "a.csv", good()), write(tmp_path / "b.csv", good(dt=6 * DT))
    refuse(lambda: read([a, b]), "within a factor of 5", "200 Hz")


# What is wrong with a file.

GOOD_TEXT = text(good())


def line_changed(number, edit):
    """The text of a good log with one line (counted from 1) edited."""
    lines = GOOD_TEXT.split("\n")
    lines[number - 1] = edit(lines[number - 1])
    return "\n".join(lines)


def lines_changed(edit):
    """The text of a good log with lines 5 to 8 edited: one row more than is mended."""
    lines = GOOD_TEXT.split("\n")
    return "\n".join([*lines[:4], *map(edit, lines[4:8]), *lines[8:]])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["empty"]),
        ("\n \n# nothing\n", ["header"]),
        ("time,q0,tau0\n", ["rows of data", "none"]),
        (GOOD_TEXT.split("\n", 1)[1], ["header", "begin with a line time,q0,tau0"]),
        (GOOD_TEXT.replace(",", " "), ["header", "commas"]),
        (
            GOOD_TEXT.replace(",", ";").replace(".", ",").replace("0,005", "0.005"),
            ["time", "'0,0' in row 1 (line 2)", "point, not a comma"],
        ),
        (
            line_changed(9, lambda s: s.rsplit(",", 1)[0]),
            ["5 cells", "4 in row 8 (line 9)", "complete or remove"],
        ),
        (line_changed(9, lambda s: s + ",1"), ["5 cells", "6 in row 8 (line 9)"]),
        ("# note\n" + line_changed(9, lambda s: s + ",1"), ["6 in row 8 (line 10)"]),
        (GOOD_TEXT + "1\n1\n", ["5 cells", "1 in row 301 (line 302)"]),
        (
            line_changed(5, lambda s: s.rsplit(",", 1)[0] + ",bad\x1b"),
            ["tau1", r"'bad\x1b' in row 4 (line 5)", "write a number"],
        ),
        (
            line_changed(5, lambda s: s.rsplit(",", 1)[0] + ",1_0"),
            ["tau1", "'1_0' in row 4 (line 5)"],
        ),
        (
            lines_changed(lambda s: s.rsplit(",", 1)[0] + ","),
            ["tau1", "an empty cell in row 4 (line 5)", "fill it"],
        ),
        (line_changed(5, lambda s: s.rsplit(",", 1)[0] + ",1+2j"), ["tau1", "'1+2j' in row 4"]),
        (
            lines_changed(lambda s: s.rsplit(",", 1)[0] + ",NaN"),
            ["tau1", "nan in row 4 (line 5)"],
        ),
        (
            lines_changed(lambda s: s.rsplit(",", 1)[0] + ",1e999"),
            ["tau1", "inf in row 4 (line 5)"],
        ),
        (line_changed(5, lambda s: s.replace("0.015", "0.016")), None),
        (line_changed(1, lambda s: s.replace("tau1", "Q0")), ["one column q0", "columns 2 and 5"]),
        (line_changed(1, lambda s: "q" * 300_000), ["1 cells in each row", "5 in row 1 (line 2)"]),
        (line_changed(1, lambda s: s.replace("time", "q" * 300_000)), ["column time", "qqq..."]),
        (
            line_changed(1, lambda s: ",".join(f"x{i}" for i in range(20_000))),
            ["at most 10000 columns"],
        ),
        (
            line_changed(1, lambda s: s.replace("q0", "q9999")),
            ["q0..q9999 without gaps", "add a column q0"],
        ),
        (line_changed(4, lambda s: '"' + s), ["cells", "row 3 (line 4)"]),
        (GOOD_TEXT.encode("utf-16"), ["UTF-16", "UTF-8"]),
        (GOOD_TEXT.encode("utf-16-le"), ["binary"]),
        (
            GOOD_TEXT.replace("tau1", "τ").encode("iso8859-7"),
            ["byte 0xf4 in line 1", "save it with that encoding"],
        ),
        (bytes(range(256)) * 9, ["binary data"]),
        (b"PAR1" + bytes(90), ["Parquet", "right ending"]),
        (b"PK\x03\x04" + bytes(90), ["ZIP", "right ending"]),
        (b"\x1f\x8b" + bytes(90), ["compressed"]),
    ],
)
def test_damaged_csv_is_refused_with_its_place(tmp_path, content, words):
    path = tmp_path / "a.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    if words is None:
        return check(read(path))
    refuse(lambda: read(path), *words)


def npz(**columns) -> bytes:
    """An archive of arrays; objects are pickled."""
    stream = io.BytesIO()
    np.savez(stream, **columns)
    return stream.getvalue()


def archive(**members) -> bytes:
    """An archive of anything."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as file:
        for name, content in members.items():
            file.writestr(name + ".npy", content)
    return stream.getvalue()


def npy(header: str) -> bytes:
    """The beginning of an array, whatever its header says."""
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()


BOTH = {kind: each_joint(good(), kind, (0, 1)) for kind in ("q", "tau")}
ENORMOUS = "{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000000, 100), }\n"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["empty"]),
        (b"no archive", ["NPZ", "export it again"]),
        (npz(**good())[:-500], ["NPZ", "export it again"]),
        (npz(**good(q0=np.zeros(299))), ["q0", "(299,)", "T = 300 as in time"]),
        (
            npz(time=good()["time"], q=BOTH["q"].T, tau=BOTH["tau"]),
            ["q", "(2, 300)", "transpose it"],
        ),
        (npz(time=good()["time"], q=BOTH["q"][None], tau=BOTH["tau"]), ["q", "(1, 300, 2)"]),
        (npz(time=1.0, q=BOTH["q"], tau=BOTH["tau"]), ["time", "shape ()"]),
        (npz(time=good()["time"], q0=good()["q0"], **BOTH), ["one column q0", "both q and q0"]),
        (npz(**good(q0=good()["q0"] + 0j)), ["q0", "complex128", "0j in row 1", "float64"]),
        (npz(**good(q0=good()["q0"].astype(str))), ["q0", "'0.0' in row 1", "float64"]),
        (npz(**good(q0=good()["q0"] > 0)), ["q0", "bool", "float64"]),
        (npz(**good(q0=good()["q0"].astype(object))), ["an array q0", "Object arrays", "float64"]),
        (npz(**good(q0=good()["q0"].astype("datetime64[s]"))), ["q0", "datetime64"]),
        (npz(**{k: v[:0] for k, v in good().items()}), ["rows of data", "none"]),
        (archive(time=npy(ENORMOUS)), ["an array time", "store it again"]),
        (archive(time=npy("{'descr': '<f8', 'shape': ((((")), ["an array time"]),
        (archive(time=npy("(" * 9000)), ["an array time"]),
        (archive(time=npy("x" * 60_000)), ["an array time"]),
        (archive(time=b"text"), ["an array time"]),
    ],
    # an archive holds the time at which it was made, which is no name for a test
    ids=lambda value: "archive" if isinstance(value, bytes) else ", ".join(value),
)
def test_damaged_npz_is_refused(tmp_path, content, words):
    (tmp_path / "a.npz").write_bytes(content)
    refuse(lambda: read(tmp_path / "a.npz"), *words)


def test_damaged_parquet_is_refused(tmp_path):
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = write(tmp_path / "a.parquet", good())
    whole = path.read_bytes()
    for content, words in [
        (whole[:-50], ["PARQUET", "export it again"]),
        (b"PAR1", ["PARQUET"]),
        (GOOD_TEXT.encode(), ["PARQUET"]),
    ]:
        path.write_bytes(content)
        refuse(lambda: read(path), *words)
    for values, words in [
        (["x"] * SAMPLES, ["q0", "'x' in row 1", "float64"]),
        ([[1.0]] * SAMPLES, ["q0", "row 1", "float64"]),
        ([None] * 4 + [1.0] * (SAMPLES - 4), ["q0", "nan in row 1"]),
        (pa.array(range(SAMPLES), pa.timestamp("ms")), ["q0", "datetime64", "float64"]),
        (pa.array([1] * SAMPLES, pa.decimal128(5, 2)), ["q0", "Decimal", "float64"]),
    ]:
        pq.write_table(pa.table(good() | {"q0": values}), path)
        refuse(lambda: read(path), *words)
    table = pa.table(good())
    pq.write_table(table.rename_columns(["time", "q0", " Q0", "tau0", "tau1"]), path)
    refuse(lambda: read(path), "one column q0", "columns 2 and 3")


def test_missing_pyarrow_is_refused_with_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow.parquet", None)
    (tmp_path / "a.parquet").write_bytes(b"PAR1")
    refuse(
        lambda: read(tmp_path / "a.parquet"),
        "pyarrow",
        "none installed",
        "save the log as CSV or NPZ",
    )


def test_paths_without_a_log_are_refused(tmp_path, monkeypatch):
    refuse(lambda: read(tmp_path / "none.csv"), "no such file")
    refuse(lambda: read(tmp_path), "a folder")
    refuse(lambda: read(Path("/dev/null")), "something else")
    refuse(lambda: read(tmp_path / "a\0b.csv"), "a log")
    refuse(lambda: read(tmp_path / ("x" * 300 + ".csv")), "too long")
    for name in ("a.xlsx", "a", "a.csv.gz"):
        (tmp_path / name).write_text("x")
        refuse(
            lambda name=name: read(tmp_path / name),
            ".csv, .tsv, .txt, .npz, .parquet, .pq",
            "save the log",
        )
    path = write(tmp_path / "a.csv", good())

    def refused(self):
        raise PermissionError

    monkeypatch.setattr(Path, "read_bytes", refused)
    refuse(lambda: read(path), "no permission")


def test_wrong_arrays_are_refused():
    time, q, tau = good()["time"], BOTH["q"], BOTH["tau"]
    refuse(
        lambda: from_arrays(time, [[1.0], [1.0, 2.0]], tau), "an array for q", "lists of numbers"
    )
    refuse(lambda: from_arrays(time, q[:-1], tau), "q in the arrays", "(299, 2)")
    refuse(lambda: from_arrays(time, q.astype(object), tau), "q0", "object", "float64")
    refuse(lambda: from_arrays(time, np.ma.masked_greater(q, 0.5), tau), "q", "masked")
    refuse(lambda: from_arrays(time, q, tau, run=[{}] * SAMPLES), "run", "{} in row 1")
    refuse(
        lambda: from_arrays(time, q, tau, run=[10**5000] + [None] * (SAMPLES - 1)),
        "run",
        "None in row 2",
    )
    refuse(lambda: from_arrays(time, q, tau, joints=3), "the model's 3 joints")
    refuse(lambda: from_arrays([], [], []), "rows of data")


# Files damaged at random.


def damaged_columns(rng, columns):
    """One thing wrong with the columns."""
    key = rng.choice(list(columns))
    columns, row = {k: v.copy() for k, v in columns.items()}, rng.integers(SAMPLES)
    match rng.integers(14):
        case 0:
            del columns[key]
        case 1:
            columns = {
                (rng.choice(["q2", "Time", "tau", "x" * 500, "", "q-1"]) if k == key else k): v
                for k, v in columns.items()
            }
        case 2:
            columns |= {f" {key.upper()}": columns[key]}
        case 3:
            columns[key][row] = rng.choice([np.nan, np.inf, -np.inf])
        case 4:
            columns[key][row] = rng.choice([1e300, -1e300, 1e12, 1.7e308, 5e-324])
        case 5:
            columns[key] = columns[key][::-1]
        case 6:
            columns = {k: v[rng.permutation(SAMPLES)] for k, v in columns.items()}
        case 7:
            columns["time"] = columns["time"] * rng.choice([0.0, -1.0, 1e3, 1e-3, 1e300, 1e-320])
        case 8:
            columns = {
                k: np.delete(v, rng.integers(SAMPLES, size=rng.integers(1, 250)))
                for k, v in columns.items()
            }
        case 9:
            columns = {k: v[: rng.integers(0, 60)] for k, v in columns.items()}
        case 10:
            columns["run"] = rng.integers(0, 3, SAMPLES)
        case 11:
            columns[key] = np.where(rng.random(SAMPLES) < 0.5, columns[key], 0.0)
        case 12:
            columns["time"] = np.cumsum(rng.exponential(DT, SAMPLES))
        case _:
            columns["time"] = columns["time"] + rng.normal(size=SAMPLES) * DT * rng.choice(
                [0.01, 0.1, 0.5]
            )
    return columns


def damaged_bytes(rng, content: bytes) -> bytes:
    """Content with up to five damages: bytes reversed, cut out, put in or overwritten."""
    data = bytearray(content)
    for _ in range(rng.integers(1, 6)):
        at = int(rng.integers(len(data) + 1))
        match rng.integers(6):
            case 0:
                del data[at:]
            case 1:
                del data[at : at + int(rng.integers(1, 50))]
            case 2:
                data[at:at] = rng.integers(0, 256, rng.integers(1, 50), dtype=np.uint8).tobytes()
            case 3:
                words = [
                    b"NaN",
                    b"text",
                    b",",
                    b"\n",
                    b"\r",
                    b'"',
                    b"\xff",
                    b"#",
                    b";",
                    b"\0",
                    b"9" * 400,
                    b"\xe2\x80\xa8",
                    b"1e999",
                ]
                data[at:at] = words[rng.integers(len(words))]
            case 4:
                edge = int(
                    rng.choice(
                        [at, max(0, len(data) - 1 - int(rng.integers(400))), int(rng.integers(200))]
                    )
                )
                data[edge : edge + 1] = bytes([int(rng.integers(256))])
            case _:
                data[at : at + 8] = data[at : at + 8][::-1]
    return bytes(data)


@pytest.mark.parametrize("ending", FORMATS)
def test_damaged_files_are_read_or_refused(tmp_path, ending):
    """Each of 300 damaged files is a sound log or refused in one line."""
    rng = np.random.default_rng(20)
    path, outcomes = tmp_path / f"a.{ending}", {"read": 0, "refused": 0}
    whole = write(path, good()).read_bytes()
    for i in range(300):
        if i % 3 == 0:
            path.unlink()
            columns = damaged_columns(rng, good())
            if ending != "npz":  # which alone may have columns of different lengths
                least = min(len(column) for column in columns.values())
                columns = {k: v[:least] for k, v in columns.items()}
            write(path, columns)
        else:
            path.write_bytes(damaged_bytes(rng, whole))
        try:
            check(read(path))
            outcomes["read"] += 1
        except LogError as error:
            line = str(error)
            assert line.isprintable(), (i, line)
            assert len(line) < 800, (i, line)
            assert not any(word in line for word in ("Traceback", "NoneType", "index out of")), (
                i,
                line,
            )
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 10, outcomes


@pytest.mark.parametrize(
    ("positions", "speeds", "word"),
    [
        (180.0 / np.pi, 1.0, "give q1 in radians"),
        (1.0, 180.0 / np.pi, "give qd1 in radians per second"),
        (1.0, -1.0, "correct their units or signs"),
        (1.0, 9.0, "or leave qd1 out"),
    ],
)
def test_speeds_in_other_units_than_positions_are_refused(positions, speeds, word):
    """Noise of the encoder, which its derivative multiplies, must not hide it."""
    c, rng = good(samples=2000, joints=2), np.random.default_rng(0)
    q, tau = (each_joint(c, kind, (0, 1)) for kind in ("q", "tau"))
    qd = np.gradient(q, c["time"], axis=0)
    q = q + rng.normal(0.0, 1e-3, q.shape)
    assert from_arrays(c["time"], q, tau, qd).qd is not None
    odd, fast = q * [1.0, positions], qd * [1.0, speeds]
    refuse(lambda: from_arrays(c["time"], odd, tau, fast), word)
