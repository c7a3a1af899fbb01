"""The command ``jaxidl simulate``."""

from pathlib import Path
from typing import Annotated

from tyro.conf import OmitArgPrefixes, arg

from jaxidl.paper.request import Request


def simulate(
    request: Annotated[Request, OmitArgPrefixes],
    *,
    out: Annotated[Path, arg(metavar="TRACE.npz")] = Path("out/trace.npz"),
) -> None:
    """Simulate one execution of the paper's point mass, or with --source a whole learning run.

    Args:
        request: settings of the run.
        out: file of the trace, with arrays (1000, 2) named q, qd, q_sensing, qd_sensing,
            qdd_desired, qdd_actual, tau, tau_inverse_desired, tau_inverse_actual, tau_feedback,
            tau_feedback_applied, tau_feedforward. For a learning run they are (executions, 1000,
            2), and q_error, feedback_applied, qdd_error, torque, finite are (executions,).
    """
    from jaxidl.paper.simulate import simulate as run

    run(request, out)
    print(f"wrote {out}")
