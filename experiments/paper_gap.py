"""What is hidden in the paper's own plant, found from a log of it; then the paper's learning on the
corrected model.

The measured data are the paper's point mass (5 kg, friction level 5, stiction level 5), moved by a
stiff position controller from place to place; the model one believes in is a free mass of 0.5 kg.
``python experiments/paper_gap.py FOLDER`` takes some four minutes, writes log, report,
``learning.json`` and ``learning.png`` into the folder, and prints what was found.
"""

import json
import sys
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from flax import struct  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402

from jaxidl import gap, report  # noqa: E402
from jaxidl.control import Pid, PidGains  # noqa: E402
from jaxidl.effects import SensingNoise  # noqa: E402
from jaxidl.jobs.provenance import revision  # noqa: E402
from jaxidl.learning.execute import Task, execute  # noqa: E402
from jaxidl.learning.guard import Guard  # noqa: E402
from jaxidl.learning.iterate import learn  # noqa: E402
from jaxidl.paper.effects import PaperFriction, paper_stiction  # noqa: E402
from jaxidl.paper.study import Condition, PaperStudy, draw_noise  # noqa: E402
from jaxidl.plot.style import SOURCE_STYLE, house_style, save  # noqa: E402
from jaxidl.systems import Plant, point_mass  # noqa: E402
from jaxidl.types import State  # noqa: E402

MODEL = """<mujoco model="point mass">
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="mass">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 1 0"/>
      <inertial pos="0 0 0" mass="0.5" diaginertia="0.001 0.001 0.001"/>
    </body>
  </worldbody>
</mujoco>
"""
FRICTION, STICTION, ENCODER = 5.0, 5.0, 2e-6  # levels, and the encoder's noise [m]
STAY, MOVES = 1500, 33  # steps at each place: shorter stays do not come to rest; places


class Tour(struct.PyTreeNode):
    """From place to place: a PD policy whose target changes every ``STAY`` steps."""

    places: jax.Array  # (M, 2) [m]

    def __call__(self, q, qd, t):
        return 100.0 * (self.places[t // STAY] - q) - 20.0 * qd


def places() -> np.ndarray:
    """(M, 2) targets: three low ones, each a little higher, where the mass sticks; two where axis 0
    is high and axis 1 is not, so that it shows which of the two positions brakes axis 0; and four
    where both are. The border at 0.2 m is passed slowly.

    A resting mass leaves a low place upwards only: the paper's stiction holds against every
    negative torque. On the way up axis 0 passes 0.2 m before axis 1 passes 0.4 m, as in the paper's
    own task: otherwise its rules let the coupling overwrite the friction of axis 0, which is no sum
    of two effects.
    """
    rng = np.random.default_rng(1)
    first = [
        (-0.3, -0.2),
        (-0.1, 0.0),
        (0.05, 0.15),
        (0.3, 0.35),
        (0.9, 1.1),
        (0.4, 0.6),
        (0.9, 1.1),
        (0.3, 0.35),
    ]
    second = [
        (-0.3, -0.2),
        (-0.1, 0.0),
        (0.05, 0.15),
        (0.16, 0.17),
        (0.18, 0.19),
        (0.8, 1.1),
        (0.6, 0.9),
        (0.8, 1.1),
    ]
    bands = np.stack([first, second])[:, np.arange(MOVES) % len(first)]  # (2, M, 2)
    return rng.uniform(bands[..., 0], bands[..., 1]).T


def measured() -> gap.Log:
    """The log that one would have recorded."""
    plant = Plant(
        point_mass(5.0), (PaperFriction(FRICTION), paper_stiction(STICTION), SensingNoise(ENCODER))
    )
    gains = PidGains(20000.0, 600.0, 0.0)
    tour, steps = jnp.asarray(places()), STAY * MOVES
    task = Task(State(tour[0], jnp.zeros(2)), Tour(tour), jnp.asarray(5000.0), steps=steps)
    noise = np.random.default_rng(2).standard_normal((steps, 2))
    run = jax.jit(execute)(plant, point_mass(5.0), Pid(gains, gains, 0.1), task, noise)
    return gap.from_arrays(
        np.arange(steps) * task.dt, np.asarray(run.q_sensing), np.asarray(run.tau)
    )


def learning(
    corrected: Plant, study: PaperStudy, seeds: tuple[int, ...]
) -> dict[str, dict[str, list]]:
    """Tracking error (K,) of each seed, model and source, with the low-gain PID that the stiction
    stops. Weighted data are learned from with the guard.
    """
    condition = Condition(0, 5e-5, FRICTION, STICTION)
    curves: dict[str, dict[str, list]] = {}
    for name, model in (
        ("0.5 kg, nothing else", point_mass(study.modelled_mass)),
        ("corrected", corrected),
    ):
        for source in SOURCE_STYLE:
            setting = study.setting("pid", condition).replace(model=model)
            run = jax.jit(
                lambda s, z, k, source=source: learn(
                    s,
                    z,
                    k,
                    source=source,
                    error_model=study.error_model,
                    training=study.training,
                    guard=Guard() if source == "weighted" else None,
                )[0]
            )
            errors = [
                run(setting, draw_noise(s, 20, study.steps), jax.random.key(s)).q_error.tolist()
                for s in seeds
            ]
            curves.setdefault(name, {})[source] = errors
    return curves


def draw(curves: dict[str, dict[str, list]], folder: Path) -> None:
    """Tracking error by iteration, one panel a model."""
    with house_style():
        figure = Figure(figsize=(7.2, 3.0), layout="constrained")
        panels = figure.subplots(1, len(curves), sharey=True)
        for axes, (name, sources) in zip(panels, curves.items(), strict=True):
            for source, errors in sources.items():
                values = np.array(errors)
                label = f"{source}, guarded" if source == "weighted" else source
                axes.plot(np.median(values, 0), label=label, **SOURCE_STYLE[source])
                axes.fill_between(
                    range(values.shape[1]),
                    values.min(0),
                    values.max(0),
                    alpha=0.15,
                    color=SOURCE_STYLE[source]["color"],
                )
            axes.set_title(f"model: {name}")
            axes.set_xlabel("learning iteration")
            axes.set_yscale("log")
            axes.set_xticks(range(0, values.shape[1], 5))
        panels[0].set_ylabel("mean tracking error [m]")
        panels[-1].legend(title="data source", loc="upper right")
        save(figure, folder, "learning")


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "point_mass.xml").write_text(MODEL)
    found = gap.diagnose(measured(), folder / "point_mass.xml")
    report.save(found, folder / "report")
    print(found.summary)
    curves = learning(found.plant, PaperStudy(), (1, 2, 3))
    (folder / "learning.json").write_text(
        json.dumps({"git_revision": revision(), "q_error": curves}, indent=1)
    )
    draw(curves, folder)
    for name, sources in curves.items():
        for source, errors in sources.items():
            middle = np.median(errors, axis=0)
            worst = max(max(row) / row[0] for row in errors)
            print(
                f"{name:>22} {source:>9}: tracking error {middle[0]:.4f} m at first,"
                f" {middle[-1]:.4f} m at last, never above {worst:.3g} times the first"
            )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/paper_gap"))
