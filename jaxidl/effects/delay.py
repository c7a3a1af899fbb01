"""Dead time: a buffer of past values, read between two of them."""

from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxidl.effects.spec import Guess, Scale, Variant
from jaxidl.types import Joints

Line = Float[Array, "H J"]  # row h is the value h + 1 steps ago

DELAYS = (0.002, 0.006, 0.015, 0.035)  # starting values for fits of a dead time [s]
LONGEST = 0.08  # longest dead time searched for [s]: a buffer's cost grows with its length

LATE = (
    "command faster motion, a chirp beyond the present band or small steps of torque: lag, dead"
    " time and compliance differ only at high frequency; a second position sensor or the motor's"
    " own current tells whether torque or position is late"
)
"""How to tell effects of timing apart."""


def variants_of(guesses: Sequence[Guess], scale: Scale) -> list[Variant]:
    """Return starting shapes of a dead time.

    Their buffer is just long enough for the longest dead time that is searched for.
    """
    options = {"steps": max(4, int(LONGEST / scale.dt))}
    return [Variant(guess, within={"delay": (0.0, LONGEST)}, options=options) for guess in guesses]


def line(value: Joints, steps: int) -> Line:
    """Return a buffer that has always held ``value`` (J,)."""
    return jnp.broadcast_to(value, (steps, *value.shape))


def push(past: Line, value: Joints) -> Line:
    """Return the buffer one step later."""
    return jnp.concatenate([value[None], past[:-1]])


def late(value: Joints, past: Line, delay: Joints) -> Joints:
    """Return the value ``delay`` (J,) steps ago [1], interpolated linearly between two steps.

    It is no older than the buffer is long.
    """
    everything = jnp.concatenate([value[None], past])
    delay = jnp.clip(delay, 0.0, past.shape[0] - 1e-6)
    before = jnp.floor(delay).astype(int)
    joints, share = jnp.arange(value.shape[0]), delay - before
    return (1.0 - share) * everything[before, joints] + share * everything[before + 1, joints]
