"""Settings of an iteration: the user's choices, and those that follow from the last iteration."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jaxidl.errors import ConfigurationError, one_of
from jaxidl.learning.guard import Guard
from jaxidl.learning.sources import SOURCES
from jaxidl.robot.execution import Execution
from jaxidl.robot.learned import Learned
from jaxidl.systems.mjcf import Model

FILTER = (
    "give the weight of a new sample in the filter of the learning feedback: 1 if it has none,"
    " dt / (T + dt) with a time constant T"
)


@dataclass(frozen=True)
class Wish:
    """What a user may choose of an iteration; None: as before, or the default."""

    source: str | None = None  # default: weighted if ``smoothing`` is known, else joint
    kept: int | None = None  # default: 0
    seed: int | None = None  # default: 0
    guard: Guard | None = None  # default: none
    epochs: int | None = None  # default: 30
    layers: tuple[int, ...] | None = None  # default: LAYERS
    torque_limit: tuple[float, ...] | None = None  # one for all or (J,) [N or Nm]; default: none
    feedforward_limit: tuple[float, ...] | None = None
    motion: str | None = None  # default: offline
    smoothing: float | None = None  # weight of a new sample in the learning feedback


class Settings(NamedTuple):
    """What is decided of an iteration; see :class:`Wish`."""

    source: str
    kept: int
    seed: int
    guard: Guard | None
    torque_limit: np.ndarray  # (J,) [N or Nm]
    feedforward_limit: np.ndarray
    motion: str
    smoothing: float | None


def settled(wish: Wish, previous: Learned | None, joints: int) -> Settings:
    """Return the settings: what is wished, else as before, else the default."""
    if previous is None:
        free = np.full(joints, np.inf)
        source = "joint" if wish.smoothing is None else "weighted"
        before = Settings(source, 0, 0, None, free, free, "offline", None)
    else:
        before = Settings(*(getattr(previous, name) for name in Settings._fields))
    limits = {
        name: bounds(wished, joints, name)
        for name in ("torque_limit", "feedforward_limit")
        if (wished := getattr(wish, name)) is not None
    }
    plain = {
        name: wished
        for name in ("source", "kept", "seed", "guard", "motion", "smoothing")
        if (wished := getattr(wish, name)) is not None
    }
    settings = before._replace(**limits, **plain)
    if settings.source not in SOURCES:
        raise one_of("--source", settings.source, SOURCES)
    if not (settings.smoothing is None or 0.0 < settings.smoothing <= 1.0):
        raise ConfigurationError("0 < --smoothing <= 1", f"{settings.smoothing:g}", FILTER)
    if settings.source == "weighted" and settings.smoothing is None:
        raise ConfigurationError("--smoothing for --source weighted", "none", FILTER)
    if settings.kept < 0:
        raise ConfigurationError("--kept >= 0", str(settings.kept), "correct it")
    if wish.layers is not None and (
        previous is not None or wish.layers[-1:] != (1,) or min(wish.layers) < 1
    ):
        raise ConfigurationError(
            "--layers of a new learner that end in 1",
            f"{wish.layers}" + " with --continue" * (previous is not None),
            "leave it out, or start a new learner",
        )
    return settings


def bounds(limits: Sequence[float], joints: int, name: str) -> np.ndarray:
    """Return limits (J,) from one for all or one for each.

    Raises:
        ConfigurationError: if there are others, or one is not positive.
    """
    if len(limits) not in (1, joints) or not all(limit > 0 for limit in limits):
        raise ConfigurationError(
            f"one --{name.replace('_', '-')} > 0, or {joints}",
            " ".join(f"{limit:g}" for limit in limits),
            "correct it",
        )
    return np.broadcast_to(np.asarray(limits, float), (joints,)).copy()


def check_fitting(executions: Sequence[Execution], model: Model, previous: Learned | None) -> None:
    """Raise ConfigurationError unless executions and the last iteration belong together."""
    if not executions:
        raise ConfigurationError("at least one log of an execution", "none", "name one")
    steps = [e.dt for e in executions] + ([] if previous is None else [previous.dt])
    if max(steps) > 1.01 * min(steps):
        raise ConfigurationError(
            "executions of one control rate",
            ", ".join(f"{1 / step:.5g} Hz" for step in steps),
            "use the logs of one controller",
        )
    for i, e in enumerate(executions):
        if e.sha in [other.sha for other in executions[:i]]:
            raise ConfigurationError("each execution once", f"{e.name} twice", "leave one out")
    if previous is None:
        return
    if executions[-1].sha in previous.logs:
        raise ConfigurationError(
            "a log recorded since the last iteration",
            f"{executions[-1].name}, which was learned from before",
            "execute with the last feedforward, and give that log",
        )
    ours, theirs = (list((m.files or {}).values()) for m in (model, previous.model))
    if ours != theirs or model.names != previous.model.names:
        raise ConfigurationError(
            "the model of the last iteration",
            f"another one in {model.path}",
            "leave out --model and --joints, or start again without --continue",
        )
