"""Find what is missing in a log: the search, the shapes, the findings and their confidence.

The algorithm is described in :mod:`jaxidl.gap.choice.search`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from jaxidl.gap.choice.confidence import Support, support
from jaxidl.gap.choice.objections import UNSURE, confirmed, held, nameable
from jaxidl.gap.choice.rivals import Contests, Tie, contested, tied
from jaxidl.gap.choice.search import search
from jaxidl.gap.evidence.gram import Group, Item, Key
from jaxidl.gap.evidence.items import columns_of, items_of
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.shape import Shape, acts_on_predicted, movable, reads_load
from jaxidl.gap.fit.library import (
    Library,
    behind_encoders,
    load_of,
    pushed,
    residual,
    upsampled,
    with_friction,
)
from jaxidl.gap.fit.prior import compact, turned
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.shapes import arriving, fitted, seen_from
from jaxidl.gap.fit.values import Value

ROUNDS = 5  # rounds of fitting shapes and searching sets, and of reading a load
STEADY = 1e-3  # relative change of values below which they no longer change

Watch = Callable[[str, float], None]  # told what is being done, and which share of it is


@dataclass(frozen=True)
class Found:
    """The result of a search. J joints."""

    library: Library
    score: Score  # with the members' fitted shapes
    solution: Solution  # of the effects that may be named
    fitted: list[Value]  # their values, fitted to the whole log
    predicted: np.ndarray  # (T, J) command predicted by the members [N or Nm]
    support: Support
    ties: list[Tie]  # effects that explain the log as well as what was found
    dropped: dict[Group, str]  # effects that the search chose but that may not be named, and why
    apart: frozenset[Key] = frozenset()  # effects whose parts are named beside them

    @property
    def named(self) -> tuple[Item, ...]:
        """The effects found."""
        return tuple(m for m in self.solution.members if not m.always)

    @property
    def explaining(self) -> list[Item]:
        """The effects found, all other common effects and what every set has."""
        named = {m.group for m in self.named}
        usual = [i for i in self.library.score.items if i.common or i.always]
        return [*(i for i in usual if i.group not in named), *self.named]


def find(library: Library, min_gain: float, watch: Watch = lambda what, share: None) -> Found:
    """Return what is missing."""
    rows = library.rows
    score, predicted = library.score, library.predicted
    banned, doubted = dict[Group, str](), dict[Group, str]()
    watch("searching", 0.0)
    now = first(score)
    number, contests = 0, Contests()
    while True:
        watch("fitting shapes", number / ROUNDS)
        score, now, predicted = settled(score, now, library, predicted, contests)
        rows = behind_encoders(rows, now)
        fit, number = set(now.members), number + 1
        back = [i for i in library.score.items if i.group in banned and not movable(i.shape)]
        score = score.having([*score.items, *back]) if back else score
        now, narrow, banned, weak = nameable(score, now, rows, min_gain, banned)
        now, whole, dropped = confirmed(narrow, now, rows, predicted)
        doubtful = {group: why for group, why in dropped.items() if why != UNSURE}
        weak |= {group: why for group, why in dropped.items() if why == UNSURE}
        doubted |= doubtful
        if number == ROUNDS or (
            not doubtful
            and all(m in fit or m.shape is None or not movable(m.shape) for m in now.members)
        ):
            break
        score = score.narrowed([i for i in score.items if i.group not in banned | doubted])
        now = search(score, now.members) if doubtful else now
    narrow, read = reread(narrow, now, rows)
    while dropped or read is not now:
        read, whole, dropped = confirmed(narrow, read, rows, predicted)
        now, doubted = read, doubted | dropped
    gone = banned | doubted | weak
    narrow = narrow.narrowed([i for i in narrow.items if i.group not in gone])
    library = library._replace(rows=behind_encoders(rows, now))
    always = Support({m.group: 1.0 for m in now.members}, [])
    return Found(library, narrow, now, whole, predicted, always, [], gone)


def weighed(found: Found, watch: Watch = lambda what, share: None) -> Found:
    """Return what was found with its support by resampling, and other explanations of the log."""
    score, now, rows = found.score, found.solution, found.library.rows
    said = support(score, now, watch=lambda share: watch("resampling", share))
    watch("looking for other explanations", 0.0)
    anew = seen_anew(score, now, rows, found.predicted, acts_on_predicted)
    anew = seen_anew(anew, now, with_friction(rows, now), load_of(rows, now), reads_load)
    return replace(found, support=said, ties=tied(anew, now, rows, found.predicted))


def first(score: Score) -> Solution:
    """Return the best set that the search reaches from everything common, or from nothing.

    If another log is the reference, it starts from nothing.
    """
    nothing = [i for i in score.items if i.always]
    common = [i for i in score.items if i.common and not i.always and score.anchor is None]
    starts = ([*nothing, *common], nothing) if common else (nothing,)
    return max((search(score, start) for start in starts), key=lambda s: s.value)


def settled(
    score: Score, now: Solution, library: Library, predicted: np.ndarray, contests: Contests
) -> tuple[Score, Solution, np.ndarray]:
    """Return the set with its shapes fitted, its score, and the command (T, J) that it predicts."""
    for _ in range(ROUNDS):
        library = library._replace(rows=behind_encoders(library.rows, now))
        rows = library.rows
        predicted = upsampled(rows, rows.command - residual(rows, now))
        score = seen_anew(score, now, rows, predicted, acts_on_predicted)
        score, members = exchanged(score, now, refitted(score, now, library, predicted))
        score = outgrown(score, members)
        now, before = search(score, members), now
        same = {m.group for m in now.members} == {m.group for m in before.members}
        if same and (better := contested(score, now, rows, predicted, contests)) is not None:
            score, _ = exchanged(score, now, better)
            now = search(score, better)
        elif same:
            break
    return score, now, predicted


def seen_anew(
    score: Score, now: Solution, rows: Rows, torque: np.ndarray, which: Callable[[Shape], bool]
) -> Score:
    """Return the score with items recomputed that depend on the predicted ``torque`` (T, J).

    These are no members, and of a shape for which ``which`` is true: acting on the predicted
    command, or reading the load. While they compete, the latter keep the envelope's prediction:
    once the command is predicted well, a share of it explains it by itself.
    """
    old = [
        i for i in score.items if i.shape is not None and which(i.shape) and i not in now.members
    ]
    if not old:
        return score
    columns = columns_of([i.shape for i in old], rows, torque)
    fresh = [replace(i, columns=c[:, :, list(i.joints)]) for i, c in zip(old, columns, strict=True)]
    return score.having([*(i for i in score.items if i not in old), *pushed(fresh, rows, torque)])


def reread(score: Score, now: Solution, rows: Rows) -> tuple[Score, Solution]:
    """Return the set whose effects read the load that this very set predicts, and its score."""
    for _ in range(ROUNDS):
        shapes = [m.shape for m in now.members if m.shape is not None and not m.always]
        reading = [s for s in shapes if reads_load(s) and not movable(s)]
        if not reading:
            break
        fresh = items_of(reading, with_friction(rows, now), load_of(rows, now), score.items)
        score, members = exchanged(score, now, fresh)
        now, before = score.solve(members), now
        # what has become like one of its parts has fewer coefficients
        if now.x.shape == before.x.shape and np.allclose(now.x, before.x, rtol=STEADY):
            break
    return score, now


def exchanged(score: Score, now: Solution, fresh: list[Item]) -> tuple[Score, list[Item]]:
    """Return the score and the set with ``fresh`` items in place of their groups'."""
    groups = {i.group for i in fresh}
    stay = [m for m in now.members if m.group not in groups]
    old = {id(m) for m in now.members if m.group in groups}
    items = [
        *(i for i in score.items if id(i) not in old),
        *(i for i in fresh if i not in score.items or id(i) in old),
    ]
    return score.having(items), [*stay, *fresh]


def outgrown(score: Score, members: list[Item]) -> Score:
    """Return the score without starting shapes that fitted ones replace.

    In the fitted one's place such a shape would be scaled as far as it may. Held there it may seem
    better by chance, and nothing on a bound is named.
    """
    gone = set[Item]()
    for m in members:
        if m.shape is not None and movable(m.shape) and not m.shape.free:
            rest = [o for o in members if o is not m]
            for i in (i for i in score.items if i.group == m.group and i is not m):
                at = score.solve([*rest, i])
                if held(i, at.x[at.of(i)]):
                    gone.add(i)
    return score.narrowed([i for i in score.items if i not in gone]) if gone else score


def refitted(score: Score, now: Solution, library: Library, predicted: np.ndarray) -> list[Item]:
    """Return the members whose columns change.

    They are those with a shape, fitted, those of a motor behind others, those that read the torque,
    a load, and a tilt of the base.
    """
    fresh, rows, x = [], library.rows, [now.x[now.of(m)] for m in now.members]
    for m in now.members:
        if m.shape is None or m.always:
            continue
        there = arriving(m, now.members, x, rows, predicted)
        if movable(m.shape):
            fresh.append(fitted(m, now, there, predicted, library.score))
        elif there is not rows:
            fresh.append(seen_from(m, m.shape, there, predicted))
        elif reads_load(m.shape):
            load = load_of(rows, now)
            fresh += items_of([m.shape], with_friction(rows, now), load, library.score.items)
        else:
            fresh += [compact(m, now, rows, score, predicted), turned(m, now, rows, predicted)]
    return [m for m in fresh if m is not None]
