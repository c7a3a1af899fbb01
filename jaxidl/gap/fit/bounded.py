"""Least squares within bounds, by block principal pivoting (Judice and Pires 1994)."""

import numpy as np
from jaxtyping import Bool, Float

MOST = 200  # steps of the active-set method
PATIENCE = 3  # steps in a row without fewer violations, after which bounds change one at a time


def bounded(
    gram: Float[np.ndarray, "F P P"],
    right: Float[np.ndarray, "F P"],
    lower: Float[np.ndarray, " P"],
    upper: Float[np.ndarray, " P"],
    dead: Bool[np.ndarray, " P"],
    start: Float[np.ndarray, " P"],
) -> Float[np.ndarray, "F P"]:
    """Return solutions (F, P) of F normal equations within bounds.

    The first one decides which bounds are active, from those that hold ``start``. What is ``dead``
    stays at zero, or the nearest bound.
    """
    x, free = np.zeros(right.shape), ~dead & ~((start <= lower) | (start >= upper))
    held = np.where(dead | np.isnan(start), np.clip(x[0], lower, upper), start)
    fewest, patience = len(free) + 1, PATIENCE
    for _ in range(MOST):
        x[0] = held
        if free.all():
            x[0] = np.linalg.solve(gram[0], right[0])
        elif free.any():
            inner, side = gram[0][np.ix_(free, free)], gram[0][np.ix_(free, ~free)]
            x[0, free] = np.linalg.solve(inner, right[0, free] - side @ held[~free])
        wrong = free & ((x[0] < lower - 1e-12) | (x[0] > upper + 1e-12))
        push = right[0] - gram[0] @ x[0]
        inward = ((held <= lower) & (push > 1e-9)) | ((held >= upper) & (push < -1e-9))
        wrong |= ~free & ~dead & (lower < upper) & inward
        number = np.count_nonzero(wrong)
        if not number:
            break
        if number < fewest:
            fewest, patience = number, PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong &= np.arange(len(wrong)) == np.flatnonzero(wrong)[-1]
        held = np.where(wrong & free, np.clip(x[0], lower, upper), held)
        free ^= wrong
    x[1:] = held
    if len(x) > 1 and free.all():
        x[1:] = np.linalg.solve(gram[1:], right[1:, :, None])[..., 0]
    elif len(x) > 1 and free.any():
        rows = gram[1:, free]
        push = right[1:, free] - rows[:, :, ~free] @ held[~free]
        x[1:, free] = np.linalg.solve(rows[:, :, free], push[..., None])[..., 0]
    return np.clip(x, lower, upper)
