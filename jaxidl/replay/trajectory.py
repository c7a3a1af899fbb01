"""Simulated against measured positions over windows of a log, with derivatives.

They are functions of the plant's parameters. The derivative is that of the simulation as it ran.
Where an effect is discontinuous it is that of the branch taken: a sliding joint feels the level of
its dry friction, a stuck one does not, and the derivative does not show that slightly less friction
would have released it; a border that is crossed (the position below which a joint sticks) has
derivative zero. Effects on the encoders are not part of a rollout; a reading in whole counts would
have derivative zero as well.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.optimize import least_squares

from jaxidl.logs.signals import Signals
from jaxidl.replay.rollout import SETTLE, Windows, replay, windows_at
from jaxidl.systems.free import Free, Names

MOMENTS = 10  # moments at which positions are compared, evenly over a window
EVALUATIONS = 40  # most evaluations of the simulation and its derivative


@partial(jax.jit, static_argnames=("names", "lead", "every", "dt"))
def window_errors(
    theta: Any,
    plant: Any,
    windows: Windows,
    span: Any,
    names: Names,
    lead: int,
    every: int,
    dt: float,
) -> tuple[Float[Array, "W K J"], Bool[Array, " W"]]:
    """Return simulated minus measured positions, and which windows were lost.

    The positions are (W, K, J) [m or rad] at K moments, the lost windows (W,).

    Args:
        theta: (P,) parameters in the order of ``names``.
        plant: the plant whose parameters they are.
        windows: (W, L, J), see :class:`jaxidl.replay.rollout.Windows`.
        span: (J,) [m or rad]; a window whose error is larger or not finite is lost: its error is
            the span throughout, its derivative zero.
        names: the free parameters of each effect.
        lead: instants before a window begins.
        every: steps from one moment to the next.
        dt: sampling interval [s].
    """
    now = Free(plant, names).set(theta)
    positions = jax.vmap(lambda window: replay(now, window, lead, dt))(windows)[
        :, every - 1 :: every
    ]
    error = positions - jnp.asarray(windows.q)[:, lead + every :: every]
    far = jnp.broadcast_to(span, error.shape)
    lost = ~jnp.all(jnp.abs(error) <= far, axis=(1, 2))  # NaN counts as lost
    return jnp.where(lost[:, None, None], far, error), lost


@partial(jax.jit, static_argnames=("names", "lead", "every", "dt"))
def window_slopes(
    theta: Any,
    plant: Any,
    windows: Windows,
    span: Any,
    names: Names,
    lead: int,
    every: int,
    dt: float,
) -> Float[Array, "W K J P"]:
    """Return derivatives of :func:`window_errors` by the parameters, in forward mode.

    All are computed side by side in one simulation. A window that was lost, or whose derivatives
    are not finite, has derivative zero.
    """

    def of(values: Any) -> Any:
        return window_errors(values, plant, windows, span, names, lead, every, dt)

    slopes, lost = jax.jacfwd(of, has_aux=True)(theta)
    known = jnp.all(jnp.isfinite(slopes), axis=(1, 2, 3)) & ~lost
    return jnp.where(known[:, None, None, None], slopes, 0.0)


class WindowFit:
    """Least squares over the windows (W,) that begin at ``starts``.

    Each joint is weighted relative to its initial error or its noise.

    Args:
        free: the plant's free parameters, with their initial values.
        signals: the log.
        starts: (W,) first instants.
        length: steps of a window.
        tied: (R, P) directions along which the parameters do not move: other parameters cover these
            directions, and no motion distinguishes them.
    """

    def __init__(
        self,
        free: Free,
        signals: Signals,
        starts: np.ndarray,
        length: int,
        tied: Sequence[np.ndarray] = (),
    ):
        self.plant, self.signals, self.starts = free.plant, signals, starts
        self.lead, self.length = round(SETTLE / signals.dt), length
        self.span = jnp.asarray(np.ptp(signals.q, axis=0))
        self.options: dict[str, Any] = {
            "names": free.labels,
            "lead": self.lead,
            "every": length // MOMENTS,
            "dt": signals.dt,
        }
        self.windows = windows_at(signals, starts, self.lead, length)
        self.start = np.asarray(free.vector)
        error, lost = self.errors(self.start)
        self.hopeless = bool(lost.all())
        rms = np.sqrt(np.mean(error[~lost | self.hopeless] ** 2, axis=(0, 1)))
        self.ties = np.array(tied, float).reshape(len(tied), len(self.start))
        self.weight = 1.0 / np.maximum(np.maximum(rms, signals.sigma), 1e-12)  # (J,) [1/m or 1/rad]
        self.ties = self.ties * np.linalg.norm(self.slopes(self.start), axis=0).max(
            initial=0.0, where=self.ties.any(0)
        )

    def errors(
        self, theta: np.ndarray, windows: Windows | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return :func:`window_errors` of the windows, or of as many others."""
        error, lost = window_errors(
            theta, self.plant, windows or self.windows, self.span, **self.options
        )
        return np.asarray(error), np.asarray(lost)

    def residual(self, theta: np.ndarray) -> np.ndarray:
        """Return weighted errors (W K J,) [1], followed by a penalty on the tied directions."""
        return np.concatenate(
            [(self.errors(theta)[0] * self.weight).ravel(), self.ties @ (theta - self.start)]
        )

    def slopes(self, theta: np.ndarray) -> np.ndarray:
        """Return derivatives (W K J + ties, P) of :meth:`residual`."""
        found = np.asarray(
            window_slopes(theta, self.plant, self.windows, self.span, **self.options)
        )
        return np.concatenate([(found * self.weight[:, None]).reshape(-1, len(theta)), self.ties])

    def solve(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Return the best parameters (P,) within the bounds (P,).

        They are found by a trust-region least-squares method. Each parameter is scaled by its
        effect on the positions (``x_scale="jac"``).
        """
        limits: Any = {"max_nfev": EVALUATIONS, "ftol": 1e-7, "xtol": 1e-12, "gtol": 1e-12}
        slopes: Any = self.slopes  # SciPy accepts a function, its stubs do not
        found = least_squares(
            self.residual, self.start, slopes, (lower, upper), x_scale="jac", **limits
        )
        return np.clip(found.x, lower, upper)

    def score(self, theta: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the root mean square weighted error (V,) of V other windows, and which were lost.

        The same compiled program is used, with windows repeated to fill it.
        """
        errors, losts = [], []
        for first in range(0, len(starts), len(self.starts)):
            part = starts[first : first + len(self.starts)]
            others = windows_at(
                self.signals, np.resize(part, len(self.starts)), self.lead, self.length
            )
            error, lost = self.errors(theta, others)
            errors.append(np.sqrt(np.mean((error * self.weight)[: len(part)] ** 2, axis=(1, 2))))
            losts.append(lost[: len(part)])
        return np.concatenate(errors), np.concatenate(losts)

    def stderr(self, theta: np.ndarray) -> np.ndarray:
        """Return standard errors (P,).

        Windows count as independent, the moments of one window do not (Liang and Zeger, Biometrika
        1986). The value is zero for a parameter without influence.
        """
        count = len(self.starts)
        slopes = self.slopes(theta)
        size = np.linalg.norm(slopes, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        slopes = slopes / size
        inverse = np.linalg.pinv(slopes.T @ slopes, rcond=1e-10, hermitian=True)
        data = len(slopes) - len(self.ties)
        each = (slopes[:data] * self.residual(theta)[:data, None]).reshape(count, -1, len(theta))
        push = each.sum(1)
        return (
            np.sqrt(np.sum((push @ inverse) ** 2, axis=0) * count / max(count - len(theta), 1))
            / size
        )
