"""Figures from stored results alone."""

import json
from dataclasses import replace

import numpy as np
import pytest

from jaxidl.errors import StoreError
from jaxidl.models import ErrorModel
from jaxidl.paper.example import example
from jaxidl.paper.grid import NOISE_LEVELS, Grid
from jaxidl.paper.runs import LearningRun, settings_of
from jaxidl.paper.study import PaperStudy
from jaxidl.plot.confusion import write_confusion
from jaxidl.plot.figures import FIGURES, averages, caption, conditions, draw_all, illustration
from tests.helpers.results import as_in_the_paper, results


def shown(grid):
    """Made-up results of a grid with an example run of a small study."""
    study = PaperStudy(steps=60, error_model=ErrorModel(layers=(8, 1)))
    run = example(LearningRun(study, grid.executions), grid)
    return results(as_in_the_paper, grid=grid).merge(run, combine_attrs="no_conflicts")


@pytest.fixture(scope="module")
def quick():
    return shown(Grid.quick())


@pytest.mark.slow
def test_every_figure_is_written_as_png_and_pdf(quick, tmp_path):
    paths = draw_all(quick, tmp_path)
    assert {p.name for p in paths} == {
        f"{name}.{kind}" for name in FIGURES for kind in ("png", "pdf")
    }
    for path in paths:
        assert path.read_bytes().startswith(b"\x89PNG" if path.suffix == ".png" else b"%PDF")


def test_quick_figures_say_so_and_whole_ones_do_not(quick):
    assert "QUICK" in caption(quick)
    for draw in FIGURES.values():
        assert "QUICK" in draw(quick)._supxlabel.get_text()
    assert caption(results(grid=Grid())).startswith("whole study: 10 seeds")
    assert caption(results(grid=Grid(seeds=(1, 2, 3)))).startswith("all settings: 3 seeds")
    assert caption(results(grid=Grid(executions=2, seeds=(1,)))).startswith("part of the grid")
    assert caption(results(grid=Grid(noise=NOISE_LEVELS["printed"], seeds=(1,)))).startswith(
        "part of the grid"
    )
    other = quick.assign_attrs(
        identity=json.dumps({"study": settings_of(PaperStudy(train_on="sensed_state"))})
    )
    assert caption(other).startswith("settings other")


def test_what_is_drawn_is_what_is_stored(quick):
    figure = illustration(quick)
    axes = figure.axes[0]
    assert axes.get_yscale() == "log"
    assert "[m]" in axes.get_ylabel()
    drawn = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
    stored = quick.q_error.sel(
        controller="pid", gain="low", noise=1e-4, friction=5.0, stiction=5.0, epochs=20, seed=1
    )
    for source in ("indirect", "direct", "joint"):
        np.testing.assert_allclose(drawn[source], stored.sel(source=source))


def test_averages_are_means_and_means_plus_a_deviation_of_the_right_runs():
    data = results(lambda label, k: as_in_the_paper(label, k) * (1 + label.noise * 1e3))
    figure = averages(data)
    titles = [axes.get_title() for axes in figure.axes[:4]]
    assert titles == ["PID, low gain", "PID, high gain", "DOOMED, low gain", "DOOMED, high gain"]
    runs = data.q_error.sel(controller="doomed", gain="low", source="direct")
    over = [dim for dim in runs.dims if dim != "iteration"]
    mean, thin = figure.axes[2].get_lines()[2:4]
    np.testing.assert_allclose(mean.get_ydata(), runs.mean(over))
    np.testing.assert_allclose(thin.get_ydata(), runs.mean(over) + runs.std(over))


def test_the_heat_map_shows_each_condition_in_its_place():
    data = results(lambda label, k: as_in_the_paper(label, k) * (1 + label.noise * 1e3))
    axes = conditions(data).axes[0]
    rows = [label.get_text() for label in axes.get_yticklabels()]
    columns = [label.get_text() for label in axes.get_xticklabels()]
    shown = axes.images[0].get_array()[
        rows.index("DOOMED low, direct"), columns.index("0.8 mm, f 5, s 5, 20")
    ]
    final = data.q_error.sel(controller="doomed", gain="low", source="direct", noise=8e-4)[
        ..., -5:
    ].mean()
    np.testing.assert_allclose(shown, final)


def test_diverged_iterations_leave_a_gap_and_are_counted():
    data = results(as_in_the_paper, lambda label, k: k < 10, Grid(noise=(1e-4, 8e-4), seeds=(1,)))
    line = illustration(data).axes[0].get_lines()[0].get_ydata()
    assert np.isfinite(line[:10]).all()
    assert np.isnan(line[10:]).all()
    assert "diverged iterations left out" in caption(data)


def test_results_without_an_example_run_are_named(tmp_path):
    with pytest.raises(StoreError, match="example run"):
        draw_all(results(as_in_the_paper), tmp_path, ["fig3_single_run"])


@pytest.mark.slow
def test_a_study_of_one_execution_is_drawn_too(quick, tmp_path):
    data = shown(replace(Grid.quick(), executions=1))
    assert len(draw_all(data, tmp_path)) == 2 * len(FIGURES)


def test_a_benchmark_of_whole_robots_alone_has_no_confusion_matrix(tmp_path):
    assert write_confusion({"confusion": {}}, tmp_path) == []
    assert not list(tmp_path.iterdir())
