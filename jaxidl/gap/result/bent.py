"""Whether an effect follows another law than its own.

Friction in proportion to the load imitates friction that grows with its square root. The residual
shows it: the effect's own torque a, bent to a·|a|, still explains a part of it.
"""

import numpy as np

from jaxidl.gap.choice.find import Found
from jaxidl.gap.fit.held_out import jackknife
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.values import Value


def other_law(value: Value) -> bool:
    """Return whether an effect may stand for one with another law.

    Common effects are taken as what they are on any robot; a shape that was fitted bends itself.
    """
    cls = value.items[0].shape.cls
    return cls.linear and not cls.common


def bend(found: Found, added: np.ndarray, joint: int) -> float:
    """Return the size of the bend of an effect, which ``added`` (N,) [N or Nm], relative to it.

    It is fitted to the residual beside all members, and less by two standard errors.
    """
    rows = found.library.rows
    use = rows.used[:, joint]
    own, block = added[use], rows.block[use]
    left = residual(rows, found.solution, joints=[joint])[use, 0]
    size = np.sqrt(np.mean(own**2)) if use.any() else 0.0
    if not size > 0.0:
        return 0.0
    beside = [
        c[use]
        for m in found.solution.members
        if joint in m.joints
        for c in m.columns[:, :, m.joints.index(joint)]
    ]
    basis = np.stack([own, *beside])
    basis = (basis / np.maximum(np.linalg.norm(basis, axis=1, keepdims=True), 1e-300)).T
    more = own * np.abs(own) / size**2
    more = more - basis @ np.linalg.lstsq(basis, more, rcond=1e-9)[0]
    width = np.sqrt(np.mean(more**2))
    if width < 1e-6:
        return 0.0
    parts = [block == b for b in np.unique(block)]
    wanted, square = (np.array([more[p] @ x[p] for p in parts]) for x in (left, more))
    without = (wanted.sum() - wanted) / np.maximum(square.sum() - square, 1e-300)
    slope = max(abs(wanted.sum() / square.sum()) - 2.0 * float(jackknife(without)), 0.0)
    return float(slope * width / size)
