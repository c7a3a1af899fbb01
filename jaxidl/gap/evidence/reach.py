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
    seen = _Watch()
    effect.alter(seen)
    return seen.carried or on_encoders(effect)


class _Watch:
    """A body that records whether more than a joint's own rotor is changed."""

    carried = False

    def add_inertia(self, extra: Any) -> "_Watch":
        return self

    def __getattr__(self, name: str) -> Any:
        def change(*values: Any) -> "_Watch":
            self.carried |= any(np.any(np.asarray(v) != 0.0) for v in values)
            return self

        return change
