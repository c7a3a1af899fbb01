"""Many configurations: independence of how they are run, resumption, damage, divergence."""

import errno
import io
import json
import os
import textwrap
from dataclasses import replace

import jax
import numpy as np
import pytest
from filelock import FileLock

from jaxidl.errors import ConfigurationError, StoreError
from jaxidl.jobs import store, sweeping
from jaxidl.jobs.points import points
from jaxidl.jobs.programs import chunks, program
from jaxidl.learning.iterate import Metrics
from jaxidl.paper.example import example, example_point
from jaxidl.paper.grid import NOISE_LEVELS, Grid
from jaxidl.paper.runs import LearningRun, read_results, run_sweep
from jaxidl.paper.study import PaperStudy
from tests.helpers.process import python
from tests.helpers.studies import SMALL_STUDY

SMALL = Grid(
    controllers=("pid",),
    noise=(1e-4, 8e-4),
    friction=(5.0,),
    stiction=(5.0,),
    epochs=(1,),
    seeds=(1, 2),
    sources=("joint",),
    executions=3,
)  # 8 runs


pytestmark = pytest.mark.usefixtures("emitters_of_users")


@pytest.fixture(autouse=True)
def one_example(monkeypatch, examples):
    """The example run in each results file is computed once for all tests."""

    def kept(run, grid):
        key = run, grid.executions, *example_point(grid).values()
        if key not in examples:
            examples[key] = example(run, grid)
        return examples[key].copy(deep=True)

    monkeypatch.setattr("jaxidl.paper.runs.example", kept)


@pytest.fixture(scope="module")
def examples():
    return {}


def run(path, study, grid=SMALL, **options):
    return run_sweep(grid, path, study, quiet=True, **options)


def assert_same(a, b, rtol=0.0):
    for name in Metrics._fields:
        np.testing.assert_allclose(a[name].values, b[name].values, rtol=rtol, err_msg=name)


def test_the_default_grid_is_the_papers():
    grid = Grid()
    assert len(grid) == 1280 * 3 == len(set(points(grid.dims())))
    seeds = [dict(at)["seed"] for at in points(grid.dims())]
    assert seeds == sorted(seeds)  # whole seeds come first


def test_printed_noise_levels_are_a_named_alternative():
    assert NOISE_LEVELS["program"] != NOISE_LEVELS["printed"] == (1e-4, 5e-4, 7e-3, 8e-3)


@pytest.mark.parametrize(
    ("axis", "values", "complaint"),
    [
        ("controllers", ("pdi",), "one of pid, doomed"),
        ("sources", ("both",), "one of indirect, direct, joint"),
        ("noise", (-1e-4,), "noise"),
        ("noise", (float("nan"),), "nan"),
        ("friction", (99.0,), "friction"),
        ("seeds", (), "at least one value for seeds"),
        ("seeds", (1, 1), "once"),
        ("seeds", (-1,), "seeds between 0"),
        ("epochs", (0,), "epochs between 1"),
        ("executions", 0, "executions between 1"),
    ],
)
def test_impossible_grids_are_refused(axis, values, complaint):
    with pytest.raises(ConfigurationError, match=complaint):
        replace(SMALL, **{axis: values})


def test_chunks_hold_one_kind_cover_every_run_once_and_keep_one_size_per_kind():
    grid = replace(
        SMALL, controllers=("pid", "doomed"), sources=("joint", "direct"), seeds=(1, 2, 3)
    )
    job = LearningRun(PaperStudy(), 3).job()
    found = list(chunks(list(points(grid.dims())), job, devices=2, per_device=2))
    assert sorted(at for chunk in found for at in chunk.points) == sorted(points(grid.dims()))
    for chunk in found:
        assert set(map(job.kind, chunk.points)) == {chunk.kind}
        assert len(chunk.padded()) == chunk.size
    assert len({(chunk.kind, chunk.size) for chunk in found}) == 4


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The uninterrupted sweep, and where it lies."""
    path = tmp_path_factory.mktemp("sweep") / "whole.nc"
    return run(path, SMALL_STUDY), path, SMALL_STUDY


@pytest.mark.parametrize("per_device", [1, 3])
def test_results_do_not_depend_on_chunks(whole, tmp_path, per_device):
    data, _, study = whole
    assert_same(data, run(tmp_path / "other.nc", study, per_device=per_device))


@pytest.mark.parametrize("per_device", [1, 8])
def test_results_do_not_depend_on_devices(whole, tmp_path, per_device):
    """XLA may sum an average in another order when there is one device; what is averaged is the
    same bit for bit.
    """
    data, _, study = whole
    assert_same(
        data, run(tmp_path / "other.nc", study, devices=1, per_device=per_device), rtol=1e-14
    )


def test_results_do_not_depend_on_the_grid_around_them_or_its_order(whole, tmp_path):
    data, _, study = whole
    other = run(
        tmp_path / "part.nc",
        study,
        replace(SMALL, noise=(8e-4,), seeds=(2, 1), gains=("high", "low")),
    )
    assert_same(data.sel(noise=[8e-4], seed=[2, 1], gain=["high", "low"]), other)


@pytest.mark.slow
def test_runs_side_by_side_agree_to_rounding(whole, tmp_path):
    """A wider program rounds differently, and training amplifies it: equal before training, close
    after little of it.
    """
    data, _, study = whole
    wide = run(tmp_path / "wide.nc", study, width=4)
    np.testing.assert_allclose(wide.q_error[..., 0], data.q_error[..., 0], rtol=1e-12)
    np.testing.assert_allclose(wide.q_error, data.q_error, rtol=1e-2, atol=1e-5)


def test_a_traced_run_is_the_grids_run(whole):
    data, _, study = whole
    at = dict(next(points(SMALL.dims())))
    with jax.enable_x64(True):
        metrics, _ = LearningRun(study, SMALL.executions).trace(at)
    row = data.q_error.sel(at)
    # another program: other rounding
    np.testing.assert_allclose(metrics.q_error, row, rtol=1e-2, atol=1e-5)


@pytest.mark.slow
def test_a_grid_compiles_once_per_kind(tmp_path, small_study):
    """Noise, friction, stiction, gains and seeds are traced; only controller, source and epochs
    make programs.
    """
    study = replace(small_study, target=(0.9, 0.9))  # nobody else's program
    grid = replace(SMALL, controllers=("pid", "doomed"), friction=(5.0, 8.0), seeds=(1, 2, 3))
    compiled = []
    before = program.cache_info().misses
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, _, **about: (
            compiled.append(about.get("fun_name"))
            if event.endswith("backend_compile_duration")
            else None
        )
    )
    try:
        run(tmp_path / "a.nc", study, grid, per_device=2)
    finally:
        jax.monitoring.clear_event_listeners()
    assert program.cache_info().misses - before == 2
    assert sum("share" in str(name) for name in compiled) == 2


def interrupted_after(monkeypatch, count):
    calls = iter(range(count + 1))
    original = sweeping.wait

    def wait(metrics):
        if next(calls) == count:
            raise KeyboardInterrupt
        return original(metrics)

    monkeypatch.setattr(sweeping, "wait", wait)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_an_interrupted_sweep_continues_without_losing_or_repeating(
    whole, tmp_path, monkeypatch, count
):
    data, _, study = whole
    path = tmp_path / "r.nc"
    with monkeypatch.context() as patch:
        interrupted_after(patch, count)
        with pytest.raises(KeyboardInterrupt):
            run(path, study, per_device=1)  # 4 chunks of 2
    assert not path.exists()
    assert len(list((tmp_path / "r.nc.parts").glob("*.npz"))) == count
    waits = []
    original = sweeping.wait
    monkeypatch.setattr(sweeping, "wait", lambda metrics: waits.append(1) or original(metrics))
    assert_same(data, run(path, study, per_device=2))  # another chunk size, too
    assert len(waits) == -(-(8 - 2 * count) // 4)
    assert not (tmp_path / "r.nc.parts").exists()


@pytest.mark.parametrize("where", ["example", "write_bytes"])
def test_an_extension_stopped_at_the_very_end_is_not_forgotten(whole, tmp_path, monkeypatch, where):
    """All runs are done, but the old file has not been replaced yet: the next call must do that,
    and nothing else.
    """
    _, path, study = whole
    own = tmp_path / "own.nc"
    own.write_bytes(path.read_bytes())
    more = replace(SMALL, seeds=(1, 2, 3))
    with monkeypatch.context() as patch:
        if where == "example":
            patch.setattr(
                "jaxidl.paper.runs.example", lambda *a: (_ for _ in ()).throw(KeyboardInterrupt)
            )
        else:
            real = store.write_bytes
            patch.setattr(
                store, "write_bytes", lambda p, c: _full_disk() if p == own else real(p, c)
            )
        with pytest.raises(KeyboardInterrupt if where == "example" else StoreError):
            run(own, study, more)
    assert own.read_bytes() == path.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(sweeping._Task, "here", lambda *a: pytest.fail("nothing was missing"))
        assert run(own, study, more).seed.values.tolist() == [1, 2, 3]
    assert read_results(own).seed.values.tolist() == [1, 2, 3]


def _full_disk():
    raise StoreError("to write", "no space left on device", "make room")


def test_a_full_disk_at_the_end_of_a_sweep_leaves_the_old_result_and_no_litter(
    whole, tmp_path, monkeypatch
):
    _, path, study = whole
    own = tmp_path / "own.nc"
    own.write_bytes(path.read_bytes())
    real = os.fsync

    def fsync(number):
        if os.fstat(number).st_size > 20_000:  # parts still fit, the results do not
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(number)

    monkeypatch.setattr("jaxidl.files.os.fsync", fsync)
    with pytest.raises(StoreError, match="no space left"):
        run(own, study, replace(SMALL, seeds=(1, 2, 3)))
    assert own.read_bytes() == path.read_bytes()
    assert {p.name for p in tmp_path.iterdir()} == {"own.nc", "own.nc.parts"}
    assert not list((tmp_path / "own.nc.parts").glob(".*"))


def test_time_and_origin_add_up_over_interruptions(whole, tmp_path, monkeypatch):
    _, _, study = whole
    with monkeypatch.context() as patch:
        interrupted_after(patch, 2)
        with pytest.raises(KeyboardInterrupt):
            run(tmp_path / "r.nc", study, per_device=1)
    kept = [
        json.loads(str(np.load(part)["origin"])) for part in (tmp_path / "r.nc.parts").glob("*.npz")
    ]
    data = run(tmp_path / "r.nc", study, per_device=1)
    assert len(kept) == 2
    assert json.loads(data.attrs["origins"])[0][2] > sum(seconds for _, _, seconds in kept) > 0
    (origin,) = json.loads(data.attrs["origins"])
    assert origin[:2] == kept[0][:2] == [data.attrs["git_revision"], data.attrs["device"]]
    again = run(tmp_path / "r.nc", study, replace(SMALL, seeds=(1, 2, 3)))
    assert json.loads(again.attrs["origins"])[0][2] > json.loads(data.attrs["origins"])[0][2]


def test_a_finished_file_is_returned_as_it_is_and_can_be_extended(
    whole, tmp_path, monkeypatch, computed
):
    data, path, study = whole
    own = tmp_path / "own.nc"
    own.write_bytes(path.read_bytes())
    with monkeypatch.context() as patch:
        patch.setattr(sweeping._Task, "here", lambda *a: pytest.fail("nothing was missing"))
        assert_same(data, run(own, study))
    assert own.read_bytes() == path.read_bytes()
    more = run(own, study, replace(SMALL, seeds=(1, 2, 3)))
    assert {dict(at)["seed"] for at in computed} == {3}
    assert_same(data, more.sel(seed=[1, 2]))


@pytest.mark.parametrize("change", [{"true_mass": 4.0}, {"train_on": "sensed_state"}])
def test_another_studys_file_is_never_mixed_in(whole, tmp_path, change):
    _, path, study = whole
    own = tmp_path / "own.nc"
    own.write_bytes(path.read_bytes())
    with pytest.raises(StoreError, match=next(iter(change))):
        run(own, replace(study, **change))
    assert own.read_bytes() == path.read_bytes()


def test_a_grid_that_would_drop_finished_runs_is_refused(whole, tmp_path):
    _, path, study = whole
    own = tmp_path / "own.nc"
    own.write_bytes(path.read_bytes())
    with pytest.raises(StoreError, match="leave out"):
        run(own, study, replace(SMALL, seeds=(1,)))
    assert own.read_bytes() == path.read_bytes()


def test_parts_of_another_study_are_refused(tmp_path, small_study, monkeypatch):
    with monkeypatch.context() as patch:
        interrupted_after(patch, 1)
        with pytest.raises(KeyboardInterrupt):
            run(tmp_path / "r.nc", small_study, per_device=1)
    with pytest.raises(StoreError, match="true_mass"):
        run(tmp_path / "r.nc", replace(small_study, true_mass=4.0))


def cut(content):
    return content[: len(content) // 2]


def flip(content):
    """One bit of a number."""
    numbers = np.load(io.BytesIO(content))["q_error"].tobytes()
    place = content.index(numbers) + len(numbers) // 2
    return content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :]


@pytest.mark.parametrize("per_device", [1, 2])  # the new part may have the damaged one's name
@pytest.mark.parametrize("harm", [cut, flip, lambda content: b""], ids=["cut", "flipped", "empty"])
def test_a_damaged_part_is_named_and_computed_again(
    whole, tmp_path, monkeypatch, capsys, harm, per_device
):
    data, _, study = whole
    with monkeypatch.context() as patch:
        interrupted_after(patch, 2)
        with pytest.raises(KeyboardInterrupt):
            run(tmp_path / "r.nc", study, per_device=1)
    part = sorted((tmp_path / "r.nc.parts").glob("*.npz"))[0]
    part.write_bytes(harm(part.read_bytes()))
    assert_same(data, run(tmp_path / "r.nc", study, per_device=per_device))
    assert part.name in capsys.readouterr().err


@pytest.mark.parametrize(
    "content", [b"", b"not a results file", None], ids=["empty", "text", "cut"]
)
def test_an_unreadable_result_is_refused_and_left_alone(whole, tmp_path, content):
    _, path, study = whole
    bad = tmp_path / "bad.nc"
    bad.write_bytes(cut(path.read_bytes()) if content is None else content)
    before = bad.read_bytes()
    with pytest.raises(StoreError, match="unreadable"):
        run(bad, study)
    assert bad.read_bytes() == before
    run(bad, study, overwrite=True)
    assert read_results(bad).sizes["seed"] == 2
    assert (tmp_path / "bad.nc.old").read_bytes() == before


def test_a_foreign_netcdf_is_refused(tmp_path):
    import xarray as xr

    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "f.nc", engine="h5netcdf")
    with pytest.raises(StoreError, match="a file without q_error"):
        read_results(tmp_path / "f.nc")


@pytest.mark.parametrize("harm", [{"identity": "none"}, {"origins": "]"}])
def test_a_file_whose_attributes_were_tampered_with_is_refused(whole, tmp_path, harm):
    data, _, _ = whole
    data.assign_attrs(harm).to_netcdf(tmp_path / "f.nc", engine="h5netcdf")
    with pytest.raises(StoreError, match=next(iter(harm))):
        read_results(tmp_path / "f.nc")


def test_two_sweeps_on_one_file_do_not_meet(tmp_path, small_study):
    (tmp_path / "r.nc.parts").mkdir()
    with (
        FileLock(tmp_path / "r.nc.parts" / "lock"),
        pytest.raises(StoreError, match="another process"),
    ):
        run(tmp_path / "r.nc", small_study)


def test_a_divergent_configuration_is_flagged_and_stops_nobody(tmp_path, small_study, monkeypatch):
    """A friction beyond all bounds overflows; friction 5 beside it, in the same chunk, does not
    notice.
    """
    monkeypatch.setattr("jaxidl.paper.grid.check_levels", lambda *levels: None)
    moving = replace(SMALL, stiction=(0.0,))  # where nothing sticks, all friction is felt
    alone = run(tmp_path / "alone.nc", small_study, moving)
    both = run(
        tmp_path / "both.nc", small_study, replace(moving, gains=("high",), friction=(5.0, 800.0))
    )
    assert not both.finite.sel(friction=800.0).any()
    assert bool(both.finite.sel(friction=5.0)[..., 0].all())
    assert_same(alone.sel(gain=["high"]), both.sel(friction=[5.0]))


def test_results_carry_units_and_where_they_came_from(whole):
    _, path, _ = whole
    stored = read_results(path)
    assert stored.q_error.dims == (
        "controller",
        "gain",
        "noise",
        "friction",
        "stiction",
        "epochs",
        "seed",
        "source",
        "iteration",
    )
    units = {
        name: stored[name].attrs["units"]
        for name in ("q_error", "feedback_applied", "qdd_error", "torque", "finite", "noise")
    }
    assert units == {
        "q_error": "m",
        "feedback_applied": "N",
        "qdd_error": "m s-2",
        "torque": "N",
        "finite": "1",
        "noise": "m",
    }
    for name in (
        "versions",
        "command",
        "git_revision",
        "precision",
        "device",
        "seconds",
        "identity",
        "created",
    ):
        assert stored.attrs[name], name
    assert json.loads(stored.attrs["identity"])["study"]["true_mass"] == 5.0
    assert "/" not in stored.attrs["command"]


FULL_DISK = """
    import resource, signal, sys
    from pathlib import Path
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    # no file can grow beyond this, as on a full disk
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))
    from jaxidl.cli import main
    sys.exit(main(["simulate", "--out", sys.argv[1], "--controller", "pid", "--gain", "low"]))
"""


def test_a_full_disk_ends_in_one_line_and_leaves_the_old_file(tmp_path):
    out = tmp_path / "t.npz"
    out.write_bytes(b"old")
    done = python("-c", textwrap.dedent(FULL_DISK), out, JAX_COMPILATION_CACHE_DIR="")
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "file too large" in done.stderr
    assert out.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["t.npz"]


def test_what_a_killed_process_left_half_written_is_cleared_away(whole, tmp_path):
    _, path, study = whole
    own = tmp_path / "r[1].nc"
    own.write_bytes(path.read_bytes())
    (tmp_path / "r[1].nc.parts").mkdir()
    (tmp_path / ".r[1].nc.0123.tmp").write_bytes(b"half of the results")
    (tmp_path / "r[1].nc.parts" / ".0a.npz.4567.tmp").write_bytes(b"half of a part")
    (tmp_path / ".r1.nc.0123.tmp").write_bytes(b"another file's")
    run(own, study)
    assert sorted(os.listdir(tmp_path)) == [".r1.nc.0123.tmp", "r[1].nc"]
