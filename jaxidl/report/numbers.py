"""Figures of the gap before and after, in numbers."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.plot.style import house_style
from jaxidl.report.common import AFTER, BEFORE, NOISE, WIDTH, length_unit, name_of, shown, which
from jaxidl.report.words import judged, percent

BAR_JOINTS = 12  # most joints shown
ACROSS = 4  # panels side by side


@house_style()
def plot_gap(d: Diagnosis) -> Figure:
    """Plot each joint's torque error relative to its command, and the error of a replay.

    Both are those on held-out data.
    """
    joints = shown(d)
    lines = -(-len(joints) // ACROSS)
    figure = Figure(figsize=(WIDTH, 3.1 + 1.9 * lines), layout="constrained")
    above, below = np.ravel(
        np.array(figure.subfigures(2, 1, height_ratios=(1.0, 0.6 + 0.65 * lines)), object)
    )
    axes = above.subplots()
    _torque_errors(axes, d)
    handles, labels = axes.get_legend_handles_labels()
    order = sorted(range(len(labels)), key=lambda k: labels[k].startswith("encoder"))  # noise last
    above.legend(
        [handles[k] for k in order],
        [labels[k] for k in order],
        loc="outside upper center",
        ncols=4,
        frameon=False,
    )
    across = -(-len(joints) // lines)
    panels = below.subplots(lines, across, squeeze=False).ravel()
    for axes, j in zip(panels, joints, strict=False):
        _rollouts(axes, d, j)
        axes.set_title(name_of(d, j, 66 // across))
        axes.set_xlabel("replayed for [s]")
    for axes in panels[len(joints) :]:
        axes.set_visible(False)
    for axes in panels[::across]:
        axes.set_ylabel(
            "position error [" + " or ".join(dict.fromkeys(length_unit(d, j) for j in joints)) + "]"
        )
    below.suptitle(
        "Replaying the logged torque from measured states" + which(d, joints), fontsize=9.5
    )
    return figure


def _torque_errors(axes: Axes, d: Diagnosis) -> None:
    order = range(len(d.model.names)) if len(d.model.names) <= BAR_JOINTS else shown(d)
    before, after = (
        np.array([side.torque_relative[j] for j in order]) for side in (d.gap.before, d.gap.after)
    )
    command = np.array([d.gap.before.torque_rms[j] for j in order]) / np.maximum(before, 1e-300)
    before, after = (
        np.array([x if judged(x) else np.nan for x in side]) for side in (before, after)
    )
    envelope = np.array([d.envelope.torque_relative[j] for j in order])
    envelope = 100.0 * np.where(np.isfinite(before), envelope, np.nan)
    floor = 100.0 * np.array([d.gap.noise_floor[j] for j in order]) / np.maximum(command, 1e-300)
    floor = np.where(np.isfinite(before), floor, np.nan)
    x, width = np.arange(len(before)), 0.36 if d.findings else 0.5
    sides = [(-width / 2, before, BEFORE, "before"), (width / 2, after, AFTER, "after")]
    sides = sides if d.findings else [(0.0, before, BEFORE, "model")]
    for shift, values, color, label in sides:
        axes.bar(x + shift, 100.0 * values, width, color=color, label=label)
        for at, value, noise in zip(x + shift, values, floor, strict=True):
            if not (np.isfinite(value) and value > 0.0):  # nothing was commanded
                continue
            # the text must not cross the noise line
            above = noise if 0.6 * noise < 100.0 * value < noise else 100.0 * value
            text = percent(value) if len(x) < 6 else percent(value).removesuffix(" %")
            axes.text(
                at, 1.06 * above, text, ha="center", va="bottom", fontsize=8 if len(x) < 6 else 6.5
            )
    span = width * (1.0 if d.findings else 0.6)
    axes.hlines(
        floor,
        x - span,
        x + span,
        color=NOISE,
        linewidth=2.0,
        linestyle="--",
        label="encoder noise alone",
        zorder=5,
    )
    axes.plot(
        x,
        envelope,
        linestyle="none",
        marker="D",
        markersize=5,
        color="white",
        markeredgecolor="0.1",
        zorder=6,
        label="conventional identification",
    )
    axes.set_yscale("log")
    known = [
        v
        for v in (*(100.0 * before), *(100.0 * after), *floor, *envelope)
        if np.isfinite(v) and v > 1e-6
    ]
    low, high = min(known, default=1.0) / 2.5, max(known, default=1.0) * 3.0
    axes.set_ylim(low, high)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)))
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(-0.8 - 0.7 * (len(x) == 1), len(x) - 0.2 + 0.7 * (len(x) == 1))
    slanted: Any = {"rotation": 20, "ha": "right", "rotation_mode": "anchor"} if len(x) > 4 else {}
    axes.set_xticks(x, [name_of(d, j, 24) for j in order], **slanted)
    axes.set_ylabel(
        "torque error [% of command]"
        if set(d.model.units) != {"N"}
        else "force error [% of command]"
    )
    axes.grid(axis="x", visible=False)


def _rollouts(axes: Axes, d: Diagnosis, joint: int) -> None:
    sides = [(d.gap.before, BEFORE, "s", "--")] + (
        [(d.gap.after, AFTER, "o", "-")] if d.findings else []
    )
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
        axes.text(
            0.5,
            0.5,
            "the held-out part\nis too short",
            ha="center",
            va="center",
            transform=axes.transAxes,
            fontsize=8,
        )
