"""What all figures of a diagnosis share: joints, colours, a clock, and names safe to draw."""

import io
import warnings

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.report.words import cut

WIDTH = 7.2  # width of every figure [in]
DPI = 180
BEFORE, AFTER, NOISE, COMMAND = "#D55E00", "#0072B2", "#009E73", "0.55"
JOINTS = 7  # most joints in figures with a row for each
POINTS = 6000  # most points of a curve or cloud; more are thinned out


def shown(d: Diagnosis) -> list[int]:
    """Return at most ``JOINTS`` joints, in the model's order.

    Joints with findings come first in the choice, then those with the largest gap.
    """
    found = {f.joint for f in d.findings}
    order = sorted(
        range(len(d.model.names)),
        key=lambda j: (j not in found, -_known(d.gap.before.torque_relative[j])),
    )
    return sorted(order[:JOINTS])


def which(d: Diagnosis, joints: list[int]) -> str:
    """Return an addition to a title if not all joints are shown."""
    total = len(d.model.names)
    return (
        ""
        if len(joints) == total
        else f"\n{len(joints)} of {total} joints: where something was found, or the gap is largest"
    )


def name_of(d: Diagnosis, joint: int | None, most: int = 22) -> str:
    """Return a joint's name, cut to length, with dollar signs that do not begin a formula."""
    name = "mechanism" if joint is None else d.model.names[joint]
    return cut(name, most).replace("$", r"\$")


def length_unit(d: Diagnosis, joint: int) -> str:
    """Return the unit of a joint's position: m or rad."""
    return "m" if d.model.kinds[joint] == "slide" else "rad"


def clock(d: Diagnosis) -> tuple[np.ndarray, np.ndarray]:
    """Return a time (N,) [s] that continues where a new log begins.

    Also return the first row of each stretch without a gap (S,).
    """
    time = np.array(d.traces.time, float)
    if len(time) < 2:
        return time, np.zeros(1, int)
    step = np.diff(time)
    usual = float(np.median(step))
    back = step <= 0.0
    time[1:] += np.cumsum(np.where(back, 20.0 * usual - step, 0.0))
    return time, np.concatenate([[0], np.flatnonzero(back | (step > 3.0 * usual)) + 1])


def broken(
    time: np.ndarray, values: np.ndarray, starts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a curve with a break before each of ``starts``.

    A long one is thinned out to the extremes of its pieces.
    """
    values = np.insert(np.array(values, float), starts[1:], np.nan)
    time = np.insert(time, starts[1:], time[starts[1:]])
    piece = -(-len(time) // POINTS) * 2
    if len(time) <= POINTS or piece < 4:
        return time, values
    whole = len(time) // piece * piece
    parts = values[:whole].reshape(-1, piece)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # some pieces contain only breaks
        extremes = np.stack([np.nanmin(parts, 1), np.nanmax(parts, 1)], 1)
    return np.repeat(time[:whole:piece], 2), extremes.ravel()


def counted(d: Diagnosis, residual: np.ndarray, joint: int) -> np.ndarray:
    """Return a joint's residual (N,), NaN where a rest begins or ends."""
    return np.where(d.traces.counted[:, joint], residual[:, joint], np.nan)


def sides(d: Diagnosis) -> list[tuple[str, str, np.ndarray]]:
    """Return label, colour and residuals (N, J) before and after.

    Only those of the model as it is if nothing was found.
    """
    if not d.findings:
        return [("residual", BEFORE, d.traces.before)]
    return [("residual before", BEFORE, d.traces.before), ("residual after", AFTER, d.traces.after)]


def limits(axes: Axes, *values: np.ndarray, share: float = 0.997) -> None:
    """Set vertical limits that contain ``share`` of the values, and zero.

    A few outliers then do not flatten the rest.
    """
    sizes = np.abs(np.concatenate([np.ravel(v) for v in values]))
    sizes = sizes[np.isfinite(sizes)]
    top = float(np.quantile(sizes, share)) if len(sizes) else 0.0
    axes.set_ylim(*((-1.2 * top, 1.2 * top) if top > 0.0 else (-1.0, 1.0)))


def png(figure: Figure) -> bytes:
    """Return the figure as a PNG file's content, the same for the same figure."""
    buffer = io.BytesIO()
    figure.set_dpi(DPI)
    with warnings.catch_warnings():
        # a joint's name may be in another script
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        # ``savefig`` would draw twice
        FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None})
    return buffer.getvalue()


def _known(number: float) -> float:
    return number if np.isfinite(number) else 0.0
