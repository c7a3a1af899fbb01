"""The data sources: training data from one execution for the error of the modelled body.

Three are the paper's; ``weighted`` is ours.
"""

from collections.abc import Callable
from functools import partial

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxidl.control import FeedbackLaw
from jaxidl.control.filters import average_along, average_around
from jaxidl.errors import one_of
from jaxidl.types import Dataset, History, Scalar, Trajectory

TRAIN_ON = ("true_state", "sensed_state")


def _inputs(run: Trajectory, qdd: History, train_on: str) -> Float[Array, "T F"]:
    """Return network inputs (T, 3J + C).

    The reference program trains on the true state; a robot has only the sensed one.
    """
    if train_on not in TRAIN_ON:
        raise one_of("train_on", train_on, TRAIN_ON)
    state = (run.q, run.qd) if train_on == "true_state" else (run.q_sensing, run.qd_sensing)
    told = () if run.circumstances is None else (run.circumstances,)
    return jnp.concatenate([*state, qdd, *told], axis=1)


def indirect(run: Trajectory, train_on: str = "true_state") -> Dataset:
    """Return T rows at the *actual* acceleration (eq. data_indirect).

    The target is tau − modelled rigid body there.
    """
    return Dataset(_inputs(run, run.qdd_actual, train_on), run.tau - run.tau_inverse_actual)


def direct(run: Trajectory, train_on: str = "true_state") -> Dataset:
    """Return T − 1 rows at the *desired* acceleration (eq. data_direct).

    The target is learning feedback one step later + feedforward.
    """
    x = _inputs(run, run.qdd_desired, train_on)[:-1]
    return Dataset(x, run.tau_feedback[1:] + run.tau_feedforward[:-1])


def joint(run: Trajectory, train_on: str = "true_state") -> Dataset:
    """Return 2T − 1 rows: the indirect ones, then the direct ones (eq. data_joint)."""
    pair = zip(indirect(run, train_on), direct(run, train_on), strict=True)
    return Dataset(*(jnp.concatenate(parts) for parts in pair))


def weighted(run: Trajectory, smoothing: Scalar) -> Dataset:
    """Return 2T − 1 rows of what the last model said, corrected by both sources without delay.

    The last feedforward is kept as it is. Only corrections are averaged over time, by weights that
    look as far ahead as back::

        Δ = G(qdd_desired − qdd_actual)
        indirect rows: (q, qd, qdd_desired − Δ) → feedforward + G(tau − feedforward − tau_inverse)
        direct rows:   (q, qd, qdd_desired)     → feedforward + B(learning feedback one step later)

    B is the filter of the learning feedback run backwards: it takes out the delay that the filter
    made running forwards, (1 − smoothing) / smoothing steps. G runs it forwards and backwards, so
    that both sources see the same average, with weights (1 − smoothing)^|k| at k steps.

    States are the sensed ones: it uses only what a robot has. Why this and not weights of rows:
    :doc:`/explanation/trust`.

    Args:
        run: the execution.
        smoothing: weight of a new sample in the learning feedback [-].
    """
    x, feedforward = _inputs(run, run.qdd_desired, "sensed_state"), run.tau_feedforward
    around = partial(average_around, alpha=smoothing)
    short = around(run.qdd_desired - run.qdd_actual)
    joints = short.shape[1]
    missed = jnp.zeros_like(x).at[:, 2 * joints : 3 * joints].set(short)
    happened = feedforward + around(run.tau - feedforward - run.tau_inverse_actual)
    wanted = average_along(run.tau_feedback, smoothing, reverse=True)[1:] + feedforward[:-1]
    return Dataset(jnp.concatenate([x - missed, x[:-1]]), jnp.concatenate([happened, wanted]))


UNWEIGHTED: dict[str, Callable[..., Dataset]] = {
    "indirect": indirect,
    "direct": direct,
    "joint": joint,
}
SOURCES = (*UNWEIGHTED, "weighted")
OwnSource = Callable[[Trajectory, FeedbackLaw], Dataset]


def rows(
    source: str | OwnSource, run: Trajectory, law: FeedbackLaw, train_on: str = "true_state"
) -> Dataset:
    """Return the training data that ``source`` takes from an execution under ``law``.

    ``source`` is one of SOURCES, or a function of your own of both.

    Raises:
        ConfigurationError: for an unknown source.
    """
    if callable(source):
        return source(run, law)
    if source == "weighted":
        return weighted(run, law.smoothing)
    if source not in UNWEIGHTED:
        raise one_of("source", source, SOURCES)
    return UNWEIGHTED[source](run, train_on)
