"""Dead time: a buffer of past values, read between two of them."""

from typing import ClassVar

import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Float

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Guess, Motor, Scale, Variant
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


class Delay(Effect):
    """A value arrives ``delay`` late, at most ``steps`` steps."""

    delay: Joints  # (J,) [s]
    steps: int = struct.field(pytree_node=False, default=64)

    prior: ClassVar[float] = 0.02
    advice: ClassVar[str] = LATE

    def mjcf_motor(self, motor: Motor, joint: int = 0) -> Motor | None:
        """Return ``motor`` unchanged: MuJoCo has no dead time, and its place does not matter."""
        return motor

    @classmethod
    def guesses(cls, scale: Scale) -> list[Guess]:
        return [{"delay": x} for x in DELAYS]

    @classmethod
    def variants(cls, scale: Scale) -> list[Variant]:
        """Return shapes whose buffer is just long enough for the longest dead time searched for."""
        within, options = {"delay": (0.0, LONGEST)}, {"steps": max(4, int(LONGEST / scale.dt))}
        return [Variant(guess, within=within, options=options) for guess in cls.guesses(scale)]


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
