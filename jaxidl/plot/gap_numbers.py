"""Pictures of what was found: ranking, parameters, and the gap before and after."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from jaxidl.gap.diagnosis import Diagnosis, Estimate, Finding, Row
from jaxidl.gap.table import SENSELESS, percent
from jaxidl.gap.words import readable
from jaxidl.plot.gap_common import ADDED, AFTER, BEFORE, NOISE, WIDTH, length_unit, name_of, shown, which
from jaxidl.plot.style import house_style

ROUNDS, BARS = 4, 8  # shown at most
PARAMETERS = 16
BAR_JOINTS = 12


@house_style()
def plot_ranking(d: Diagnosis) -> Figure:
    """The best effects of the first rounds and of the last: share of the held-out error that each removes."""
    numbers = list(range(len(d.rounds)))
    numbers = numbers if len(numbers) <= ROUNDS else [*numbers[: ROUNDS - 1], numbers[-1]]
    heights = [max(2, len(d.rounds[n][:BARS])) for n in numbers] or [1]
    figure = Figure(figsize=(WIDTH, 0.9 + sum(0.21 * h + 0.45 for h in heights)), layout="constrained")
    grid = figure.subplots(len(heights), 1, squeeze=False, sharex=True, height_ratios=heights)[:, 0]
    for axes, number in zip(grid, numbers, strict=False):
        _bars(axes, d, d.rounds[number][:BARS])
        chosen = [label_of(d, row.name, row.joint) for row in d.rounds[number] if row.chosen]
        axes.set_title(f"round {number + 1}: " + (f"{chosen[0]} is added" if chosen else "nothing is added"), loc="left")
    ends = [100.0 * (row.gain + row.gain_stderr) for n in numbers for row in d.rounds[n][:BARS]]
    most = max([10.0, *(end for end in ends if np.isfinite(end))])
    grid[0].set_xlim(-8.0, 1.3 * most)
    grid[0].set_xticks([t for t in (0, 5, 10, 20, 40, 60, 80, 100) if t <= most and (most < 20 or t not in (5, 10))])
    grid[-1].set_xlabel("share of the held-out error that it removes [%]; dotted: least to be named")
    left = f" (rounds {', '.join(str(n + 1) for n in numbers)} of {len(d.rounds)})" if len(numbers) < len(d.rounds) else ""
    figure.suptitle("Which effect explains it best, round by round" + left, fontsize=10)
    return figure


def label_of(d: Diagnosis, name: str, joint: int | None) -> str:
    """An effect and, if there are several joints, the one it is on."""
    return readable(name) + (f", {name_of(d, joint)}" if joint is not None and len(d.model.names) > 1 else "")


def _bars(axes: Axes, d: Diagnosis, rows: tuple[Row, ...]) -> None:
    gains = [100.0 * row.gain if np.isfinite(row.gain) else 0.0 for row in rows]
    errors = [100.0 * row.gain_stderr if np.isfinite(row.gain_stderr) else 0.0 for row in rows]
    colors = [ADDED if row.chosen else "0.75" for row in rows]
    axes.barh(range(len(rows)), np.maximum(gains, -6.0), color=colors, height=0.72)
    axes.errorbar(np.maximum(gains, -6.0), range(len(rows)), xerr=errors, fmt="none", color="0.15", elinewidth=0.9, capsize=2)
    for k, (gain, error, row) in enumerate(zip(gains, errors, rows, strict=True)):
        text = f"{gain:.1f} ± {error:.1f}" + ("  ◂ added" if row.chosen else "")
        ground = {"facecolor": "white", "edgecolor": "none", "pad": 0.4}
        weight = "bold" if row.chosen else "normal"
        axes.text(max(gain + error, 0.0) + 1.2, k, text, va="center", fontsize=7.5, fontweight=weight, bbox=ground)
    axes.set_yticks(range(len(rows)), [label_of(d, row.name, row.joint) for row in rows])
    axes.set_ylim(max(len(rows), 2) - 0.4, -0.6)
    axes.axvline(0.0, color="0.2", linewidth=0.8)
    axes.axvline(100.0 * d.options.get("min_gain", 0.05), color="0.2", linewidth=0.8, linestyle=":")
    axes.grid(axis="y", visible=False)


@house_style()
def plot_gap(d: Diagnosis) -> Figure:
    """On the data kept aside: torque error of each joint relative to its command, and how far a replay runs away."""
    joints = shown(d)
    figure = Figure(figsize=(WIDTH, 4.9), layout="constrained")
    above, below = np.ravel(np.array(figure.subfigures(2, 1, height_ratios=(1.0, 1.15)), object))
    axes = above.subplots()
    _torque_errors(axes, d)
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda k: labels[k].startswith("encoder"))  # noise last
    above.legend([handles[k] for k in order], [labels[k] for k in order], loc="outside upper center", ncols=3, frameon=False)
    panels = below.subplots(1, len(joints), squeeze=False)[0]
    for axes, j in zip(panels, joints, strict=True):
        _rollouts(axes, d, j)
        axes.set_title(name_of(d, j, 60 // len(joints)))
        axes.set_xlabel("replayed for [s]")
    panels[0].set_ylabel("position error [" + " or ".join(dict.fromkeys(length_unit(d, j) for j in joints)) + "]")
    below.suptitle("Replaying the logged torque from measured states" + which(d, joints), fontsize=9.5)
    return figure


def _torque_errors(axes: Axes, d: Diagnosis) -> None:
    order = range(len(d.model.names)) if len(d.model.names) <= BAR_JOINTS else shown(d)
    before, after = (np.array([side.torque_relative[j] for j in order]) for side in (d.gap.before, d.gap.after))
    command = np.array([d.gap.before.torque_rms[j] for j in order]) / np.maximum(before, 1e-300)
    before, after = (np.where(side < SENSELESS, side, np.nan) for side in (before, after))
    floor = 100.0 * np.array([d.gap.noise_floor[j] for j in order]) / np.maximum(command, 1e-300)
    floor = np.where(np.isfinite(before), floor, np.nan)
    x, width = np.arange(len(before)), 0.36 if d.findings else 0.5
    sides = [(-width / 2, before, BEFORE, "before"), (width / 2, after, AFTER, "after")]
    sides = sides if d.findings else [(0.0, before, BEFORE, "model")]
    for shift, values, color, label in sides:
        axes.bar(x + shift, 100.0 * values, width, color=color, label=label)
        for at, value, noise in zip(x + shift, values, floor, strict=True):
            if not np.isfinite(value):  # nothing was commanded
                continue
            above = noise if 0.6 * noise < 100.0 * value < noise else 100.0 * value  # not across the line of the noise
            text = percent(value) if len(x) < 6 else percent(value).removesuffix(" %")
            axes.text(at, 1.06 * above, text, ha="center", va="bottom", fontsize=8 if len(x) < 6 else 6.5)
    span = width * (1.0 if d.findings else 0.6)
    axes.hlines(floor, x - span, x + span, color=NOISE, linewidth=2.0, linestyle="--", label="encoder noise alone", zorder=5)
    axes.set_yscale("log")
    known = [v for v in (*(100.0 * before), *(100.0 * after), *floor) if np.isfinite(v) and v > 1e-6]
    low, high = min(known, default=1.0) / 2.5, max(known, default=1.0) * 3.0
    axes.set_ylim(low, high)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(-0.8 - 0.7 * (len(x) == 1), len(x) - 0.2 + 0.7 * (len(x) == 1))
    axes.set_xticks(x, [name_of(d, j, max(8, 70 // len(x))) for j in order])
    axes.set_ylabel("torque error [% of command]" if set(d.model.units) != {"N"} else "force error [% of command]")
    axes.grid(axis="x", visible=False)


def _rollouts(axes: Axes, d: Diagnosis, joint: int) -> None:
    sides = [(d.gap.before, BEFORE, "s", "--")] + ([(d.gap.after, AFTER, "o", "-")] if d.findings else [])
    drawn = False
    for side, color, marker, line in sides:
        points = sorted((float(h), float(e[joint])) for h, e in side.rollout_rms.items())
        points = [(h, e) for h, e in points if np.isfinite(e) and e > 0.0]
        if points:
            axes.plot(*zip(*points, strict=True), color=color, marker=marker, linestyle=line)
            drawn = True
    if drawn:
        axes.loglog()
        ticks = sorted(float(h) for h in d.gap.before.rollout_rms)
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.minorticks_off()
    else:
        axes.text(0.5, 0.5, "the part kept aside\nis too short", ha="center", va="center", transform=axes.transAxes, fontsize=8)


class _Scalar(NamedTuple):
    label: str
    value: float
    stderr: float
    unit: str


@house_style()
def plot_parameters(d: Diagnosis) -> Figure | None:
    """Each parameter found, ± two standard errors beside zero, and tables as curves over position. None if nothing was found."""
    scalars, tables = _split(d)
    if not scalars and not tables:
        return None
    heights = [0.42] * len(scalars) + [1.6] * len(tables)
    figure = Figure(figsize=(WIDTH, 0.7 + sum(heights) + 0.35 * len(tables)), layout="constrained")
    grid = figure.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    for axes, scalar in zip(grid, scalars, strict=False):
        _number(axes, scalar)
    for axes, (finding, name, estimate) in zip(grid[len(scalars) :], tables, strict=True):
        _curve(axes, d, finding, name, estimate)
    total = sum(len(f.parameters) for f in d.findings)
    some = f" (the first {PARAMETERS})" if total > PARAMETERS else ""
    figure.suptitle("Parameters found, ± two standard errors" + some, fontsize=10)
    return figure


def _split(d: Diagnosis) -> tuple[list[_Scalar], list[tuple[Finding, str, Estimate]]]:
    """Numbers, and tables over position."""
    scalars: list[_Scalar] = []
    tables: list[tuple[Finding, str, Estimate]] = []
    for finding, name, estimate in [(f, n, p) for f in d.findings for n, p in f.parameters.items()][:PARAMETERS]:
        label = f"{label_of(d, finding.name, finding.joint)}\n{readable(name)}"
        if not isinstance(estimate.value, list):
            scalars.append(_Scalar(label, float(estimate.value), float(np.mean(estimate.stderr)), estimate.unit))
        elif _ends(finding):
            tables.append((finding, name, estimate))
        else:
            errors = np.broadcast_to(np.array(estimate.stderr, float), len(estimate.value))
            for axis, value, stderr in zip("xyz", estimate.value, errors, strict=False):
                scalars.append(_Scalar(f"{label} {axis}", value, float(stderr), estimate.unit))
    return scalars, tables


def _ends(finding: Finding) -> tuple[float, float] | None:
    """Positions of a table's first and last value."""
    effect: Any = getattr(finding.effect, "effect", finding.effect)
    if not hasattr(effect, "lower"):
        return None
    return float(np.ravel(effect.lower)[0]), float(np.ravel(effect.upper)[0])


def _number(axes: Axes, scalar: _Scalar) -> None:
    error = 2.0 * scalar.stderr if np.isfinite(scalar.stderr) else 0.0
    ends = [0.0, scalar.value - error, scalar.value + error]
    span = max(ends) - min(ends) or 1.0
    axes.errorbar([scalar.value], [0.0], xerr=error, fmt="o", color=AFTER, capsize=3, markersize=4)
    axes.axvline(0.0, color="0.2", linewidth=0.8)
    axes.set_xlim(min(ends) - 0.08 * span, max(ends) + 0.08 * span)
    axes.set_ylim(-1.0, 1.0)
    axes.set_yticks([0.0], [scalar.label])
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="x", labelsize=7, pad=1.5, length=2)
    unit = "" if scalar.unit == "1" else f" {scalar.unit}"
    axes.text(1.02, 0.5, f"{scalar.value:.4g} ± {scalar.stderr:.2g}{unit}", transform=axes.transAxes, va="center", fontsize=8)


def _curve(axes: Axes, d: Diagnosis, finding: Finding, name: str, estimate: Estimate) -> None:
    values = np.array(estimate.value, float)
    error = 2.0 * np.nan_to_num(np.broadcast_to(np.array(estimate.stderr, float), values.shape))
    q = np.linspace(*(_ends(finding) or (0.0, 1.0)), len(values))
    other = getattr(finding.effect, "other", finding.joint)
    axes.fill_between(q, values - error, values + error, color=AFTER, alpha=0.2, linewidth=0)
    axes.plot(q, values, color=AFTER, marker="o", markersize=3)
    axes.axhline(0.0, color="0.2", linewidth=0.8)
    axes.set_title(f"{label_of(d, finding.name, finding.joint)}: {readable(name)}", loc="left")
    where = "" if other is None else f" of {name_of(d, other)} [{length_unit(d, other)}]"
    axes.set_xlabel(f"position{where}")
    axes.set_ylabel(f"[{estimate.unit}]")
