"""The quantitative experiment: ten executions, every source, several noise levels, causal and
zero-phase accelerations.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jaxtyping import Array, Bool, Float

from jaxidl import jobs
from jaxidl.arm.setup import ACCELERATIONS, ArmStudy, feedback_mse, learn_arm
from jaxidl.backend import MATMUL_PRECISION
from jaxidl.errors import ConfigurationError, one_of
from jaxidl.jobs import Variable
from jaxidl.jobs.programs import Arrays, wait
from jaxidl.learning.deploy import export_feedforward
from jaxidl.learning.execute import desired_trajectory
from jaxidl.learning.sources import SOURCES, UNWEIGHTED
from jaxidl.systems.arm import JOINTS, arm
from jaxidl.types import Trajectory

# runs side by side: a core keeps one run's weights in its cache; elsewhere all seeds
WIDTH = {"cpu": 1}
EVERY = 4  # steps between the instants of stored traces
RUN, JOINT = ("iteration",), ("iteration", "joint")
VARIABLES = {
    "feedback_mse": Variable(RUN, "N2 m2", "mean squared applied feedback"),
    "feedback_mse_joint": Variable(JOINT, "N2 m2", "mean squared applied feedback of each joint"),
    "path_error": Variable(RUN, "rad", "mean |position - desired path|"),
    "feedforward_peak": Variable(RUN, "N m", "largest torque of the error model"),
    "model_error_rms": Variable(
        JOINT, "N m", "what the modelled arm truly lacks along the way, root mean square"
    ),
    "unpredicted_rms": Variable(JOINT, "N m", "the same less what the error model says"),
    "finite": Variable(RUN, "1", "stayed everything finite, the training before it included?"),
    "feedback_trace": Variable(
        ("execution", "time", "joint"),
        "N m",
        "applied feedback of the first and the last execution",
    ),
    "model_error_trace": Variable(
        ("time", "joint"), "N m", "what the modelled arm truly lacks in the last execution"
    ),
    "feedforward_trace": Variable(
        ("time", "joint"), "N m", "what the error model says in the last execution"
    ),
}
TRACES = [name for name, about in VARIABLES.items() if "time" in about.dims]


@dataclass(frozen=True)
class ArmGrid:
    """What is varied on the arm."""

    noise: tuple[float, ...] = (1e-6, 1e-5, 1e-4)  # of the encoders [rad]
    accelerations: tuple[str, ...] = ACCELERATIONS
    sources: tuple[str, ...] = tuple(UNWEIGHTED)
    seeds: tuple[int, ...] = (1, 2, 3, 4, 5)
    executions: int = 10

    def __post_init__(self) -> None:
        for what, given, known in (
            ("source", self.sources, SOURCES),
            ("acceleration", self.accelerations, ACCELERATIONS),
        ):
            for name in given:
                if name not in known:
                    raise one_of(what, name, known)
        if not all(0.0 <= noise <= 1e-2 for noise in self.noise):
            raise ConfigurationError(
                "encoder noise between 0 and 0.01 rad", f"{self.noise}", "correct it"
            )
        if not all(0 <= seed < 2**31 for seed in self.seeds):
            raise ConfigurationError(
                f"seeds between 0 and {2**31 - 1}", f"{self.seeds}", "correct them"
            )
        for name in ("noise", "accelerations", "sources", "seeds"):
            if len(set(values := getattr(self, name))) < len(values):
                raise ConfigurationError(
                    f"each value of {name} once", f"{values}", "drop the repeated ones"
                )
        if not (
            self.noise
            and self.accelerations
            and self.sources
            and self.seeds
            and self.executions >= 2
        ):
            raise ConfigurationError(
                "a value on every axis and two executions", f"{self}", "add what is missing"
            )

    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Return the axes by their names in a results file."""
        return {
            "acceleration": self.accelerations,
            "source": self.sources,
            "noise": self.noise,
            "seed": self.seeds,
        }


QUICK = ArmGrid(noise=(1e-5,), seeds=(1, 2), executions=4)


class Summary(NamedTuple):
    """What is kept of a run of K executions; traces at every ``EVERY``-th of T steps."""

    feedback_mse: Float[Array, " K"]  # mean squared applied feedback [Nm^2]
    feedback_mse_joint: Float[Array, "K J"]
    path_error: Float[Array, " K"]  # mean |position − desired path| [rad]
    feedforward_peak: Float[Array, " K"]  # largest |error model's torque| [Nm]
    model_error_rms: Float[Array, "K J"]  # what the modelled arm truly lacks along the way [Nm]
    unpredicted_rms: Float[Array, "K J"]  # ... less what the error model says [Nm]
    finite: Bool[Array, " K"]  # stayed everything finite, the training before it included?
    # applied feedback of the first and the last execution [Nm]
    feedback_trace: Float[Array, "2 T J"]
    # what the modelled arm truly lacks in the last execution [Nm]
    model_error_trace: Float[Array, "T J"]
    feedforward_trace: Float[Array, "T J"]  # what the error model says then [Nm]


def summarise(
    study: ArmStudy, noise: Float[Array, ""], runs: Trajectory, finite: Bool[Array, " K"]
) -> Summary:
    """Summarise trajectories (K, T, J)."""
    setting = study.setting(noise)

    def lacking(q: Array, qd: Array, qdd: Array) -> Array:
        """Return what the true arm needs beyond the modelled one for the desired acceleration."""
        return setting.plant.inverse_dynamics(q, qd, qdd) - setting.model.inverse_dynamics(
            q, qd, qdd
        )

    every = jax.tree.map(lambda x: x[:, ::EVERY], runs)
    truth = jax.lax.map(
        lambda run: jax.lax.map(lambda now: lacking(*now), run),
        (every.q, every.qd, every.qdd_desired),
    )
    rms = lambda x: jnp.sqrt(jnp.mean(x**2, axis=1))
    return Summary(
        feedback_mse(runs),
        jnp.mean(runs.tau_feedback_applied**2, axis=1),
        jnp.abs(runs.q - desired_trajectory(setting.task).q[None]).mean((1, 2)),
        jnp.abs(runs.tau_feedforward).max((1, 2)),
        rms(truth),
        rms(truth - every.tau_feedforward),
        finite,
        every.tau_feedback_applied[jnp.array([0, -1])],
        truth[-1],
        every.tau_feedforward[-1],
    )


@dataclass(frozen=True)
class ArmLearning:
    """One learning run on the arm, of ``executions``: what a sweep computes."""

    study: ArmStudy
    executions: int

    def __call__(
        self, *, acceleration: str, source: str, noise: Any, seed: Any
    ) -> dict[str, Array]:
        """Return :class:`Summary` by name."""
        study = replace(self.study, acceleration=acceleration)
        with jax.default_matmul_precision(MATMUL_PRECISION):
            _, runs, finite = learn_arm(study, source, noise, jax.random.key(seed), self.executions)
            return summarise(study, noise, runs, finite)._asdict()


def run_study(
    study: ArmStudy, grid: ArmGrid, out: Path, identity: dict[str, Any], quiet: bool = False
) -> xr.Dataset:
    """Run what ``out`` does not hold yet: dims (acceleration, source, noise, seed, ...) of
    :data:`VARIABLES`.

    Runs on direct data, which no estimate made after the execution changes, are the same for all
    kinds of acceleration.
    """
    width = WIDTH.get(jax.default_backend(), len(grid.seeds))
    first = grid.accelerations[0]
    coords = {
        "iteration": np.arange(grid.executions),
        "joint": np.arange(JOINTS) + 1,
        "execution": [0, grid.executions - 1],
    }
    time = ("time", np.arange(0, study.steps, EVERY) * study.dt, {"units": "s"})
    return jobs.sweep(
        ArmLearning(study, grid.executions),
        grid.axes(),
        out,
        static=("acceleration", "source"),
        inputs=lambda at: {"seed": np.uint32(at["seed"])},
        settings=identity,
        variables=VARIABLES,
        coords={**coords, "time": time, "noise": ("noise", list(grid.noise), {"units": "rad"})},
        alike=lambda at: {**at, "acceleration": first} if at["source"] == "direct" else at,
        per_device=width,
        width=width,
        quiet=quiet,
    )


def thinned(data: xr.Dataset) -> xr.Dataset:
    """Return the results with traces of the first seed only, in single precision."""
    return data.assign(
        {name: data[name].isel(seed=0, drop=True).astype(np.float32) for name in TRACES}
    )


def trained(study: ArmStudy, grid: ArmGrid) -> Arrays:
    """Return the weights after the last training, (7, ...) each, by name.

    Of the grid's first seed and lowest noise, with joint data.

    Raises:
        ConfigurationError: if that run diverged.
    """

    @jax.jit
    def run(key: Any) -> Any:
        with jax.default_matmul_precision(MATMUL_PRECISION):
            found = learn_arm(study, "joint", jnp.asarray(min(grid.noise)), key, grid.executions)
            return found.learner.params, found.finite

    params, finite = wait(run(jax.random.key(grid.seeds[0])))
    if not bool(finite.all()):
        raise ConfigurationError(
            "a run that stays finite, to export its weights",
            "one that diverged",
            "lower rate or noise",
        )
    leaves = jax.tree_util.tree_flatten_with_path(params)[0]
    return {jax.tree_util.keystr(path): np.asarray(leaf) for path, leaf in leaves}


def deployed(study: ArmStudy, weights: Arrays) -> bytes:
    """Return the feedforward with these weights as a file's content.

    See :mod:`jaxidl.learning.deploy`.
    """
    like = study.error_model.init(jax.random.key(0))
    params = jax.tree_util.tree_map_with_path(
        lambda path, leaf: jnp.asarray(weights[jax.tree_util.keystr(path)]), like
    )
    return export_feedforward(study.task(), arm().plant.body, study.error_model, params)
