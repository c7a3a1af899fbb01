"""Sweeps of any function: what is computed, kept and refused.

Progress without a terminal, and pools.
"""

import importlib.util
import json
import subprocess
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.errors import ConfigurationError, StoreError
from jaxidl.jobs import Variable, geometric, read, sweep
from jaxidl.jobs import progress as progressing
from jaxidl.jobs.pieces import Pieces, set_aside
from jaxidl.jobs.pool import each
from jaxidl.jobs.store import Store
from tests.helpers.paths import ROOT

EXAMPLE = ROOT / "experiments" / "own_sweep.py"


def product(*, a, b, power=2):
    """A run of two numbers. One of them is a Python number where it is static."""
    return {"value": a * jnp.arange(3.0) ** power, "sum": a + b, "fits": b > 1.0}


def test_a_run_is_a_function_of_its_point(tmp_path):
    data = sweep(
        product,
        {"b": (1.0, 2.0), "power": (1, 3), "a": (10, 20, 30)},
        tmp_path / "r.nc",
        static=("power",),
        quiet=True,
    )
    assert dict(data.sizes) == {"b": 2, "power": 2, "a": 3, "value_0": 3}
    np.testing.assert_array_equal(data["value"].sel(a=20, power=3, b=1.0), [0.0, 20.0, 160.0])
    np.testing.assert_array_equal(
        data["sum"].sel(power=1).transpose("a", "b"), [[11, 12], [21, 22], [31, 32]]
    )
    assert data["fits"].dtype == bool
    assert data.attrs["programs"] == "2"
    assert read(tmp_path / "r.nc").identical(data)


def test_only_what_is_new_is_computed(tmp_path, computed):
    axes = {"a": (1.0, 2.0), "b": (0.0,)}
    first = sweep(
        product, axes, tmp_path / "r.nc", settings={"version": 1, "kind": "a"}, quiet=True
    )
    computed.clear()
    more = sweep(
        product,
        axes | {"a": (3.0, 1.0, 2.0)},
        tmp_path / "r.nc",
        settings={"kind": "a", "version": 1},  # in whatever order
        quiet=True,
    )
    assert {dict(at)["a"] for at in computed[1:]} == {3.0}  # the first one is a trial of shapes
    assert more.sel(a=[1.0, 2.0]).equals(first)
    with pytest.raises(StoreError, match=r"version \(1 there, 2 here\)"):
        sweep(product, axes, tmp_path / "r.nc", settings={"version": 2, "kind": "a"}, quiet=True)
    with pytest.raises(StoreError, match="leave out"):
        sweep(product, axes, tmp_path / "r.nc", settings={"version": 1, "kind": "a"}, quiet=True)


def test_texts_are_static_unless_the_host_makes_numbers_of_them(tmp_path):
    def named(*, name, scale):
        return {"length": jnp.asarray(float(len(name)) * scale)}

    def indexed(*, name, scale, draw):
        return {"length": name * scale + draw}

    axes = {"name": ("ab", "c"), "scale": (1.0, 10.0)}
    data = sweep(named, axes, tmp_path / "a.nc", quiet=True)
    assert data.attrs["programs"] == "2"
    np.testing.assert_array_equal(data["length"], [[2.0, 20.0], [1.0, 10.0]])
    given = lambda at: {"name": np.float64(len(at["name"])), "draw": 0.5}
    data = sweep(indexed, axes, tmp_path / "b.nc", inputs=given, quiet=True)
    assert data.attrs["programs"] == "1"
    np.testing.assert_array_equal(data["length"], [[2.5, 20.5], [1.5, 10.5]])


def test_points_that_are_alike_are_computed_once(tmp_path, computed):
    data = sweep(
        product,
        {"a": (1.0, 2.0), "b": (0.0, 5.0)},
        tmp_path / "r.nc",
        variables={
            "value": Variable(("k",), "m", "a line"),
            "sum": Variable(),
            "fits": Variable(),
        },
        alike=lambda at: {**at, "b": 0.0} if at["a"] == 1.0 else at,
        quiet=True,
    )
    assert (("a", 1.0), ("b", 5.0)) not in computed
    np.testing.assert_array_equal(data["value"].sel(a=1.0, b=5.0), data["value"].sel(a=1.0, b=0.0))
    assert set(data.data_vars) == {"value", "sum", "fits"}
    assert (data["value"].attrs["units"], data["value"].dims) == ("m", ("a", "b", "k"))


@pytest.mark.parametrize(
    ("axes", "more", "complaint"),
    [
        ({"a": (1.0,), "b": ()}, {}, "at least one value for b"),
        ({"a": (1.0, 1.0), "b": (1.0,)}, {}, "each value of a once"),
        ({"a": (1.0,), "b": (True,)}, {}, "texts or numbers on axis b"),
        ({"a": (1.0,)}, {}, "an axis for the argument b"),
        (
            {"a": (1.0,), "b": (1.0,), "c": (1.0,)},
            {},
            "axes that are arguments of the function; got c",
        ),
        ({"a": (1.0,), "b": (1.0,)}, {"static": ("d",)}, "static axes among the axes; got d"),
        (
            {"a": (1.0,), "b": (1.0,)},
            {"variables": {"origin": Variable()}},
            "names for axes and variables; got origin",
        ),
        ({"a": (1.0,), "b": (1.0,)}, {"width": 0}, "--width between 1"),
        ({"a": (1.0,), "b": (1.0,)}, {"devices": 1, "cluster": "local"}, "--devices or --cluster"),
    ],
)
def test_what_does_not_fit_is_refused_before_anything_is_written(tmp_path, axes, more, complaint):
    with pytest.raises(ConfigurationError, match=complaint):
        sweep(product, axes, tmp_path / "r.nc", quiet=True, **more)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("returned", [lambda x: x, lambda x: {"x": {"y": x}}])
def test_a_run_that_returns_no_mapping_of_arrays_is_refused(tmp_path, returned):
    with pytest.raises(ConfigurationError, match="mapping of names to arrays"):
        sweep(lambda x: returned(x), {"x": [1.0, 2.0]}, tmp_path / "r.nc", quiet=True)
    assert not list(tmp_path.iterdir())


def test_the_example_runs_stops_and_continues(tmp_path, monkeypatch):
    spec = importlib.util.spec_from_file_location("own_sweep", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    monkeypatch.setattr(example, "STEPS", 100)
    axes = example.AXES | {"seed": (1, 2)}
    whole = sweep(example.run_one, axes, tmp_path / "whole.nc", quiet=True)
    with monkeypatch.context() as patch:
        waits = iter(range(2))
        patch.setattr(
            "jaxidl.jobs.sweeping.wait",
            lambda x: jax.block_until_ready(x) if next(waits) < 1 else _stop(),
        )
        with pytest.raises(KeyboardInterrupt):
            sweep(example.run_one, axes, tmp_path / "cut.nc", quiet=True)
    assert len(list((tmp_path / "cut.nc.parts").glob("*.npz"))) == 1
    again = sweep(example.run_one, axes, tmp_path / "cut.nc", quiet=True)
    assert again.drop_attrs().identical(whole.drop_attrs())
    # more friction, further off the path
    assert (again["error"].sel(friction=[1.0, 10.0, 100.0]).diff("friction") > 0.0).all()
    assert json.loads(again.attrs["origins"])


def _stop():
    raise KeyboardInterrupt


def test_a_part_of_runs_that_the_file_holds_goes_without_a_word(tmp_path, monkeypatch, capsys):
    """A process can be killed between writing the file and removing its parts."""
    path, kept = tmp_path / "r.nc", {}
    original = Store.finish

    def finish(self, *args):
        kept.update({part: part.read_bytes() for part in self.parts.glob("*.npz")})
        return original(self, *args)

    monkeypatch.setattr(Store, "finish", finish)
    sweep(product, {"a": (1.0, 2.0), "b": (0.0,)}, path, quiet=True)
    (part,) = kept
    assert not part.exists()
    part.parent.mkdir(exist_ok=True)
    part.write_bytes(kept[part])
    data = sweep(product, {"a": (1.0, 2.0, 3.0), "b": (0.0,)}, path, quiet=True)
    np.testing.assert_array_equal(data["a"], [1.0, 2.0, 3.0])
    assert "damaged" not in capsys.readouterr().err
    assert not part.exists()


def test_a_folder_of_results_is_set_aside_and_nothing_else_is(tmp_path):
    folder, old = tmp_path / "out", tmp_path / "out.old"
    for text in ("first", "second"):
        folder.mkdir()
        (folder / "root.json").write_text(text)
        set_aside(folder, ("root.json", "parts"))
        assert not folder.exists()
        assert (old / "root.json").read_text() == text
    set_aside(folder, ("root.json",))  # nothing there
    folder.mkdir()
    (folder / "letter.txt").write_text("mine")
    with pytest.raises(StoreError, match="something else"):
        set_aside(folder, ("root.json",))
    with Pieces(folder / "parts", {}), pytest.raises(StoreError, match="another process"):
        set_aside(folder, ("parts",))
    assert (folder / "letter.txt").read_text() == "mine"


def test_without_a_terminal_a_line_a_minute_says_how_far_it_is(capsys, monkeypatch):
    clock = iter(np.arange(0.0, 1000.0, 25.0))
    monkeypatch.setattr(progressing.time, "monotonic", lambda: next(clock))
    with progressing.Bar("runs", 10.0) as bar:
        for k in range(6):
            bar.advance(1.0, f"{k + 1}/10")
    said = [line for line in capsys.readouterr().err.splitlines() if "runs" in line and "%" in line]
    assert any(line.startswith("runs 3/10 30%") for line in said), said


def touch(path: Path) -> None:
    path.write_text("done")


def fail(path: Path) -> None:
    raise StoreError("to write", "nothing", "try again")


def test_a_pool_does_every_item_and_an_error_ends_it(tmp_path):
    each(touch, [tmp_path / "a", tmp_path / "b"], 2, "files")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
    with pytest.raises(StoreError, match="nothing"):
        each(fail, [tmp_path / "c"], 1, "files")


BEATS = """
import sys, time
from pathlib import Path
from jaxidl.jobs.pool import each
def beat(path):
    while True:
        path.write_text(str(time.monotonic()))
        time.sleep(0.02)
if __name__ == "__main__":
    each(beat, [Path(sys.argv[1])], 1, "beats")
"""


def test_no_process_of_a_pool_outlives_the_program(tmp_path):
    script, beats = tmp_path / "beats.py", tmp_path / "beats"
    script.write_text(BEATS)
    with subprocess.Popen([sys.executable, script, beats], stderr=subprocess.DEVNULL) as program:
        try:
            assert soon(beats.exists)
        finally:
            program.kill()

    def stopped():
        last = beats.read_text()
        time.sleep(0.5)
        return beats.read_text() == last

    assert soon(stopped)


def soon(what, seconds=60.0):
    """Whether something is true before so many seconds have passed."""
    end = time.monotonic() + seconds
    while not (true := what()) and time.monotonic() < end:
        time.sleep(0.02)
    return true


def test_one_statistic_for_all_intervals():
    mean = geometric(np.array([1.0, 2.0, 4.0, np.nan]))
    assert mean is not None
    assert mean.value == pytest.approx(2.0)
    assert mean.seeds == 3
    half = 4.302653 * np.log(2.0) / np.sqrt(3.0)  # Student's t of two degrees of freedom
    assert mean.interval == pytest.approx((2.0 * np.exp(-half), 2.0 * np.exp(half)))
    assert geometric(np.array([3.0])).interval is None
    assert geometric(np.array([np.nan])) is None


@pytest.mark.parametrize(
    ("variables", "complaint"),
    [
        ({"value": Variable(("place",))}, "all that a run returns"),
        ({"value": Variable(), "sum": Variable(), "fits": Variable()}, "1 dims for value"),
    ],
)
def test_variables_that_are_not_those_of_a_run_end_it_at_the_first_chunk(
    tmp_path, variables, complaint
):
    with pytest.raises(ConfigurationError, match=complaint):
        sweep(
            product, {"a": (1.0,), "b": (2.0,)}, tmp_path / "r.nc", variables=variables, quiet=True
        )
    assert not (tmp_path / "r.nc").exists()
