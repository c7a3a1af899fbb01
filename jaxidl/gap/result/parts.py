"""Whether a log's parts differ: a load was picked up half-way, or somebody guided the robot.

What was found is fitted anew to the part of the log before an instant and to that after it (Chow
1960). The parts differ if that leaves less than half of some joint's mean square error, and if it
makes the log more likely than the additional parameters explain.
"""

from collections.abc import Sequence

import numpy as np

from jaxidl.gap.choice.find import Found
from jaxidl.gap.evidence.items import PARAMETER
from jaxidl.gap.fit.score import RIDGE
from jaxidl.gap.result.diagnosis import MUCH

SHORTEST = 3  # blocks of either part
LESS = 0.5  # of the mean square error
CLEAR = 20.0  # log likelihood


def differing(found: Found, names: Sequence[str]) -> list[str]:
    """Return a sentence if the parts of a log of joints called ``names`` differ; else nothing.

    Changes since another log are not asked about.
    """
    rows, score, members = found.library.rows, found.score, found.solution.members
    if score.anchor is not None:
        return []
    at, count = score.indices(members), score.count[score.training].sum(0)
    blocks, floor = len(score.weights), np.maximum(score.floor * count, 1e-300)

    def error(part: slice) -> np.ndarray:
        """Return the sum of squares (J,) that the best coefficients leave of some blocks."""
        gram, right, own = score.normal_equations(at, part)
        steady = gram.sum(0) + np.diag(RIDGE * np.diagonal(gram.sum(0)) + 1e-9 + score.prior[at])
        x = np.linalg.solve(steady, right.sum(0)) if len(at) else np.zeros(0)
        return np.maximum(score.errors(own, x, part).sum(0), 0.0)

    whole, splits = error(slice(blocks)), range(SHORTEST, blocks - SHORTEST + 1)
    apart = np.stack([error(slice(k)) + error(slice(k, blocks)) for k in splits])
    gain = 0.5 * np.log(np.maximum(whole, floor) / np.maximum(apart, floor)) @ score.effective
    k = int(np.argmax(gain))
    unit = score.noise / np.sqrt(np.maximum(count, 1.0)) / np.maximum(rows.spread, 1e-300)
    usual, left = np.sqrt(whole) * unit, np.sqrt(apart[k]) * unit
    shows = (apart[k] < LESS * whole) & (usual > MUCH)
    if gain[k] < CLEAR + PARAMETER * len(at) or not shows.any():
        return []
    j, signals = int(np.argmax(np.where(shows, usual - left, -1.0))), rows.signals
    begin = int(signals.rows[np.flatnonzero(rows.block >= splits[k])[0]])
    run = next(n for n, part in enumerate(signals.slices) if begin < part.stop)
    since = (begin - signals.slices[run].start) * signals.dt
    where = f" of run {run + 1}" if len(signals.slices) > 1 else ""
    return [
        f"the log differs before and after about {since:.0f} s{where}: fitted to either part alone,"
        f" what was found leaves {left[j]:.0%} of {names[j]}'s torque instead of {usual[j]:.0%}, as"
        " if a load had been picked up or someone had guided the robot; diagnose the parts one by"
        " one, or one with the other as --reference"
    ]
