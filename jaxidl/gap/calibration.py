"""From what speaks for a finding to how likely it is right: a logistic model, fitted to the benchmark's cases of another root.

Resampling a log does not see imitation: an effect that stands for something the catalogue has not is there on every draw. What
gives it away is that it is rare, explains little, and leaves something behind. ``experiments/calibrate.py`` fits the weights.
"""

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

WEIGHTS = Path(__file__).with_suffix(".json")

SIGNS = (
    *("support", "evidence", "margin", "gain", "share", "remainder", "unexplained", "systematic", "odds", "tied"),
    *("rare", "own", "left", "strange"),
)
"""What speaks for and against a finding, as numbers of about the same size."""


def signs(
    support: float,
    evidence: float,
    margin: float,
    gain: float,
    share: float,
    remainder: float,
    unexplained: float,
    systematic: float,
    odds: float,
    common: bool,
    tied: bool,
) -> dict[str, float]:
    """Return the signs of a finding.

    Args:
        support: share of draws of the log's blocks in which the search keeps it.
        evidence: fall of the score without it.
        margin: by how much it promises more than the best other effect in its place.
        gain: share of the error on data kept aside that goes with it, on its joint.
        share: of the command that it explains there.
        remainder: error that is left there over the floor of the noise.
        unexplained: share of the gap there that is neither explained nor noise.
        systematic: share of what is left there that a network predicts.
        odds: the effect's log prior odds.
        common: does conventional identification fit it on every joint?
        tied: does another effect explain the log as well?
    """
    log = lambda x, low, high: float(np.log10(np.clip(x, low, high)))  # noqa: E731
    rare, left = float(not common), log(remainder, 1.0, 30.0)
    explained, open_ = log(share, 1e-3, 1.0), log(unexplained, 1e-2, 1.0)
    return {
        "support": support,
        "evidence": log(evidence, 1.0, 1e4),
        "margin": log(margin, 1.0, 1e4),
        "gain": float(np.clip(gain, -0.2, 1.0)),
        "share": explained,
        "remainder": left,
        "systematic": float(np.clip(systematic, 0.0, 1.0)),
        "odds": odds / 4.0,
        "own": rare * explained,
        "rare": rare,
        "left": rare * left,
        "tied": float(tied),
        "unexplained": open_,
        "strange": rare * open_,
    }


def probability(found: Mapping[str, float]) -> float:
    """Return how likely a finding with these signs is right; the share of draws where nothing has been fitted yet."""
    weights = _weights()
    if not weights:
        return found["support"]
    return float(1.0 / (1.0 + np.exp(-weights["constant"] - sum(weights[name] * found[name] for name in SIGNS))))


@lru_cache(maxsize=1)
def _weights() -> dict[str, Any]:
    return json.loads(WEIGHTS.read_text())["weights"] if WEIGHTS.exists() else {}
