"""What the whole log does not confirm is not named.

The search fits to a part of the log. Fitted to all of it, an effect's values must differ from zero,
one by one or together, be off their bounds, and be possible in a simulation. What only seems wrong
since another effect has gone is judged again once something else could take that one's place.
Nothing takes the place of what may be zero: it would be as little sure.
"""

from collections.abc import Sequence

import numpy as np

from jaxidl.effects import Effect, added_to
from jaxidl.errors import EffectError
from jaxidl.gap.choice.objections import BOUND, EXCLUDED
from jaxidl.gap.evidence.gram import Group, Key
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.fit.score import Score, Solution
from jaxidl.gap.fit.values import Value, values

UNSURE = "the whole log does not confirm what a part of it suggests"


def possible(effect: Effect, own: Sequence[Effect]) -> bool:
    """Return whether an effect, with what the model has of it already, is within its bounds.

    Values fitted to the whole log may leave them; a model with such an effect cannot be simulated.
    """
    try:
        added_to(own, effect).check()
    except EffectError:
        return False
    return True


def confirmed(
    score: Score, now: Solution, rows: Rows, predicted: np.ndarray
) -> tuple[Solution, list[Value], dict[Group, str]]:
    """Return a set without what the whole log does not confirm, its values, and what went and why.

    The values are fitted to the whole log. The weakest goes first, since the others were fitted
    beside it; nothing goes that was confirmed before.
    """
    dropped, doubted = dict[Group, str](), set[Key]()
    while True:
        fitted = values(score, now, rows.whole(), predicted)
        wrong = {v.key: why for v in fitted if (why := unconfirmed(v, rows.effects))}
        doubted = doubted or wrong.keys()
        if not (wrong := {key: why for key, why in wrong.items() if key in doubted}):
            return now, fitted, dropped
        less = {
            key: score.solve([m for m in now.members if m.always or m.key != key]) for key in wrong
        }
        weakest = max(less, key=lambda key: less[key].value)
        gone = (m.group for m in now.members if not m.always and m.key == weakest)
        dropped |= dict.fromkeys(gone, wrong[weakest])
        now = less[weakest]


def unconfirmed(value: Value, own: Sequence[Effect]) -> str:
    """Return why the values fitted to the whole log rule an effect out; empty if they do not."""
    known = any(np.any(np.abs(v) > EXCLUDED * e) for v, e in value.parameters.values())
    if not (known or value.together > EXCLUDED or value.share > 0.0):
        return UNSURE
    if value.on_bound:
        return BOUND
    return "" if possible(value.effect, own) else "its value is impossible"
