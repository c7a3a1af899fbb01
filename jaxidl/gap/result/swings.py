"""Whether what remains drifts, or swings at one frequency of its own.

Then it has a cause in time, not in the state.
"""

from collections.abc import Sequence

import numpy as np
from scipy.fft import dct

from jaxidl.gap.evidence.drift import SLOW
from jaxidl.gap.evidence.rows import Rows, rms
from jaxidl.gap.result.diagnosis import MUCH

MOST = 0.5  # share of the residual's energy that makes a swing or a drift worth mentioning
FINER = 16  # frequencies per one over the log's duration


def swings(rows: Rows, left: np.ndarray, names: Sequence[str]) -> list[str]:
    """Return a sentence for each joint whose large residual is mostly one swing, or drift.

    A frequency that the motion has, too, is none of its own; a slow motion hides drift.

    Args:
        rows: N rows of the log.
        left: (N, J) residual [N or Nm].
        names: names of the joints.
    """
    signals = rows.signals
    at = signals.rows * signals.dt
    even = np.arange(at[0], at[-1], float(np.median(np.diff(at))))
    lines = lambda x: _lines(np.interp(even, at, x))
    frequency = np.fft.rfftfreq(FINER * len(even), even[1] - even[0])
    size, said = rms(left, rows.used), list[str]()
    for j in np.flatnonzero(size > np.maximum(MUCH * rows.spread, 2.0 * rows.floor)).tolist():
        share = lines(np.where(rows.used[:, j], left[:, j], 0.0))
        peak = int(np.argmax(share))
        moves = lines(signals.q[signals.rows, j])[peak]
        if share[peak] > MOST and moves < 0.5 * share[peak] and frequency[peak] * even[-1] > 3.0:
            said.append(
                f"{names[j]}: {share[peak]:.0%} of what remains swings at {frequency[peak]:.3g} Hz,"
                " which the motion does not: a vibration or a torque from outside"
            )
        use = rows.used[:, j]
        drift, moves = (_drift(x[use]) for x in (left[:, j], signals.q[signals.rows, j]))
        if drift > MOST and moves < 0.5 * drift:
            share = size[j] / rows.spread[j]
            said.append(
                f"{names[j]}: {drift:.0%} of what remains is slow drift, {share:.0%} of the"
                " command: let the machine warm up, or check the zero of its torque sensor"
            )
    return said


def _drift(x: np.ndarray) -> float:
    """Return the share of the energy of ``x`` (N,) about its mean in slow components."""
    x = x - x.mean()
    return float(
        np.sum(np.asarray(dct(x, norm="ortho"))[: SLOW + 1] ** 2) / max(float(x @ x), 1e-300)
    )


def _lines(x: np.ndarray) -> np.ndarray:
    """Return the share of the energy of ``x`` (N,) that a sine of each frequency explains."""
    x = x - x.mean()
    power = np.abs(np.fft.rfft(x, FINER * len(x))) ** 2
    return 2.0 * power / max(len(x) * float(x @ x), 1e-300)
