"""A diagnosis presented in the terminal, as a page, as JSON and in figures.

``jaxidl.report.save(diagnosis, folder)`` writes all of it.
"""

from jaxidl.report.document import fragment, page
from jaxidl.report.figures import (
    FIGURES,
    draw,
    plot_gap,
    plot_improvement,
    plot_parameters,
    plot_residual,
    plot_spectrum,
    plot_where,
)
from jaxidl.report.folder import check_folder, save
from jaxidl.report.terminal import table

__all__ = [
    "FIGURES",
    "check_folder",
    "draw",
    "fragment",
    "page",
    "plot_gap",
    "plot_improvement",
    "plot_parameters",
    "plot_residual",
    "plot_spectrum",
    "plot_where",
    "save",
    "table",
]
