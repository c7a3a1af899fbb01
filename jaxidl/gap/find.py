"""Find what is missing in a log: the search, the shapes, the findings and their confidence.

The algorithm is described in :mod:`jaxidl.gap.search`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from jaxidl.effects import Effect
from jaxidl.gap.confidence import DRAWS, Support, support
from jaxidl.gap.consistent import physical_fit
from jaxidl.gap.gram import Group, Item
from jaxidl.gap.items import columns_of, items_of
from jaxidl.gap.library import Library, pushed, residual, upsampled
from jaxidl.gap.noise import in_units_of_noise
from jaxidl.gap.projection import ALIGNMENT
from jaxidl.gap.rivals import Tie, contested, tied
from jaxidl.gap.rows import Rows
from jaxidl.gap.score import Score, Solution
from jaxidl.gap.search import EPSILON, search, without
from jaxidl.gap.shape import movable, on_bound, sees, vector
from jaxidl.gap.shapes import fitted

ROUNDS = 5  # rounds of fitting shapes and searching sets
BOUND = "its value is on a bound"
UNPHYSICAL = "it would require a link that cannot be built, or friction that feeds motion"
STRONG = 10.0  # contribution to the score: without such an effect the set is a different one
EXCLUDED = 2.0  # standard errors by which a value must differ from zero

Watch = Callable[[str, float], None]


@dataclass(frozen=True)
class Found:
    """The result of a search. J joints."""

    library: Library
    score: Score  # with the members' fitted shapes
    solution: Solution  # of the effects that may be named
    predicted: np.ndarray  # (T, J) command predicted by the members [N or Nm]
    support: Support
    ties: list[Tie]  # effects that explain the log as well as what was found
    dropped: dict[Group, str]  # effects that the search chose but that may not be named, and why

    @property
    def named(self) -> tuple[Item, ...]:
        """The effects found."""
        return tuple(m for m in self.solution.members if not m.always)


def find(
    library: Library,
    min_gain: float,
    watch: Watch = lambda what, share: None,
    resample: bool = True,
) -> Found:
    """Return what is missing.

    The search starts from the envelope, or from nothing if another log is the reference.
    """
    rows = library.rows
    score, predicted, banned = library.score, library.predicted, dict[Group, str]()
    watch("searching", 0.0)
    now = search(score, [i for i in score.items if i.always or (i.common and score.anchor is None)])
    number = 0
    while True:
        watch("fitting shapes", number / ROUNDS)
        score, now, predicted = settled(score, now, library, predicted)
        fit, number = set(now.members), number + 1
        now, narrow, strong, weak = nameable(score, now, rows, min_gain)
        banned |= strong
        if number == ROUNDS or all(
            m in fit or m.shape is None or not movable(m.shape) for m in now.members
        ):
            break
        score = score.narrowed([i for i in score.items if i.group not in strong])
    watch("resampling", 0.0)
    said = support(
        narrow, now, DRAWS if resample else 0, watch=lambda share: watch("resampling", share)
    )
    watch("looking for other explanations", 0.0)
    ties = (
        tied(seen_anew(narrow, now, rows, predicted, load=True), now, library, predicted)
        if resample
        else []
    )
    return Found(library, narrow, now, predicted, said, ties, banned | weak)


def settled(
    score: Score, now: Solution, library: Library, predicted: np.ndarray
) -> tuple[Score, Solution, np.ndarray]:
    """Return the set with its shapes fitted, its score, and the command (T, J) that it predicts."""
    rows = library.rows
    for _ in range(ROUNDS):
        predicted = upsampled(rows, rows.command - residual(rows, now))
        score = seen_anew(score, now, rows, predicted)
        fresh = refitted(now, library, predicted)
        score, after = renewed(score, now, fresh, rows)
        same = {m.group for m in after.members} == {m.group for m in now.members}
        now = after
        if same and (better := contested(score, now, library, predicted)) is not None:
            score, now = renewed(score, now, better, rows)
        elif same:
            break
    return score, now, predicted


def seen_anew(
    score: Score, now: Solution, rows: Rows, predicted: np.ndarray, load: bool = False
) -> Score:
    """Return the score with items recomputed that depend on the predicted command.

    These are no members, and use the command to see whether it gets through; with ``load`` also
    those for which it is the load. While they compete, the latter keep the envelope's prediction:
    once the command is predicted well, a share of it explains it by itself.
    """
    looks = lambda shape: sees(shape) if load else shape.cls.seen is not Effect.seen
    old = [
        i for i in score.items if i.shape is not None and looks(i.shape) and i not in now.members
    ]
    if not old:
        return score
    columns = columns_of([i.shape for i in old], rows, predicted)
    fresh = [replace(i, columns=c[:, :, list(i.joints)]) for i, c in zip(old, columns, strict=True)]
    items = [*(i for i in score.items if i not in old), *pushed(fresh, rows, predicted)]
    return Score(rows, items, score.noise, score.effective, score.anchor, score)


def renewed(score: Score, now: Solution, fresh: list[Item], rows: Rows) -> tuple[Score, Solution]:
    """Return the score with ``fresh`` items in place of their groups', and the best set from it."""
    groups = {i.group for i in fresh}
    members = (
        [*(m for m in now.members if m.group not in groups), *fresh]
        if len(fresh) < len(now.members)
        else fresh
    )
    old = {id(m) for m in now.members if m.group in groups}
    items = [
        *(i for i in score.items if id(i) not in old),
        *(i for i in fresh if i not in score.items or id(i) in old),
    ]
    score = Score(rows, items, score.noise, score.effective, score.anchor, score)
    return score, search(score, members)


def refitted(now: Solution, library: Library, predicted: np.ndarray) -> list[Item]:
    """Return the members whose columns change.

    They are those with a shape, fitted, and those that read the torque.
    """
    fresh = []
    for m in now.members:
        if m.shape is None or m.always:
            continue
        if movable(m.shape):
            fresh.append(fitted(m, now, library.rows, predicted, library.score))
        elif m.shape.effect().reads_torque(len(library.score.noise)):
            fresh += items_of([m.shape], library.rows, predicted, library.score.items)
    return fresh


def nameable(
    score: Score, now: Solution, rows: Rows, min_gain: float
) -> tuple[Solution, Score, dict[Group, str], dict[Group, str]]:
    """Return the set without what may not be named, its score, and what was removed and why.

    There are two records of what was removed: members beside which the rest was judged, and others.
    Members that improve by less than the least improvement are removed last, and nothing takes
    their place.
    """
    now, score, strong, weak = supported(score, now, rows)
    while found := objections(score, now, min_gain, rows):
        _, worst, why = min(found, key=lambda o: o[0])
        weak[worst.group], now = why, score.solve(without(now, worst))
    return now, score, strong, weak


def supported(
    score: Score, now: Solution, rows: Rows
) -> tuple[Solution, Score, dict[Group, str], dict[Group, str]]:
    """Return the set without what the log does not support, as :func:`nameable` does.

    The weakest is removed first; the rest is fitted and searched again each time.
    """
    every, strong, weak = score, dict[Group, str](), dict[Group, str]()
    while True:
        found = objections(score, now, 0.0, rows) or unphysical(score, now, rows)
        if not found:
            again = search(score, now.members) if strong or weak else now
            if again.value <= now.value + EPSILON:
                return now, score, strong, weak
            now = again
            continue
        worth, worst, why = min(found, key=lambda o: o[0])
        if worth > STRONG or why in (BOUND, UNPHYSICAL):  # the others were judged in its presence
            strong[worst.group], weak = why, {}
        else:
            weak[worst.group] = why
        score = every.narrowed(
            [i for i in every.items if i.group not in strong and i.group not in weak]
        )
        now = search(score, without(now, worst), swap=worth > STRONG)


# the member's contribution to the score, and why it may not be named
Objection = tuple[float, Item, str]


def objections(score: Score, now: Solution, min_gain: float, rows: Rows) -> list[Objection]:
    """Return the members that may not be named."""
    found = [(m, why) for m in now.members if (why := objection(score, now, m, min_gain, rows))]
    return [(now.value - score.solve(without(now, m)).value, m, why) for m, why in found]


def unphysical(score: Score, now: Solution, rows: Rows) -> list[Objection]:
    """Return the member without which a physical set explains the log better.

    In such a set all links could be built and all friction dissipates. The list is empty if there
    is no such member.
    """
    cost = price(score, now, rows)
    best, found = now.value - cost, list[Objection]()
    for m in now.members if cost > EPSILON else ():
        if not m.always and (m.shape.cls.friction or m.shape.cls.alter is not Effect.alter):
            then = score.solve(without(now, m))
            if (value := then.value - price(score, then, rows)) > best:
                best, found = value, [(now.value - then.value, m, UNPHYSICAL)]
    return found


def price(score: Score, now: Solution, rows: Rows) -> float:
    """Return how much the score falls if a set is kept physical."""
    x = physical_fit(score, now, rows)
    return (
        0.0
        if x is None
        else score.likelihood(now.members, now.x) - score.likelihood(now.members, x)
    )


def objection(score: Score, now: Solution, m: Item, min_gain: float, rows: Rows) -> str:
    """Return why a member may not be named; empty if it may."""
    if m.always:
        return ""
    at = now.of(m)
    x, stderr = now.x[at], jackknife(now.folds[:, at])
    if not (np.any(np.abs(x) > EXCLUDED * stderr) or together(x, now.folds[:, at]) > EXCLUDED):
        return "its standard error does not exclude zero"
    at_bound = (x <= m.lower) | (x >= m.upper)
    if np.all(at_bound | (x == 0.0)) or on_bound(m.shape, vector(m.shape, x)) or beyond(m, x):
        return BOUND
    other = score.solve(without(now, m))
    interval = rows.signals.dt
    if late(now, m, x) - EXCLUDED * interval / np.sqrt(12.0) <= interval:
        return "it is hardly more than a sampling interval"
    pick = list(m.joints)
    if worse_aside(score, other, now, pick):
        return "held-out data are predicted better without it"
    without_it, with_it = (in_units_of_noise(rows, residual(rows, s)) for s in (other, now))
    if np.all(with_it[pick] > without_it[pick]):
        return "it only makes the encoder's noise smaller"
    if gain(score, other, now)[pick].max() < min_gain:
        return f"it removes less than {min_gain:.0%} of the error"
    return ""


def beyond(m: Item, x: np.ndarray) -> bool:
    """Return whether a member's reported values exceed the catalogue's bounds.

    An example is the centre of a load that is far away.
    """
    if not m.shape.cls.internal:
        return False
    effect = m.shape.at(x).settled()
    values = {n: np.asarray(getattr(effect, n), float) for n in m.shape.cls.parameters}
    return any(
        np.any((v < p.lower) | (v > p.upper))
        for v, p in ((values[n], m.shape.cls.parameters[n]) for n in values)
    )


def late(now: Solution, m: Item, x: np.ndarray) -> float:
    """Return the longest time [s] among the parameters of an effect that only delays.

    It is infinite for other effects. What the alignment of the joint's torque cancels does not
    count.
    """
    if m.shape.free:
        return np.inf
    names = [n for n in movable(m.shape) for _ in range(np.size(m.shape.values[n]))]
    times = [
        v
        for n, v in zip(names, vector(m.shape, x), strict=True)
        if m.shape.cls.parameters[n].unit == "s"
    ]
    back = [float(now.x[now.of(o)][0]) for o in now.members if o.key == (ALIGNMENT, m.shape.joint)]
    return max(times) + min([0.0, *back]) if times else np.inf


def worse_aside(score: Score, before: Solution, after: Solution, joints: list[int]) -> bool:
    """Return whether held-out blocks are predicted worse than before.

    The increase has to exceed the scatter between them, and what noise would explain.
    """
    count = np.maximum(score.count[~score.training], 1.0)
    a, b = (np.maximum(score.aside(s), score.floor * count)[:, joints] for s in (after, before))
    rise = (a - b).sum(1)
    return bool(len(rise) > 1 and rise.sum() > np.std(rise, ddof=1) * np.sqrt(len(rise)))


def worse_by(score: Score, before: Solution, after: Solution, joint: int) -> tuple[float, float]:
    """Return the share of a joint's root mean square held-out error that is removed.

    Also return its standard error.
    """
    a, b = (score.aside(s)[:, joint] / s.passed[joint] for s in (after, before))
    share = lambda x, y: 1.0 - np.sqrt(x / np.maximum(y, 1e-300))
    return float(share(a.sum(), b.sum())), float(jackknife(share(a.sum() - a, b.sum() - b)))


def aside(score: Score, found: Solution) -> np.ndarray:
    """Return the mean squared error (J,) on held-out rows [noise^2].

    It is relative to what actuators let through.
    """
    return (
        score.aside(found).sum(0)
        / np.maximum(score.count[~score.training].sum(0), 1.0)
        / found.passed
    )


def gain(score: Score, before: Solution, after: Solution) -> np.ndarray:
    """Return the share (J,) by which the root mean square error on left-out blocks falls."""
    count = np.maximum(score.count[score.training].sum(0), 1.0)
    a, b = (
        np.sqrt(np.maximum(s.error.sum(0) / count / s.passed, score.floor)) for s in (after, before)
    )
    return 1.0 - a / b


def together(x: np.ndarray, folds: np.ndarray) -> float:
    """Return the root mean square of coefficients (P,) in standard errors, jointly (Wald).

    ``folds`` are the coefficients fitted without one block each.
    """
    if len(x) < 2:
        return 0.0
    apart = folds - folds.mean(0)
    covariance = (len(folds) - 1) / len(folds) * apart.T @ apart
    return float(np.sqrt(max(x @ np.linalg.pinv(covariance, hermitian=True) @ x, 0.0) / len(x)))


def jackknife(samples: np.ndarray) -> np.ndarray:
    """Return the standard error (...) of ``samples`` (B, ...), each without one block."""
    b = len(samples)
    return np.asarray(np.sqrt((b - 1) / b * np.sum((samples - samples.mean(0)) ** 2, axis=0)))
