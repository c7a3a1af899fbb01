"""Figures of the arm study: the paper's two, and one that needs the simulation's true error."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from jaxidl.plot.panels import seed_curves, shared_legend
from jaxidl.plot.style import SOURCE_STYLE

JOINT_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")


def feedback_by_execution(data: xr.Dataset) -> Figure:
    """Plot the mean squared feedback of each execution (the paper's Fig. 3).

    Encoder noise varies across, the kind of acceleration down.
    """
    rows, columns = data.acceleration.values.tolist(), data.noise.values.tolist()
    figure = Figure(figsize=(2.6 * len(columns) + 0.8, 2.2 * len(rows) + 0.7), layout="constrained")
    axes = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
    for i, acceleration in enumerate(rows):
        for j, noise in enumerate(columns):
            seed_curves(
                axes[i, j], data["feedback_mse"].sel(acceleration=acceleration, noise=noise)
            )
            if i == 0:
                axes[i, j].set_title(f"encoder noise {noise:g} rad")
            if i == len(rows) - 1:
                axes[i, j].set_xlabel("execution")
                axes[i, j].set_xticks(
                    range(data.sizes["iteration"]), range(1, data.sizes["iteration"] + 1)
                )
        axes[i, 0].set_ylabel(
            f"{acceleration.replace('_', '-')} accelerations\nmean squared feedback [Nm²]"
        )
    shared_legend(figure, axes[0, 0])
    return figure


def feedback_over_time(data: xr.Dataset, source: str = "joint") -> Figure:
    """Plot feedback over time in the first and the last execution (the paper's Fig. 4).

    ``data`` is that of one condition; there is a panel for each joint.
    """
    source = source if source in data.source.values else str(data.source.values[0])
    traces = data["feedback_trace"].sel(source=source)
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    for panel, execution in zip(axes, traces.execution.values.tolist(), strict=True):
        for joint, color in zip(traces.joint.values.tolist(), JOINT_COLORS, strict=True):
            trace = traces.sel(execution=execution, joint=joint)
            panel.plot(traces.time, trace, color=color, linewidth=1.0, label=f"joint {joint}")
        panel.set_title(
            f"execution {execution + 1}"
            + (", no error model yet" if execution == 0 else f", {source} data")
        )
        panel.set_ylabel("feedback [Nm]")
    axes[1].set_xlabel("time [s]")
    shared_legend(figure, axes[0])
    return figure


def model_error(data: xr.Dataset, source: str = "joint") -> Figure:
    """Plot the true error of the modelled arm in the last execution, and the error model's output.

    ``data`` is that of one condition.
    """
    source = source if source in data.source.values else str(data.source.values[0])
    truth, said = (
        data[name].sel(source=source) for name in ("model_error_trace", "feedforward_trace")
    )
    figure = Figure(figsize=(9.2, 4.2), layout="constrained")
    axes = figure.subplots(2, 4, sharex=True)
    for panel, joint in zip(axes.flat, data.joint.values.tolist(), strict=False):
        panel.plot(
            data.time,
            truth.sel(joint=joint),
            color="black",
            linewidth=0.9,
            label="true error of the modelled arm",
        )
        style = SOURCE_STYLE[source]["color"]
        panel.plot(
            data.time,
            said.sel(joint=joint),
            color=style,
            linewidth=0.9,
            label=f"error model ({source} data)",
        )
        missed = np.sqrt(
            float(
                ((truth - said).sel(joint=joint) ** 2).mean() / (truth.sel(joint=joint) ** 2).mean()
            )
        )
        panel.set_title(f"joint {joint}: {100 * missed:.0f} % unpredicted")
    axes[0, 0].set_ylabel("torque [Nm]")
    axes[1, 0].set_ylabel("torque [Nm]")
    for panel in (*axes[1, :3], axes[0, 3]):
        panel.set_xlabel("time [s]")
        panel.tick_params(labelbottom=True)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    axes[1, 3].axis("off")
    axes[1, 3].legend(handles, labels, loc="center", frameon=False)
    return figure
