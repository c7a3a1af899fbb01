"""The confidence of a finding by resampling.

On each draw the blocks of the log get random weights (the Bayesian bootstrap, Rubin 1981), and the
search improves its result. The share of draws in which an effect is still found is one factor of
its confidence (:mod:`jaxidl.gap.result.calibration`). No block is left out of a draw: with it would
go positions that no other block visits, and with those a table over position. Resampling does not
detect imitation: an effect that takes the place of one missing from the catalogue is found on every
draw. Effects that can replace each other are looked for in :mod:`jaxidl.gap.choice.rivals`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jaxidl.gap.choice import estimates
from jaxidl.gap.choice.objections import held
from jaxidl.gap.choice.search import search
from jaxidl.gap.evidence.gram import Group
from jaxidl.gap.fit.score import Score, Solution

DRAWS = 24
# log odds: an explanation with a twenty times lower prior is not an equal one
FARTHER = 3.0


class Support(NamedTuple):
    """The result of resampling a set."""

    share: dict[Group, float]  # share of the draws in which a member is found
    # for each draw: by how much the coefficients of each member found on it differ; left out are
    # those beside an effect on a bound, which could not be named there
    moves: list[dict[Group, np.ndarray]]


def support(
    score: Score,
    found: Solution,
    watch: Callable[[float], None] = lambda share: None,
) -> Support:
    """Return how often each member of a set stays when the training blocks are weighed anew."""
    rng, blocks = np.random.default_rng(0), len(score.weights)
    there = {m.group: 0 for m in found.members}
    moves: list[dict[Group, np.ndarray]] = []
    rival = _rivals(score, found)
    for draw in range(DRAWS):
        watch(draw / DRAWS)
        weights = blocks * rng.dirichlet(np.ones(blocks))
        now = search(rival.resampled(weights), found.members, swap=False)
        new = [m for m in now.members if m.group not in there]
        bound = {j for m in new if held(m, now.x[now.of(m)]) for j in m.joints}
        moves.append(
            {
                m.group: now.x[now.of(m)] - found.x[found.of(m)]
                for m in found.members
                if m in now.members and not bound & set(m.joints)
            }
        )
        for group in there.keys() & {m.group for m in now.members}:
            there[group] += 1
    return Support({g: n / DRAWS for g, n in there.items()}, moves)


def _rivals(score: Score, found: Solution) -> Score:
    """Return the score restricted to items that could take a member's place.

    They are those that promise most, with it and without, unless their prior was much lower than
    that of everything on its joints.
    """
    promise = estimates.promise(score, found.members)
    near = {id(i) for i in score.items if promise.get(id(i), -np.inf) > -4.0}
    for m in found.members:
        without = estimates.promise(score, [o for o in found.members if o is not m])
        ranked = sorted(
            (i for i in score.items if id(i) in without and set(i.joints) & set(m.joints)),
            key=lambda i: -without[id(i)],
        )
        near |= {id(i) for i in ranked[:3]}
    least = {
        j: min((m.odds for m in found.members if j in m.joints), default=0.0) - FARTHER
        for j in range(len(score.noise))
    }
    likely = [i for i in score.items if id(i) in near and i.odds > min(least[j] for j in i.joints)]
    return score.narrowed([*likely, *(m for m in found.members if m not in likely)])
