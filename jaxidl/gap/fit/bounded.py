"""Least squares within bounds, for several normal equations with the same active bounds."""

import numpy as np
from jaxtyping import Bool, Float

MOST = 12  # changes of the active bounds


def bounded(
    gram: Float[np.ndarray, "F P P"],
    right: Float[np.ndarray, "F P"],
    lower: Float[np.ndarray, " P"],
    upper: Float[np.ndarray, " P"],
    dead: Bool[np.ndarray, " P"],
) -> Float[np.ndarray, "F P"]:
    """Return solutions (F, P) of F normal equations within bounds.

    The first one decides which bounds are active. What is ``dead`` stays at zero, or the nearest
    bound.
    """
    x, free = np.zeros(right.shape), ~dead
    held = np.clip(x[0], lower, upper)
    for _ in range(MOST):
        x[0] = held
        if free.all():
            x[0] = np.linalg.solve(gram[0], right[0])
        elif free.any():
            inner, side = gram[0][np.ix_(free, free)], gram[0][np.ix_(free, ~free)]
            x[0, free] = np.linalg.solve(inner, right[0, free] - side @ held[~free])
        wrong = free & ((x[0] < lower - 1e-12) | (x[0] > upper + 1e-12))
        if not wrong.any():
            if free.all():
                break
            push = right[0] - gram[0] @ x[0]
            back = ~free & ~dead & (lower < upper)
            back &= ((held <= lower) & (push > 1e-9)) | ((held >= upper) & (push < -1e-9))
            if not back.any():
                break
            free |= back & (np.abs(push) == np.max(np.abs(push[back])))
            continue
        held = np.where(wrong, np.clip(x[0], lower, upper), held)
        free &= ~wrong
    if free.all():
        x[1:] = np.linalg.solve(gram[1:], right[1:, :, None])[..., 0]
    elif free.any():
        rows = gram[1:, free]
        x[1:] = held
        x[1:, free] = np.linalg.solve(
            rows[:, :, free], (right[1:, free] - rows[:, :, ~free] @ held[~free])[..., None]
        )[..., 0]
    else:
        x[1:] = held
    return np.clip(x, lower, upper)
