"""What a derivative through learning tells: the error after three executions around the paper's
gains, and its tangent.

``python experiments/what_a_derivative_tells.py FOLDER`` draws the error over relative changes of
the learner's gain, with the paper's networks and with rounded kinks, and prints derivative and
differences at several scales. Minutes.
"""

import json
import sys
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from jaxidl import Condition, ErrorModel, PaperStudy, Training, draw_noise, learn
from jaxidl.files import write_bytes
from jaxidl.jobs.provenance import revision
from jaxidl.models import start
from jaxidl.paper.vary import varied
from jaxidl.plot.style import house_style, save

jax.config.update("jax_enable_x64", True)

WIDTHS = {
    "kinks as in the paper": 0.0,
    "kinks rounded, width 0.1": 0.1,
    "kinks rounded, width 0.5": 0.5,
}
SCALES = (1e-7, 1e-5, 1e-3, 3e-2)


def log_error(width, change, derivative=None):
    """Log of the last execution's error, low-gain PID on joint data, if the learner's gain is
    500·(1 + change).
    """
    networks = ErrorModel(activation_width=width)
    study = PaperStudy(
        error_model=networks, training=Training(epochs=5), friction_width=0.02, stiction_width=0.05
    )
    study = varied(study, {"learner_gain": 500.0 * (1.0 + change)})
    setting, noise = (
        study.setting("pid", Condition(0, 1e-4, 5.0, 5.0)),
        jnp.asarray(draw_noise(1, 3, study.steps)),
    )
    # rounding plays no part
    weights = jax.tree.map(lambda leaf: leaf.astype(jnp.float64), networks.init(jax.random.key(7)))
    how = {
        "source": "joint",
        "error_model": networks,
        "training": study.training,
        "learner": start(study.training, weights),
    }
    return jnp.log(
        learn(setting, noise, jax.random.key(1), derivative=derivative, **how)[0].q_error[-1]
    )


def look(width: float) -> dict:
    """Error along ±3 % and along ±0.01 % of the gain, the derivative, and differences at SCALES."""
    along = jax.jit(partial(jax.lax.map, partial(log_error, width)))
    slope = jax.jit(jax.jacfwd(partial(log_error, width, derivative="forward")))(0.0)
    wide, near = np.linspace(-0.03, 0.03, 41), np.linspace(-1e-4, 1e-4, 41)
    ends = np.asarray(
        along(np.array([sign * scale for scale in SCALES for sign in (1, -1)]))
    ).reshape(-1, 2)
    differences = (ends[:, 0] - ends[:, 1]) / (2 * np.array(SCALES))
    curves = {
        "wide": [wide.tolist(), np.asarray(along(wide)).tolist()],
        "near": [near.tolist(), np.asarray(along(near)).tolist()],
    }
    return {
        "derivative": float(slope),
        "differences": dict(zip(map(str, SCALES), differences.tolist(), strict=True)),
        **curves,
    }


def draw(found: dict) -> Figure:
    """One column for each width, ±3 % above, ±0.01 % below; the tangent dashed."""
    figure = Figure(figsize=(8.2, 4.4), layout="constrained")
    grid = figure.subplots(2, len(found), sharey=True, squeeze=False)
    for column, (name, one) in zip(grid.T, found.items(), strict=True):
        for axes, key in zip(column, ("wide", "near"), strict=True):
            change, error = np.array(one[key])
            axes.plot(
                100 * change,
                np.exp(error),
                ".-",
                color="#0072B2",
                linewidth=0.7,
                markersize=3,
                label="learning run",
            )
            tangent = np.exp(error[len(error) // 2] + one["derivative"] * change)
            axes.plot(
                100 * change, tangent, "--", color="#D55E00", label="tangent from the derivative"
            )
        column[0].set_title(name)
        column[1].set_xlabel("change of the learner's gain [%]")
    errors = np.exp([one[key][1] for one in found.values() for key in ("wide", "near")])
    grid[0, 0].set_yscale("log")
    grid[0, 0].set_ylim(errors.min() / 1.2, errors.max() * 1.2)  # tangents may leave it
    for axes in grid[:, 0]:
        axes.set_ylabel("error after 3 executions [m]")
    figure.legend(
        *grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False
    )
    return figure


if __name__ == "__main__":
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    found = {name: look(width) for name, width in WIDTHS.items()}
    for name, one in found.items():
        print(
            f"{name}: derivative {one['derivative']:.4g}, differences",
            {k: float(f"{v:.4g}") for k, v in one["differences"].items()},
        )
    kept = {"git_revision": revision(), "networks": found}
    write_bytes(folder / "derivative_tells.json", (json.dumps(kept) + "\n").encode())
    with house_style():
        for path in save(draw(found), folder, "derivative_tells"):
            print(f"wrote {path}")
