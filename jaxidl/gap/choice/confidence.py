"""The confidence of a finding by resampling.

On each draw the blocks of the log get random weights (the Bayesian bootstrap, Rubin 1981), and the
search improves its result. The share of draws in which an effect is still found is one factor of
its confidence (:mod:`jaxidl.gap.result.calibration`). No block is left out of a draw: with it would
go positions that no other block visits, and with those a table over position. Resampling does not
detect imitation: an effect that takes the place of one missing from the catalogue is found on every
draw. Which effects can replace each other shows in what takes a member's place when it is not
found.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from jaxidl.gap.choice import estimates
from jaxidl.gap.choice.objections import held
from jaxidl.gap.choice.search import search
from jaxidl.gap.evidence.gram import Group, Item
from jaxidl.gap.fit.score import Score, Solution

DRAWS = 24
# log odds: an explanation with a twenty times lower prior is not an equal one
FARTHER = 3.0
OFTEN = 0.8  # a member found on a smaller share of draws may be another effect


class Support(NamedTuple):
    """The result of resampling a set."""

    share: dict[Group, float]  # share of the draws in which a member is found
    instead: dict[Group, dict[Group, int]]  # what takes a member's place, and how often
    # for each draw: by how much the coefficients of each member found on it differ; left out are
    # those beside an effect on a bound, which could not be named there
    moves: list[dict[Group, np.ndarray]]


def support(
    score: Score,
    found: Solution,
    draws: int = DRAWS,
    seed: int = 0,
    watch: Callable[[float], None] = lambda share: None,
) -> Support:
    """Return how often each member of a set stays when the training blocks are weighed anew."""
    rng, blocks = np.random.default_rng(seed), len(score.weights)
    there = {m.group: 0 for m in found.members}
    instead: dict[Group, dict[Group, int]] = {m.group: {} for m in found.members}
    moves: list[dict[Group, np.ndarray]] = []
    rival = _rivals(score, found)
    for draw in range(draws):
        watch(draw / draws)
        weights = blocks * rng.dirichlet(np.ones(blocks))
        now = search(rival.resampled(weights), found.members, swap=False)
        groups = {m.group: m for m in now.members}
        new = [m for m in now.members if m.group not in there]
        bound = {j for m in new if held(m, now.x[now.of(m)]) for j in m.joints}
        moves.append(
            {
                m.group: now.x[now.of(m)] - found.x[found.of(m)]
                for m in found.members
                if m in now.members and not bound & set(m.joints)
            }
        )
        for m in found.members:
            if m.group in groups:
                there[m.group] += 1
                continue
            for other in new:
                if set(other.joints) & set(m.joints):
                    instead[m.group][other.group] = instead[m.group].get(other.group, 0) + 1
    return Support({g: n / draws if draws else 1.0 for g, n in there.items()}, instead, moves)


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


def ambiguous(found: Sequence[Item], said: Support) -> list[list[Group]]:
    """Return sets of effects that replace each other across draws, the one found first."""
    sets = []
    for m in found:
        missing = 1.0 - said.share[m.group]
        if missing <= 1.0 - OFTEN:
            continue
        often = [g for g, n in said.instead[m.group].items() if n >= 0.5 * missing * DRAWS]
        if often:
            sets.append([m.group, *often])
    return sets
