"""A film of learning: ``python experiments/learning_film.py FOLDER`` writes learning.gif and .png.

The paper's point mass under low-gain PID, noise 0.5 mm, friction and stiction 5, learning from
joint data: executions 1, 2 and 5 of one learning run side by side.
"""

import sys
from pathlib import Path

import jax
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from jaxidl import PaperStudy
from jaxidl.paper.runs import LearningRun
from jaxidl.plot.style import CONTROLLER_NAME, SOURCE_STYLE, house_style

POINT = {
    "controller": "pid",
    "gain": "low",
    "noise": 5e-4,
    "friction": 5.0,
    "stiction": 5.0,
    "epochs": 20,
    "seed": 1,
    "source": "joint",
}
SHOWN = (0, 1, 4)  # executions, counted from 0
FRAMES = 50


def main(folder: Path) -> None:
    study = PaperStudy()
    with jax.enable_x64(True):
        metrics, runs = LearningRun(study, 1 + SHOWN[-1]).trace(POINT)
        wanted = np.asarray(study.reference())
    paths, errors = np.asarray(runs.q)[list(SHOWN)], np.asarray(metrics.q_error)[list(SHOWN)]
    folder.mkdir(parents=True, exist_ok=True)
    with house_style():
        draw(paths, errors, wanted, folder)


def draw(paths: np.ndarray, errors: np.ndarray, wanted: np.ndarray, folder: Path) -> None:
    """Draw executions (3, T, 2) [m] with their mean errors (3,) [m] and the path wanted (T, 2)."""
    figure = Figure(figsize=(7.4, 2.7), layout="constrained")
    axes = figure.subplots(1, len(SHOWN), sharex=True, sharey=True)
    color = SOURCE_STYLE[POINT["source"]]["color"]
    moving = []
    for panel, path, error, number in zip(axes, paths, errors, SHOWN, strict=True):
        panel.plot(*wanted.T, color="0.75", linewidth=5, solid_capstyle="round", label="desired")
        (trace,) = panel.plot([], [], color=color, label="actual")
        (goal,) = panel.plot([], [], "o", color="0.45", markersize=9, fillstyle="none")
        (mass,) = panel.plot([], [], "o", color=color, markersize=7)
        moving.append((path, trace, goal, mass))
        panel.set_title(f"execution {number + 1}: mean error {1e3 * error:.0f} mm")
        panel.set_xlabel("position of axis 0 [m]")
        panel.set_aspect("equal")
    axes[0].set(ylabel="position of axis 1 [m]", xlim=(-0.15, 2.3), ylim=(-0.15, 1.9))
    axes[0].legend(loc="lower right", frameon=False)
    about = f"{CONTROLLER_NAME[POINT['controller']]}, low gain, joint data, noise 0.5 mm, seed 1"
    figure.supxlabel(about, fontsize=7.5, color="0.35")

    def show(step: int) -> None:
        for path, trace, goal, mass in moving:
            trace.set_data(*path[: step + 1].T)
            goal.set_data(*wanted[step : step + 1].T)
            mass.set_data(*path[step : step + 1].T)

    steps = np.linspace(0, len(wanted) - 1, FRAMES).astype(int)
    film = FuncAnimation(figure, lambda frame: show(steps[min(frame, FRAMES - 1)]), FRAMES + 15)
    film.save(folder / "learning.gif", PillowWriter(fps=15), dpi=100)
    show(int(steps[-1]))
    figure.savefig(folder / "learning.png", dpi=200)
    for name in ("learning.gif", "learning.png"):
        print(f"wrote {folder / name}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
