"""Which joints an effect concerns: its own alone, two, or all that carry what it changes.

An effect of one joint is computed as if the mechanism had no other, so that one program serves all
joints.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxidl.effects import Effect, OnJoint
from jaxidl.logs.encoders import on_encoders

Columns = slice | list[int]  # joints


def narrowed(effects: Sequence[Effect]) -> tuple[Columns, list[Effect], list[int]]:
    """Return the joints that effects concern, the effects on those alone, and where they reach.

    The effects are as if the mechanism had no other joints, so that one program serves all joints;
    the last result is the joint of each effect that reaches other joints.
    """
    first, nowhere = effects[0], [0] * len(effects)
    if isinstance(first, OnJoint) and not any(reaches(e.effect) for e in effects):  # type: ignore[attr-defined]
        return slice(first.joint, first.joint + 1), [e.effect for e in effects], nowhere  # type: ignore[attr-defined]
    if isinstance(first, OnJoint):
        return slice(None), [e.replace(joint=0) for e in effects], [e.joint for e in effects]  # type: ignore[attr-defined]
    if hasattr(first, "other"):
        return [first.joint, first.other], [e.replace(joint=0, other=1) for e in effects], nowhere  # type: ignore[attr-defined]
    return slice(None), list(effects), nowhere


def reaches(effect: Effect) -> bool:
    """Return whether an effect of one joint changes what other joints feel.

    It does if it changes the body that the joint carries, or the joint's position.
    """
    carried = (x for name, x in alterations(effect) if name != "add_inertia")
    return any(map(np.any, carried)) or on_encoders(effect)


def alterations(effect: Effect) -> list[tuple[str, np.ndarray]]:
    """Return how an effect alters a body: names of the body's methods, and their arguments."""
    body = _Altered()
    effect.alter(body)
    return body.made


class _Altered:
    """A body that notes how it is altered."""

    def __init__(self) -> None:
        self.made: list[tuple[str, np.ndarray]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda extra: self.made.append((name, np.asarray(extra))) or self
