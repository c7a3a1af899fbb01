"""Task-specific learning as one scan over iterations.

Execute, train on the recorded execution, execute again.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Array, Bool, Float, Int

from jaxidl.control import FeedbackLaw
from jaxidl.learning.execute import Task, desired_trajectory, execute
from jaxidl.learning.guard import Guard, Strayed, distance
from jaxidl.learning.schedule import Schedule
from jaxidl.learning.sources import OwnSource, rows
from jaxidl.models import ErrorModel, Learner, Training, draw_batches, fit, start
from jaxidl.systems import Plant, RigidBody
from jaxidl.types import Dataset, History, Key, Trajectory


class Setting(struct.PyTreeNode):
    """One configuration: all that an execution and a training need.

    Its numbers are traced, except those in static fields.
    """

    plant: Plant  # the true system
    model: RigidBody  # the modelled rigid body
    law: FeedbackLaw
    task: Task
    reference: History  # (T, J) positions to which q_error is measured [m]


class Metrics(NamedTuple):
    """The study's measures of each execution: means over steps and joints."""

    q_error: Float[Array, "..."]  # |q − frictionless reference| [m]
    feedback_applied: Float[Array, "..."]  # |applied feedback| [N]
    qdd_error: Float[Array, "..."]  # |desired − actual acceleration| [m/s^2]
    torque: Float[Array, "..."]  # |commanded torque| [N]
    finite: Bool[Array, "..."]  # true if everything in the execution stayed finite


def measure(run: Trajectory, reference: History) -> Metrics:
    """Return the metrics of one execution against the ``reference`` (T, J) positions."""
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
    source: str | OwnSource,
    error_model: ErrorModel,
    training: Training,
    train_on: str = "true_state",
    record: bool = False,
    starts: Float[Array, "K J"] | None = None,
    kept: int = 0,
    refine: Callable[[Trajectory], Trajectory] = lambda run: run,
    learner: Learner | None = None,
    guard: Guard | None = None,
    schedule: Schedule | None = None,
    derivative: str | None = None,
) -> tuple[Metrics, Learner, Trajectory | None]:
    """Run K executions with K − 1 trainings between them.

    Args:
        setting: the configuration.
        noise: (K, T, J) standard-normal draws, one slice per execution.
        key: root of the initial weights and of every iteration's batches; iteration k uses
            ``fold_in(key, k)``.
        source: "indirect", "direct", "joint" or "weighted"; or a function of your own that makes
            training data of an execution and its feedback law.
        train_on: "true_state" or "sensed_state"; weighted data are always of the sensed one, and a
            source of your own decides for itself.
        record: also return every execution.
        starts: (K, J) true initial position of each execution. Default: the task's.
        kept: number of earlier executions whose data are learned from in addition to the last
            one's. An epoch covers all of it, so that a training takes 1 + kept times the steps.
        refine: applied to an execution before it is learned from, for example for estimates that
            need its future.
        learner: the initial learner, with your own weights or from an earlier call. Default: a new
            one.
        guard: limits what a new model may do; see :mod:`jaxidl.learning.guard`. Default: none, as
            in the paper.
        schedule: lets the applied gains fall as the model earns trust; see
            :mod:`jaxidl.learning.schedule`. Default: none, as in the paper.
        derivative: "forward" or "reverse" if the result is to be differentiated in that mode, by
            anything continuous in ``setting``, ``training.learning_rate``, ``learner``, ``noise``
            or ``starts``: through all executions and all training steps. The values are the same
            except for rounding. Which snapshots were best and which branches the effects followed
            are treated as fixed.

    Returns:
        Metrics with leaves (K,), the learner used in the last execution, and the trajectories (K,
            T, J) or None.
    """
    if learner is None:
        learner = start(training, error_model.init(jax.random.fold_in(key, 0)))
    checkpoint = derivative == "reverse"

    watched = guard is not None or schedule is not None
    desired = desired_trajectory(setting.task).q if watched else None

    def run_once(
        inputs: Any, feedforward: Any = None, fade: Any = None, gains: Any = None
    ) -> tuple[Any, Any, Any]:
        draws, begin = inputs
        run = execute(
            setting.plant,
            setting.model,
            setting.law,
            setting.task,
            draws,
            feedforward,
            begin,
            fade=fade,
            gains=gains,
            checkpoint=checkpoint,
        )
        data = rows(source, refine(run), setting.law, train_on)
        strayed = None if desired is None else distance(run.q_sensing, desired)
        return data, (measure(run, setting.reference), run if record else None), strayed

    def iteration(carry: Any, inputs: Any) -> tuple[Any, Any]:
        learner, memory, past, share = carry
        k, *now = inputs
        known = recall(memory, k)
        size = int(training.mask_of(known.x.shape[0], 1 + kept).sum())
        batches = draw_batches(jax.random.fold_in(key, k), size, training)
        learner, progress = fit(
            error_model,
            training,
            learner,
            known,
            batches,
            executions=1 + kept,
            derivative=derivative,
        )
        feedforward: Any = partial(error_model.torque, learner.params)
        fade = gains = None
        if guard is not None:
            region = guard.region(known, past)
            feedforward, fade = region.feedforward(error_model, learner.params), region.fade
        if schedule is not None:
            gains = schedule.gains(share, past)
        data, (metrics, run), strayed = run_once(now, feedforward, fade, gains)
        # a failed training makes a failed iteration
        finite = metrics.finite & jnp.isfinite(progress.validation)
        memory = jax.tree.map(lambda new, old: jnp.concatenate([new[None], old[:-1]]), data, memory)
        if watched:
            past = past.after(strayed)
        if schedule is not None:
            share = schedule.after(share, strayed, past)
        return (learner, memory, past, share), (metrics._replace(finite=finite), run)

    everything = noise, starts
    data, first, strayed = run_once(jax.tree.map(lambda x: x[0], everything))
    past = Strayed.of(strayed) if watched else None
    share = None if schedule is None else jnp.ones(())
    rest = jax.tree.map(lambda x: x[1:], everything)
    memory = jax.tree.map(lambda x: jnp.stack([x] * (1 + kept)), data)
    last, later = jax.lax.scan(
        iteration, (learner, memory, past, share), (jnp.arange(1, noise.shape[0]), *rest)
    )
    metrics, runs = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, later)
    return metrics, last[0], runs


def recall(memory: Dataset, k: Int[Array, ""]) -> Dataset:
    """Return the rows of the last executions, (kept + 1, N) each, as one data set.

    Before iteration ``k`` there have been k executions. While there are fewer than are kept, each
    is used several times, as evenly as possible.
    """
    slots = memory.x.shape[0]
    if slots > 1:
        memory = jax.tree.map(lambda x: x[jnp.arange(slots) % jnp.minimum(k, slots)], memory)
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), memory)
