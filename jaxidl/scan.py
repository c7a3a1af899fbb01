"""A scan whose reverse-mode derivative fits into memory."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

Carry = TypeVar("Carry")


def scan(
    step: Callable[[Carry, Any], tuple[Carry, Any]],
    carry: Carry,
    xs: Any,
    *,
    checkpoint: bool = False,
) -> tuple[Carry, Any]:
    """Run ``jax.lax.scan`` of ``step`` over the leading axis of ``xs``, of length n.

    Reverse mode stores what every step computes. With ``checkpoint`` it stores the carry of each
    √n-th step only and recomputes the rest, stretch by stretch: memory grows with √n instead of n,
    at the cost of at most one more forward pass. The values are the same.
    """
    if not checkpoint:
        return jax.lax.scan(step, carry, xs)
    length = jax.tree.leaves(xs)[0].shape[0]
    stretch = max(1, math.isqrt(length))
    whole = length // stretch
    cut = whole * stretch
    # within a scan XLA cannot merge the two passes
    along = jax.checkpoint(partial(jax.lax.scan, step), prevent_cse=False)
    carry, first = jax.lax.scan(
        along, carry, jax.tree.map(lambda x: x[:cut].reshape(whole, stretch, *x.shape[1:]), xs)
    )
    first = jax.tree.map(lambda x: x.reshape(cut, *x.shape[2:]), first)
    if cut == length:
        return carry, first
    carry, last = along(carry, jax.tree.map(lambda x: x[cut:], xs))
    return carry, jax.tree.map(lambda a, b: jnp.concatenate([a, b]), first, last)
