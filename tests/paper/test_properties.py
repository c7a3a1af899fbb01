"""Whatever is configured is refused or means one thing; what is stored comes back bit for bit, or
its damage is noticed.
"""

import inspect
import json
import math
import os
import tempfile
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from jaxidl.errors import ConfigurationError, StoreError
from jaxidl.jobs.points import Point, axes_of, point, points
from jaxidl.jobs.results import Origin
from jaxidl.jobs.store import Store
from jaxidl.learning.iterate import Metrics
from jaxidl.learning.sources import TRAIN_ON
from jaxidl.models import ErrorModel, Training
from jaxidl.paper.grid import AXES, Grid
from jaxidl.paper.runs import META, read_results, run_sweep, settings_of
from jaxidl.paper.study import PaperStudy
from tests.helpers.properties import COUNTS, FLOATS, NAMES, examples, h5netcdf_may_stumble

STUDY = PaperStudy(steps=20, error_model=ErrorModel(layers=(4, 1)), training=Training(batch=8))
IDENTITY = {"study": "any", "größe": [1, 2.5, None]}
TEXT = st.text(max_size=5)
LEVEL = st.floats(allow_nan=False, allow_infinity=False)
COUNT = st.integers(-(2**62), 2**62)
VALUES = (TEXT, TEXT, LEVEL, LEVEL, LEVEL, COUNT, COUNT, TEXT)
POINT = st.tuples(*VALUES).map(lambda values: tuple(sorted(zip(AXES, values, strict=True))))
LABELS = st.lists(POINT, min_size=1, max_size=4, unique=True)
CUT = 8
PLACE, BIT = st.integers(0, 2**20), st.integers(0, CUT)
Runs = dict[Point, dict[str, np.ndarray]]


ANY = (
    st.floats()
    | st.integers()
    | st.sampled_from([5, 5.0, True, -0.0, np.int64(3), np.float32(0.5), 10**400, None, "5", 1j])
)


def as_given(cls, **values):
    """The configuration from values at which no type checker has looked."""
    configuration = object.__new__(cls)
    inspect.unwrap(cls.__init__)(configuration, **values)
    return configuration


@st.composite
def axes(draw) -> dict:
    """Keywords of a Grid, mostly right."""
    found: dict = {
        name: draw(st.lists(st.sampled_from(valid), min_size=1, unique=True))
        for name, valid in NAMES.items()
    }
    if draw(st.booleans()):
        found[draw(st.sampled_from(list(NAMES)))] = draw(
            st.lists(st.sampled_from(["low", "pid", "PID", ""]), max_size=2)
        )
    for name, (low, high) in (FLOATS | COUNTS).items():
        right = (
            st.floats(low, high)
            if name in FLOATS
            else st.integers(low, high) | st.integers(low, 3).map(np.int32)
        )
        found[name] = draw(
            st.lists(right, min_size=1, max_size=3, unique=True) | st.lists(right | ANY, max_size=3)
        )
    return found | {"executions": draw(st.integers(-1, 3) | ANY)}


@examples(150)
@given(keywords=axes())
def test_a_grid_is_refused_or_each_of_its_runs_has_a_label_of_its_own_that_survives_json(keywords):
    try:
        grid = as_given(Grid, **keywords)
    except ConfigurationError:
        return
    labels = list(points(axes_of(grid.dims())))
    assert (
        len(labels)
        == len(set(labels))
        == len(grid)
        == math.prod(len(values) for values in grid.axes().values())
        > 0
    )
    assert [tuple(map(tuple, row)) for row in json.loads(json.dumps(labels))] == labels
    assert type(grid.executions) is int


MEASURES = (
    st.floats(0, exclude_min=True)
    | st.floats()
    | st.integers(-1, 2)
    | st.sampled_from([5e-324, math.inf, math.nan])
)


@examples(200)
@given(
    numbers=st.fixed_dictionaries(
        dict.fromkeys(("true_mass", "modelled_mass", "dt", "torque_limit"), MEASURES)
    ),
    usual=st.sets(
        st.sampled_from(["true_mass", "modelled_mass", "dt", "torque_limit"]), min_size=2
    ),
    steps=st.just(2) | st.integers(-1, 3),
    train_on=st.sampled_from(TRAIN_ON) | st.sampled_from(["", "state", *TRAIN_ON]),
)
def test_a_study_is_refused_or_its_settings_survive_json(numbers, usual, steps, train_on):
    numbers = {name: value for name, value in numbers.items() if name not in usual}
    right = (
        all(math.isfinite(value) and value >= 0 for value in numbers.values())
        and all(value > 0 for name, value in numbers.items() if name != "modelled_mass")
        and steps >= 2
        and train_on in TRAIN_ON
    )
    try:
        study = as_given(PaperStudy, **numbers, steps=steps, train_on=train_on)
    except ConfigurationError:
        assert not right
        return
    assert right
    assert json.loads(json.dumps(settings_of(study))) == settings_of(study)
    longer = as_given(PaperStudy, **numbers, steps=steps + 1, train_on=train_on)
    assert settings_of(longer) != settings_of(study)


@examples(100)
@given(
    training=st.builds(
        Training,
        st.integers(1, 5),
        st.integers(1, 9),
        holdout_every=st.sampled_from([0, 2, 3, 5, 50]),
    ),
    rows=st.integers(0, 60),
)
def test_training_leaves_out_every_so_many_rows_and_looks_at_the_first_and_the_last_step(
    training, rows
):
    every, mask = training.holdout_every, training.train_mask(rows)
    assert np.flatnonzero(~mask).tolist() == (list(range(every + 1, rows, every)) if every else [])
    seen = training.snapshots(rows)
    assert len(seen) == training.steps(rows) == training.epochs * (mask.sum() // training.batch)
    assert len(seen) == 0 or (seen[0] and seen[-1])


def bits(runs: Runs) -> dict:
    """Runs in a form that is equal only bit for bit.

    The text of a label distinguishes 0.0 from -0.0.
    """
    return {
        repr(tuple(label)): {
            name: (np.asarray(value).dtype.str, np.asarray(value).tobytes())
            for name, value in run.items()
        }
        for label, run in runs.items()
    }


def metrics_of(draw, runs: int, executions: int) -> Metrics:
    """Any numbers at all: infinite, NaN of either sign, denormal."""
    shape = (runs, executions)
    columns = {
        name: draw(hnp.arrays(np.float64, shape)) for name in Metrics._fields if name != "finite"
    }
    return Metrics(**columns, finite=draw(hnp.arrays(np.bool_, shape)))


@examples(40)
@given(data=st.data(), labels=LABELS, executions=st.integers(1, 3), cut=st.integers(0, 4))
def test_runs_come_back_bit_for_bit_whatever_they_are_called_and_hold(
    data, labels, executions, cut
):
    metrics = metrics_of(data.draw, len(labels), executions)
    chunks = [piece for piece in (slice(0, cut), slice(cut, None)) if labels[piece]]
    with tempfile.TemporaryDirectory() as folder:
        with Store(Path(folder, "r.nc"), IDENTITY, META) as store:
            for piece in chunks:
                store.add(
                    labels[piece],
                    {name: leaf[piece] for name, leaf in metrics._asdict().items()},
                    Origin("r", "d", 0.1),
                )
            added = bits(store.runs)
        with Store(Path(folder, "r.nc"), IDENTITY, META) as again:
            assert not again.damaged
            assert bits(again.runs) == added
    given_in = {
        label: {name: column[i] for name, column in metrics._asdict().items()}
        for i, label in enumerate(labels)
    }
    assert added == bits(given_in)


@pytest.fixture(scope="module")
def parts(tmp_path_factory) -> tuple[dict[str, bytes], dict, dict[str, set]]:
    """Two sound part files by name, the runs in them, and which part holds which."""
    path = tmp_path_factory.mktemp("parts") / "r.nc"
    random, names = np.random.default_rng(1), {}
    with Store(path, IDENTITY, META) as store:
        for seed in (1, 2):
            labels = [
                point({"gain": gain, "noise": 1e-4, "seed": seed}) for gain in ("low", "high")
            ]
            columns = [random.standard_normal((2, 3)) for _ in range(4)]
            before = set(store.parts.glob("*.npz"))
            store.add(
                labels,
                Metrics(*columns, finite=np.ones((2, 3), bool))._asdict(),
                Origin("r", "d", 0.1),
            )
            (part,) = set(store.parts.glob("*.npz")) - before
            names[part.name] = {repr(tuple(label)) for label in labels}
        return (
            {part.name: part.read_bytes() for part in store.parts.glob("*.npz")},
            bits(store.runs),
            names,
        )


def harmed(content: bytes, place: int, bit: int) -> bytes:
    """One bit flipped, or cut short."""
    place %= len(content)
    return content[:place] + (
        b"" if bit == CUT else bytes([content[place] ^ 1 << bit]) + content[place + 1 :]
    )


@examples(200)
@given(which=st.integers(0, 1), place=PLACE, bit=BIT)
def test_a_flipped_bit_or_a_cut_in_a_part_changes_no_number_without_notice(
    parts, which, place, bit
):
    files, sound, names = parts
    hit = sorted(files)[which]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "r.nc")
        Path(f"{path}.parts").mkdir()
        for name, content in files.items():
            Path(f"{path}.parts", name).write_bytes(
                harmed(content, place, bit) if name == hit else content
            )
        try:
            with Store(path, IDENTITY, META) as store:
                found, damaged = bits(store.runs), [part.name for part in store.damaged]
        except StoreError:
            return
    if damaged:
        assert damaged == [hit]
        assert found == {label: run for label, run in sound.items() if label not in names[hit]}
    else:
        assert found == sound


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> tuple[Path, xr.Dataset]:
    """A finished results file and what is in it."""
    path = tmp_path_factory.mktemp("results") / "r.nc"
    run_sweep(
        grid((1e-4, 8e-4), (5.0,), (5.0,), ("low",), (1, 2)), path, STUDY, per_device=1, quiet=True
    )
    return path, read_results(path)


def grid(noise, friction, stiction, gains, seeds) -> Grid:
    """Of one kind of program: only what is traced varies."""
    return Grid(
        ("pid",),
        tuple(gains),
        tuple(noise),
        tuple(friction),
        tuple(stiction),
        (1,),
        tuple(seeds),
        ("joint",),
        2,
    )


@pytest.mark.slow
@h5netcdf_may_stumble
@examples(50)
@given(place=PLACE, bit=BIT)
def test_a_flipped_bit_or_a_cut_in_the_results_changes_nothing_without_notice(
    results, tmp_path, place, bit
):
    (path, sound), other = results, tmp_path / "other.nc"
    other.write_bytes(harmed(path.read_bytes(), place, bit))
    try:
        found = read_results(other)
    except StoreError:
        return
    assert found.equals(sound)
    assert found.attrs == sound.attrs


def values(strategy, size=2):
    return st.lists(strategy, min_size=1, max_size=size, unique=True)


@pytest.mark.slow
@examples(4)
@given(
    chosen=st.tuples(
        values(st.floats(0, 1) | st.sampled_from([0.0, -0.0, 5e-324, 1.0])),
        values(st.floats(0, 12) | st.sampled_from([0.0, 12.0]), 1),
        values(st.floats(0, 1000) | st.sampled_from([-0.0, 1000.0]), 1),
        values(st.sampled_from(["low", "high"])),
        values(st.integers(0, 2**31) | st.sampled_from([0, 2**31])),
    )
)
def test_a_valid_grid_runs_and_its_results_carry_what_was_asked(chosen):
    asked = grid(*chosen)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "r.nc")
        data = run_sweep(asked, path, STUDY, per_device=1, quiet=True)
        assert os.listdir(folder) == ["r.nc"]
        stored = read_results(path)
        again = run_sweep(asked, path, STUDY, per_device=1, quiet=True)
    for dim, wanted in zip(AXES, asked.axes().values(), strict=True):
        # in the order asked, to the sign of zero
        assert repr(stored[dim].values.tolist()) == repr(list(wanted))
    for name in Metrics._fields:
        assert stored[name].sizes["iteration"] == asked.executions
        assert (
            stored[name].values.tobytes()
            == data[name].values.tobytes()
            == again[name].values.tobytes()
        )
        assert np.isfinite(stored[name].values[stored["finite"].values]).all()
