"""Joints that mimic another one: they move with it, and are no degrees of freedom of their own.

Inverse dynamics of all joints, at the positions that follow, are brought to the independent ones by
virtual work.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class Following:
    """A mechanism of M joints, all of which follow J of them.

    Their positions are ``ratio`` times those of the J joints, plus ``offset``.
    """

    source: mujoco.MjModel
    own: tuple[int, ...]  # numbers of the J joints among all
    ratio: Float[np.ndarray, "M J"]
    offset: Float[np.ndarray, " M"]

    def motion(self, q: Any, qd: Any, qdd: Any) -> tuple[Any, Any, Any]:
        """Return the motion (..., M) of all joints for one (..., J) of the independent ones."""
        ratio = self.ratio.T.astype(q.dtype)
        return q @ ratio + self.offset.astype(q.dtype), qd @ ratio, qdd @ ratio


def following_of(model: mujoco.MjModel) -> Following | None:
    """Return what follows what in a compiled model by its equality constraints; None if nothing.

    They are of joints, and proportional.
    """
    if not model.neq:
        return None
    others = model.eq_obj1id.tolist()
    own = tuple(j for j in range(model.njnt) if j not in others)
    ratio, offset = np.zeros((model.njnt, len(own))), np.zeros(model.njnt)
    ratio[list(own), range(len(own))] = 1.0
    for j, master, data in zip(others, model.eq_obj2id.tolist(), model.eq_data, strict=True):
        ratio[j, own.index(master)] = data[1]
        offset[j] = model.qpos0[j] + data[0] - data[1] * model.qpos0[master]
    return Following(model, own, ratio, offset)
