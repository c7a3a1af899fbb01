"""The report of a feedforward learned from recorded executions: a text and two pictures."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from jaxidl.files import markdown
from jaxidl.plot.style import house_style
from jaxidl.report.common import AFTER, BEFORE, JOINTS, NOISE, POINTS, limits, png
from jaxidl.report.words import cut, oneline
from jaxidl.robot.execution import Execution
from jaxidl.robot.held_out import BLOCKS, HELD, left_by
from jaxidl.robot.learn import data_of
from jaxidl.robot.learned import Learned
from jaxidl.types import Dataset

TORQUE, PROGRESS, TEXT = "figures/torque.png", "figures/progress.png", "report.md"


def learned_report(learned: Learned, execution: Execution) -> dict[str, bytes]:
    """Return the report's files by name.

    Args:
        learned: the feedforward.
        execution: the last one that it was learned from.
    """
    with house_style():
        files = {TORQUE: png(plot_torque(learned, execution))}
        if len(learned.history) > 1:
            files[PROGRESS] = png(plot_progress(learned))
    return {TEXT: report_text(learned, execution, list(files)).encode(), **files}


def report_text(learned: Learned, execution: Execution, pictures: list[str]) -> str:
    """Return the report as Markdown, with links to ``pictures``."""
    last, names, units = learned.history[-1], learned.model.names, learned.model.units
    sentences = [
        f"Iteration {learned.iteration}, source {learned.source}, learned from {last['rows']} rows"
        f" ({Path(execution.name).name} the last log), model {learned.model.path.name}. The guard"
        f" is {'off' if learned.guard is None else 'on'}.",
        "**Lacking** is the root mean square torque that the model lacks in the last execution,"
        " according to the rows of the source. **Left** is the part that the new networks do not"
        " explain; in brackets the part that the last iteration's networks do not explain, which"
        " were not trained on this execution. **Kept aside**: fresh networks are trained without"
        f" stretches {', '.join(str(b + 1) for b in HELD)} of {BLOCKS} of that execution, and"
        " judged there: lacking → left. Noise of the rows' torques is part of every number.",
    ]
    before = last["left_by_previous"]
    rows = [
        (
            oneline(name),
            _number(last["lacking"][j]),
            _number(last["left"][j]) + (f" ({_number(before[j])})" if before else ""),
            f"{_number(last['held_out_lacking'][j])} → {_number(last['held_out_left'][j])}",
            _number(last["feedback"][j]),
            units[j],
        )
        for j, name in enumerate(names)
    ]
    heads = ("joint", "lacking", "left", "kept aside", "applied feedback", "unit")
    parts = ["# A learned feedforward", *sentences, markdown(heads, rows)]
    if len(learned.history) > 1:
        steps = [
            (h["iteration"], Path(h["log"]).name, *(_number(x) for x in h["feedback"]))
            for h in learned.history
        ]
        parts += [
            "## Feedback over the executions",
            "Root mean square of the applied feedback.",
            markdown(
                (
                    "iteration",
                    "log",
                    *(f"{oneline(n)} [{u}]" for n, u in zip(names, units, strict=True)),
                ),
                steps,
            ),
        ]
    parts += [f"![{Path(name).stem}]({name})" for name in pictures]
    notes = [oneline(note) for note in execution.notes]
    if notes:
        parts += ["## Notes", "\n".join(f"- {note}" for note in notes)]
    return "\n\n".join(parts) + "\n"


def plot_torque(learned: Learned, execution: Execution) -> Figure:
    """Draw for each joint the torque that the model lacks, the learned one, and what is left."""
    data = data_of(execution, learned.source, learned.smoothing)
    steps = min(len(data.x), len(execution.run.tau) - 1)
    data = Dataset(data.x[:steps], data.y[:steps])
    every = slice(None, None, max(1, steps // POINTS))
    lacking = np.asarray(data.y)
    left = left_by(learned.error_model, learned.learner.params, data)
    time, joints = execution.dt * np.arange(steps)[every], _shown(lacking)
    figure = Figure(figsize=(7.2, 1.1 + 1.35 * len(joints)), layout="constrained")
    grid = figure.subplots(len(joints), 2, squeeze=False, sharex=True, sharey="row")
    for row, j in zip(grid, joints, strict=True):
        row[0].plot(time, lacking[every, j], color=BEFORE, lw=0.8, label="the model lacks")
        row[0].plot(time, (lacking - left)[every, j], color=AFTER, lw=1.2, label="learned")
        row[1].plot(time, left[every, j], color=NOISE, lw=0.8, label="left")
        name = cut(learned.model.names[j], 22).replace("$", r"\$")
        row[0].set_ylabel(f"{name}\n[{learned.model.units[j]}]")
        limits(row[0], lacking[:, j])
    for axes, title in zip(grid[0], ("lacking and learned torque", "what is left"), strict=True):
        axes.set_title(title)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    grid[0, 0].legend(loc="best")
    if len(joints) < len(learned.model.names):
        figure.suptitle(f"the {len(joints)} joints that lack most", fontsize=9)
    return figure


def plot_progress(learned: Learned) -> Figure:
    """Draw feedback and what networks leave of the lacking torque, over the iterations."""
    steps, joints = [h["iteration"] for h in learned.history], len(learned.model.names)
    figure = Figure(figsize=(7.2, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    colours = [f"C{j % 10}" for j in range(joints)]
    for j in range(joints):
        name = cut(learned.model.names[j], 22).replace("$", r"\$")
        feedback = [h["feedback"][j] for h in learned.history]
        left.plot(steps, feedback, marker="o", color=colours[j], label=name)
        known = [h for h in learned.history if h["left_by_previous"]]
        share = [h["left_by_previous"][j] / max(h["lacking"][j], 1e-12) for h in known]
        right.plot([h["iteration"] for h in known], share, marker="o", color=colours[j])
    units = " or ".join(dict.fromkeys(learned.model.units))
    left.set(title="applied feedback in the execution", ylabel=f"root mean square [{units}]")
    right.set(
        title="lacking torque that the last networks missed", ylabel="share of what is lacking [-]"
    )
    for axes in (left, right):
        axes.set_xlabel("iteration")
        axes.set_ylim(bottom=0.0)
        axes.set_xticks(steps if len(steps) < 12 else steps[:: -(-len(steps) // 10)])
    left.legend(loc="best")
    return figure


def _shown(lacking: np.ndarray) -> list[int]:
    """Return at most ``JOINTS`` joints, those that lack most."""
    order = np.argsort(-np.sqrt(np.mean(lacking**2, axis=0)))
    return sorted(order[:JOINTS].tolist())


def _number(value: float) -> str:
    return f"{value:.3g}"
