"""Task-specific learning: execute, train on what happened, execute again, as one scan over
iterations.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Bool, Float, Int

from jaxidl.control import FeedbackLaw
from jaxidl.learning.execute import Task, execute
from jaxidl.learning.sources import SOURCES
from jaxidl.models import ErrorModel, Learner, Training, draw_batches, fit, start
from jaxidl.systems import Plant, RigidBody
from jaxidl.types import Dataset, History, Key, Trajectory


class Setting(struct.PyTreeNode):
    """One configuration: everything an execution and a training need, traced; the rest is
    static.
    """

    plant: Plant  # the true system
    model: RigidBody  # the believed one
    law: FeedbackLaw
    task: Task
    reference: History  # (T, J) positions that q_error is measured against [m]


class Metrics(NamedTuple):
    """What the study records of each execution: means over steps and joints."""

    q_error: Float[Array, "..."]  # |q − frictionless reference| [m]
    feedback_applied: Float[Array, "..."]  # |applied feedback| [N]
    qdd_error: Float[Array, "..."]  # |desired − actual acceleration| [m/s^2]
    torque: Float[Array, "..."]  # |commanded torque| [N]
    finite: Bool[Array, "..."]  # did everything in the execution stay finite?


def measure(run: Trajectory, reference: History) -> Metrics:
    """The metrics of one execution against the ``reference`` (T, J) positions."""
    q_error = jnp.abs(run.q - reference).mean()
    feedback = jnp.abs(run.tau_feedback_applied).mean()
    qdd_error = jnp.abs(run.qdd_desired - run.qdd_actual).mean()
    torque = jnp.abs(run.tau).mean()
    finite = jnp.isfinite(jnp.stack([q_error, feedback, qdd_error, torque])).all()
    return Metrics(q_error, feedback, qdd_error, torque, finite)


def learn(
    setting: Setting,
    noise: Float[Array, "K T J"],
    key: Key,
    *,
    source: str,
    error_model: ErrorModel,
    training: Training,
    train_on: str = "true_state",
    keep: bool = False,
    starts: Float[Array, "K J"] | None = None,
    kept: int = 0,
    refine: Callable[[Trajectory], Trajectory] = lambda run: run,
    learner: Learner | None = None,
    derivative: str | None = None,
) -> tuple[Metrics, Learner, Trajectory | None]:
    """K executions with K − 1 trainings between them.

    Args:
        setting: the configuration.
        noise: (K, T, J) standard-normal draws, one slice per execution.
        key: root of the initial weights and of every iteration's batches; iteration k uses
            ``fold_in(key, k)``.
        source: "indirect", "direct" or "joint".
        keep: also return every execution.
        starts: (K, J) where the mechanism truly is at the start of each execution, if not just
            where the task says.
        kept: of how many earlier executions the data are learned from, too, beside the last one's.
            An epoch goes over all of it, so that a training takes 1 + kept times the steps.
        refine: what is made of an execution before it is learned from: estimates that need its
            future, for one.
        learner: what to begin with: weights of one's own, or of an earlier call; fresh ones unless
            given.
        derivative: "forward" or "reverse" where the result is to be differentiated in that mode, by
            anything continuous in ``setting``, ``training.learning_rate``, ``learner``, ``noise``
            or ``starts``: through all executions and all training steps. The values are the same
            but for rounding. Which snapshots were best and which rules the effects followed count
            as given.

    Returns:
        Metrics with leaves (K,), the learner used in the last execution, and the trajectories (K,
        T, J) or None.
    """
    if learner is None:
        learner = start(training, error_model.init(jax.random.fold_in(key, 0)))
    checkpoint = derivative == "reverse"

    def run_once(inputs, feedforward=None):
        draws, begin = inputs
        run = execute(
            setting.plant,
            setting.model,
            setting.law,
            setting.task,
            draws,
            feedforward,
            begin,
            checkpoint=checkpoint,
        )
        data = SOURCES[source](refine(run), train_on)
        return data, (measure(run, setting.reference), run if keep else None)

    def iteration(carry, inputs):
        learner, memory = carry
        k, *now = inputs
        known = recall(memory, k)
        rows = int(training.mask_of(known.x.shape[0], 1 + kept).sum())
        batches = draw_batches(jax.random.fold_in(key, k), rows, training)
        learner, progress = fit(
            error_model,
            training,
            learner,
            known,
            batches,
            executions=1 + kept,
            derivative=derivative,
        )
        data, (metrics, run) = run_once(now, partial(error_model.torque, learner.params))
        # a training that failed is a failed iteration
        finite = metrics.finite & jnp.isfinite(progress.validation)
        memory = jax.tree.map(lambda new, old: jnp.concatenate([new[None], old[:-1]]), data, memory)
        return (learner, memory), (metrics._replace(finite=finite), run)

    everything = noise, starts
    data, first = run_once(jax.tree.map(lambda x: x[0], everything))
    rest = jax.tree.map(lambda x: x[1:], everything)
    memory = jax.tree.map(lambda x: jnp.stack([x] * (1 + kept)), data)
    (learner, _), later = jax.lax.scan(
        iteration, (learner, memory), (jnp.arange(1, noise.shape[0]), *rest)
    )
    metrics, runs = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, later)
    return metrics, learner, runs


def recall(memory: Dataset, k: Int[Array, ""]) -> Dataset:
    """The rows of the last executions, (kept + 1, N) each, as one data set; before iteration ``k``
    there have been k of them.

    As long as there are fewer than are kept, each is taken several times, as evenly as can be.
    """
    slots = memory.x.shape[0]
    if slots > 1:
        memory = jax.tree.map(lambda x: x[jnp.arange(slots) % jnp.minimum(k, slots)], memory)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), memory)
