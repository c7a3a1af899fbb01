"""An unannounced load on an arm whose gains have fallen: ``python experiments/load.py FOLDER``.

The seven-joint arm learns from weighted data, with and without the guard and a schedule of gains
(:mod:`jaxidl.learning.schedule`). Then 2.5 kg hang on its flange that it knows nothing of. FOLDER
gets load.md, .json, .png and .pdf: path error and gains of all executions, with a training between
each two.
"""

from functools import partial
from pathlib import Path
from typing import Any

import guard
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from jaxidl.arm.setup import ArmStudy, carrying
from jaxidl.arm.smoothing import zero_phase
from jaxidl.backend import choose_devices, compiler_options
from jaxidl.files import markdown
from jaxidl.jobs.provenance import revision
from jaxidl.jobs.statistics import geometric
from jaxidl.learning.execute import desired_trajectory, execute
from jaxidl.learning.guard import Guard, Strayed, distance
from jaxidl.learning.schedule import Schedule
from jaxidl.learning.sources import rows
from jaxidl.models import draw_batches, fit
from jaxidl.models import start as start_of
from jaxidl.plot.style import house_style, save
from jaxidl.systems.arm import JOINTS
from jaxidl.types import State

SEEDS = (41, 42, 43)
NOISE, LOAD = 1e-5, 2.5  # of the encoders [rad], of the load [kg]
BEFORE, LOADED = 10, 3  # executions without and with the load
STYLES = (
    {"color": "#D55E00", "linestyle": "--", "marker": "s"},
    {"color": "#0072B2", "linestyle": "-.", "marker": "^"},
    {"color": "#009E73", "linestyle": "-", "marker": "o"},
)


def executed(
    study: ArmStudy, seed: int, limits: Guard | None, schedule: Schedule | None
) -> dict[str, list[float]]:
    """Return path error [rad] and mean share of the gains of every execution, the last loaded."""
    setting, task = study.setting(jnp.asarray(NOISE)), study.task()
    model, training = study.error_model, study.training
    wanted, key = desired_trajectory(task), jax.random.key(seed)
    refine = partial(zero_phase, model=setting.model, task=task, band=study.acceleration_band)

    def once(k: Any, load: Any, learner: Any, known: Any, past: Any, share: Any) -> Any:
        draws, start = jax.random.split(jax.random.fold_in(key, 1_000_000 + k))
        feedforward = fade = gains = None
        if known is not None:
            number = int(training.train_mask(known.x.shape[0]).sum())
            batches = draw_batches(jax.random.fold_in(key, k), number, training)
            learner, _ = fit(model, training, learner, known, batches)
            feedforward = lambda state, qdd, _: model.torque(learner.params, state, qdd)
            if limits:
                region = limits.region(known, past)
                feedforward, fade = region.feedforward(model, learner.params), region.fade
            gains = schedule.gains(share, past) if schedule else None
        run = execute(
            carrying(setting.plant, load[None]),
            setting.model,
            setting.law,
            task,
            jax.random.normal(draws, (study.steps, JOINTS)),
            feedforward,
            task.start.q + NOISE * jnp.clip(jax.random.normal(start, (JOINTS,)), -1.0, 1.0),
            fade=fade,
            gains=gains,
        )
        applied = jnp.ones(())
        if gains:
            applied = jnp.mean(jax.vmap(gains)(State(run.q_sensing, run.qd_sensing), wanted))
        strayed = distance(run.q_sensing, wanted.q)
        past = Strayed.of(strayed) if past is None else past.after(strayed)
        share = schedule.after(share, strayed, past) if schedule and known else share
        known = rows("weighted", refine(run), setting.law, "sensed_state")
        return (learner, known, past, share), (jnp.abs(run.q - wanted.q).mean(), applied)

    jitted = jax.jit(once, compiler_options=compiler_options())
    learner = start_of(training, model.init(jax.random.fold_in(key, 0)))
    carry, found = (learner, None, None, jnp.ones(())), []
    for k in range(BEFORE + LOADED):
        load = jnp.asarray(LOAD if k >= BEFORE else 0.0)
        carry, measured = jitted(jnp.asarray(k), load, *carry)
        found.append([float(x) for x in measured])
    path, applied = map(list, zip(*found, strict=True))
    return {"path": path, "gains": applied}


def table(found: dict[str, list[dict[str, list[float]]]]) -> str:
    """Return path errors and gains of the last executions as Markdown."""
    heads = ["", "before the load"] + [
        f"{name} with it" for name in ("first", "second", "third")[:LOADED]
    ]
    rows_of = []
    for name, runs in found.items():
        path, gains = (np.array([run[what] for run in runs]) for what in ("path", "gains"))
        for what, values, unit in (("path error [mrad]", path, 1e3), ("share of gains", gains, 1)):
            late = [geometric(unit * values[:, k]) for k in range(BEFORE - 1, BEFORE + LOADED)]
            rows_of.append([f"{name}: {what}", *map(str, late)])
    return markdown(heads, rows_of)


def draw(found: dict[str, list[dict[str, list[float]]]], folder: Path) -> None:
    """Draw path error and gains of every execution: geometric mean, and the range over seeds."""
    with house_style():
        figure = Figure(figsize=(7.2, 3.0), layout="constrained")
        panels = figure.subplots(1, 2)
        for (name, runs), style in zip(found.items(), STYLES, strict=True):
            for axes, what, unit in zip(panels, ("path", "gains"), (1e3, 1.0), strict=True):
                values = unit * np.array([run[what] for run in runs])
                executions = np.arange(1, values.shape[1] + 1)
                axes.plot(executions, np.exp(np.log(values).mean(0)), label=name, **style)
                axes.fill_between(
                    executions, values.min(0), values.max(0), color=style["color"], alpha=0.15
                )
        for axes in panels:
            axes.axvline(BEFORE + 0.5, color="black", linewidth=0.6)
            axes.set(xlabel="execution", xticks=range(1, BEFORE + LOADED + 1, 2))
            axes.annotate(
                f"{LOAD:g} kg more",
                (BEFORE + 0.3, 1.0),
                xycoords=("data", "axes fraction"),
                ha="right",
                va="top",
                fontsize=8,
            )
        panels[0].set(yscale="log", ylabel="mean path error [mrad]")
        panels[1].set(ylabel="share of the applied gains", ylim=(0.0, 1.25))
        panels[0].legend(loc="upper center", bbox_to_anchor=(0.45, 0.92))
        save(figure, folder, "load")


def main() -> None:
    given = guard.folders(__doc__ or "")
    choose_devices(None)
    jax.config.update("jax_enable_x64", True)
    study, began = ArmStudy(acceleration="zero_phase"), revision()
    found = {
        name: [executed(study, seed, *kept) for seed in SEEDS]
        for name, kept in {
            "guard, fixed gains": (Guard(), None),
            "guard, scheduled gains": (Guard(), Schedule()),
            "scheduled gains": (None, Schedule()),
        }.items()
    }
    about = {"git_revision": began, "load": LOAD, "seeds": SEEDS, "runs": found}
    guard.keep(given.folder, "load", about, table(found))
    draw(found, given.folder)


if __name__ == "__main__":
    main()
