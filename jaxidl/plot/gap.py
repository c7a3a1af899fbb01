"""The figures of a gap diagnosis: functions from a :class:`jaxidl.gap.diagnosis.Diagnosis` to a ``Figure``.

They keep to Matplotlib's object-oriented interface: no window, no global state. :func:`jaxidl.plot.gap_common.png` renders them.
"""

from collections.abc import Callable

from matplotlib.figure import Figure

from jaxidl.gap.diagnosis import Diagnosis
from jaxidl.plot.gap_common import png
from jaxidl.plot.gap_numbers import plot_gap, plot_parameters, plot_ranking
from jaxidl.plot.gap_traces import plot_residual, plot_spectrum, plot_where

FIGURES: dict[str, Callable[[Diagnosis], Figure | None]] = {
    "gap": plot_gap,
    "residual": plot_residual,
    "where": plot_where,
    "ranking": plot_ranking,
    "parameters": plot_parameters,
    "spectrum": plot_spectrum,
}


def draw(d: Diagnosis) -> dict[str, bytes]:
    """PNG content of all figures that this diagnosis has something to show in, by name."""
    drawn = {name: plot(d) for name, plot in FIGURES.items()}
    return {name: png(figure) for name, figure in drawn.items() if figure is not None}


__all__ = ["FIGURES", "draw", "plot_gap", "plot_parameters", "plot_ranking", "plot_residual", "plot_spectrum", "plot_where"]
