"""What effects do to the encoders is undone: the true motion behind the readings."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from jaxidl.effects import Effect, OnJoint
from jaxidl.logs.low_pass import by_run, derivative


def true_positions(
    effects: Sequence[Effect], q: np.ndarray, slices: tuple[slice, ...], dt: float
) -> np.ndarray:
    """Return the positions (T, J) behind encoder readings ``q`` (T, J).

    What ``effects`` do to the encoders is undone, the last one first.
    """
    for effect in filter(on_encoders, reversed(effects)):
        undone = lambda part, e=effect: np.asarray(e.true_position(jnp.asarray(part), dt))
        q = by_run(q, slices, undone)
    return q


def true_motion(
    effects: Sequence[Effect],
    q: np.ndarray,
    qd: np.ndarray,
    qdd: np.ndarray,
    slices: tuple[slice, ...],
    dt: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions, velocities and accelerations (T, J) behind measured ones.

    See :func:`true_positions`. It is applied after smoothing, as where an effect is fitted: a shift
    in time averages neighbouring samples, and on raw ones that would look like a quieter encoder.
    """
    if not any(map(on_encoders, effects)):
        return q, qd, qdd
    true = true_positions(effects, q, slices, dt)
    slope = lambda x: by_run(x, slices, lambda part: derivative(part, dt))
    # a logged velocity is corrected, not derived anew: it is as late as the position
    speed = slope(true - q)
    return true, qd + speed, qdd + slope(speed)


def lateness(effects: Sequence[Effect], q: np.ndarray, dt: float) -> int:
    """Return how many instants at the end of a run need later readings for true positions.

    The run is like ``q`` (T, J). They are the instants at the end of half a steady motion that
    change when its other half is read too.
    """
    if not any(map(on_encoders, effects)):
        return 0
    half = len(q) // 2
    steady = np.linspace(0.0, 1.0, len(q))[:, None] + 0.0 * q
    whole, part = (
        true_positions(effects, x, (slice(None),), dt)[:half] for x in (steady, steady[:half])
    )
    told = np.all(np.abs(whole - part) < 1e-3 / len(q), axis=1)
    return half - int(np.argmin(told)) if not told.all() else 0


def on_encoders(effect: Effect) -> bool:
    """Return whether the effect changes the encoders' readings in a way that can be undone."""
    inner = effect.effect if isinstance(effect, OnJoint) else effect
    return type(inner).true_position is not Effect.true_position
