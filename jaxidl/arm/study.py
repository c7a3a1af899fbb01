"""The quantitative experiment: ten executions, every source, several noise levels, causal and zero-phase accelerations."""

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import Array, Bool, Float

from jaxidl.backend import compiler_options
from jaxidl.errors import ConfigurationError, StoreError, one_of
from jaxidl.learning.arm import ACCELERATIONS, ArmStudy, feedback_mse, learn_arm
from jaxidl.learning.deploy import export_feedforward
from jaxidl.learning.execute import desired_trajectory
from jaxidl.learning.sources import SOURCES
from jaxidl.sweep.launch import wait
from jaxidl.sweep.parts import Arrays, Parts
from jaxidl.sweep.run import MATMUL_PRECISION
from jaxidl.systems.arm import JOINTS, arm
from jaxidl.types import Trajectory

WIDTH = {"cpu": 1}  # runs side by side: a core keeps one run's weights in its cache; elsewhere all seeds
EVERY = 4  # steps between the instants of stored traces
META = {
    "feedback_mse": {"units": "N2 m2", "long_name": "mean squared applied feedback"},
    "feedback_mse_joint": {"units": "N2 m2", "long_name": "mean squared applied feedback of each joint"},
    "path_error": {"units": "rad", "long_name": "mean |position - desired path|"},
    "feedforward_peak": {"units": "N m", "long_name": "largest torque of the error model"},
    "model_error_rms": {"units": "N m", "long_name": "what the modelled arm truly lacks along the way, root mean square"},
    "unpredicted_rms": {"units": "N m", "long_name": "the same less what the error model says"},
    "finite": {"units": "1", "long_name": "stayed everything finite, the training before it included?"},
    "feedback_trace": {"units": "N m", "long_name": "applied feedback of the first and the last execution"},
    "model_error_trace": {"units": "N m", "long_name": "what the modelled arm truly lacks in the last execution"},
    "feedforward_trace": {"units": "N m", "long_name": "what the error model says in the last execution"},
}


@dataclass(frozen=True)
class ArmGrid:
    """What is varied on the arm."""

    noise: tuple[float, ...] = (1e-6, 1e-5, 1e-4)  # of the encoders [rad]
    accelerations: tuple[str, ...] = ACCELERATIONS
    sources: tuple[str, ...] = tuple(SOURCES)
    seeds: tuple[int, ...] = (1, 2, 3, 4, 5)
    iterations: int = 10

    def __post_init__(self) -> None:
        for what, given, known in (("source", self.sources, SOURCES), ("acceleration", self.accelerations, ACCELERATIONS)):
            for name in given:
                if name not in known:
                    raise one_of(what, name, known)
        if not all(0.0 <= noise <= 1e-2 for noise in self.noise):
            raise ConfigurationError("encoder noise between 0 and 0.01 rad", f"{self.noise}", "correct it")
        if not all(0 <= seed < 2**31 for seed in self.seeds):
            raise ConfigurationError(f"seeds between 0 and {2**31 - 1}", f"{self.seeds}", "correct them")
        for name in ("noise", "accelerations", "sources", "seeds"):
            if len(set(values := getattr(self, name))) < len(values):
                raise ConfigurationError(f"each value of {name} once", f"{values}", "drop the repeated ones")
        if not (self.noise and self.accelerations and self.sources and self.seeds and self.iterations >= 2):
            raise ConfigurationError("a value on every axis and two executions", f"{self}", "add what is missing")

    def labels(self) -> Iterator["Label"]:
        """All runs, those of one program after the other."""
        return itertools.starmap(Label, itertools.product(self.accelerations, self.sources, self.noise, self.seeds))


QUICK = ArmGrid(noise=(1e-5,), seeds=(1, 2), iterations=4)


class Label(NamedTuple):
    """One run."""

    acceleration: str
    source: str
    noise: float
    seed: int

    @property
    def name(self) -> str:
        """Of its piece: runs on direct data, which no estimate made after the execution changes, are the same for both kinds."""
        acceleration = "any" if self.source == "direct" else self.acceleration
        return f"{acceleration}-{self.source}-{self.noise!r}-{self.seed}"


class Summary(NamedTuple):
    """What is kept of a run of K executions; traces at every ``EVERY``-th of T steps."""

    feedback_mse: Float[Array, " K"]  # mean squared applied feedback [Nm^2]
    feedback_mse_joint: Float[Array, "K J"]
    path_error: Float[Array, " K"]  # mean |position − desired path| [rad]
    feedforward_peak: Float[Array, " K"]  # largest |error model's torque| [Nm]
    model_error_rms: Float[Array, "K J"]  # what the modelled arm truly lacks along the way [Nm]
    unpredicted_rms: Float[Array, "K J"]  # ... less what the error model says [Nm]
    finite: Bool[Array, " K"]  # stayed everything finite, the training before it included?
    feedback_trace: Float[Array, "2 T J"]  # applied feedback of the first and the last execution [Nm]
    model_error_trace: Float[Array, "T J"]  # what the modelled arm truly lacks in the last execution [Nm]
    feedforward_trace: Float[Array, "T J"]  # what the error model says then [Nm]


def summarise(study: ArmStudy, noise: Float[Array, ""], runs: Trajectory, finite: Bool[Array, " K"]) -> Summary:
    """Of trajectories (K, T, J)."""
    setting = study.setting(noise)

    def lacking(q: Array, qd: Array, qdd: Array) -> Array:
        """What the true arm needs beyond the modelled one for the desired acceleration."""
        return setting.plant.inverse_dynamics(q, qd, qdd) - setting.model.inverse_dynamics(q, qd, qdd)

    every = jax.tree.map(lambda x: x[:, ::EVERY], runs)
    truth = jax.lax.map(lambda run: jax.lax.map(lambda now: lacking(*now), run), (every.q, every.qd, every.qdd_desired))
    rms = lambda x: jnp.sqrt(jnp.mean(x**2, axis=1))  # noqa: E731
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


@cache
def program(study: ArmStudy, source: str, iterations: int, devices: int, width: int) -> Any:
    """(noise (R,), seeds (R,)) -> :class:`Summary` with leaves (R, ...); devices map over shares, ``width`` side by side."""
    mesh = Mesh(np.array(jax.devices()[:devices]), ("runs",))

    def one(run: tuple[Array, Array]) -> Summary:
        noise, seed = run
        with jax.default_matmul_precision(MATMUL_PRECISION):
            _, runs, finite = learn_arm(study, source, noise, jax.random.key(seed), iterations)
            return summarise(study, noise, runs, finite)

    split, batch = PartitionSpec("runs"), None if width == 1 else width
    each = lambda *runs: jax.lax.map(one, runs, batch_size=batch)  # noqa: E731
    share = jax.shard_map(each, mesh=mesh, in_specs=split, out_specs=split, check_vma=False)
    return jax.jit(share, compiler_options=compiler_options())


def run_study(study: ArmStudy, grid: ArmGrid, parts: Parts, step: Callable[[], None]) -> None:
    """Compute what ``parts`` has not yet; ``step`` is called after every run."""
    devices, width = jax.device_count(), WIDTH.get(jax.default_backend(), len(grid.seeds))
    size = devices * width
    for acceleration, source in itertools.product(grid.accelerations, grid.sources):
        run = program(replace(study, acceleration=acceleration), source, grid.iterations, devices, width)
        group = [label for label in grid.labels() if label[:2] == (acceleration, source)]
        runs = [label for label in group if parts.load(label.name) is None]
        for _ in range(len(group) - len(runs)):
            step()
        for chunk in (runs[at : at + size] for at in range(0, len(runs), size)):
            padded = [*chunk, *[chunk[-1]] * (size - len(chunk))]
            began = time.monotonic()
            noise, seeds = np.array([x.noise for x in padded], float), np.array([x.seed for x in padded], np.uint32)
            found = wait(run(noise, seeds))
            for k, label in enumerate(chunk):
                arrays = {name: np.asarray(value[k]) for name, value in found._asdict().items()}
                parts.save(label.name, arrays | {"seconds": np.array((time.monotonic() - began) / len(chunk))})
                step()


def assemble(study: ArmStudy, grid: ArmGrid, parts: Parts) -> xr.Dataset:
    """Labelled results of all runs: dims (acceleration, source, noise, seed, iteration), traces of the first seed only."""
    dims = ("acceleration", "source", "noise", "seed")
    shape = len(grid.accelerations), len(grid.sources), len(grid.noise), len(grid.seeds)
    runs = [_needed(parts, label) for label in grid.labels()]
    over = {"feedback_mse": "iteration", "path_error": "iteration", "feedforward_peak": "iteration"}
    over |= {"finite": "iteration", "feedback_mse_joint": "iteration joint"}
    over |= {"model_error_rms": "iteration joint", "unpredicted_rms": "iteration joint"}
    variables = {}
    for name, inner in over.items():
        values = np.stack([run[name] for run in runs])
        variables[name] = ((*dims, *inner.split()), values.reshape(*shape, *values.shape[1:]), META[name])
    traces = {"feedback_trace": "execution time joint", "model_error_trace": "time joint", "feedforward_trace": "time joint"}
    for name, inner in traces.items():
        values = np.stack([run[name] for run in runs]).astype(np.float32)
        values = values.reshape(*shape, *values.shape[1:])[:, :, :, 0]
        variables[name] = ((*dims[:3], *inner.split()), values, META[name])
    coords = {"acceleration": list(grid.accelerations), "source": list(grid.sources), "noise": list(grid.noise)}
    coords |= {"seed": list(grid.seeds), "iteration": np.arange(grid.iterations), "joint": np.arange(JOINTS) + 1}
    coords |= {"execution": [0, grid.iterations - 1], "time": np.arange(0, study.steps, EVERY) * study.dt}
    data = xr.Dataset(variables, coords)
    data["noise"].attrs["units"] = "rad"
    data["time"].attrs["units"] = "s"
    seconds = {label.name: float(run["seconds"]) for label, run in zip(grid.labels(), runs, strict=True)}
    data.attrs["seconds"] = sum(seconds.values())  # runs on direct data are counted once
    return data


def _needed(parts: Parts, label: Label) -> Arrays:
    found = parts.load(label.name)
    if found is None:
        raise StoreError(f"a finished run {label.name}", "none", "run it again")
    return found


def trained(study: ArmStudy, grid: ArmGrid) -> Arrays:
    """Weights after the last training of the grid's first seed and lowest noise, joint data: (7, ...) each, by name.

    Raises:
        ConfigurationError: if that run diverged.
    """

    @jax.jit
    def run(key: Any) -> Any:
        with jax.default_matmul_precision(MATMUL_PRECISION):
            found = learn_arm(study, "joint", jnp.asarray(min(grid.noise)), key, grid.iterations)
            return found.learner.params, found.finite

    params, finite = wait(run(jax.random.key(grid.seeds[0])))
    if not bool(finite.all()):
        raise ConfigurationError("a run that stays finite, to export its weights", "one that diverged", "lower rate or noise")
    leaves = jax.tree_util.tree_flatten_with_path(params)[0]
    return {jax.tree_util.keystr(path): np.asarray(leaf) for path, leaf in leaves}


def deployed(study: ArmStudy, weights: Arrays) -> bytes:
    """The feedforward with these weights as a file's content, see :mod:`jaxidl.learning.deploy`."""
    like = study.error_model.init(jax.random.key(0))
    params = jax.tree_util.tree_map_with_path(lambda path, leaf: jnp.asarray(weights[jax.tree_util.keystr(path)]), like)
    return export_feedforward(study.task(), arm().plant.body, study.error_model, params)
