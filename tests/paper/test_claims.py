"""Claims on made-up results whose answers are known."""

import itertools
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from jaxidl.paper.claims import CLAIMS
from jaxidl.paper.grid import Grid
from jaxidl.paper.verdicts import as_json, as_markdown, as_table, check_claims
from jaxidl.paper.view import View
from tests.helpers.results import GRID, as_in_the_paper, results


def verdicts(data):
    return {row.name: row for row in check_claims(data)}


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
    found = verdicts(
        results(
            lambda label, k: as_in_the_paper(
                SimpleNamespace(**{**vars(label), "source": opposite[label.source]}), k
            )
        )
    )
    for name in (
        "indirect-low-pid",
        "joint-ordering/pid",
        "joint-faster/pid",
        "joint-faster/doomed",
    ):
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
    row = verdicts(results(lambda label, k: 1.0 if k == 0 else np.exp(float(label.seed))))[
        "indirect-low-pid"
    ]
    np.testing.assert_allclose(row.average.value, np.exp(2.0))
    half = 4.302653 / np.sqrt(3)  # t for 2 degrees of freedom, standard deviation 1
    np.testing.assert_allclose(np.log(row.average.interval), [2 - half, 2 + half], rtol=1e-6)


def test_diverged_iterations_stay_out_and_are_counted():
    def wild(label, k):
        return label.seed == 2 and k > 10

    clean = verdicts(results(lambda label, k: 2.0 if k else 1.0))["indirect-low-pid"]
    row = verdicts(
        results(
            lambda label, k: np.nan if wild(label, k) else (2.0 if k else 1.0),
            lambda label, k: not wild(label, k),
        )
    )["indirect-low-pid"]
    assert row.left_out == 9 * len(GRID) / 3
    assert row.average.seeds == 2
    assert row.average.value == clean.average.value


def test_one_seed_has_no_interval_and_a_part_of_the_grid_says_so():
    rows = verdicts(
        results(
            as_in_the_paper,
            grid=Grid(
                controllers=("pid",),
                noise=(1e-4,),
                friction=(5.0,),
                stiction=(5.0,),
                epochs=(20,),
                seeds=(4,),
            ),
        )
    )
    assert rows["indirect-low-pid"].average.interval is None
    assert rows["joint-faster/doomed"].verdict == "not in these results"
    # one noise level says nothing about noise
    assert rows["indirect-noise/pid"].verdict == "not in these results"


def test_too_few_executions_have_no_final_error():
    rows = verdicts(results(as_in_the_paper, grid=replace(GRID, executions=4)))
    assert rows["joint-ordering/pid"].verdict == "not in these results"
    assert rows["high-gain-first/pid"].verdict == "holds"


@pytest.mark.parametrize("level", [0.5, 1.0])
def test_when_nothing_happens_nothing_is_claimed(level):
    """All errors equal: no source improves, none is better than another."""
    rows = verdicts(results(lambda label, k: level))
    held = {name for name, row in rows.items() if row.verdict == "holds"}
    assert held == {
        "indirect-low-pid",
        "direct-high-noise/pid",
        "direct-high-noise/doomed",
        "indirect-noise/pid",
        "indirect-noise/doomed",
        "joint-high-gain/pid",
        "joint-high-gain/doomed",
    }


def test_steady_convergence_is_not_erratic():
    def errors(label, k):
        return np.exp(-0.3 * k) if label.source == "direct" else 1 + 0.05 * (-1) ** k

    assert verdicts(results(errors))["direct-erratic/pid"].verdict != "holds"


def test_a_curve_that_only_falls_does_not_degrade():
    assert verdicts(results(lambda label, k: 1.5**-k))["direct-degrades"].verdict == "does not hold"


def test_every_claim_is_computed_on_the_whole_grid_and_printed():
    data = results(as_in_the_paper).assign_attrs(git_revision="0123abc")
    rows = check_claims(data)
    assert len(rows) == len(CLAIMS) == len({row.name for row in rows})
    assert all(row.average and row.typical for row in rows)
    written = json.loads(as_json(rows, data))
    assert written["git_revision"] == "0123abc"
    assert len(written["claims"]) == len(rows)
    for text in (as_table(rows), as_markdown(rows)):
        assert text.count("holds") + text.count("does not hold") + text.count("only partly") >= len(
            rows
        )
        assert "3 seeds" in text


@pytest.mark.slow
def test_no_claim_is_decided_by_its_form():
    """Every statement can come out either way."""
    rng, seen = np.random.default_rng(0), {claim.name: set() for claim in CLAIMS}
    for trial in range(60):
        width = (1.5, 0.03, 0.3)[trial % 3]
        keys = itertools.product(GRID.controllers, GRID.gains, GRID.sources, GRID.noise, range(4))
        scale = {key: np.exp(rng.normal() * width) for key in keys}
        shake = {
            key: rng.uniform(1, 3) for key in itertools.product(GRID.controllers, GRID.sources)
        }
        # now and then one source is always best
        lean = {source: np.exp(rng.normal() * 4) for source in GRID.sources}

        def value(label, k, scale=scale, shake=shake, lean=lean):
            late = 0 if k == 0 else 1 if k < 10 else 2 if k < 15 else 3
            wobble = shake[label.controller, label.source] ** (-1) ** k
            return (
                scale[label.controller, label.gain, label.source, label.noise, late]
                * wobble
                * lean[label.source]
            )

        data = results(value)
        data["feedback_applied"], data["torque"] = data["q_error"].copy(), data["q_error"].copy()
        for name, row in verdicts(data).items():
            seen[name].add(row.verdict)
        if all({"holds", "does not hold"} <= found for found in seen.values()):
            return
    undecided = {k: found for k, found in seen.items() if not {"holds", "does not hold"} <= found}
    pytest.fail(f"decided: {undecided}")


def test_what_would_hold_for_other_sources_too_stands_beside():
    found = verdicts(results(as_in_the_paper))
    assert found["joint-low-pid"].beside.keys() == {"indirect", "direct"}
    assert found["direct-low-noise/pid"].beside["joint"].endswith("(true)")
    assert not found["joint-low-pid"].beside["indirect"].endswith("(true)")
    # indirect against itself says nothing
    assert found["joint-faster/pid"].beside.keys() == {"direct"}
    assert "(true)" in as_markdown(list(found.values()))


def test_no_worse_is_judged_setting_by_setting():
    """One setting with a huge error decides an average; it does not decide in how many settings a
    source is worse.
    """

    def error(label, k):
        if label.source != "joint":
            return 100.0 if label.noise > 5e-4 else 1.0
        return 50.0 if label.noise > 5e-4 else 3.0

    assert (
        float(
            View(results(error), typical=False)
            .end(controller="pid", gain="high", source="joint")
            .mean()
        )
        < 50.5
    )
    verdict = verdicts(results(error))["joint-high-gain/pid"]
    assert verdict.average.value == pytest.approx(np.sqrt(0.5 * 3.0))
    assert verdict.average.value > 1.1
