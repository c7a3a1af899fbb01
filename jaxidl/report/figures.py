"""The figures of a diagnosis.

They are functions from a :class:`jaxidl.gap.result.diagnosis.Diagnosis` to a ``Figure``. They use
Matplotlib's object-oriented interface: no window, no global state. :func:`jaxidl.report.common.png`
renders them.
"""

from collections.abc import Callable

from matplotlib.figure import Figure

from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.report.common import png
from jaxidl.report.found import plot_improvement, plot_parameters
from jaxidl.report.numbers import plot_gap
from jaxidl.report.traces import plot_residual, plot_spectrum, plot_where

FIGURES: dict[str, Callable[[Diagnosis], Figure | None]] = {
    "gap": plot_gap,
    "improvement": plot_improvement,
    "parameters": plot_parameters,
    "residual": plot_residual,
    "where": plot_where,
    "spectrum": plot_spectrum,
}


def draw(d: Diagnosis) -> dict[str, bytes]:
    """Return PNG content, by name, of all figures for which this diagnosis has data."""
    drawn = {name: plot(d) for name, plot in FIGURES.items()}
    return {name: png(figure) for name, figure in drawn.items() if figure is not None}


__all__ = [
    "FIGURES",
    "draw",
    "plot_gap",
    "plot_improvement",
    "plot_parameters",
    "plot_residual",
    "plot_spectrum",
    "plot_where",
]
