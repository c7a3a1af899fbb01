"""The magnitudes of a log on each joint, from which effects derive their starting values."""

from collections.abc import Sequence

import numpy as np

from jaxidl.effects import Effect, Scale
from jaxidl.gap.evidence.items import columns_of
from jaxidl.gap.evidence.rows import Rows, rms
from jaxidl.gap.fit.score import Solution

TOGETHER = 0.1  # share of a joint's motion in which another one has to move, too


def scales(rows: Rows) -> list[Scale]:
    """Return the magnitudes on each joint.

    Positions are those of training rows: a table over others would not be fitted there.
    """
    signals, residual = rows.signals, rms(rows.gap, rows.used)
    lows, highs = np.quantile(signals.q[signals.rows[rows.training]], (0.002, 0.998), axis=0)
    inertia = np.median(np.diagonal(signals.tables.inertia, axis1=1, axis2=2), axis=0)
    mobility = np.diagonal(np.linalg.pinv(signals.tables.inertia, hermitian=True), axis1=1, axis2=2)
    free = 1.0 / np.maximum(mobility.max(axis=0), 1e-300)
    speed = np.quantile(np.abs(signals.qd), 0.998, axis=0)
    size, moving = np.abs(signals.tau), signals.moving.astype(float)
    together = moving.T @ moving >= TOGETHER * moving.sum(0)[:, None]
    torque, effort, typical = size.max(0), np.sqrt(np.mean(size**2, 0)), np.median(size, 0)
    return [
        Scale(
            float(torque[j]),
            float(speed[j]),
            float(lows[j]),
            float(highs[j]),
            float(inertia[j]),
            float(residual[j]),
            signals.band,
            signals.interval,
            j,
            len(lows),
            tuple(lows.tolist()),
            tuple(highs.tolist()),
            float(signals.rest_speed[j]),
            float(effort[j]),
            float(typical[j]),
            float(free[j]),
            tuple(np.flatnonzero(~together[j]).tolist()),
        )
        for j in range(len(lows))
    ]


def heavier(scales: Sequence[Scale], found: Solution, rows: Rows) -> list[Scale]:
    """Return the magnitudes with the inertia that a set adds to single joints, such as rotors.

    A torque per acceleration is an inertia: the columns are computed again with one more.
    """
    members = [
        m
        for m in found.members
        if m.shape is not None and m.shape.cls.alter is not Effect.alter and len(m.joints) == 1
    ]
    faster = rows._replace(signals=rows.signals._replace(qdd=rows.signals.qdd + 1.0))
    extra = np.zeros(len(scales))
    for m, columns in zip(
        members, columns_of([m.shape for m in members], faster, rows.tau), strict=True
    ):
        (j,) = m.joints
        added = np.median(columns[:, :, j] - m.columns[:, :, 0], axis=1)
        extra[j] += float(found.x[found.of(m)] @ added)
    return [s._replace(inertia=s.inertia + max(extra[s.joint], 0.0)) for s in scales]
