"""Any command line and any file that it reads: it runs, or it is refused in one clear line."""

import contextlib
import io
import os
import pickle
import shutil
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from jaxidl.cli import main
from jaxidl.jobs.programs import layout
from jaxidl.learning.sources import SOURCES, TRAIN_ON
from tests.helpers.properties import COUNTS, FLOATS, NAMES, examples, h5netcdf_may_stumble

pytestmark = pytest.mark.slow  # hundreds of command lines; single ones are in test_commands.py

LINES = {"noise-levels": ("program", "printed"), "train-on": TRAIN_ON}
ODD = [
    "nan",
    "-nan",
    "inf",
    "-inf",
    "1e400",
    "5e-324",
    "-5e-324",
    "0",
    "0.0",
    "-0.0",
    "-0",
    "-1",
    "1.5",
    "1.0",
    "1e0",
    "5",
]
ODD += [
    "5.0",
    "05",
    "+5",
    "1_0",
    "٣",
    "0x10",
    " 5 ",
    "12",
    "12.000001",
    "1000",
    "100001",
    "10001",
    str(2**31),
    str(2**31 + 1),
]
ODD += [
    str(10**30),
    str(-(10**30)),
    "9" * 5000,
    "",
    " ",
    "1e-4",
    "abc",
    "True",
    "1,2",
    "é",
    "😀",
    "a\nb",
    "\x1b[31m",
    "\udcff",
]
NOT_NAMES = [
    "pdi",
    "PID",
    "pid ",
    "",
    "lqr",
    "both",
    "ünï",
    "😀",
    "true state",
    "5",
    "─",
    "│",
    "a\nb",
    "\udcff",
    "[red]",
]
SPOILT = [
    "--nois",
    "--noise-level",
    "-noise",
    "--bogus",
    "-x",
    "---",
    "--=",
    "-",
    "--seeds=",
    "--seeds=1",
    "--noise=-1",
    "None",
]
# what a shell can pass
WORD = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=6)
NUMBER = (
    st.sampled_from(ODD)
    | st.floats().map(repr)
    | st.floats(0, 1).map(repr)
    | st.integers(-2, 12).map(str)
)
NUMBER |= st.integers().map(str) | st.integers(0, 12).map("{}.0".format)


class Said(NamedTuple):
    status: int
    out: str
    err: str


def say(words, encoding="utf-8") -> Said:
    """Run a command line in this process, in a terminal of this encoding.

    A refusal is one clear line.
    """
    streams = [
        io.TextIOWrapper(io.BytesIO(), encoding, errors)
        for errors in ("strict", "backslashreplace")
    ]
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        status = main([str(word) for word in words])
    for stream in streams:
        stream.flush()
    out, err = (stream.buffer.getvalue().decode(encoding) for stream in streams)
    assert status in (0, 2)
    if status == 2:
        assert len(err.splitlines()) == 1
        assert err.startswith("jaxidl: expected ")
        assert "got ;" not in err
        assert len(err) < 500 + 10 * sum(len(str(word)) for word in words)
        assert not out
    else:
        assert out
        assert not err
    return Said(status, out, err)


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """The (grid, study) of every sweep that the command line would run.

    The folder is empty, and runs take no time.
    """
    # the first computation has been: the command line cannot change their number any more
    jax.devices()
    found = []

    def run(grid, path, study=None, *, devices=None, per_device=None, width=None, **_):
        layout(devices, per_device, width)
        found.append((grid, study))

    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    monkeypatch.setattr("jaxidl.paper.runs.run_sweep", run)
    monkeypatch.setattr(
        "jaxidl.paper.simulate.draw_noise", lambda seed, *shape: np.zeros((*shape, 2))
    )
    for name in ("_execution", "_learning"):
        monkeypatch.setattr(
            f"jaxidl.paper.simulate.{name}", lambda study, label, draws: {"draws": draws}
        )
    return found


def numbers(axis, words):
    """What these words mean as values of this axis, or None where they must be refused."""
    low, high = (FLOATS | COUNTS)[axis]
    try:
        values = [(float if axis in FLOATS else int)(word) for word in words]
    except ValueError:
        return None
    right = (
        values and len(set(values)) == len(values) and all(low <= value <= high for value in values)
    )
    return values if right and not (axis == "executions" and len(values) > 1) else None


def same(a, b) -> bool:
    """Equal to the sign of zero."""
    return repr(tuple(a)) == repr(tuple(b))


@examples(120)
@given(
    axis=st.sampled_from([*FLOATS, *COUNTS]),
    words=st.lists(NUMBER, max_size=3),
    before=st.lists(NUMBER, max_size=2),
)
def test_numbers_on_an_axis_become_just_those_values_or_are_refused(asked, axis, words, before):
    asked.clear()
    # given twice, the last one counts
    twice = [f"--{axis}", *before] if numbers(axis, before) else []
    said = say(["sweep", "--out", "r.nc", *twice, f"--{axis}", *words])
    wanted = numbers(axis, words)
    assert said.status == (2 if wanted is None else 0), said.err
    if wanted:
        got = getattr(asked[0][0], axis)
        assert same(got if isinstance(got, tuple) else [got], wanted)
    else:
        assert not asked
    assert not os.listdir()


@examples(80)
@given(axis=st.sampled_from([*NAMES, *LINES]), data=st.data())
def test_names_on_an_axis_are_taken_once_each_or_refused(asked, axis, data):
    asked.clear()
    valid = (NAMES | LINES)[axis]
    words = data.draw(
        st.lists(st.sampled_from(valid) | st.sampled_from([*valid, *NOT_NAMES]), max_size=3)
    )
    said = say(
        ["sweep", "--out", "r.nc", f"--{axis}", *words],
        data.draw(st.sampled_from(["utf-8", "ascii"])),
    )
    right = 0 < len(words) == len(set(words)) <= (3 if axis in NAMES else 1) and set(words) <= set(
        valid
    )
    assert said.status == (0 if right else 2), said.err
    if right and axis in NAMES:
        assert getattr(asked[0][0], axis) == tuple(words)
    if right and axis == "train-on":
        assert [asked[0][1].train_on] == words


@examples(80)
@given(
    devices=st.none() | st.integers(-1, 3).map(str) | NUMBER,
    per_device=st.none() | st.integers(0, 6).map(str) | NUMBER,
    width=st.none() | st.integers(0, 6).map(str) | NUMBER,
)
def test_a_layout_within_the_machine_is_taken_and_any_other_refused(
    asked, devices, per_device, width
):
    given_words = {"--devices": devices, "--per-device": per_device, "--width": width}
    words = [
        word for name, value in given_words.items() if value is not None for word in (name, value)
    ]
    usual = layout(None, None, None)
    try:
        d, p = int(devices or usual.devices), int(per_device or usual.per_device)
        right = (
            "" not in words
            and 1 <= d <= len(jax.devices())
            and 1 <= p <= 10**6
            and 1 <= int(width or 1) <= p
        )
    except ValueError:
        right = False
    assert say(["sweep", "--out", "r.nc", *words]).status == (0 if right else 2)


PIECES = [
    "simulate",
    "sweep",
    "figures",
    "claims",
    "reproduce",
    "--out",
    "r.nc",
    "--help",
    "--version",
    "--json",
    "--markdown",
]
PIECES += [
    "--controller",
    "pid",
    "--gain",
    "low",
    "--source",
    "joint",
    "--seed",
    "--standard-normal",
    "--overwrite",
    "--",
]
PIECES += [
    f"--{name}" for name in (*FLOATS, *COUNTS, *NAMES, *LINES, "devices", "per-device", "width")
]
BEGIN = {
    "sweep": ["--out", "r.nc"],
    "simulate": ["--out", "t.npz", "--controller", "pid", "--gain", "low"],
}


@examples(100)
@given(
    start=st.sampled_from(
        [[], ["sweep"], ["claims"], ["figures"], *([name, *words] for name, words in BEGIN.items())]
    ),
    words=st.lists(
        st.sampled_from(PIECES) | st.sampled_from(SPOILT + ODD) | WORD | WORD.map("--{}".format),
        max_size=6,
    ),
    encoding=st.sampled_from(["utf-8", "ascii"]),
)
def test_random_words_get_no_traceback_and_leave_no_file(asked, start, words, encoding):
    if say([*start, *words], encoding).status == 2:
        assert not os.listdir()
    for made in Path().iterdir():
        shutil.rmtree(made) if made.is_dir() else made.unlink()


@examples(100)
@given(
    values=st.fixed_dictionaries(
        {"friction": NUMBER, "stiction": NUMBER, "noise": NUMBER, "seeds": NUMBER, "epochs": NUMBER}
    ),
    given_names=st.sets(
        st.sampled_from(["friction", "stiction", "noise", "seeds", "epochs"]), max_size=2
    ),
    source=st.none() | st.sampled_from([*SOURCES, "both", ""]),
    executions=st.none() | st.sampled_from(["1", "3", "0", "-1", "x", "10001"]),
)
def test_a_simulation_runs_or_is_refused_without_a_trace(
    asked, values, given_names, source, executions
):
    words = [
        word
        for name in given_names
        for word in (f"--{name.replace('seeds', 'seed')}", values[name])
    ]
    words += [] if source is None else ["--source", source]
    words += [] if executions is None else ["--executions", executions]
    said = say(["simulate", *BEGIN["simulate"], *words])
    right = source in (None, *SOURCES) and all(
        numbers(name, [values[name]]) for name in given_names
    )
    right &= executions is None or (source is not None and executions in ("1", "3"))
    assert said.status == (0 if right else 2), said.err
    assert os.listdir() == (["t.npz"] if right else [])
    if right:
        shape = (1000, 2) if source is None else (int(executions or 20), 1000, 2)
        with np.load("t.npz") as trace:
            assert trace["draws"].shape == shape
        os.unlink("t.npz")


class Bomb:
    """Unpickling it makes a folder."""

    def __reduce__(self):
        return os.mkdir, ("unpickled",)


def saved(array) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


DRAWS = saved(np.zeros((1000, 2)))
MAGIC = [
    b"",
    b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': ",
    b"\x93NUMPY\x02\x00",
    b"PK\x03\x04",
]
MAGIC += [b"\x89HDF\r\n\x1a\n", b"CDF\x01", b"PK\x05\x06" + bytes(18), DRAWS[:60]]
SIMULATE = ["simulate", *BEGIN["simulate"], "--standard-normal", "../z.npy"]


@h5netcdf_may_stumble
@examples(80)
@given(
    begin=st.sampled_from(MAGIC) | st.integers(0, len(DRAWS) - 300).map(lambda size: DRAWS[:size]),
    rest=st.binary(max_size=200),
)
def test_a_broken_file_is_refused_by_every_command_that_reads_one(asked, begin, rest):
    Path("../z.npy").write_bytes(begin + rest)
    for words in (SIMULATE, ["claims", "../z.npy"], ["figures", "../z.npy", "--out", "figs"]):
        assert say(words).status == 2
    assert not os.listdir()


@examples(120)
@given(
    dtype=st.sampled_from(["f2", "f4", ">f8", "g"])
    | st.sampled_from(["i8", "c16", "U3", "?", "M8[s]", "f8,f8", "S2"]),
    shape=st.just((1000, 2))
    | st.sampled_from([(1, 1000, 2), (2, 1000, 2), (2, 1000), (999, 2), (2000,), (0, 2), ()]),
    odd=st.just(0) | st.sampled_from([np.nan, np.inf, np.longdouble("1e4000")]),
    order=st.sampled_from("CF"),
)
@example(dtype="g", shape=(1000, 2), odd=np.longdouble("1e4000"), order="C")
def test_draws_are_taken_where_they_are_finite_floats_of_the_right_shape(
    asked, dtype, shape, odd, order
):
    draws = np.zeros(shape, dtype, order)
    if draws.dtype.kind == "f" and draws.size:
        with np.errstate(over="ignore"):
            draws[()] = odd
    Path("../z.npy").write_bytes(saved(draws))
    right = draws.dtype.kind == "f" and shape in ((1000, 2), (1, 1000, 2)) and odd == 0
    assert say(SIMULATE).status == (0 if right else 2)
    assert os.listdir() == (["t.npz"] if right else [])
    Path("t.npz").unlink(missing_ok=True)


@pytest.mark.parametrize(
    "write",
    [
        lambda f, x: f.write(pickle.dumps(x)),
        lambda f, x: np.save(f, np.array([x])),
        lambda f, x: np.savez(f, x),
    ],
)
def test_a_pickle_is_refused_and_not_opened(asked, write):
    with Path("../z.npy").open("wb") as file:
        write(file, Bomb())
    for words in (SIMULATE, ["claims", "../z.npy"]):
        assert say(words).status == 2
    assert not os.listdir()
