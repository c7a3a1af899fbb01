"""The probability that a finding is right, from the evidence for it.

It is a logistic model, fitted to the benchmark's cases of another root and to published robots.
Resampling a log does not detect imitation: an effect that takes the place of one missing from the
catalogue is found on every draw. It shows by being rare, explaining little, having values that
hardly differ from zero, and leaving a residual behind; an effect that is common occurs on all
joints. Each sign can only have one direction: an effect that explains more is never less likely for
it. ``experiments/calibrate.py`` fits the weights.
"""

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

WEIGHTS = Path(__file__).with_suffix(".json")

SIGNS: Mapping[str, int] = {
    **dict.fromkeys(("margin", "share", "odds", "rare_share", "rare_gain", "company"), 1),
    **dict.fromkeys(("open", "systematic", "tied", "rare_left", "small", "vague", "bent"), -1),
    "rare": 0,
}
"""Evidence for (1) or against (-1) a finding, as numbers of similar magnitude."""

SMALL = 0.05  # share of the command below which a rare effect is more often an imitation,
KNOWN = 10.0  # and standard errors from zero, which none of its values reaches
STRAIGHT = 0.02  # share of an effect up to which its law hardly matters


def signs(
    margin: float,
    gain: float,
    share: float,
    left: float,
    unexplained: float,
    systematic: float,
    odds: float,
    common: bool,
    tied: float,
    company: float,
    known: float,
    bent: float,
) -> dict[str, float]:
    """Return the signs of a finding.

    Args:
        margin: by how much its expected log likelihood exceeds that of the best other effect in its
            place.
        gain: share of the held-out error on its joint that it removes.
        share: share of the command there that it explains.
        left: residual error there over the noise floor.
        unexplained: share of the gap there that is neither explained nor noise.
        systematic: share of the residual there that a network predicts.
        odds: the effect's log prior odds.
        common: true if conventional identification fits it on every joint.
        tied: prior probability, relative to the effect's, of another effect that explains the log
            as well; 0 if there is none.
        company: share of the other joints on which the same was found.
        known: by how many standard errors the best known of its values differs from zero.
        bent: share by which a rare effect on its joint follows another law than its own; then what
            stands beside it is in doubt, too.
    """
    log = lambda x, low, high: float(np.log10(np.clip(x, low, high)))
    rare, explained = float(not common), log(share, 1e-3, 1.0)
    return {
        "margin": log(margin, 1.0, 1e4),
        "share": explained,
        "open": log(unexplained, 0.1, 1.0) + 1.0,
        "systematic": float(np.clip(systematic, 0.0, 1.0)),
        "odds": odds / 4.0,
        "tied": tied,
        "rare": rare,
        "rare_share": rare * explained,
        "rare_left": rare * log(left, 1.0, 30.0),
        "rare_gain": rare * float(np.clip(gain, 0.0, 1.0)),
        "company": (1.0 - rare) * company,
        "small": rare * (np.log10(SMALL) - log(share, 1e-3, SMALL)),
        "vague": rare * (np.log10(KNOWN) - log(known, 1.0, KNOWN)),
        "bent": float(np.log(np.clip(bent, STRAIGHT, 1.0) / STRAIGHT)),
    }


def probability(found: Mapping[str, float]) -> float:
    """Return the probability that a finding with these signs is right; 1 without weights."""
    weights = _weights()
    if not weights:
        return 1.0
    odds = weights["constant"] + sum(weights[name] * found[name] for name in SIGNS)
    return float(1.0 / (1.0 + np.exp(-odds)))


def margin_of(wanted: float, found: Mapping[str, float]) -> float:
    """Return the margin that makes a finding as probable as ``wanted``, other signs the same.

    No other effect explains the log as well by then. The margin is from 1 to 1e4, within which it
    counts, or infinite if even that is not enough.
    """
    weights = _weights()
    if not weights:
        return 1.0
    kept = [name for name in SIGNS if name in found and name not in ("margin", "tied")]
    rest = weights["constant"] + sum(weights[name] * found[name] for name in kept)
    sign = (np.log(wanted / (1.0 - wanted)) - rest) / max(weights["margin"], 1e-9)
    return float(10.0 ** max(sign, 0.0)) if sign <= 4.0 else np.inf


@lru_cache(maxsize=1)
def _weights() -> dict[str, Any]:
    return json.loads(WEIGHTS.read_text())["weights"] if WEIGHTS.exists() else {}
