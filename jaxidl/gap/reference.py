"""What a reference log says about a later one of the same machine."""

import numpy as np

from jaxidl.gap.choice.find import Found
from jaxidl.gap.evidence.gram import Anchor
from jaxidl.gap.evidence.rows import rms
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score


def reference_of(before: Found) -> Anchor:
    """Return the evidence of a log about common effects and its findings, at the values found."""
    rows, score, named = before.library.rows, before.score, before.named
    taken = {m.group for m in named}
    members = [
        *named,
        *(m for m in before.library.envelope.members if not m.always and m.group not in taken),
    ]
    fresh = Score(
        rows._replace(gap=residual(rows, before.solution)), members, score.noise, score.effective
    )
    gram, right = fresh.normal(members)
    known, _ = fresh.known(members)
    at = [
        before.solution.x[before.solution.of(m)] if m in named else np.zeros(len(m.lower))
        for m in members
    ]
    return Anchor(tuple(members), gram.sum(0) + known, right.sum(0) - known @ np.concatenate(at))


def left_by(found: Found) -> list[float]:
    """Return the residual (J,) that was left by what was found [N or Nm]."""
    rows = found.library.rows
    return rms(residual(rows, found.solution), rows.used).tolist()
