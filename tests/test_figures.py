"""Figures from stored results alone."""

import numpy as np
import pytest

from jaxidl.errors import StoreError
from jaxidl.plot.figures import FIGURES, caption, draw_all, illustration
from jaxidl.sweep.example import example
from jaxidl.sweep.grid import QUICK, Grid
from tests.test_claims import as_in_the_paper, results


@pytest.fixture(scope="module")
def quick():
    from jaxidl.learning.paper import PaperStudy
    from jaxidl.models import ErrorModel

    study = PaperStudy(steps=60, error_model=ErrorModel(layers=(8, 1)))
    return results(as_in_the_paper, grid=QUICK).merge(example(study, QUICK), combine_attrs="no_conflicts")


def test_every_figure_is_written_as_png_and_pdf(quick, tmp_path):
    paths = draw_all(quick, tmp_path)
    assert {p.name for p in paths} == {f"{name}.{kind}" for name in FIGURES for kind in ("png", "pdf")}
    for path in paths:
        assert path.read_bytes().startswith(b"\x89PNG" if path.suffix == ".png" else b"%PDF")


def test_quick_figures_say_so_and_whole_ones_do_not(quick):
    assert "QUICK" in caption(quick)
    for draw in FIGURES.values():
        assert "QUICK" in draw(quick)._supxlabel.get_text()
    whole = results(grid=Grid(iterations=2))
    assert caption(whole).startswith("whole study: 10 seeds")
    assert caption(results(grid=Grid(iterations=2, seeds=(1, 2, 3)))).startswith("all settings: 3 seeds")


def test_what_is_drawn_is_what_is_stored(quick):
    figure = illustration(quick)
    axes = figure.axes[0]
    assert axes.get_yscale() == "log"
    assert "[m]" in axes.get_ylabel()
    drawn = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
    stored = quick.q_error.sel(controller="pid", gain="low", noise=1e-4, friction=5.0, stiction=5.0, epochs=20, seed=1)
    for source in ("indirect", "direct", "joint"):
        np.testing.assert_allclose(drawn[source], stored.sel(source=source))


def test_diverged_iterations_leave_a_gap_and_are_counted():
    data = results(as_in_the_paper, lambda label, k: k < 10, Grid(noise=(1e-4, 8e-4), seeds=(1,)))
    line = illustration(data).axes[0].get_lines()[0].get_ydata()
    assert np.isfinite(line[:10]).all()
    assert np.isnan(line[10:]).all()
    assert "diverged iterations left out" in caption(data)


def test_results_without_an_example_run_are_named(tmp_path):
    with pytest.raises(StoreError, match="example run"):
        draw_all(results(as_in_the_paper), tmp_path)
