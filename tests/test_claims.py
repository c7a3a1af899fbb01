"""Claims on made-up results whose answers are known."""

import json

import numpy as np
import pytest

from jaxidl.sweep.claims import CLAIMS, as_json, as_markdown, as_table, check_claims
from jaxidl.sweep.grid import Grid
from jaxidl.sweep.store import assemble

GRID = Grid(noise=(1e-4, 8e-4), friction=(5.0,), stiction=(5.0,), epochs=(20,), seeds=(1, 2, 3))


def results(error_of=lambda label, k: 1.0, finite_of=lambda label, k: True, grid=GRID):
    """A results file in which run ``label`` has error ``error_of(label, k)`` in execution k, other numbers 1."""
    rows = range(grid.iterations)
    runs = {}
    for label in grid.labels():
        errors = np.array([error_of(label, k) for k in rows], float)
        runs[label] = dict.fromkeys(("feedback_applied", "qdd_error", "torque"), np.ones(len(rows)))
        runs[label] |= {"q_error": errors, "finite": np.array([finite_of(label, k) for k in rows])}
    return assemble(grid, runs)


def verdicts(data):
    return {row.name: row for row in check_claims(data)}


def as_in_the_paper(label, k):
    """Joint falls fastest, direct falls but jumps in high noise, indirect stays where it is with low-gain PID."""
    first = 1.0 if label.gain == "low" else 0.1
    rate = {"indirect": 0.05, "direct": 0.15, "joint": 0.3}[label.source]
    if (label.controller, label.gain, label.source) == ("pid", "low", "indirect"):
        return 1.0 + (0.05 + 0.001 * label.seed) * (k > 5) + 0.001 * (k % 2)
    jump = 3.0 ** ((-1) ** k) if label.source == "direct" and label.noise > 5e-4 else 1.0
    return first * np.exp(-rate * k) * jump * (1 + 0.01 * label.seed)


def test_the_papers_story_holds_where_it_is_put_in():
    found = verdicts(results(as_in_the_paper))
    for name in (
        "indirect-low-pid",
        "indirect-slower",
        "joint-ordering/pid",
        "joint-faster/doomed",
        "direct-erratic/pid",
        "indirect-noise/pid",
    ):
        assert found[name].verdict == "holds", found[name]
    assert found["joint-high-gain/pid"].verdict == "holds"


def test_the_opposite_does_not_hold():
    opposite = {"indirect": "joint", "joint": "indirect", "direct": "direct"}
    found = verdicts(results(lambda label, k: as_in_the_paper(label._replace(source=opposite[label.source]), k)))
    for name in ("indirect-low-pid", "joint-ordering/pid", "joint-faster/pid", "joint-faster/doomed"):
        assert found[name].verdict == "does not hold", found[name]


def test_seeds_that_disagree_make_it_only_partly():
    def errors(label, k):
        better = label.source == "joint"
        return 1.0 if k == 0 or not better else [0.2, 2.0, 0.9][label.seed - 1]

    row = verdicts(results(errors))["joint-ordering/pid"]
    assert row.verdict == "only partly"
    assert row.average.interval[0] < 1 < row.average.interval[1]
    np.testing.assert_allclose(row.average.value, np.exp(np.log([0.2, 2.0, 0.9]).mean()))


def test_one_run_that_runs_away_decides_the_average_but_not_the_typical():
    def errors(label, k):
        away = label.source == "joint" and label.noise < 5e-4 and k == 19
        return 1e6 if away else as_in_the_paper(label, k)

    row = verdicts(results(errors))["joint-ordering/pid"]
    assert row.average.value > 1e3
    assert row.typical.value < 1
    assert row.verdict == "only partly"


def test_the_interval_is_students_over_seeds():
    row = verdicts(results(lambda label, k: 1.0 if k == 0 else np.exp(float(label.seed))))["indirect-low-pid"]
    np.testing.assert_allclose(row.average.value, np.exp(2.0))
    half = 4.302653 / np.sqrt(3)  # t for 2 degrees of freedom, standard deviation 1
    np.testing.assert_allclose(np.log(row.average.interval), [2 - half, 2 + half], rtol=1e-6)


def test_diverged_iterations_stay_out_and_are_counted():
    def wild(label, k):
        return label.seed == 2 and k > 10

    clean = verdicts(results(lambda label, k: 2.0 if k else 1.0))["indirect-low-pid"]
    row = verdicts(
        results(lambda label, k: np.nan if wild(label, k) else (2.0 if k else 1.0), lambda label, k: not wild(label, k))
    )["indirect-low-pid"]
    assert row.left_out == 9 * len(GRID) / 3
    assert row.average.seeds == 2
    assert row.average.value == clean.average.value


def test_one_seed_has_no_interval_and_a_part_of_the_grid_says_so():
    rows = verdicts(
        results(
            as_in_the_paper,
            grid=Grid(controllers=("pid",), noise=(1e-4,), friction=(5.0,), stiction=(5.0,), epochs=(20,), seeds=(4,)),
        )
    )
    assert rows["indirect-low-pid"].average.interval is None
    assert rows["joint-faster/doomed"].verdict == "not in these results"


def test_every_claim_is_computed_on_the_whole_grid_and_printed():
    rows = check_claims(results(as_in_the_paper))
    assert len(rows) == len(CLAIMS) == len({row.name for row in rows})
    assert all(row.average and row.typical for row in rows)
    assert len(json.loads(as_json(rows))) == len(rows)
    for text in (as_table(rows), as_markdown(rows)):
        assert text.count("holds") + text.count("does not hold") + text.count("only partly") >= len(rows)
        assert "3 seeds" in text


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda c: c.name)
def test_no_claim_is_decided_by_its_form(claim):
    """Every statement can come out either way."""
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(60):
        scale = {
            (c, g, s, n, late): np.exp(rng.normal() * 1.5)
            for c in GRID.controllers
            for g in GRID.gains
            for s in GRID.sources
            for n in GRID.noise
            for late in (0, 1, 2)
        }
        shake = {(c, s): rng.uniform(1, 3) for c in GRID.controllers for s in GRID.sources}

        def value(label, k, scale=scale, shake=shake):
            late = 0 if k == 0 else 1 if k < 10 else 2
            return (
                scale[label.controller, label.gain, label.source, label.noise, late]
                * shake[label.controller, label.source] ** (-1) ** k
            )

        data = results(value)
        data["feedback_applied"], data["torque"] = data["q_error"].copy(), data["q_error"].copy()
        seen.add(verdicts(data)[claim.name].verdict)
        if {"holds", "does not hold"} <= seen:
            return
    pytest.fail(f"only {seen}")
