"""The style of all figures: legible in print, in grey and to colour-blind readers."""

import io
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxidl.files import write_bytes

# Okabe and Ito's palette; line style and marker distinguish the sources without colour
SOURCE_STYLE: dict[str, dict[str, Any]] = {
    "indirect": {"color": "#D55E00", "linestyle": "--", "marker": "s"},
    "direct": {"color": "#0072B2", "linestyle": "-.", "marker": "^"},
    "joint": {"color": "#009E73", "linestyle": "-", "marker": "o"},
    "weighted": {"color": "#CC79A7", "linestyle": ":", "marker": "D"},
}
CONTROLLER_NAME = {"pid": "PID", "doomed": "DOOMED"}


@contextmanager
def house_style() -> Generator[None]:
    """Set the Matplotlib settings of all figures, and undo them on leaving."""
    settings: Any = {
        "font.size": 9,
        "axes.titlesize": 9.5,
        "axes.labelsize": 9,
        "legend.fontsize": 8.5,
        "xtick.labelsize": 8,
        "ytick.labelsize": 8,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.alpha": 0.3,
        "grid.linewidth": 0.5,
        "lines.linewidth": 1.4,
        "lines.markersize": 3.5,
        "figure.dpi": 100,
        "savefig.dpi": 200,
        "pdf.fonttype": 42,
    }
    with mpl.rc_context(settings):
        yield


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write ``name``.png and ``name``.pdf into ``folder``; return the two paths."""
    paths = []
    for kind, metadata in (("png", {"Software": None}), ("pdf", {"CreationDate": None})):
        buffer = io.BytesIO()
        FigureCanvasAgg(figure)
        figure.savefig(buffer, format=kind, bbox_inches="tight", metadata=metadata)
        paths.append(folder / f"{name}.{kind}")
        write_bytes(paths[-1], buffer.getvalue())
    return paths
