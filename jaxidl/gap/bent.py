"""How much of an effect follows another law than its own.

What grows with the square root of the load, or with the cube of an angle, is imitated by what grows
in proportion to it. The residual shows it: there is then something left that the effect's own
torque a, bent to a·|a|, explains.
"""

import numpy as np

from jaxidl.gap.held_out import jackknife


def bent(left: np.ndarray, own: np.ndarray, others: np.ndarray, block: np.ndarray) -> float:
    """Return the size of an effect's bend relative to the effect.

    It is less by two standard errors, and at least 0.

    Args:
        left: (N,) residual [N or Nm].
        own: (N,) the effect's torque [N or Nm].
        others: (P, N) columns of all members of the set.
        block: (N,) number of the block of each row.
    """
    size = np.sqrt(np.mean(own**2))
    if not size > 0.0:
        return 0.0
    scaled = own / size
    bend = scaled * np.abs(scaled)
    basis = np.stack([scaled, *others])
    basis = basis / np.maximum(np.linalg.norm(basis, axis=1, keepdims=True), 1e-300)
    bend = bend - np.linalg.lstsq(basis.T, bend, rcond=1e-9)[0] @ basis
    width = np.sqrt(np.mean(bend**2))
    if width < 1e-6:
        return 0.0
    each = [block == b for b in np.unique(block)]
    product = np.array([bend[b] @ left[b] for b in each])
    square = np.array([bend[b] @ bend[b] for b in each])
    slope = product.sum() / square.sum()
    without = (product.sum() - product) / np.maximum(square.sum() - square, 1e-300)
    known = max(abs(float(slope)) - 2.0 * float(jackknife(without)), 0.0)
    return float(known * width / size)
