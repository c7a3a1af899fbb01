"""Learning from recorded executions: the same training as :func:`jaxidl.learning.iterate.learn`.

One call is one iteration: it takes the last iteration's feedforward and the logs that were recorded
since, and gives the next one. On logs of simulated executions it gives the weights of ``learn`` to
rounding.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.backend import MATMUL_PRECISION
from jaxidl.errors import ConfigurationError
from jaxidl.learning.deploy import export_feedforward
from jaxidl.learning.execute import Task
from jaxidl.learning.guard import Guard, Strayed, distance
from jaxidl.learning.iterate import recall
from jaxidl.learning.sources import UNWEIGHTED, weighted
from jaxidl.models import ErrorModel, Learner, Training, draw_batches, fit, start
from jaxidl.robot.execution import Execution
from jaxidl.robot.held_out import held_out_rows, left_by, rms
from jaxidl.robot.learned import Learned
from jaxidl.robot.settings import Wish, check_fitting, settled
from jaxidl.systems.mjcf import Model
from jaxidl.types import Dataset, Key, State

DEFAULTS = Wish()
LAYERS = (200, 100, 50, 1)
BATCH, PASSES = 256, 8  # largest batch; a smaller one if an epoch had fewer steps than this
QUANTILE = 0.995  # of a signal's size is its scale: a few outliers do not count


def learn_from(
    executions: Sequence[Execution],
    model: Model,
    wish: Wish = DEFAULTS,
    previous: Learned | None = None,
    *,
    error_model: ErrorModel | None = None,
    training: Training | None = None,
    watch: Callable[[str], None] = lambda what: None,
) -> Learned:
    """Learn from the last of some executions, as one iteration, and judge the result.

    Args:
        executions: in the order of their recording; the last one and ``kept`` before it are learned
            from, all count for the guard.
        model: of the robot.
        wish: what is not to be the default.
        previous: the last iteration, from which weights and optimiser continue.
        error_model: networks of a new learner. Default: scales from the data.
        training: of all iterations. Default: 30 epochs.
        watch: called with what is being done.

    Raises:
        ConfigurationError: if executions, model and wish do not fit each other or the last
            iteration, or training does not stay finite.
    """
    settings = settled(wish, previous, len(model.names))
    check_fitting(executions, model, previous)
    iteration = 1 if previous is None else previous.iteration + 1
    last, guard = executions[-1], settings.guard
    strayed = _strayed(executions, previous, guard)
    sets = [data_of(e, settings.source, settings.smoothing) for e in executions]
    known, slots = _known(sets, settings.kept, iteration)
    if previous is not None:
        error_model, training = previous.error_model, previous.training
    error_model = error_model or scaled(known, wish.layers or LAYERS)
    training = training or sensible(len(known.x))
    if wish.epochs is not None:
        training = replace(training, epochs=wish.epochs)
    key = jax.random.key(settings.seed)
    new = start(training, error_model.init(jax.random.fold_in(key, 0)))
    train = partial(_trained, error_model, training, jax.random.fold_in(key, iteration))
    watch("training")
    learner = train(new if previous is None else previous.learner, known, slots)
    watch("judging on data kept aside")
    seen, held = held_out_rows(sets[-1], len(last.run.tau))
    apart = train(new, seen, 1)
    left = lambda by, data: rms(left_by(error_model, by.params, data))
    judged = {
        "iteration": iteration,
        "log": Path(last.name).name,
        "rows": len(known.x),
        "lacking": rms(sets[-1].y),
        "left": left(learner, sets[-1]),
        "left_by_previous": previous and left(previous.learner, sets[-1]),
        "held_out_lacking": rms(held.y),
        "held_out_left": left(apart, held),
        "feedback": rms(last.run.tau_feedback_applied),
        "strayed": None if last.desired is None else rms(last.run.q_sensing - last.desired),
    }
    logs, history = (previous.logs, previous.history) if previous else ((), ())
    return Learned(
        model,
        error_model,
        learner,
        training,
        iteration=iteration,
        dt=last.dt,
        logs=(*logs, *(e.sha for e in executions if e.sha not in logs)),
        history=(*history, judged),
        strayed=strayed,
        region=None if guard is None or strayed is None else guard.region(known, strayed),
        **settings._asdict(),
    )


def data_of(execution: Execution, source: str, smoothing: float | None) -> Dataset:
    """Return the training data that ``source`` takes from an execution.

    Args:
        execution: T control steps.
        source: one of :data:`jaxidl.learning.sources.SOURCES`.
        smoothing: weight of a new sample in the learning feedback, for weighted data [-].
    """
    if source == "weighted" and smoothing is not None:
        return weighted(execution.run, smoothing)
    return UNWEIGHTED[source](execution.run, "sensed_state")


def program(learned: Learned) -> bytes:
    """Return the feedforward as a file's content for the robot's control computer.

    See :mod:`jaxidl.learning.deploy`: position, velocity, desired acceleration and, with a guard,
    desired position (J,) each give (2, J), torque of the model and learned torque.
    """
    none = jnp.zeros(len(learned.model.names))
    task = Task(
        State(none, none),
        lambda q, qd, t: qd,
        jnp.asarray(learned.torque_limit),
        jnp.asarray(learned.feedforward_limit),
    )
    plant, networks, params = learned.model.plant, learned.error_model, learned.learner.params
    return export_feedforward(task, plant, networks, params, region=learned.region, parts=True)


def scaled(data: Dataset, layers: tuple[int, ...] = LAYERS) -> ErrorModel:
    """Return networks whose scales are the sizes of positions, ..., torques in ``data`` (N rows).

    Each is the largest over joints of the 99.5 % quantile, rounded to two digits.
    """
    joints = data.y.shape[1]
    parts = np.split(np.asarray(data.x), [joints, 2 * joints, 3 * joints], axis=1)[:3]
    sizes = [
        float(np.quantile(np.abs(part), QUANTILE, axis=0).max())
        for part in (*parts, np.asarray(data.y))
    ]
    q, qd, qdd, tau = (float(f"{size:.2g}") or 1.0 for size in sizes)
    return ErrorModel(joints, layers, q, qd, qdd, tau)


def sensible(rows: int) -> Training:
    """Return the training for so many rows: 30 epochs, batches of 256 or less."""
    batch = 2 ** int(np.log2(max(1, 0.8 * rows / PASSES)))
    return Training(epochs=30, batch=min(BATCH, batch))


def _trained(
    error_model: ErrorModel,
    training: Training,
    key: Key,
    learner: Learner,
    data: Dataset,
    executions: int,
) -> Learner:
    rows = int(training.mask_of(len(data.x), executions).sum())
    if training.epochs < 1 or rows < training.batch:
        raise ConfigurationError(
            f"at least one epoch of batches of {training.batch} rows",
            f"{training.epochs} epochs of {rows} rows",
            "record a longer execution, or give more --epochs",
        )
    with jax.default_matmul_precision(MATMUL_PRECISION):
        batches = draw_batches(key, rows, training)
        learner, progress = fit(
            error_model, training, learner, data, batches, executions=executions
        )
    if not np.isfinite(progress.validation):
        raise ConfigurationError(
            "a training that stays finite", "NaN or infinity", "start again, without --continue"
        )
    return learner


def _known(sets: list[Dataset], kept: int, iteration: int) -> tuple[Dataset, int]:
    """Return the rows of the last executions, and how many executions that is.

    While there are fewer than are kept, each is used several times, as in ``learn``.
    """
    slots = 1 + kept
    newest = sets[::-1][:slots]
    if len(newest) < min(iteration, slots):
        raise ConfigurationError(
            f"{min(iteration, slots)} logs for --kept {kept} in iteration {iteration}",
            f"{len(newest)}",
            "name the earlier ones, too, the oldest first",
        )
    if len({len(data.x) for data in newest}) > 1:
        got = ", ".join(str(len(data.x)) for data in newest)
        raise ConfigurationError(
            "executions of equal length with --kept", f"{got} rows", "leave out --kept"
        )
    filled = newest + [newest[0]] * (slots - len(newest))
    memory = jax.tree.map(lambda *parts: jnp.stack(parts), *filled)
    return recall(memory, jnp.asarray(len(newest))), slots


def _strayed(
    executions: Sequence[Execution], previous: Learned | None, guard: Guard | None
) -> Strayed | None:
    """Return how far all executions so far have strayed; None if that is not known."""
    past = None if previous is None else previous.strayed
    fresh = [e for e in executions if previous is None or e.sha not in previous.logs]
    lacking = [e.name for e in fresh if e.desired is None]
    if previous is not None and past is None:
        lacking = ["the logs before"]
    if lacking:
        if guard is None:
            return None
        raise ConfigurationError(
            "desired positions (q_desired0, ...) in all logs for --guard",
            f"none in {lacking[0]}",
            "log them, or leave out --guard",
        )
    for e in fresh:
        away = distance(e.run.q_sensing, jnp.asarray(e.desired))
        past = Strayed.of(away) if past is None else past.after(away)
    return past
