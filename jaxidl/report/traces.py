"""Figures of the residual: over time, over the state, over frequency."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import signal

from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.plot.style import house_style
from jaxidl.report import common
from jaxidl.report.common import (
    NOISE,
    WIDTH,
    broken,
    clock,
    counted,
    length_unit,
    limits,
    name_of,
    shown,
    sides,
    which,
)

BINS = 26  # number of bins over the range of position, velocity or acceleration
FEWEST = 8  # fewest samples of a bin
CLEARLY = 0.4  # a residual reduced below this share is shown enlarged
LONG = 4.0  # a longer log is also shown enlarged [s]


@house_style()
def plot_residual(d: Diagnosis) -> Figure:
    """Plot command and residual before and after over time, a row for each joint.

    On the right is a stretch of held-out data.
    """
    joints = shown(d)
    time, starts = clock(d)
    zoom = _stretch(d, time, joints) if time[-1] - time[0] > LONG else None
    figure = Figure(
        figsize=(
            WIDTH,
            0.9 + (2.3 if len(joints) == 1 else 1.75 if len(joints) < 5 else 1.4) * len(joints),
        ),
        layout="constrained",
    )
    widths = (1.7, 1.0) if zoom else (1.0,)
    rows = figure.subplots(
        len(joints), len(widths), squeeze=False, sharex="col", width_ratios=widths
    )
    for row, j in zip(rows, joints, strict=True):
        row[0].plot(
            *broken(time, d.traces.command[:, j], starts),
            color=common.COMMAND,
            linewidth=0.8,
            label="command",
        )
        for axes in row:
            _residuals(axes, d, j, time, starts)
        row[0].set_ylabel(
            f"{name_of(d, j)}\ntorque [{d.model.units[j]}]".replace("torque [N]", "force [N]")
        )
        limits(row[0], d.traces.command[:, j], counted(d, d.traces.before, j))
        if zoom:
            inside = (time >= zoom[0]) & (time <= zoom[1])
            row[1].set_xlim(*zoom)
            _fit(row[1], d, j, inside)
            for edge in zoom:
                row[0].axvline(edge, color="0.2", linewidth=0.6, linestyle=":")
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
    if zoom:
        rows[0, 1].set_title("between the dotted lines")
    rows[0, 0].set_title("grey background: held out, not used for fitting")
    figure.suptitle("What the model does not explain" + which(d, joints), fontsize=10)
    handles = rows[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _residuals(axes: Axes, d: Diagnosis, joint: int, time: np.ndarray, starts: np.ndarray) -> None:
    aside = np.flatnonzero(np.diff(d.traces.kept_aside.astype(int), prepend=0, append=0))
    for first, last in aside.reshape(-1, 2):
        axes.axvspan(float(time[first]), float(time[last - 1]), color="0.92", linewidth=0, zorder=0)
    floor = d.gap.noise_floor[joint]
    band: Any = {"color": NOISE, "alpha": 0.35, "linewidth": 0, "zorder": 1.5}
    axes.axhspan(-2.0 * floor, 2.0 * floor, label="encoder noise (± 2 standard deviations)", **band)
    for label, color, residual in sides(d):
        axes.plot(
            *broken(time, counted(d, residual, joint), starts),
            color=color,
            linewidth=0.9,
            label=label,
        )


def _fit(axes: Axes, d: Diagnosis, joint: int, inside: np.ndarray) -> None:
    """Set vertical limits for the residuals within a stretch, with zero and its noise."""
    values = np.concatenate(
        [counted(d, x, joint)[inside] for x in (d.traces.before, d.traces.after)]
    )
    floor = 3.0 * d.gap.noise_floor[joint]
    low, high = (
        np.quantile(values[np.isfinite(values)], [0.003, 0.997])
        if np.isfinite(values).any()
        else (-1.0, 1.0)
    )
    low, high = min(low, -floor), max(high, floor)
    pad = 0.1 * (high - low) or 1.0
    axes.set_ylim(low - pad, high + pad)


def _stretch(d: Diagnosis, time: np.ndarray, joints: list[int]) -> tuple[float, float]:
    """Return the held-out stretch, a tenth of the log, with most of the residual's energy."""
    length = float(np.clip((time[-1] - time[0]) / 10.0, 1.0, 6.0))
    scale = np.maximum(np.var(d.traces.command[:, joints], axis=0), 1e-300)
    energy = np.sum(d.traces.before[:, joints] ** 2 * d.traces.counted[:, joints] / scale, axis=1)
    total = np.concatenate([[0.0], np.cumsum(energy)])
    first = np.flatnonzero(
        d.traces.kept_aside if d.traces.kept_aside.any() else np.ones(len(time), bool)
    )
    first = (
        first[time[first] + length <= time[-1]]
        if np.any(time[first] + length <= time[-1])
        else first[:1]
    )
    last = np.searchsorted(time, time[first] + length)
    best = first[np.argmax(total[last] - total[first])]
    return float(time[best]), float(time[best]) + length


@house_style()
def plot_where(d: Diagnosis) -> Figure:
    """Plot the residual against velocity, position and acceleration.

    Shown are samples, and mean and spread within bins. A step at zero velocity is dry friction, a
    slope viscous friction, a slope over acceleration an inertia, a shape over position friction, a
    spring or ripple. With one or two joints the residual after is shown a second time, enlarged.
    """
    joints = shown(d)
    twice = [
        j
        for j in joints
        if len(joints) <= 2 and d.gap.after.torque_rms[j] < CLEARLY * d.gap.before.torque_rms[j]
    ]
    rows = [
        (j, enlarged) for j in joints for enlarged in ((False, True) if j in twice else (False,))
    ]
    figure = Figure(
        figsize=(WIDTH, 0.9 + (1.75 if len(rows) < 5 else 1.45) * len(rows)), layout="constrained"
    )
    grid = figure.subplots(len(rows), 3, squeeze=False, sharey="row")
    for line, (j, enlarged) in zip(grid, rows, strict=True):
        unit, torque = length_unit(d, j), d.model.units[j]
        states = (
            (d.traces.qd[:, j], f"velocity [{unit}/s]"),
            (d.traces.q[:, j], f"position [{unit}]"),
        )
        for axes, (x, label) in zip(
            line, (*states, (_acceleration(d, j), f"acceleration [{unit}/s²]")), strict=True
        ):
            for name, color, residual in sides(d)[int(enlarged) :]:
                _cloud(axes, x, counted(d, residual, j), color, name)
            axes.set_xlabel(label if len(rows) < 5 or (j, enlarged) == rows[-1] else "")
            axes.axhline(0.0, color="0.2", linewidth=0.6)
        limits(line[0], counted(d, d.traces.after if enlarged else d.traces.before, j), share=0.99)
        left = "after, enlarged" if enlarged else "residual"
        line[0].set_ylabel(f"{name_of(d, j)}\n{left} [{torque}]")
    figure.suptitle(
        "Where the residual is: samples, mean and spread" + which(d, joints), fontsize=10
    )
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
    return figure


def _cloud(axes: Axes, x: np.ndarray, residual: np.ndarray, color: str, label: str) -> None:
    known = np.isfinite(residual) & np.isfinite(x)
    x, residual = x[known], residual[known]
    stride = max(1, -(-len(x) // common.POINTS))
    axes.plot(
        x[::stride],
        residual[::stride],
        ".",
        color=color,
        markersize=1.2,
        alpha=0.22,
        markeredgewidth=0,
        rasterized=True,
    )
    centre, mean, spread = binned(x, residual)
    axes.errorbar(
        centre,
        mean,
        spread,
        color=color,
        marker="o",
        markersize=2.4,
        linewidth=1.1,
        elinewidth=0.7,
        label=label,
    )


def binned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return centre, mean and standard deviation (B,) of ``y`` (N,) in bins of ``x`` (N,).

    No bin extends across zero.
    """
    if not len(x):
        return np.zeros(0), np.zeros(0), np.zeros(0)
    low, high = np.quantile(x, [0.005, 0.995])
    edges = np.linspace(low, high, BINS + 1)
    if low < 0.0 < high:
        below = max(2, round(BINS * -low / (high - low)))
        edges = np.concatenate(
            [np.linspace(low, 0.0, below + 1), np.linspace(0.0, high, max(2, BINS - below) + 1)[1:]]
        )
    place = np.searchsorted(edges, x, side="right") - 1
    inside = [y[place == k] for k in range(len(edges) - 1)]
    kept = [k for k, part in enumerate(inside) if len(part) >= FEWEST]
    centre = (edges[:-1] + edges[1:])[kept] / 2.0
    return (
        centre,
        np.array([inside[k].mean() for k in kept]),
        np.array([inside[k].std() for k in kept]),
    )


def _acceleration(d: Diagnosis, joint: int) -> np.ndarray:
    """Return the acceleration from the velocity (N,), stretch by stretch.

    It is accurate enough for a figure.
    """
    time, starts = clock(d)
    out = np.full(len(time), np.nan)
    for a, b in zip(starts, [*starts[1:], len(time)], strict=True):
        if b - a > 2:
            out[a:b] = np.gradient(d.traces.qd[a:b, joint], time[a:b])
    return out


@house_style()
def plot_spectrum(d: Diagnosis) -> Figure:
    """Plot the power spectral density of the residual before and after.

    It also shows the part due to the encoder's noise.
    """
    joints = shown(d)
    columns = min(2, len(joints))
    lines = -(-len(joints) // columns)
    figure = Figure(
        figsize=(WIDTH, 0.9 + (2.2 if lines == 1 else 1.9 * lines)), layout="constrained"
    )
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True).ravel()
    for axes, j in zip(grid, joints, strict=False):
        _spectra(axes, d, j)
        axes.set_title(name_of(d, j))
        axes.set_ylabel(f"[{d.model.units[j]}²/Hz]")
        axes.set_xlabel("frequency [Hz]")
    for axes in grid[len(joints) :]:
        axes.set_visible(False)
    figure.suptitle("Power spectral density of the residual" + which(d, joints), fontsize=10)
    figure.legend(
        *grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False
    )
    return figure


def _spectra(axes: Axes, d: Diagnosis, joint: int) -> None:
    time, starts = clock(d)
    stretch = max(zip(starts, [*starts[1:], len(time)], strict=True), key=lambda s: s[1] - s[0])
    part, rate = slice(*stretch), 1.0 / float(np.median(np.diff(time[slice(*stretch)])))
    top, lowest = 0.0, 0.0
    for label, color, residual in sides(d):
        values = np.nan_to_num(counted(d, residual, joint)[part])
        f, power = signal.welch(values, rate, nperseg=min(512, len(values)))
        inside = (f > 0.0) & (f <= d.band)
        axes.loglog(
            f[inside], np.maximum(power[inside], 1e-300), color=color, linewidth=1.1, label=label
        )
        top, lowest = max(top, power[inside].max(initial=0.0)), f[1] if len(f) > 1 else 0.1
    f = np.geomspace(max(min(lowest, d.band / 2), 1e-3), d.band, 50)
    # white noise, differentiated twice: a density that grows with the fourth power, with the noise
    # floor as its integral
    noise = 5.0 * d.gap.noise_floor[joint] ** 2 / d.band**5 * f**4
    axes.loglog(f, np.maximum(noise, 1e-300), color=NOISE, linestyle="--", label="encoder noise")
    if top > 0.0:
        axes.set_ylim(top * 1e-8, top * 3.0)
