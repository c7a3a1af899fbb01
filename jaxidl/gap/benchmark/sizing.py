"""The size at which an effect has a given share of the command on a given motion."""

from collections.abc import Callable

import numpy as np

from jaxidl.gap.benchmark.injected import Injected
from jaxidl.gap.benchmark.worth import Motion, acts, rms


def sized(
    effect: Callable[[float], Injected], xml: str, motion: Motion, aim: float, start: float = 1.0
) -> float:
    """Return the size at which ``effect(size)`` has the strength ``aim`` on ``motion``.

    The motion is that of the model ``xml``; see :func:`strength`. Sizes are corrected in proportion
    four times: exact at once for effects in proportion to their size.

    Raises:
        ValueError: where the effect does nothing at all.
    """
    size = start
    for _ in range(4):
        found = strength(effect(size), xml, motion)
        if not found > 0:
            raise ValueError(f"{effect(size)} does nothing on this motion")
        if abs(found / aim - 1) < 0.02:
            break
        size *= float(np.clip(aim / found, 1e-5, 1e5))
    return size


def strength(effect: Injected, xml: str, motion: Motion) -> float:
    """Return RMS torque over RMS command of an effect.

    It is taken on the joint where ``effect`` is strongest relative to the command.
    """
    return float((rms(acts(effect, xml, motion)) / rms(motion.tau)).max())
