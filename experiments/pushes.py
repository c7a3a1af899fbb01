"""Which pushes a detector feels, with which model: ``python experiments/pushes.py FOLDER``.

The seven-joint arm repeats its task with what it has learned from weighted data, and is pushed on
one joint at a random moment: 1 to 10 Nm for 20 to 200 ms. Thresholds come from earlier executions
without a push. Compared are the learning feedback that is left, and the generalised momentum
observer with the rigid model, with the model that ``jaxidl gap`` has corrected, and with the
learned one. FOLDER gets pushes.md, .json, .png and .pdf, and one push as push.png and .pdf; the
diagnosis stays in ``--sweeps`` (default: FOLDER), and is not repeated.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import guard
import jax
import jax.numpy as jnp
import numpy as np
import wall
from felt import AFTER, ASKED, Pushes, scored
from matplotlib.figure import Figure

from jaxidl import report
from jaxidl.arm.hidden import Logged, find
from jaxidl.arm.setup import ArmStudy, learn_arm
from jaxidl.backend import choose_devices, compiler_options
from jaxidl.control import Filtered
from jaxidl.effects import ConstantOffset
from jaxidl.files import markdown
from jaxidl.jobs.provenance import revision
from jaxidl.learning.detector import Observer, calibrate
from jaxidl.learning.execute import execute
from jaxidl.plot.style import house_style, save
from jaxidl.systems import Plant
from jaxidl.systems.arm import JOINTS, arm
from jaxidl.systems.mjcf import read_model
from jaxidl.types import Trajectory

SEEDS = (31, 32, 33)  # of learning runs; others were looked at while this was made
NOISE = 1e-5  # of the encoders [rad]
LEARNED, EARLIER, QUIET, PUSHED, WALLS = 6, 20, 150, 150, 50  # executions of each seed
SIZE, LASTS = (1.0, 10.0), (0.02, 0.2)  # of a push [Nm], [s]; drawn uniformly in the logarithm
SHOWN = 2.0, 0.1  # [Nm], [s]: the push nearest to this one is drawn
MODELS = {
    "feedback": "learning feedback",
    "rigid": "observer, rigid model",
    "corrected": "observer, corrected by gap",
    "learned": "observer, learned model",
}
STYLE = {
    "feedback": {"color": "#D55E00", "linestyle": "--"},
    "rigid": {"color": "#777777", "linestyle": "-."},
    "corrected": {"color": "#0072B2", "linestyle": ":"},
    "learned": {"color": "#009E73", "linestyle": "-"},
}
KINDS = {"pushes": "pushed on one joint", "collisions": "run into a wall"}


def draw(study: ArmStudy, number: int, seed: int) -> Pushes:
    """Return as many pushes: joint, torque [Nm], first and last step."""
    rng = np.random.default_rng([seed, 1])
    between = lambda low, high: np.exp(rng.uniform(np.log(low), np.log(high), number))
    size, lasts = between(*SIZE) * rng.choice([-1.0, 1.0], number), between(*LASTS) / study.dt
    begin = rng.integers(100, study.steps - round((LASTS[1] + AFTER) / study.dt), number)
    joint = rng.integers(0, JOINTS, number)
    return {"joint": joint, "size": size, "begin": begin, "end": begin + lasts.round().astype(int)}


def pushed(plant: Plant, circumstances: Any) -> Plant:
    """Return the plant with a torque (J,) [Nm] from outside."""
    *rest, _ = plant.effects
    return plant.replace(effects=(*rest, ConstantOffset(circumstances)))


def residuals(study: ArmStudy, corrected: Plant, run: Trajectory, delay: float) -> dict[str, Any]:
    """Return the residuals (T, J) of one execution, by model; the motors' ``delay`` is in [s]."""
    lag = delay + Filtered(study.velocity_band, study.acceleration_band).lag(study.dt)
    observe = lambda model, run: Observer(model, study.dt, study.smoothing, lag).along(run)
    body = arm().plant.body
    unlearned = replace(run, tau_feedforward=jnp.zeros_like(run.tau))
    found = {
        "feedback": run.tau_feedback,
        "rigid": observe(body, unlearned),
        "corrected": observe(corrected, unlearned),
        "learned": observe(body, run),
    }
    return jax.tree.map(lambda x: x.astype(jnp.float32), found)


@cache
def learned(study: ArmStudy, seed: int) -> Any:
    """Return the weights after ``LEARNED`` executions."""
    learn = lambda key: learn_arm(study, "weighted", jnp.asarray(NOISE), key, LEARNED)
    jitted = jax.jit(learn, compiler_options=compiler_options())
    return jitted(jax.random.key(seed)).learner.params


def runner(
    study: ArmStudy, params: Any, corrected: Plant
) -> Callable[[Any, Pushes], dict[str, np.ndarray]]:
    """Return a function of a key and pushes (N,) to residuals (N, T, J) of each model."""
    setting = study.setting(jnp.asarray(NOISE))
    plant = setting.plant.replace(
        effects=(*setting.plant.effects, ConstantOffset(jnp.zeros(JOINTS)))
    )
    feedforward = lambda state, qdd, _: study.error_model.torque(params, state, qdd)

    def one(inputs: Any) -> dict[str, Any]:
        key, push = inputs
        draws, start = jax.random.split(key)
        t = jnp.arange(study.steps)[:, None]
        now = (t >= push["begin"]) & (t < push["end"]) & (jnp.arange(JOINTS) == push["joint"])
        task = setting.task.replace(circumstances=jnp.where(now, push["size"], 0.0), world=pushed)
        off = NOISE * jnp.clip(jax.random.normal(start, (JOINTS,)), -1.0, 1.0)
        noise = jax.random.normal(draws, (study.steps, JOINTS))
        start_at = task.start.q + off
        run = execute(plant, setting.model, setting.law, task, noise, feedforward, start_at)
        return residuals(study, corrected, run, study.delay)

    all_of = jax.jit(partial(jax.lax.map, one), compiler_options=compiler_options())
    return lambda key, pushes: jax.tree.map(
        np.asarray, all_of((jax.random.split(key, len(pushes["joint"])), pushes))
    )


def corrected_model(folder: Path) -> Plant:
    """Return the arm's model as the gap finder corrects it from a log, diagnosed once."""
    to = folder / "pushes_corrected"
    if not (to / "report" / "model.xml").exists():
        find(Logged(), to, report.save)
    return read_model(to / "report" / "model.xml").plant


def executed(folder: Path, seed: int) -> tuple[ArmStudy, Pushes, dict[str, Any]]:
    """Learn, then execute: return the pushes and residuals of each kind of execution and model."""
    study = ArmStudy(acceleration="zero_phase")
    run = runner(study, learned(study, seed), corrected_model(folder))
    none = lambda number: {**draw(study, number, seed), "size": np.zeros(number)}
    kinds = {
        "earlier": none(EARLIER),
        "quiet": none(QUIET),
        "pushed": draw(study, PUSHED, seed),
    }
    keys = jax.random.split(jax.random.fold_in(jax.random.key(seed), 7), len(kinds))
    found = {name: run(k, kind) for k, (name, kind) in zip(keys, kinds.items(), strict=True)}
    return study, kinds["pushed"], found


def collided(folder: Path, seed: int) -> tuple[ArmStudy, Pushes, dict[str, Any]]:
    """Learn, then execute in MuJoCo: the same, with walls in the way instead of pushes."""
    study = ArmStudy(acceleration="zero_phase")
    corrected, engine = corrected_model(folder), wall.Engine(study, NOISE, folder)
    observed = lambda run: residuals(study, corrected, run, 0.0)
    once = wall.executions(study, learned(study, seed), engine, observed)
    key = jax.random.fold_in(jax.random.key(seed), 8)
    engine.begin()
    path = np.asarray(once(key)[1])
    places = [()] * (EARLIER + WALLS) + wall.walls(path, study.dt, WALLS, seed)
    found, touched = [], []
    for k, place in enumerate(places):
        engine.begin(*place)
        found.append(jax.tree.map(np.asarray, once(jax.random.fold_in(key, 1 + k))[0]))
        touched.append(engine.touched)
    begin = np.array(touched[-WALLS:])
    assert (begin >= 0).all()
    assert max(touched[:-WALLS]) < 0
    several = lambda runs: {model: np.stack([run[model] for run in runs]) for model in MODELS}
    cut = {
        "earlier": several(found[:EARLIER]),
        "quiet": several(found[EARLIER:-WALLS]),
        "pushed": several(found[-WALLS:]),
    }
    # of a collision there is neither size nor end: what counts is how soon it is felt
    none = np.zeros(WALLS)
    return study, {"joint": none, "size": none, "begin": begin, "end": begin}, cut


def draw_figure(found: dict[str, Any], folder: Path) -> None:
    """Draw which share of pushes and collisions is felt, over false alarms an hour."""
    with house_style():
        figure = Figure(figsize=(7.2, 3.1), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (kind, title) in zip(panels, KINDS.items(), strict=True):
            for model, row in found[kind].items():
                alarms = np.array(row["alarms_per_hour"])
                # none seen: less than one in all of them
                shown = np.maximum(alarms, row["fewest"] / 2.0)
                axes.plot(shown, 100.0 * np.array(row["felt"]), label=MODELS[model], **STYLE[model])
                axes.plot(
                    max(row["false"], row["fewest"] / 2.0),
                    100.0 * row["share"],
                    "o",
                    color=STYLE[model]["color"],
                    markersize=5,
                )
            axes.axvline(ASKED, color="black", linewidth=0.6)
            axes.set(title=title, xscale="log", xlabel="false alarms per hour", ylim=(0.0, 103.0))
        panels[0].set_ylabel("detected [%]")
        panels[1].legend(loc="lower left")
        save(figure, folder, "pushes")


def draw_push(
    study: ArmStudy, pushes: Pushes, found: dict[str, dict[str, np.ndarray]], folder: Path
) -> None:
    """Draw what each way to feel a push shows of one of them, beside its threshold."""
    lasts = (pushes["end"] - pushes["begin"]) * study.dt
    far = [
        np.abs(np.log(x / y)) for x, y in zip((np.abs(pushes["size"]), lasts), SHOWN, strict=True)
    ]
    k = int(np.argmin(far[0] + far[1]))
    joint, begin, end = (int(pushes[name][k]) for name in ("joint", "begin", "end"))
    near = slice(begin - 150, end + 250)
    ms = 1e3 * study.dt * (np.arange(near.start, near.stop) - begin)
    acted = np.where((ms >= 0.0) & (ms < 1e3 * lasts[k]), pushes["size"][k], 0.0)
    with house_style():
        figure = Figure(figsize=(7.2, 2.5), layout="constrained")
        for axes, (model, name) in zip(
            figure.subplots(1, 4, sharex=True, sharey=True), MODELS.items(), strict=True
        ):
            limit = float(calibrate(found["earlier"][model], study.dt, ASKED).threshold[joint])
            felt = found["pushed"][model][k, near, joint]
            felt = -felt if model == "feedback" else felt  # it acts against the push
            axes.axhspan(-limit, limit, color="0.88", linewidth=0.0)
            axes.plot(ms, acted, color="black", linewidth=0.8)
            axes.plot(ms, felt, linewidth=0.9, **STYLE[model])
            over = np.flatnonzero((np.abs(felt) > limit) & (ms >= 0.0))
            if len(over):
                axes.plot(
                    ms[over[0]], felt[over[0]], "o", color=STYLE[model]["color"], markersize=5
                )
            axes.set_title(name.replace(", ", ",\n"), fontsize=8.5)
            axes.set_xlabel("time [ms]")
        figure.axes[0].set_ylabel(f"torque on joint {joint + 1} [Nm]")
        save(figure, folder, "push")


def table(found: dict[str, dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    heads = [
        "what is watched",
        f"false alarms per hour (asked: {ASKED:g})",
        "detected",
        *(f"detected, {name}" for name in next(iter(found["pushes"].values()))["share_of"]),
        "delay, median and 90 %",
        "collisions detected",
        "delay",
    ]
    rows = []
    for model, row in found["pushes"].items():
        wall = found["collisions"][model]
        ms = lambda delay: "{:.0f}, {:.0f} ms".format(*(1e3 * np.array(delay)))
        share = lambda of: "{:.0%} [{:.0%}, {:.0%}]".format(of["share"], *of["share_between"])
        rows.append(
            [
                MODELS[model],
                "{:.0f} [{:.0f}, {:.0f}]".format(row["false"], *row["false_between"]),
                share(row),
                *(f"{x:.0%}" for x in row["share_of"].values()),
                ms(row["delay"]),
                share(wall),
                ms(wall["delay"]),
            ]
        )
    return markdown(heads, rows)


def main() -> None:
    given = guard.folders(__doc__ or "")
    choose_devices(None)
    jax.config.update("jax_enable_x64", True)
    work, began = given.sweeps or given.folder, revision()
    runs = [executed(work, seed) for seed in SEEDS]
    draw_push(*runs[0], given.folder)
    found = {
        "pushes": scored(runs),
        "collisions": scored([collided(work, seed) for seed in SEEDS]),
    }
    found = {kind: {model: rows[model] for model in MODELS} for kind, rows in found.items()}
    about = {"git_revision": began, "asked": ASKED, "seeds": SEEDS, **found}
    guard.keep(given.folder, "pushes", about, table(found))
    draw_figure(found, given.folder)


if __name__ == "__main__":
    main()
