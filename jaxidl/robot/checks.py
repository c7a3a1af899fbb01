"""Checks of a recorded execution before anything is learned from it.

What a user has to correct is a ``LogError`` that names signal and row.
"""

from typing import Any

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.mending import Samples
from jaxidl.systems.mjcf import Model

LEAST_ROWS = 100
RATES = 20.0, 50_000.0  # [Hz]
JITTER = 0.5  # of a step: a row's stamp may be off by so much
BEYOND = 0.1  # of a joint's range: positions may be outside by so much
SPAN = 0.1  # [s] over which accelerations are compared
DEGREES = 180.0 / np.pi


def step_of(found: Samples) -> float:
    """Return the control step [s] of one execution that was sampled at every step.

    Raises:
        LogError: if it is more than one execution, too short, or steps are missing.
    """
    table, time = found.table, found.time
    if found.run[-1]:
        raise LogError(
            f"one execution in {table.name}", f"{found.run[-1] + 1} runs", "write one file for each"
        )
    if len(time) < LEAST_ROWS:
        raise LogError(
            f"at least {LEAST_ROWS} rows in {table.name}", f"{len(time)}", "record the whole of it"
        )
    steps = np.diff(time)
    dt = float(np.median(steps))
    if not 1.0 / RATES[1] <= dt <= 1.0 / RATES[0]:
        raise LogError(
            f"{RATES[0]:g} to {RATES[1]:g} control steps a second in {table.name}",
            f"a row every {dt:.6g} s",
            "give time in seconds, one row for each control step",
        )
    bad = np.flatnonzero(np.abs(steps - dt) > JITTER * dt)
    if bad.size:
        got = f"{steps[bad[0]]:.6g} s instead of {dt:.6g} s before {table.row(int(bad[0]) + 1)}"
        raise LogError(
            f"one row for each control step in {table.name}",
            got + (f", and {bad.size - 1} more" if bad.size > 1 else ""),
            "record every control step; missing ones cannot be made up",
        )
    return float(time[-1] - time[0]) / (len(time) - 1)


def plausible(found: Samples, model: Model, dt: float) -> None:
    """Raise LogError where positions or accelerations are not those of this robot in SI units."""
    table, q, wanted = found.table, found.signals["q"], found.signals["qdd_desired"]
    body: Any = model.plant.body  # a MujocoBody
    source = body.source
    for j, (low, high) in enumerate(source.jnt_range):
        room = BEYOND * (high - low)
        out = np.flatnonzero((q[:, j] < low - room) | (q[:, j] > high + room))
        if source.jnt_limited[j] and out.size:
            got = f"q{j} = {q[out[0], j]:.4g} in {table.row(int(out[0]))}"
            raise LogError(
                f"{model.names[j]} between {low:.4g} and {high:.4g} {_unit(model, j)}, as in the"
                f" model, in {table.name}",
                got,
                "convert degrees to rad, or correct the order of the joints or the model",
            )
    if not np.ptp(wanted, axis=0).any():
        raise LogError(
            f"desired accelerations that change in {table.name}",
            f"each constant, qdd_desired0 = {wanted[0, 0]:g}",
            "log what the policy or planner demands in every control step",
        )
    in_degrees(found, dt)


def in_degrees(found: Samples, dt: float) -> None:
    """Raise LogError if positions and desired accelerations differ by the factor of degrees."""
    q, wanted = found.signals["q"], found.signals["qdd_desired"]
    span = max(2, min(round(SPAN / dt), len(q) // 4))
    average = lambda x: (lambda c: (c[span:] - c[:-span]) / span)(np.cumsum(x, 0))
    bent = (q[2 * span :] - 2.0 * q[span:-span] + q[: -2 * span]) / (span * dt) ** 2
    asked = average(average(wanted))[: len(bent)]
    both, size = np.sum(bent * asked, 0), np.sqrt(np.sum(bent**2, 0) * np.sum(asked**2, 0))
    for j in np.flatnonzero((both > 0.8 * size) & (size > 0.0)):
        ratio = float(np.sqrt(np.sum(bent[:, j] ** 2) / np.sum(asked[:, j] ** 2)))
        for factor, names in ((DEGREES, ("q", "qdd_desired")), (1 / DEGREES, ("qdd_desired", "q"))):
            if 0.4 < ratio / factor < 2.5:
                raise LogError(
                    f"q{j} and qdd_desired{j} of {found.table.name} both in rad",
                    f"accelerations of the positions {ratio:.3g} times the desired ones",
                    f"{names[0]}{j} seems to be in degrees: convert it",
                )


def balanced(
    found: Samples,
    what: str,
    total: np.ndarray,
    parts: np.ndarray,
    tolerance: float,
    model: Model,
    remedy: str,
) -> None:
    """Raise LogError at the row where ``total`` (T, J) is not the sum of its ``parts`` (T, J).

    Args:
        found: the log.
        what: the sum in words.
        total: what was commanded [N or Nm].
        parts: the sum of what it was made of.
        tolerance: largest difference, as a share of the joint's largest ``total``.
        model: of the robot.
        remedy: what to do.
    """
    off = np.abs(total - parts) / np.maximum(np.abs(total).max(0), 1e-9)
    if not (off.max() <= tolerance):  # NaN fails, too
        row, j = np.unravel_index(np.argmax(np.nan_to_num(off, nan=np.inf)), off.shape)
        many = int(np.sum((off > tolerance).any(1)))
        got = (
            f"{total[row, j]:.4g} instead of {parts[row, j]:.4g} {model.units[int(j)]} for"
            f" {model.names[int(j)]} in {found.table.row(int(row))}, and more than"
            f" {tolerance:.0%} off in {many} rows"
        )
        raise LogError(f"{what} in {found.table.name}", got, remedy)


def _unit(model: Model, j: int) -> str:
    return "m" if model.kinds[j] == "slide" else "rad"
