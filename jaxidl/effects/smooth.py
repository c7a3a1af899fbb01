"""Borders between regions, sharp or blurred.

Where an effect jumps from one rule to another, a derivative through it knows only the rule that
holds, and nothing of the jump: it misses that a parameter also moves the instant at which a border
is crossed. Blurred over a width, the border is crossed gradually and the derivative includes this.
As the width goes to zero, values converge to the sharp ones; derivatives do not, because they
contain ever steeper slopes.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

# true or false; if blurred, between 0 and 1
Share = Bool[Array, "..."] | Float[Array, "..."]


def inside(width: float, *distances: Float[Array, "..."]) -> Share:
    """Return whether all ``distances`` from borders are positive.

    With a ``width`` > 0, in their unit, return to which share: a product of logistics.
    """
    share = jnp.ones((), bool)
    for distance in distances:
        share = (
            share & (distance > 0.0) if width == 0.0 else share * jax.nn.sigmoid(distance / width)
        )
    return share


def choose(
    share: Share, yes: Float[Array, "..."] | float, no: Float[Array, "..."] | float
) -> Float[Array, "..."]:
    """Return ``yes`` where ``share`` is true, ``no`` where it is false, a mixture in between."""
    return jnp.where(share, yes, no) if share.dtype == bool else share * yes + (1.0 - share) * no


def either(a: Share, b: Share) -> Share:
    """Return whether at least one of the two holds."""
    return a | b if a.dtype == b.dtype == bool else 1.0 - (1.0 - a) * (1.0 - b)
