"""Ablations: any number of the study as one more axis of a sweep."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.cli import main
from jaxidl.cli.ablate import varying
from jaxidl.errors import ConfigurationError, StoreError
from jaxidl.jobs.points import points
from jaxidl.jobs.programs import program
from jaxidl.jobs.results import assemble
from jaxidl.learning.iterate import recall
from jaxidl.paper.ablation import as_markdown, final, rows
from jaxidl.paper.grid import Grid
from jaxidl.paper.runs import META, LearningRun, read_results, run_sweep
from jaxidl.paper.study import PaperStudy
from jaxidl.paper.vary import check, leaves, parsed, traced, varied
from jaxidl.types import Dataset
from tests.helpers.commands import refusal

SMALL = Grid(("pid",), ("high",), (1e-4,), (5.0,), (5.0,), (1,), (1, 2), ("joint",), 3)
ONE = replace(SMALL, seeds=(1,))
pytestmark = pytest.mark.usefixtures("emitters_of_users")


def run(path, study, grid, **options):
    return run_sweep(grid, path, study, quiet=True, **options)


def programs(study, grid):
    """Those of a sweep on two devices, one a kind."""
    run = LearningRun(study, grid.executions)
    return [
        program(run, kind, 2, 1)
        for kind in {run.job(grid.vary).kind(at) for at in points(grid.dims())}
    ]


def test_every_number_of_the_study_has_a_name_and_can_be_replaced_by_itself():
    study = PaperStudy()
    for name, value in leaves(study).items():
        if name == "applied_gain":  # sets low and high alike
            continue
        assert varied(study, {name: parsed(study, name, str(value))}) == study, name
    numbers = jax.tree.leaves(study.to_dict())
    named = leaves(study)
    # layers are one, joints and epochs none
    assert len(numbers) - len(study.error_model.layers) - 2 <= len(named)
    assert {
        "alpha",
        "learner_gain",
        "pid_gains.1.2",
        "training.learning_rate",
        "train_on",
        "kept",
    } <= named.keys()


def test_gains_keep_their_proportions():
    study = PaperStudy()
    learner = varied(study, {"learner_gain": 250.0})
    np.testing.assert_allclose(learner.pid_learner, (250.0, 25.0, 0.005))
    assert learner.doomed_learner == 0.25
    applied = varied(study, {"applied_gain": 100.0})
    np.testing.assert_allclose(applied.pid_gains, ((100.0, 10.0, 0.02), (100.0, 10.0, 0.002)))
    np.testing.assert_allclose(applied.doomed_rates, (0.04, 0.04))
    assert varied(study, {"learner_gain": 500.0}) == study


def test_what_sets_no_size_is_traced():
    study = PaperStudy()
    for name in (
        "alpha",
        "prior_mass",
        "learner_gain",
        "applied_gain",
        "pid_gains.0.1",
        "learning_rate",
        "target.0",
    ):
        assert traced(study, name)
    for name in (
        "layers",
        "kept",
        "steps",
        "dt",
        "batch",
        "train_on",
        "error_model.torque_scale",
        "training.holdout_every",
    ):
        assert not traced(study, name)


VALUES = {
    "alpha": 0.3,
    "prior_mass": 2.0,
    "learner_gain": 100.0,
    "learning_rate": 3e-3,
    "policy_gains.1": 15.0,
}


@pytest.mark.slow
def test_traced_numbers_do_what_the_same_numbers_in_the_study_do(small_study, tmp_path):
    """All five at once: a number that were not applied, or in another's place, would be missed."""
    changed = replace(
        small_study,
        smoothing=0.3,
        modelled_mass=2.0,
        pid_learner=(100.0, 10.0, 0.002),
        doomed_learner=0.1,
        training=replace(small_study.training, learning_rate=3e-3),
        policy_gains=(100.0, 15.0),
    )
    assert varied(small_study, VALUES) == changed
    numbers = leaves(small_study)
    vary = tuple((name, (numbers[name], value)) for name, value in VALUES.items())
    data = run(tmp_path / "a.nc", small_study, replace(ONE, vary=vary))
    plain, other = (
        run(tmp_path / f"{i}.nc", study, ONE) for i, study in enumerate((small_study, changed))
    )
    # other programs, whose rounding training amplifies
    for place, wanted in enumerate((plain, other)):
        got = data.isel(dict.fromkeys(VALUES, place))
        for metric in ("q_error", "feedback_applied"):
            np.testing.assert_allclose(got[metric][..., 0], wanted[metric][..., 0], rtol=1e-9)
            np.testing.assert_allclose(got[metric], wanted[metric], rtol=2e-2)
    for name in VALUES:
        alone = data.isel({other: int(other == name) for other in VALUES})
        assert abs(plain.q_error - alone.q_error).max() > 1e-6, name


@pytest.mark.slow
def test_an_ablation_of_traced_numbers_compiles_once_and_one_of_sizes_once_each(
    small_study, tmp_path
):
    study = replace(small_study, target=(0.8, 0.9))  # nobody else's program
    compiled = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda event, *_, **__: compiled.append(event)
    )
    try:
        before = program.cache_info().misses
        grid = replace(SMALL, vary=(("alpha", (0.1, 0.2, 0.4)), ("prior_mass", (0.0, 0.5))))
        data = run(tmp_path / "a.nc", study, grid)
        assert program.cache_info().misses - before == 1 == int(data.attrs["programs"])
        assert [p._cache_size() for p in programs(study, grid)] == [1]
        before = program.cache_info().misses
        grid = replace(
            ONE, vary=(("layers", ("4,1", "6,1")), ("kept", (0, 1)), ("alpha", (0.1, 0.3)))
        )
        data = run(tmp_path / "b.nc", study, grid)
        assert program.cache_info().misses - before == 4 == int(data.attrs["programs"])
    finally:
        jax.monitoring.clear_event_listeners()


@pytest.mark.slow
def test_results_are_labelled_continued_and_extended(small_study, tmp_path):
    grid = replace(
        SMALL, vary=(("train_on", ("true_state", "sensed_state")), ("alpha", (0.1, 0.2)))
    )
    path = tmp_path / "a.nc"
    data = run(path, small_study, grid, per_device=1)
    assert data.q_error.dims[-3:] == ("train_on", "alpha", "iteration")
    assert data.train_on.values.tolist() == ["true_state", "sensed_state"]
    wider = replace(grid, vary=(grid.vary[0], ("alpha", (0.1, 0.2, 0.5))))
    more = run(path, small_study, wider)
    np.testing.assert_array_equal(more.q_error.sel(alpha=[0.1, 0.2]), data.q_error)
    assert (read_results(path).q_error == more.q_error).all()
    whole = run(tmp_path / "b.nc", small_study, wider, per_device=1)
    np.testing.assert_array_equal(whole.q_error, more.q_error)
    with pytest.raises(StoreError, match="leave out"):
        run(path, small_study, SMALL)


@pytest.mark.slow
def test_with_many_programs_each_is_dropped_when_its_runs_are_done(
    small_study, tmp_path, monkeypatch
):
    grid = replace(SMALL, seeds=(1, 2, 3), vary=(("kept", (0, 1, 2)),))
    study = replace(small_study, target=(0.7, 0.9))
    plain = run(tmp_path / "a.nc", study, grid, per_device=1)
    assert [p._cache_size() for p in programs(study, grid)] == [1, 1, 1]
    monkeypatch.setattr("jaxidl.jobs.sweeping.KINDS_AT_ONCE", 2)
    dropping = run(tmp_path / "b.nc", study, grid, per_device=1)
    assert [p._cache_size() for p in programs(study, grid)] == [0, 0, 0]
    np.testing.assert_array_equal(plain.q_error, dropping.q_error)


def test_earlier_data_come_back_as_evenly_as_can_be():
    memory = Dataset(jnp.arange(4.0).reshape(4, 1, 1), 10.0 * jnp.arange(4.0).reshape(4, 1, 1))
    for k, wanted in (
        (1, [0, 0, 0, 0]),
        (2, [0, 1, 0, 1]),
        (3, [0, 1, 2, 0]),
        (4, [0, 1, 2, 3]),
        (9, [0, 1, 2, 3]),
    ):
        rows = recall(memory, jnp.array(k))
        np.testing.assert_array_equal(rows.x[:, 0], wanted)
        np.testing.assert_array_equal(rows.y[:, 0], 10.0 * np.array(wanted))


def test_no_row_that_is_held_out_is_trained_on_in_another_copy():
    training = PaperStudy().training
    for count in (999, 1000, 1999):
        mask = training.mask_of(3 * count, 3).reshape(3, count)
        assert (mask == training.train_mask(count)).all()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["learner_gian", "1"], "one of alpha, prior_mass, .*learner_gain.*; got 'learner_gian'"),
        (["alpha"], "a name and values"),
        (["alpha", "zero"], "a finite number for alpha"),
        (["alpha", "0"], "smoothing > 0 and <= 1; got 0.0"),
        (["alpha", "nan"], "a finite number for alpha"),
        (["prior_mass", "-1"], "modelled_mass >= 0"),
        (["kept", "1.5"], "a whole number for kept"),
        (["batch", "0"], "batch >= 1"),
        (["layers", "20,2"], "end with 1"),
        (["train_on", "guess"], "one of true_state, sensed_state"),
        (["learning_rate", "inf"], "a finite number"),
        (["epochs", "few"], "a whole number for epochs"),
        (["noise", "-1"], "noise"),
        (["alpha", "0.1", "0.1"], "each value of alpha once"),
        (["layers", "20,1", "20, 1"], "each value of layers once"),
        (["error_model.position_scale", "0"], "position_scale > 0"),
        (["error_model.activation_width", "-1"], "activation_width >= 0"),
        (["training.snapshot_epochs", "nan"], "a finite number"),
        (["target.0", "nan"], "a finite number"),
        (["steps", "10000000000"], "2 to 1000000 control steps"),
    ],
)
def test_what_cannot_be_varied_is_refused_in_one_line(words, complaint, tmp_path, capsys):
    with pytest.raises(ConfigurationError, match=complaint):
        varying(Grid(), PaperStudy(), (tuple(words),))
    refusal(capsys, "ablate", "--vary", *words, "--out", tmp_path / "a.nc")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("vary", "complaint"),
    [
        (
            (("doomed_learner", (0.2, 0.3)), ("learner_gain", (500.0, 1000.0))),
            "axes that set different numbers",
        ),
        ((("pid_gains.0.1", (1.0,)), ("applied_gain", (50.0,))), "axes that set different numbers"),
        ((("steps", (80, 20)), ("batch", (16, 30))), "a batch no larger than"),
        ((("learner_gian", (1.0,)),), "one of alpha"),
        ((("alpha", (7.0,)),), "smoothing"),
    ],
)
def test_axes_that_do_not_fit_are_refused_before_anything_is_computed(
    vary, complaint, small_study, tmp_path
):
    with pytest.raises(ConfigurationError, match=complaint):
        run(tmp_path / "a.nc", small_study, replace(ONE, vary=vary))
    assert not list(tmp_path.iterdir())
    fits = replace(ONE, vary=(("steps", (80, 40)), ("batch", (16, 30))))
    check(small_study, fits.vary)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("--out a.nc", "something that varies"),
        ("--vary alpha 0.1 --out a.nc", "something that varies"),
        ("--vary seed 1 2 --out a.nc", "something that varies"),
        ("--vary alpha 0.1 0.2 --out a.md", "--out FILE.nc"),
        ("--vary noise 1e-4 --vary noise 5e-4 --out a.nc", "each name to vary once"),
    ],
)
def test_command_lines_that_would_lose_something_are_refused(
    words, complaint, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert complaint in refusal(capsys, "ablate", *words.split())
    assert not list(tmp_path.iterdir())


def test_one_number_under_two_names_is_refused():
    grid = varying(Grid(), PaperStudy(), (("alpha", "0.1"), ("smoothing", "0.2")))
    with pytest.raises(ConfigurationError, match="different numbers"):
        check(PaperStudy(), grid.vary)


def test_the_grids_own_axes_can_be_varied_too():
    grid = varying(
        Grid(),
        PaperStudy(),
        (("controller", "doomed"), ("noise", "1e-4"), ("epochs", "5", "7"), ("alpha", "0.5")),
    )
    assert (grid.controllers, grid.noise, grid.epochs) == (("doomed",), (1e-4,), (5, 7))
    assert grid.vary == (("alpha", (0.5,)),)


def made(values, seeds=(0, 1, 2, 3), sources=("indirect", "joint"), **axes):
    """Results whose final error is 0.1·value·(1 + seed/10), ten times as much for indirect data."""
    grid = Grid(
        ("pid",),
        ("low",),
        (1e-4,),
        (5.0,),
        (5.0,),
        (20,),
        seeds,
        sources,
        12,
        (("alpha", tuple(values)),),
    )
    grid = replace(grid, **axes)

    def run(at):
        size = 0.1 * at["alpha"] * (1 + at["seed"] / 10) * (10 if at["source"] == "indirect" else 1)
        curve = size * np.ones(12)
        return {name: np.ones(12, bool) if name == "finite" else curve for name in META}

    return assemble(
        grid.dims(), META, {at: run(dict(at)) for at in points(grid.dims())}
    ).assign_coords(iteration=np.arange(12))


def test_the_table_is_the_geometric_mean_of_the_final_errors():
    data = made((0.1, 0.5))
    table = rows(data)
    assert [(row["alpha"], row["source"]) for row in table] == [
        (a, s) for a in (0.1, 0.5) for s in ("indirect", "joint")
    ]
    seeds = 1 + np.arange(4) / 10
    mean = table[3]["q_error"]
    assert mean.value == pytest.approx(0.05 * np.exp(np.log(seeds).mean()))
    assert mean.interval[0] < mean.value < mean.interval[1]
    assert as_markdown(data).count("\n") == 5


def test_a_diverged_run_is_left_out_and_counted():
    data = made((0.1, 0.5))
    data["finite"][{"alpha": 0, "seed": 2, "source": 1, "iteration": 10}] = False
    assert np.isnan(final(data, "q_error").isel(alpha=0, seed=2, source=1)).all()
    row = rows(data)[1]
    assert (row["q_error"].seeds, row["diverged"]) == (3, 1)


@pytest.mark.parametrize(
    "axes",
    [
        {},
        {"controllers": ("pid", "doomed")},
        {"noise": (1e-4, 8e-4), "epochs": (5, 20)},
        {"seeds": (1,)},
    ],
)
def test_the_figure_has_a_panel_for_each_other_setting_and_draws_what_is_there(axes):
    from jaxidl.plot.ablation import ablation

    data = made((0.1, 0.2, 0.5), **axes)
    figure = ablation(data)
    panels = figure.axes
    others = int(np.prod([len(values) for name, values in axes.items() if name != "seeds"]))
    assert len(panels) == 2 * others
    lines = {
        line.get_label(): line
        for line in panels[0].get_lines()
        if not line.get_label().startswith("_")
    }
    assert lines.keys() == {"indirect", "joint"}
    wanted = [row["q_error"].value for row in rows(data) if row["source"] == "joint"][:3]
    np.testing.assert_allclose(lines["joint"].get_ydata(), wanted)
    assert [text.get_text() for text in panels[-1].get_xticklabels()] == ["0.1", "0.2", "0.5"]


def test_nothing_varied_is_refused():
    with pytest.raises(StoreError, match="varies"):
        rows(made((0.1,)).isel(alpha=0, drop=True))


@pytest.mark.slow
def test_the_command_writes_results_table_and_figure(tmp_path, capsys, monkeypatch, small_study):
    monkeypatch.setattr(
        "jaxidl.paper.runs.run_sweep",
        lambda grid, out, **how: run_sweep(grid, out, small_study, quiet=True),
    )
    words = [
        "--vary",
        "alpha",
        "0.1",
        "0.2",
        "--seeds",
        "1",
        "2",
        "--executions",
        "2",
        "--epochs",
        "1",
        "--sources",
        "joint",
    ]
    assert main(["ablate", *words, "--out", str(tmp_path / "a.nc")]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"a.nc", "a.md", "a.png", "a.pdf"}
    assert (tmp_path / "a.md").read_text() in capsys.readouterr().out
    assert main(["figures", str(tmp_path / "a.nc"), "--out", str(tmp_path / "again")]) == 0
    assert {path.name for path in (tmp_path / "again").iterdir()} == {"a.png", "a.pdf"}
    capsys.readouterr()
    assert "an ablation over alpha" in refusal(capsys, "claims", tmp_path / "a.nc")
