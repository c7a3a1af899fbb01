"""Many learning runs in one program: ``lax.map`` over runs, ``vmap`` inside it, shards over devices outside."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import Array, Float, Int

from jaxidl.backend import compiler_options
from jaxidl.learning.iterate import Metrics, learn
from jaxidl.learning.paper import GAINS, Condition, PaperStudy, draw_noise
from jaxidl.learning.vary import Value, traced, varied
from jaxidl.sweep.grid import Label
from jaxidl.types import Trajectory

MATMUL_PRECISION = "float32"  # a GPU's default rounds the inputs of every product to 10 bits (TF32); a CPU has no other


class Inputs(NamedTuple):
    """The traced half of R runs."""

    condition: Condition  # leaves (R,)
    seed: Int[Array, " R"]  # root of weights and batches
    noise: Float[Array, "R K T J"]  # standard-normal draws of every execution
    varied: dict[str, Float[Array, " R"]]  # the study's numbers that an ablation varies


class Kind(NamedTuple):
    """The static half of a run: one program is compiled per kind and chunk shape, not one per configuration."""

    controller: str
    source: str
    epochs: int
    fixed: tuple[tuple[str, Value], ...] = ()  # numbers that an ablation varies and a program cannot: sizes, whole numbers

    @classmethod
    def of(cls, label: Label, study: PaperStudy) -> "Kind":
        """The kind of a run, which may differ from ``study`` in what its label says."""
        fixed = tuple((name, value) for name, value in label.varied if not traced(study, name))
        return cls(label.controller, label.source, label.epochs, fixed)

    def study(self, study: PaperStudy) -> PaperStudy:
        """``study`` as the runs of this kind have it, but for what is traced."""
        return varied(replace(study, training=replace(study.training, epochs=self.epochs)), dict(self.fixed))


def inputs_of(labels: Sequence[Label], study: PaperStudy, iterations: int) -> Inputs:
    """The traced half of the given runs of one kind, stacked on the host."""
    steps = Kind.of(labels[0], study).study(study).steps
    levels: dict[str, Any] = {name: np.array([getattr(run, name) for run in labels], float) for name in Condition._fields[1:]}
    gains: Any = np.array([GAINS.index(run.gain) for run in labels], np.int32)
    seeds: Any = np.array([run.seed for run in labels], np.uint32)
    draws = {seed: draw_noise(seed, iterations, steps) for seed in {run.seed for run in labels}}
    noise: Any = np.stack([draws[run.seed] for run in labels])
    names = [name for name, _ in labels[0].varied if traced(study, name)]
    leaves: dict[str, Any] = {name: np.array([dict(run.varied)[name] for run in labels], float) for name in names}
    return Inputs(Condition(gains, **levels), seeds, noise, leaves)


def one_run(study: PaperStudy, kind: Kind, inputs: Inputs, keep: bool = False) -> tuple[Metrics, Trajectory | None]:
    """One learning run (leaves of ``inputs`` without the R axis): metrics (K,) and, if asked, trajectories (K, T, J).

    The key is the seed's alone: runs of one seed share initial weights and batch order whatever their condition, so
    differences between conditions and sources are paired, and a run's result does not depend on the grid around it.
    """
    study = varied(kind.study(study), inputs.varied)
    with jax.default_matmul_precision(MATMUL_PRECISION):
        metrics, _, runs = learn(
            study.setting(kind.controller, inputs.condition),
            inputs.noise,
            jax.random.key(inputs.seed),
            source=kind.source,
            error_model=study.error_model,
            training=study.training,
            train_on=study.train_on,
            keep=keep,
            kept=study.kept,
        )
    return metrics, runs


@cache
def program(study: PaperStudy, kind: Kind, devices: int = 1, width: int = 1) -> Any:
    """The compiled-on-first-use program of one kind: ``Inputs`` of R runs -> ``Metrics`` with leaves (R, K).

    R is a multiple of ``devices``. Each device maps over its share, ``width`` runs at a time side by side: 1 keeps a run's
    weights in a core's cache, a GPU wants as many as fit. With the same ``width`` results are the same bit for bit on one
    kind of device whatever the share, since the compiled loop body is the same.
    """
    mesh = Mesh(np.array(jax.devices()[:devices]), ("runs",))
    split = PartitionSpec("runs")

    def share(inputs: Inputs) -> Metrics:
        batch_size = None if width == 1 else width
        return jax.lax.map(lambda one: one_run(study, kind, one)[0], inputs, batch_size=batch_size)

    shards = jax.shard_map(share, mesh=mesh, in_specs=split, out_specs=split, check_vma=False)
    return jax.jit(shards, compiler_options=compiler_options())


def trace(study: PaperStudy, label: Label, inputs: Inputs) -> tuple[Metrics, Trajectory]:
    """One learning run with every execution kept: metrics (K,) and trajectories (K, T, J).

    Another program than a sweep's, so its rounding differs, and twenty trainings in float32 make that visible: the same run
    in kind, not digit by digit.
    """
    metrics, runs = jax.jit(one_run, static_argnums=(0, 1, 3))(study, Kind.of(label, study), inputs, True)
    assert runs is not None
    return metrics, runs
