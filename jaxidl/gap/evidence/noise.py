"""What the encoder's noise does to fits, and how it is taken out of them.

Noise of the encoder is in the measured acceleration, and so in the residual, where it grows with
the square of the frequency. A drive with a spring takes the motor's inertia off the link, and the
motor moves as its command says, not as the noisy encoder: that alone makes the residual smaller.

* A fit minimises the squared residual minus what noise alone contributes to it at these parameters
  (bias-compensated least squares: Stoica and Soederstroem 1982). That is seen on the log as if it
  had been read once more: the same motion with noise of the same size added.
* An effect has to make the residual smaller also in units of what noise causes at each frequency.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.signal import welch

from jaxidl.effects import Effect
from jaxidl.gap.evidence.rows import LEAST_FLOOR, Rows
from jaxidl.gap.evidence.shape import Shape
from jaxidl.systems.tables import inverse_dynamics

SEGMENT = 256  # rows


def accelerates(shape: Shape | None) -> bool:
    """Return whether what an effect adds depends on the acceleration, where the noise is.

    Where an effect jumps, its response to noise is no measure of what noise contributes.
    """
    return shape is not None and shape.cls.alter is not Effect.alter and not shape.cls.jumps


def read_again(rows: Rows) -> Rows:
    """Return the rows of the log as if it had been read once more, with noise added."""
    signals = rows.signals.read_again()
    motion = (x[signals.rows] for x in (signals.q, signals.qd, signals.qdd))
    noise = signals.tables.torque[signals.rows] - inverse_dynamics(signals.body, *motion)
    return rows._replace(signals=signals, gap=rows.gap + noise)


def in_units_of_noise(rows: Rows, left: np.ndarray, joints: Sequence[int]) -> np.ndarray:
    """Return the mean over frequencies of a residual's spectrum over that of noise, (K,).

    The residual ``left`` (N, K) is that of K of the ``joints``.

    Encoder noise that is white has a spectrum in the torque that grows with the frequency's fourth
    power. No simulation is assumed to be better than a small white residual.
    """
    signals, joints = rows.signals, list(joints)
    used = np.where(rows.used[:, joints], left, 0.0)
    whole: Any = False  # the mean of a segment, too, so that offsets count
    segment = min(SEGMENT, len(left))
    frequency, power = welch(used, 1.0 / rows.step, nperseg=segment, detrend=whole, axis=0)
    encoder = 5.0 * signals.noise_floor[joints] ** 2 * frequency[:, None] ** 4 / signals.band**5
    least = 2.0 * rows.step * (LEAST_FLOOR * rows.spread[joints]) ** 2
    # neither noise nor a command: whatever is there is far above both
    nothing = 1e-12 * power.max(axis=0) + np.finfo(float).tiny
    return np.mean(power / (encoder + least + nothing), axis=0)
