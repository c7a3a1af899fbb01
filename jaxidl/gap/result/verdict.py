"""The verdict on a log: what is certain, what is in doubt, and what stays unexplained.

What one log cannot tell apart comes with the experiment that separates it.
"""

import shlex
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from jaxidl.effects import CATALOGUE
from jaxidl.gap.choice import estimates
from jaxidl.gap.choice.find import Found
from jaxidl.gap.choice.rivals import Tie
from jaxidl.gap.evidence.gram import Key
from jaxidl.gap.result.diagnosis import LIKELY, MUCH, Ambiguity, Finding, Row

HALF = 0.5  # share of the command's spread that no model may leave
MORE = 1.5  # times what a reference log leaves: less may come from another motion
SHOWN = 12  # most rivals reported
MOST = 2  # most pieces of advice


def verdict_of(
    findings: Sequence[Finding], doubts: Sequence[Ambiguity], unexplained: Sequence[int]
) -> str:
    """Return the verdict.

    A suspicion that is more likely wrong than right does not make a named effect ambiguous.
    """
    if unexplained:
        return "unexplained"
    sure = {(f.name, f.joint) for f in findings if f.sure}
    likely = {(f.name, f.joint) for f in findings if f.confidence >= LIKELY} - sure
    if sure and not any(
        set(d.candidates) & likely and not set(d.candidates) & sure for d in doubts
    ):
        return "named"
    return "ambiguous" if findings else "nothing_missing"


def doubts_of(ties: Sequence[Tie], named: Sequence[Finding]) -> tuple[Ambiguity, ...]:
    """Return sets of effects that the log cannot tell apart, of which the first was found."""
    there = {(f.name, f.joint) for f in named}
    sets = [tuple(dict.fromkeys(g[:2] for g in (*t.found, *t.instead))) for t in ties]
    return tuple(
        Ambiguity(keys, experiment(keys))
        for keys in dict.fromkeys(sets)
        if len(keys) > 1 and keys[0] in there
    )


def unexplained_joints(
    remaining: Sequence[float],
    everywhere: Sequence[float],
    network: Sequence[tuple[float, float]],
    envelope: Sequence[float],
    spread: Sequence[float],
    floor: Sequence[float],
    earlier: Sequence[float] | None = None,
) -> tuple[int, ...]:
    """Return joints with a large residual.

    Large is ``MUCH`` of the command's spread: the part of it that a network still predicts from the
    state, in all of the log, or that the envelope predicts on held-out data. Or it is large if
    ``HALF`` of the command's spread is left there.

    Args:
        remaining: (J,) residual in the model returned, on held-out data [N or Nm].
        everywhere: (J,) the same in all of the log [N or Nm].
        network: (J,) share of it that a network removes, and its standard error.
        envelope: (J,) residual of the envelope [N or Nm].
        spread: (J,) of the command [N or Nm].
        floor: (J,) error due to encoder noise alone [N or Nm].
        earlier: (J,) what a reference log leaves [N or Nm]: no more than that is no change.
    """
    out = []
    for j, (gain, stderr) in enumerate(network):
        left, much = remaining[j], MUCH * spread[j]
        worst = max(left, everywhere[j])
        predicted = worst * np.sqrt(1.0 - (1.0 - np.clip(gain, 0.0, 1.0)) ** 2)
        systematic = predicted > much and gain > 2.0 * stderr
        half = HALF * spread[j] if spread[j] else np.inf  # without a drive there is no command
        beaten = left**2 > min(envelope[j] ** 2 + much**2, half**2)
        before = 0.0 if earlier is None else MORE * earlier[j]
        if worst > max(2.0 * floor[j], before) and (systematic or beaten):
            out.append(j)
    return tuple(out)


def rivals_of(found: Found) -> tuple[Row, ...]:
    """Return the effects that were not chosen, and why."""
    named = {m.key for m in found.named}
    reasons = {g[:2]: why for g, why in found.dropped.items() if g[:2] not in named}
    dropped = [Row(*key, 0.0, why) for key, why in reasons.items()]
    promise = estimates.promise(found.score, found.solution.members)
    rest = sorted(
        (i for i in found.score.items if id(i) in promise and not i.always),
        key=lambda i: -promise[id(i)],
    )
    seen = named | set(reasons)
    for i in rest:
        if i.key not in seen and len(dropped) < SHOWN:
            seen.add(i.key)
            dropped.append(Row(i.key[0], i.key[1], promise[id(i)], "it does not raise the score"))
    return tuple(dropped)


def experiment(candidates: Sequence[Key]) -> str:
    """Return the motion or load that would separate the candidates, as the rarest advises."""
    names = list(dict.fromkeys(name for name, _ in candidates))
    if len(names) == 1:
        return "move all joints at once, at different speeds, and each of them alone"
    ordered = sorted((CATALOGUE[name] for name in names), key=lambda cls: cls.prior)
    return "; or ".join(list(dict.fromkeys(cls.advice for cls in ordered))[:MOST])


def designed(model: Path, folder: Path, names: Iterable[str]) -> str:
    """Return the command that designs the motion to settle the diagnosis in ``folder``.

    ``names`` are those of the effects in question.
    """
    where = shlex.join(["--model", str(model), "--for", str(folder)])
    return f"jaxidl excite {where}{plugins(names)} --out motion.csv"


def plugins(names: Iterable[str]) -> str:
    """Return the option that loads the user's own effects among those of the given names."""
    modules = dict.fromkeys(CATALOGUE[name].__module__ for name in names)
    own = [name for name in modules if not name.startswith("jaxidl.")]
    files = [str(getattr(sys.modules.get(name), "__file__", None) or name) for name in own]
    return f" --plugin {shlex.join(files)}" if files else ""
