"""What each ingredient of weighted data and of the guard is worth: ``python
experiments/ingredients.py FOLDER``.

Learning from weighted data with the guard, and the same with one ingredient left out or replaced,
in the conditions of ``guard.py``, which no rule was made on. For comparison, the paper's sources
with the guard, on sensed states as on a robot. FOLDER gets ingredients.md, .json, .png and .pdf;
the sweep stays in ``--sweeps`` (default: FOLDER), and an interrupted run continues.
"""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import guard
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from jaxidl import jobs
from jaxidl.backend import MATMUL_PRECISION, choose_devices
from jaxidl.control import FeedbackLaw
from jaxidl.control.filters import average_along, average_around
from jaxidl.files import markdown
from jaxidl.jobs.statistics import geometric
from jaxidl.learning.guard import Guard, Region, Strayed
from jaxidl.learning.iterate import learn
from jaxidl.learning.sources import OwnSource, rows, weighted
from jaxidl.paper.grid import GAINS
from jaxidl.paper.runs import META, LearningRun
from jaxidl.paper.study import Condition, PaperStudy
from jaxidl.plot.style import CONTROLLER_NAME, house_style, save
from jaxidl.types import Dataset, Trajectory

STUDY = PaperStudy()
RUN = LearningRun(STUDY, guard.GRID.executions)


def half(run: Trajectory, law: FeedbackLaw, *, first: bool) -> Dataset:
    """Return the weighted rows of one source only: the indirect ones (first), or the direct."""
    data, steps = weighted(run, law.smoothing), len(run.q)
    return jax.tree.map(lambda x: x[:steps] if first else x[steps:], data)


def delayed(run: Trajectory, law: FeedbackLaw) -> Dataset:
    """Return weighted rows whose direct targets keep the delay of the learning feedback."""
    data = weighted(run, law.smoothing)
    late = run.tau_feedback[1:] + run.tau_feedforward[:-1]
    return Dataset(data.x, data.y.at[len(run.q) :].set(late))


def unaveraged(run: Trajectory, law: FeedbackLaw) -> Dataset:
    """Return weighted rows whose indirect half is the paper's, as it happened at each step."""
    data, plain = weighted(run, law.smoothing), rows("indirect", run, law, "sensed_state")
    steps = len(run.q)
    return Dataset(data.x.at[:steps].set(plain.x), data.y.at[:steps].set(plain.y))


def blurred(run: Trajectory, law: FeedbackLaw) -> Dataset:
    """Return weighted rows whose targets are averaged as a whole, the last feedforward included."""
    x = weighted(run, law.smoothing).x
    happened = average_around(run.tau - run.tau_inverse_actual, law.smoothing)
    back = average_along(run.tau_feedback, law.smoothing, reverse=True)[1:]
    wanted = back + average_around(run.tau_feedforward, law.smoothing)[:-1]
    return Dataset(x, jnp.concatenate([happened, wanted]))


def on_true_states(run: Trajectory, law: FeedbackLaw) -> Dataset:
    """Return weighted rows at the true states, which no robot knows."""
    return weighted(replace(run, q_sensing=run.q, qd_sensing=run.qd), law.smoothing)


class Unlimited(Guard):
    """A guard that fades only: inputs and torques of the network are not clipped."""

    def region(self, data: Dataset, strayed: Strayed) -> Region:
        known = super().region(data, strayed)
        return known.replace(
            lowest=jnp.full_like(known.lowest, -jnp.inf),
            highest=jnp.full_like(known.highest, jnp.inf),
            least=jnp.full_like(known.least, -jnp.inf),
            most=jnp.full_like(known.most, jnp.inf),
        )


WHOLE = "weighted, guarded"
PAPERS = ("indirect", "direct", "joint")
VARIANTS: dict[str, tuple[str | OwnSource, Guard | None]] = {
    WHOLE: ("weighted", Guard()),
    "indirect half only": (partial(half, first=True), Guard()),
    "direct half only": (partial(half, first=False), Guard()),
    "direct half with its delay": (delayed, Guard()),
    "indirect half not averaged": (unaveraged, Guard()),
    "last feedforward averaged, too": (blurred, Guard()),
    "at true states": (on_true_states, Guard()),
    "not guarded": ("weighted", None),
    "guard without fading": ("weighted", Guard(near=1e6, far=2e6)),
    "guard without clipping": ("weighted", Unlimited()),
    **{f"{source} data, sensed states": (source, Guard()) for source in PAPERS},
}


def run_one(*, controller, gain, noise, friction, seed, variant, draws) -> dict[str, Any]:
    """Return the metrics (K,) of one learning run."""
    source, limits = VARIANTS[variant]
    with jax.default_matmul_precision(MATMUL_PRECISION):
        metrics, _, _ = learn(
            STUDY.setting(controller, Condition(gain, noise, friction, guard.GRID.stiction[0])),
            draws,
            jax.random.key(seed),
            source=source,
            error_model=STUDY.error_model,
            training=STUDY.training,
            train_on="sensed_state",
            guard=limits,
        )
    return metrics._asdict()


def inputs(at: Mapping[str, Any]) -> dict[str, Any]:
    """Return a gain's index, and the draws (K, T, J) of a seed."""
    return RUN.inputs(at)


def sweep(folder: Path) -> xr.Dataset:
    """Return the metrics of every variant, condition and seed."""
    grid = guard.GRID
    return jobs.sweep(
        run_one,
        {
            "variant": tuple(VARIANTS),
            "controller": grid.controllers,
            "gain": GAINS,
            "noise": grid.noise,
            "friction": grid.friction,
            "seed": grid.seeds,
        },
        folder / "ingredients.nc",
        inputs=inputs,
        settings={"study": STUDY.to_dict()},
        variables=META,
    )


def compared(data: xr.Dataset) -> list[dict[str, Any]]:
    """Return a row for each controller, gain and variant.

    Ratios are to the whole, paired over conditions and seeds; their intervals are those over seeds
    of the mean over conditions.
    """
    out = []
    error = data["q_error"]
    last = error.isel(iteration=slice(-guard.LAST, None)).mean("iteration")
    later = error.isel(iteration=slice(1, None)) / error.isel(iteration=0)
    for controller, gain, variant in itertools.product(guard.GRID.controllers, GAINS, VARIANTS):
        at = {"controller": controller, "gain": gain}
        here = last.sel(at)
        change = np.log(here.sel(variant=variant).values / here.sel(variant=WHOLE).values)
        seeds = list(here.sel(variant=WHOLE).dims).index("seed")
        over = tuple(axis for axis in range(change.ndim) if axis != seeds)
        worst = later.sel(at | {"variant": variant})
        out.append(
            at
            | {
                "variant": variant,
                "ratio": geometric(np.exp(change.mean(over))),
                "median": float(here.sel(variant=variant).median()),
                "worst": float(worst.max()),
                "above_3": int((worst > 3.0).sum()),
                "executions": int(worst.size),
            }
        )
    return out


def table(found: list[dict[str, Any]]) -> str:
    """Return the rows as Markdown."""
    heads = [
        "controller, gain",
        "learning from",
        "final error over the whole's, 95 % over seeds",
        "median [mm]",
        "worst execution over the first",
        "executions above three times the first",
    ]
    return markdown(
        heads,
        (
            [
                f"{CONTROLLER_NAME[r['controller']]}, {r['gain']}",
                r["variant"],
                "1" if r["variant"] == WHOLE else r["ratio"],
                f"{1e3 * r['median']:.3g}",
                f"{r['worst']:.3g}",
                f"{r['above_3']} of {r['executions']}",
            ]
            for r in found
        ),
    )


def draw(found: list[dict[str, Any]], folder: Path) -> None:
    """Draw each variant's final error over the whole's, one panel for each controller and gain."""
    with house_style():
        figure = Figure(figsize=(7.0, 3.7), layout="constrained")
        axes = figure.subplots(1, 4, sharex=True, sharey=True)
        names = [name for name in VARIANTS if name != WHOLE]
        at = {name: -k - 0.7 * (k >= 6) - 0.7 * (k >= 9) for k, name in enumerate(names)}
        for panel, (controller, gain) in zip(
            axes, itertools.product(guard.GRID.controllers, GAINS), strict=True
        ):
            for r in found:
                if (r["controller"], r["gain"]) != (controller, gain) or r["variant"] == WHOLE:
                    continue
                mean, y = r["ratio"], at[r["variant"]]
                low, high = mean.interval
                color = "#D55E00" if low > 1.0 else "#0072B2" if high < 1.0 else "0.45"
                panel.plot((low, high), (y, y), color=color, linewidth=1.6)
                panel.plot(mean.value, y, "o", color=color, markersize=4)
                if r["above_3"]:
                    panel.plot(
                        0.97, y, "x", color="k", markersize=4, transform=panel.get_yaxis_transform()
                    )
            panel.axvline(1.0, color="0.5", linewidth=0.8, zorder=0)
            panel.set(xscale="log")
            panel.set_title(f"{CONTROLLER_NAME[controller]}, {gain} gain", fontsize=8.5)
        axes[0].set_yticks(list(at.values()), list(at))
        figure.supxlabel(
            "final error over that of weighted data with the guard (cross: some execution"
            " above three times the first)",
            fontsize=8.5,
        )
        save(figure, folder, "ingredients")


def main() -> None:
    given = guard.folders(__doc__ or "")
    choose_devices(None)
    data = sweep(given.sweeps or given.folder)
    found = compared(data)
    about = {
        "git_revision": data.attrs["git_revision"],
        "rows": [r | {"ratio": [r["ratio"].value, *(r["ratio"].interval or ())]} for r in found],
    }
    guard.keep(given.folder, "ingredients", about, table(found))
    draw(found, given.folder)


if __name__ == "__main__":
    main()
