"""Acceleration policies: the desired acceleration in a state, independent of any dynamics.

A policy is called as ``policy(q, qd, t)`` with positions (J,), velocities (J,) and the number of
the control step, and returns the desired acceleration (J,) [m/s^2].
"""

import jax.numpy as jnp
import numpy as np
import scipy.linalg
from flax import struct
from jaxtyping import Array, Float, Int

from jaxidl.errors import ConfigurationError
from jaxidl.types import Joints, Scalar


class PdPolicy(struct.PyTreeNode):
    """The paper's simulation policy: kp·(target − q) + kd·(0 − qd)."""

    target: Joints  # (J,) [m]
    kp: Scalar  # [1/s^2]
    kd: Scalar  # [1/s]

    def __call__(self, q: Joints, qd: Joints, t: Int[Array, ""] | int) -> Joints:
        return self.kp * (self.target - q) + self.kd * (0.0 - qd)


class LqrPolicy(struct.PyTreeNode):
    """Kinematic LQR, as on the paper's robot: −K_t·(q − target, qd).

    It is that of a double integrator on every joint. One row of gains means an infinite horizon;
    with several, step t uses row t and every step after the horizon the last row.
    """

    target: Joints  # (J,) [m]
    gains: Float[Array, "H 2"]  # (H, 2) position and velocity gain of each step [1/s^2, 1/s]

    def __call__(self, q: Joints, qd: Joints, t: Int[Array, ""] | int) -> Joints:
        kp, kd = self.gains[jnp.minimum(t, self.gains.shape[0] - 1)]
        return -(kp * (q - self.target) + kd * qd)


class Sequence(struct.PyTreeNode):
    """One goal after the other with the same gains: what a planner sends to an arm."""

    targets: Float[Array, "G J"]  # (G, J) goals [m or rad]
    begins: Int[Array, " G"]  # step from which each goal applies; the first is 0
    gains: Float[Array, "H 2"]  # see :class:`LqrPolicy`

    def __call__(self, q: Joints, qd: Joints, t: Int[Array, ""] | int) -> Joints:
        now = jnp.sum(t >= self.begins) - 1
        return LqrPolicy(self.targets[now], self.gains)(q, qd, t - self.begins[now])


def double_integrator(dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return A (2, 2) and B (2, 1) of one joint under the package's integrator.

    ``dt`` [s] is the time step.
    """
    return np.array([[1.0, dt], [0.0, 1.0]]), np.array([[0.5 * dt**2], [dt]])


def lqr(
    target: Joints,
    dt: float,
    *,
    position: float = 1.0,
    velocity: float = 0.0,
    effort: float = 1e-4,
    horizon: int | None = None,
) -> LqrPolicy:
    """Return an LQR policy towards ``target`` (J,) [m] at rest.

    It minimises Σ position·e² + velocity·qd² + effort·qdd². The infinite horizon is solved by SciPy
    (``solve_discrete_are``); a finite ``horizon`` [steps] runs the Riccati recursion backwards from
    it, with the stage cost at the end.

    Raises:
        ConfigurationError: for a cost that is negative, or zero where it must not be, or an empty
            horizon.
    """
    if not (position > 0 and velocity >= 0 and effort > 0 and dt > 0):
        got = f"position={position}, velocity={velocity}, effort={effort}, dt={dt}"
        raise ConfigurationError(
            "position > 0, velocity >= 0, effort > 0, dt > 0", got, "correct the costs"
        )
    if horizon is not None and horizon < 1:
        raise ConfigurationError(
            "a horizon of at least one step", str(horizon), "lengthen it or leave it out"
        )
    a, b = double_integrator(dt)
    cost, weight = np.diag([position, velocity]), np.array([[effort]])
    if horizon is None:
        value = scipy.linalg.solve_discrete_are(a, b, cost, weight)
        return LqrPolicy(target, jnp.asarray(_gain(value, a, b, weight)))

    gains, value = [], cost
    # on the host, in float64: the recursion loses too much in single precision
    for _ in range(horizon):
        gains.append(_gain(value, a, b, weight)[0])
        value = cost + a.T @ value @ (a - b @ gains[-1:])
    return LqrPolicy(target, jnp.asarray(np.stack(gains[::-1])))


def _gain(value: np.ndarray, a: np.ndarray, b: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return K (1, 2) = (R + BᵀPB)⁻¹ BᵀPA for the value matrix P (2, 2)."""
    return (b.T @ value @ a) / (weight + b.T @ value @ b)
