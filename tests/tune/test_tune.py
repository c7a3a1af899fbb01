"""Gains tuned by gradient, on a problem whose answer is known."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.control import Doomed, Pid
from jaxidl.errors import ConfigurationError
from jaxidl.jobs import Pieces
from jaxidl.learning.iterate import Metrics
from jaxidl.plot.tune import figure
from jaxidl.tune import search as searching
from jaxidl.tune.problem import Problem, point_mass_problem
from jaxidl.tune.run import as_text, compared, tune, verdict
from jaxidl.tune.search import Search, Trail, direction
from tests.helpers.commands import refusal
from tests.helpers.numeric import quick

BEST = np.log([0.03, 1.5])  # where the error is least, without a bound


def bowl(law, seed, smooth, derivative):
    """Error grows with the distance from BEST, effort with the rate; a seed scatters both."""
    logs = jnp.log(jnp.stack([law.rate, law.learner_gain]))
    scatter = 0.05 * jnp.sin(1.0 * seed)
    error = jnp.exp(jnp.sum((logs - BEST) ** 2) + scatter)
    effort = law.rate * jnp.exp(scatter)
    two = jnp.ones(2)
    return Metrics(error * two, effort * two, two, two, jnp.isfinite(error) * two > 0)


def problem():
    return Problem(
        {"plant": "point_mass", "controller": "doomed", "executions": 2},
        Doomed(0.01, 0.5, 0.1, 0.9),
        bowl,
        gradient_cost=2,
    )


SEARCH = Search(steps=60, runs=2, test_runs=6)


def test_the_numbers_of_a_law_have_names_bounds_and_a_way_back():
    p = point_mass_problem("pid")
    assert p.names[:3] == ["applied.kp[0]", "applied.kp[1]", "applied.kd[0]"]
    assert p.names[-1] == "smoothing"
    assert len(p.names) == len(p.start) == 13
    law = p.law_of(jnp.asarray(p.start))
    assert isinstance(law, Pid)
    for a, b in zip(jax.tree.leaves(law), jax.tree.leaves(p.law), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    low, high = p.bounds()
    assert (low < p.start).all()
    assert (p.start < high).all()
    assert high[-1] == 0.0
    # an infinite limit is no gain
    assert problem().names == ["rate", "learner_gain", "smoothing", "gradient_smoothing"]
    with pytest.raises(ConfigurationError, match="pid, doomed"):
        point_mass_problem("lqr")


@pytest.mark.slow
def test_a_learning_run_of_the_point_mass_is_judged_by_its_metrics():
    p = point_mass_problem("doomed", executions=2, epochs=1)
    out = quick(p.run)(jnp.asarray(p.start), jnp.array(3, jnp.uint32))
    metrics = quick(lambda seed: p.learn(p.law, seed, False, None))(jnp.array(3, jnp.uint32))
    np.testing.assert_allclose(out.error, np.log(metrics.q_error[1]), rtol=1e-3)
    np.testing.assert_allclose(out.effort, np.log(metrics.feedback_applied.mean()), rtol=1e-3)
    assert out.finite


def test_a_seeds_gradient_counts_up_to_a_length_and_nan_not_at_all():
    slopes = np.array([[3.0, 4.0], [0.0, 0.2], [np.nan, 1.0], [np.inf, 0.0]])
    np.testing.assert_allclose(direction(slopes), [0.6 / 4, (0.8 + 0.2) / 4])


def test_the_best_point_keeps_the_bound_if_any_does():
    trail = Trail(
        np.zeros((3, 1)), np.array([[1.0], [2.0], [3.0]]), np.array([[5.0], [0.5], [0.2]])
    )
    assert trail.best(1.0) == 1
    assert trail.best(0.1) == 2  # none does: the one that exceeds it least
    assert trail.best(9.0) == 0
    assert trail.best(1.0, upto=1) == 0


def test_descent_finds_the_best_gains_within_the_bound_and_random_search_may_cost_as_much(tmp_path):
    result = tune(problem(), SEARCH, tmp_path, bound=0.02, quiet=True)
    found = result["numbers"]["gradient"]
    assert found["rate"] == pytest.approx(0.02, rel=0.1)  # at the bound
    assert found["learner_gain"] == pytest.approx(1.5, rel=0.1)
    assert len(result["course"]["random"]["runs"]) == 60 * 3
    assert result["course"]["gradient"]["runs"][-1] == result["course"]["random"]["runs"][-1]
    errors = {way: np.exp(np.mean(np.log(runs["error"]))) for way, runs in result["fresh"].items()}
    assert errors["gradient"] < errors["random"] < errors["as it is"]
    assert "better than the gains as they are, within the bound" in verdict(result)
    assert json.loads((tmp_path / "tune.json").read_text())["numbers"] == result["numbers"]
    assert as_text(result).count("|") > 12
    panels = figure(result).axes
    assert panels[0].get_legend_handles_labels()[1] == ["gradient", "random"]
    assert panels[1].get_legend_handles_labels()[1] == ["as it is", "gradient", "random", "bound"]


def test_the_bound_is_by_default_the_effort_of_the_law_as_it_is(tmp_path):
    result = tune(problem(), SEARCH, tmp_path, quiet=True)
    assert result["bound"] == pytest.approx(0.01, rel=0.1)
    assert result["numbers"]["gradient"]["rate"] <= 0.0101


def test_an_interrupted_search_continues_to_the_same_result(tmp_path, monkeypatch):
    whole = tune(problem(), SEARCH, tmp_path / "whole", quiet=True)
    saved, save = [], Pieces.save

    def broken(self, name, arrays):
        if len(saved) == 9:
            raise KeyboardInterrupt
        saved.append(name)
        save(self, name, arrays)

    monkeypatch.setattr(Pieces, "save", broken)
    with pytest.raises(KeyboardInterrupt):
        tune(problem(), SEARCH, tmp_path / "cut", quiet=True)
    monkeypatch.setattr(Pieces, "save", save)
    calls, judged = [], searching.judged
    monkeypatch.setattr(searching, "judged", lambda *a: calls.append(1) or judged(*a))
    again = tune(problem(), SEARCH, tmp_path / "cut", quiet=True)
    for result in (again, whole):
        assert all(course.pop("seconds") >= 0.0 for course in result["course"].values())
    for key in ("numbers", "course", "fresh", "compared", "bound"):
        assert again[key] == whole[key]
    pieces = SEARCH.steps + -(-SEARCH.points(problem()) // searching.BATCH)
    assert len(calls) == pieces - 8  # one of the nine is the law as it is


def test_runs_that_diverge_lose():
    def wild(law, seed, smooth, derivative):
        out = bowl(law, seed, smooth, derivative)
        return out._replace(finite=(law.rate < 0.02) & out.finite)

    p = Problem(problem().settings, problem().law, wild)
    points = np.stack([p.start, p.start + np.log([4.0, 1.0, 1.0, 1.0])])
    with jax.enable_x64(True):
        found = searching.judged(p, points, np.arange(3, dtype=np.uint32))
    assert np.isfinite(found["error"][0]).all()
    assert np.isinf(found["error"][1]).all()


def test_ratios_are_paired_by_seed():
    base = np.log(np.array([[1.0, 10.0, 100.0]]))
    half = {"error": base + np.log(0.5), "effort": base + np.log([[0.9, 1.0, 1.1]])}
    table = compared(half, {"error": base, "effort": base})
    assert table["error"]["ratio"] == pytest.approx(0.5)
    np.testing.assert_allclose(table["error"]["interval"], 0.5)
    low, high = table["effort"]["interval"]
    assert low < 1.0 < high
    assert table["error"]["wins"] == 3


def test_seeds_that_compare_are_not_those_that_search():
    search = Search(runs=600, test_runs=600, root=5_000_000)
    assert not set(search.train()) & set(search.test())
    assert len(set(search.train())) == len(set(search.test())) == 600


def test_gains_that_diverge_are_never_called_better(tmp_path):
    """Two of the fresh seeds diverge at the larger rate."""
    fresh = Search(steps=60, runs=2, test_runs=6).test()

    def thrown(law, seed, smooth, derivative):
        out = bowl(law, seed, smooth, derivative)
        return out._replace(
            finite=out.finite & ~((law.rate > 0.011) & ((seed == fresh[0]) | (seed == fresh[3])))
        )

    p = Problem(problem().settings, problem().law, thrown, gradient_cost=2)
    result = tune(p, SEARCH, tmp_path, bound=0.02, quiet=True)
    assert result["compared"]["gradient / as it is"]["error"]["not_finite"] == 2
    assert result["compared"]["gradient / as it is"]["error"]["interval"][1] < 1.0
    assert "better than the gains as they are" not in verdict(result)
    assert "| 4 of 6 | 2 |" in as_text(result)
    assert "Infinity" not in (tmp_path / "tune.json").read_text()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("--plant boat", "one of point_mass, arm"),
        ("--controller lqr", "one of pid, doomed"),
        ("--bound 0", "--bound > 0"),
        ("--steps 0", "steps >= 1"),
        ("--plant arm --controller pid", "doomed on the arm"),
        ("--executions 1", "--executions >= 2"),
    ],
)
def test_what_cannot_be_tuned_is_refused_in_one_line(words, complaint, tmp_path, capsys):
    assert complaint in refusal(capsys, "tune", *words.split(), "--out", tmp_path / "out")
    assert not list(tmp_path.iterdir())
