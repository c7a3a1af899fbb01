"""Feedback laws by their gains in a YAML or JSON file, for logs without the feedback itself.

``law: pid`` has ``kp``, ``kd``, ``ki``, the learner's ``learner: {kp, kd, ki}`` and ``smoothing``;
``law: doomed`` has ``rate``, ``learner_gain``, ``smoothing`` and optionally ``gradient_smoothing``
and ``limit``. Numbers are one for all joints or a list of one for each.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

from jaxidl.control import Doomed, Feedback, FeedbackLaw, Pid, PidGains
from jaxidl.errors import ConfigurationError
from jaxidl.files import LARGEST_BY_HAND
from jaxidl.types import History, Joints, State

EXAMPLE = "write law: pid, kp, kd, ki, learner: {kp, kd, ki} and smoothing"
OPTIONAL = {"gradient_smoothing": 0.9, "limit": jnp.inf}
NEEDED = {
    "pid": ("kp", "kd", "ki", "learner", "smoothing"),
    "doomed": ("rate", "learner_gain", "smoothing"),
}


def read_gains(path: Path, joints: int) -> FeedbackLaw:
    """Return the feedback law of a file with gains for ``joints`` joints.

    Raises:
        ConfigurationError: if the file cannot be read, or its numbers do not fit.
    """
    import yaml  # needed only if there is such a file

    try:
        if path.stat().st_size > LARGEST_BY_HAND:
            raise ConfigurationError(f"gains in {path}", "more than 1 MiB", "name the YAML file")
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeError, yaml.YAMLError, ValueError, RecursionError) as error:
        got = " ".join(str(getattr(error, "strerror", None) or error).split())[:150]
        raise ConfigurationError(f"gains as YAML in {path}", got.lower(), EXAMPLE) from None
    law = said.get("law") if isinstance(said, dict) else None
    if law not in NEEDED:
        got = f"law {law!r}" if isinstance(said, dict) else f"a {type(said).__name__}"
        raise ConfigurationError(f"law: pid or law: doomed in {path}", got[:60], EXAMPLE)
    _keys(said, ("law", *NEEDED[law]), OPTIONAL if law == "doomed" else {}, path)
    number = lambda part, key: _numbers(part, key, joints, path)
    if law == "doomed":
        found = {key: number(OPTIONAL | said, key) for key in (*NEEDED[law][:2], "limit")}
        weights = {
            key: _weight(OPTIONAL | said, key, path) for key in ("smoothing", "gradient_smoothing")
        }
        return Doomed(**found, **weights)
    learner = said["learner"]
    if not isinstance(learner, dict):
        raise ConfigurationError(f"learner: {{kp, kd, ki}} in {path}", repr(learner)[:60], EXAMPLE)
    _keys(learner, ("kp", "kd", "ki"), {}, path)
    applied, learning = (
        PidGains(*(number(part, key) for key in ("kp", "kd", "ki"))) for part in (said, learner)
    )
    return Pid(applied, learning, _weight(said, "smoothing", path))


def feedback_of(
    law: FeedbackLaw,
    desired: State,
    sensed: State,
    qdd_desired: History,
    qdd_actual: History,
) -> Feedback:
    """Return the feedback (T, J) that a law gives along an execution, both kinds.

    Args:
        law: the feedback law, at rest before the first step.
        desired: (T, J) desired states; so are the sensed ones.
        qdd_desired: (T, J) the accelerations that the law compares; so is ``qdd_actual``.
    """

    def instant(memory: Any, row: Any) -> tuple[Any, Feedback]:
        *states, wanted, actual = row
        feedback, memory = law.act(memory, *states)
        return law.observe(memory, wanted, actual), feedback

    rows = desired, sensed, qdd_desired, qdd_actual
    return jax.lax.scan(instant, law.init(sensed.q[0]), rows)[1]


def _keys(
    said: Mapping[str, Any], needed: tuple[str, ...], more: Mapping[str, Any], path: Path
) -> None:
    for key in (*needed, *said):
        if key not in said or key not in (*needed, *more):
            got = f"no {key}" if key not in said else f"{key!r}"[:60]
            raise ConfigurationError(f"{', '.join(needed)} in {path}", got, "correct the file")


def _numbers(said: Mapping[str, Any], key: str, joints: int, path: Path) -> Joints:
    value = said[key]
    entries = value if isinstance(value, list) else [value] * joints
    if len(entries) != joints or not all(
        isinstance(entry, int | float) and not isinstance(entry, bool) and entry >= 0
        for entry in entries
    ):
        raise ConfigurationError(
            f"one {key} >= 0, or {joints}, in {path}", repr(value)[:60], "correct the file"
        )
    return jnp.asarray(entries, float)


def _weight(said: Mapping[str, Any], key: str, path: Path) -> float:
    value = said[key]
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value <= 1:
        raise ConfigurationError(f"0 < {key} <= 1 in {path}", repr(value)[:60], "correct the file")
    return float(value)
