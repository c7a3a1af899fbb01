"""What a reference log says about changes since then.

What both logs need is no change. So what the reference shows of common effects and of its own
findings is evidence in the search for changes. A rare effect found in the new log is compared with
the same effect in both: where the reference cannot tell, since its motion would not show it, as
much speaks for the one as for the other, and changes that only the one needs are as doubtful.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from jaxidl.effects import Effect, added_to
from jaxidl.gap.choice.find import Found
from jaxidl.gap.choice.objections import possible
from jaxidl.gap.evidence.gram import Anchor, Item, Key
from jaxidl.gap.evidence.items import columns_of, item
from jaxidl.gap.evidence.rows import rms
from jaxidl.gap.evidence.shape import effect_at, reads_load, vector
from jaxidl.gap.fit.library import load_of, residual, with_friction
from jaxidl.gap.fit.score import Score
from jaxidl.gap.result.diagnosis import SURE, Finding
from jaxidl.gap.result.words import listed, readable


def evidence_of(before: Found, more: Sequence[Item] = ()) -> Anchor:
    """Return the evidence of a log about common effects and its findings, at the values found.

    It is also about ``more`` items, of which the log was found to have nothing.
    """
    rows, score, members = before.library.rows, before.score, [*_known(before), *more]
    fresh = Score(
        rows._replace(gap=residual(rows, before.solution)), members, score.noise, score.effective
    )
    gram, right, known, _ = fresh.normal(members)
    at = [
        before.solution.x[before.solution.of(m)] if m in before.named else np.zeros(len(m.lower))
        for m in members
    ]
    information, pull = gram.sum(0) + known, right.sum(0) - known @ np.concatenate(at)
    return Anchor(tuple(members), information, pull, fresh.alike)


def _known(before: Found) -> list[Item]:
    """Return what a log is evidence of: its findings, and what else is common."""
    taken = {m.group for m in before.named}
    rest = before.library.envelope.members
    return [*before.named, *(m for m in rest if not m.always and m.group not in taken)]


def shared(
    before: Found,
    found: Found,
    common: Sequence[Effect],
    beside: Sequence[Sequence[Effect]],
) -> list[Effect]:
    """Return the effects ``common`` to two logs with what explains both best beside the changes.

    They stay what they were where they would not be possible ``beside`` the model's effects and the
    changes, as these are fitted. So do effects without amplitudes, such as a motor constant.
    """
    now, out = found.solution, list(common)
    anchor = found.score.anchor
    for old, new in zip(_known(before), anchor.items if anchor else (), strict=True):
        more = effect_at(old.shape, vector(old.shape, now.x[now.of(new)]))
        if not old.shape.free or not all(possible(more, [*out, *others]) for others in beside):
            continue
        for n, e in enumerate(out):
            if (whole := added_to([e], more)) is not more:
                out[n] = whole
                break
        else:
            out.append(more)
    return out


def left_by(found: Found) -> np.ndarray:
    """Return the residual (J,) that was left by what was found [N or Nm]."""
    rows = found.library.rows
    return rms(residual(rows, found.solution), rows.used)


def since_then(found: Found, before: Found) -> dict[Key, float]:
    """Return the probability that each effect found was not there ``before``.

    An effect that the reference does not know is compared with the same effect in both logs: at
    least one half speaks for a change, since the search of the reference has not found it. If it
    was there before, other changes may not be needed, and are as doubtful.
    """
    score, now, out = found.score, found.solution, {v.key: 1.0 for v in found.fitted}
    known = score.anchor.items if score.anchor else ()
    for v in found.fitted:
        if v.key in {i.key for i in known}:
            continue  # the search has compared them
        both = [_anywhere(m) for m in v.items]
        anchor = evidence_of(before, [_then(m, before) for m in v.items])
        anchor = anchor._replace(items=(*known, *both))
        every = [*(m for m in now.members if m not in v.items), *both]
        fresh = Score(found.library.rows, every, score.noise, score.effective, anchor)
        with_it = fresh.solve(every).value
        rise = with_it - (now.value - sum(m.odds for m in v.items))
        likely = float(1.0 / (1.0 + np.exp(min(rise, 0.0))))
        for o in found.fitted:
            if o is v or fresh.solve([m for m in every if m not in o.items]).value >= with_it:
                out[o.key] *= likely
    return out


def _anywhere(m: Item) -> Item:
    """Return an item as it is if both logs have it: no finding, with any value."""
    far = np.full(len(m.lower), np.inf)
    return replace(m, always=True, odds=0.0, lower=-far, upper=far)


def _then(m: Item, before: Found) -> Item:
    """Return an item of the new log as it would have been in the one before."""
    rows, torque = before.library.rows, before.predicted
    if reads_load(m.shape):
        rows, torque = with_friction(rows, before.solution), load_of(rows, before.solution)
    return item(m.shape, *columns_of([m.shape], rows, torque))


def untold(since: Mapping[Key, float], named: Sequence[Finding], names: Sequence[str]) -> list[str]:
    """Return a sentence about changes ``named`` of joints called ``names`` that may be none.

    ``since`` is the probability that each is a change.
    """
    found = [
        readable(f.name) + (f" ({names[f.joint]})" if f.joint is not None else "")
        for f in named
        if since.get((f.name, f.joint), 1.0) < SURE
    ]
    if not found:
        return []
    return [
        f"the reference log hardly tells whether {listed(found)} changed since then; record both"
        " logs with the same motion"
    ]
