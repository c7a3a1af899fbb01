"""Borders, sharp or blurred.

Where an effect jumps from one rule to another, a derivative through it knows the rule that holds
and nothing of the jump: not that a parameter moves the instant at which a border is crossed.
Blurred over a width, the border is crossed gradually, and the derivative is that of all that
happens. As the width goes to zero, values converge to the sharp ones; derivatives do not, they
contain ever steeper slopes.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

# true or false; blurred, something between 0 and 1
Share = Bool[Array, "..."] | Float[Array, "..."]


def inside(width: float, *distances: Float[Array, "..."]) -> Share:
    """Are all ``distances`` from borders positive? With a ``width`` > 0, in their unit, to which
    share: product of logistics.
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
    """``yes`` where ``share`` is true, ``no`` where it is false; between them in proportion."""
    return jnp.where(share, yes, no) if share.dtype == bool else share * yes + (1.0 - share) * no


def either(a: Share, b: Share) -> Share:
    """Does one of both hold?"""
    return a | b if a.dtype == b.dtype == bool else 1.0 - (1.0 - a) * (1.0 - b)
