"""The torque balance of a model with given effects.

Nothing is fitted except when within a sample a torque acts.
"""

from collections.abc import Collection, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxidl.effects import CATALOGUE, Effect
from jaxidl.gap.evidence.additions import additions
from jaxidl.gap.evidence.behind import Behind
from jaxidl.gap.evidence.friction import before_gears
from jaxidl.gap.evidence.items import imitation
from jaxidl.gap.evidence.rows import Rows, rows_of
from jaxidl.gap.fit.library import alignments, noise_of, residual, upsampled
from jaxidl.gap.fit.score import Score
from jaxidl.logs.signals import Signals
from jaxidl.systems.free import inner


def balance(
    signals: Signals, own: Sequence[Effect], more: Sequence[Effect] = (), held_out: float = 0.3
) -> tuple[Rows, Float[np.ndarray, "N J"]]:
    """Return the rows of a log and the residual of a model with effects there (N, J) [N or Nm].

    This is how a diagnosis of the patched model would begin.

    Args:
        signals: the log, prepared for the model with its ``own`` effects.
        own: effects of the model: what they do to the encoders is undone in the signals.
        more: additional effects: what they do to the encoders is not.
        held_out: share of the rows that is held out.
    """
    rows = rows_of(signals, own, held_out)
    left, predicted, tau = rows.gap, rows.tau, rows.tau
    every = (*own, *more)
    unloaded, behind = before_gears(every, signals, tau), Behind(every, signals.body)
    for _ in range(2):  # what reads the torque reads the predicted one, after the motor's effects
        left, tau = rows.gap, rows.tau
        for effect in more:
            load = predicted + tau - rows.tau
            added, tau = additions([effect], signals, tau, load, unloaded=unloaded, behind=behind)
            left = left - added[0]
        predicted = upsampled(rows, rows.command - left)
    rest = rows._replace(gap=left, tau=tau)
    noise, effective = noise_of(rest, left, ())
    items = alignments(rest, predicted)
    return rest, residual(rest, Score(rest, items, noise, effective).solve(items))


def parts_of(
    effect: Effect, names: Sequence[str], present: Collection[str], signals: Signals
) -> list[Float[np.ndarray, " P"]]:
    """Return amplitudes (P,) with which an effect adds the same as simpler effects on its joint.

    There is one array for one unit of each simpler effect among ``present``. Only those count that
    the effect contains while its parameters ``names`` are free, and that have one parameter.
    """
    own = inner(effect)
    contained = [
        name for name in own.contains(tuple(names)) if name in present and name in CATALOGUE
    ]
    if not own.linear or not contained or own is effect:
        return []
    zero = own.replace(**{n: 0.0 * getattr(own, n) for n in own.parameters})
    ones = lambda name: zero.replace(**{name: 0.0 * getattr(own, name) + 1.0})
    columns = _added([ones(name) for name in names], effect, signals)
    unit = lambda cls: cls(*(jnp.ones(1) for _ in cls.parameters))
    simple = [CATALOGUE[name] for name in contained if len(CATALOGUE[name].parameters) == 1]
    parts = [_added([unit(cls)], effect, signals)[0] for cls in simple]
    return [a for part in parts if (a := imitation(columns, part)) is not None]


def _added(parts: Sequence[Effect], effect: Effect, signals: Signals) -> np.ndarray:
    """Return the torque that effects on the joint of another one add (G, N, J)."""
    return additions(
        [effect.replace(effect=part) for part in parts], signals, signals.tau, signals.tau
    )[0]
