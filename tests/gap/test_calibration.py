"""How likely a finding is right: the signs, the weights that come with the package, and how they
are fitted.
"""

import json

import numpy as np
import pytest

from jaxidl.gap.benchmark.calibration import fitted
from jaxidl.gap.result import calibration
from jaxidl.gap.result.calibration import SIGNS, margin_of, probability, signs

GOOD = {
    "margin": 100.0,
    "gain": 0.6,
    "share": 0.3,
    "left": 1.2,
    "unexplained": 0.01,
    "systematic": 0.0,
    "odds": 0.0,
    "common": True,
    "tied": 0.0,
    "company": 1.0,
    "known": 30.0,
    "bent": 0.0,
}
BAD = GOOD | {
    "margin": 0.1,
    "gain": 0.06,
    "share": 0.01,
    "left": 8.0,
    "unexplained": 0.8,
    "odds": -4.0,
    "common": False,
    "known": 0.5,
}


def test_the_packaged_weights_tell_a_dry_friction_from_a_crumb():
    kept = json.loads(calibration.WEIGHTS.read_text())
    assert set(kept["weights"]) == {*SIGNS, "constant"}
    assert probability(signs(**GOOD)) > 0.9
    assert probability(signs(**BAD)) < 0.5


@pytest.mark.parametrize("name", ["margin", "left", "share", "unexplained", "known", "bent"])
def test_signs_are_finite_however_extreme(name):
    for value in (0.0, 1e-300, 1e300, np.inf):
        assert all(np.isfinite(v) for v in signs(**(GOOD | {name: value})).values())


def test_the_margin_that_is_asked_for_gives_the_probability():
    found = signs(
        **(GOOD | {"margin": 1.0, "share": 0.03, "company": 0.0, "odds": -2.0, "tied": 0.5})
    )
    margin = margin_of(0.8, found)
    assert 1.0 < margin < 1e4
    enough = found | {"tied": 0.0, "margin": float(np.log10(margin))}
    assert probability(enough) == pytest.approx(0.8)
    assert margin_of(0.8, signs(**GOOD)) == 1.0  # named whatever comes nearest
    assert margin_of(0.9999, signs(**BAD)) == np.inf


def test_without_weights_only_the_draws_count(monkeypatch, tmp_path):
    monkeypatch.setattr(calibration, "WEIGHTS", tmp_path / "none.json")
    calibration._weights.cache_clear()
    try:
        assert probability(signs(**BAD)) == 1.0
    finally:
        calibration._weights.cache_clear()


def test_a_fit_finds_the_weights_that_made_the_answers_and_families_weigh_alike():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(6000, len(SIGNS)))
    true = np.zeros(len(SIGNS))
    true[[list(SIGNS).index(name) for name in ("margin", "share", "open")]] = 2.0, 1.0, -1.5
    right = rng.random(6000) < 1.0 / (1.0 + np.exp(-0.7 - x @ true))
    rows = [
        ("robot", dict(zip(SIGNS, row, strict=True)), bool(ok))
        for row, ok in zip(x, right, strict=True)
    ]
    weights = fitted(rows)
    np.testing.assert_allclose([weights[name] for name in SIGNS], true, atol=0.25)
    assert weights["constant"] == pytest.approx(0.7, abs=0.15)
    assert fitted(rows) == weights
    # some of the weights alone
    again = fitted(rows, only=["share"], held=weights | {"share": 0.0})
    assert again == pytest.approx(weights | {"share": again["share"]})
    assert again["share"] == pytest.approx(weights["share"], abs=0.02)
    # a sign that seems to speak the wrong way does not speak
    turned = fitted(
        [(family, found | {"share": -found["share"]}, ok) for family, found, ok in rows]
    )
    assert turned["share"] == 0.0
    # a family of a hundred findings counts as much as one of thousands
    wrong = [("single", signs_of, not ok) for _, signs_of, ok in rows[:100]]
    both = fitted([*rows, *wrong], strength=10.0)
    assert abs(both["margin"]) < 0.6 * weights["margin"]


def test_the_figure_has_each_family_with_findings_and_their_numbers():
    from jaxidl.plot.reliability import plot_reliability

    empty = {"share": np.nan, "n": 0, "low": 0.0, "high": 1.0}
    some = {"share": 0.9, "n": 17, "low": 0.7, "high": 0.97}
    bins = {"0.0-0.5": empty, "0.5-0.8": empty, "0.8-0.9": some, "0.9-1.0": some | {"n": 40}}
    figure = plot_reliability(
        {"calibration": {"single": bins, "robot": bins, "none": dict.fromkeys(bins, empty)}}
    )
    (axes,) = figure.axes
    assert {text.get_text() for text in axes.texts} == {"17", "40"}
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["as reported", "single effects", "whole robots"]
    assert axes.get_xlabel() == "reported confidence"
