"""A controller's estimates from encoder readings: velocity and acceleration.

They come with the desired acceleration to compare them with.
"""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np
from flax import struct

from jaxidl.types import Joints, Scalar, State


class Motion(NamedTuple):
    """The estimated motion after a reading."""

    sensed: State  # position as read, estimated velocity
    qdd: Joints  # (J,) estimated acceleration [m/s^2 or rad/s^2]
    # (J,) desired acceleration to compare the estimate with, delayed as the estimate is
    qdd_desired: Joints


@runtime_checkable
class Estimator(Protocol):
    """An estimator of motion: ``start`` once, then ``update`` with every reading."""

    def start(self, sensed: State) -> Any:
        """Return the memory at rest in the ``sensed`` state."""
        ...

    def update(
        self, memory: Any, before: State, q: Joints, qdd_desired: Joints, dt: float
    ) -> tuple[Motion, Any]:
        """Return motion and new memory after the reading ``q`` (J,).

        The reading is taken ``dt`` [s] after the state ``before``, in which ``qdd_desired`` (J,)
        was the desired acceleration.
        """
        ...


class FiniteDifference(struct.PyTreeNode):
    """The paper's simulation: only finite differences of readings and of velocities."""

    def start(self, sensed: State) -> tuple[()]:
        return ()

    def update(
        self, memory: tuple[()], before: State, q: Joints, qdd_desired: Joints, dt: float
    ) -> tuple[Motion, tuple[()]]:
        qd = (q - before.q) / dt
        return Motion(State(q, qd), (qd - before.qd) / dt, qdd_desired), ()

    def lag(self, dt: float) -> float:
        """Return how late the velocity is [s]: a difference is that of the middle of its step."""
        return 0.5 * dt


class FilterMemory(NamedTuple):
    """Memory of :class:`Filtered`, (J,) each."""

    difference: Joints  # difference of the last two readings over the step [m/s or rad/s]
    qd: Joints
    qdd: Joints
    late: Joints  # desired acceleration of the step before
    qdd_desired: Joints  # filtered desired acceleration


class Filtered(struct.PyTreeNode):
    """First-order low passes of finite differences, for noisy encoders at 1 kHz.

    The desired acceleration goes through the acceleration's filter with one step of shift (a
    command needs a step to show in the differences), so that the filter's lag is not taken for an
    error.
    """

    velocity_band: Scalar = 80.0  # cut-off [Hz]
    acceleration_band: Scalar = 30.0  # cut-off [Hz]

    def start(self, sensed: State) -> FilterMemory:
        zero = jnp.zeros_like(sensed.q)
        return FilterMemory(sensed.qd, sensed.qd, zero, zero, zero)

    def update(
        self, memory: FilterMemory, before: State, q: Joints, qdd_desired: Joints, dt: float
    ) -> tuple[Motion, FilterMemory]:
        fast, slow = share(self.velocity_band, dt), share(self.acceleration_band, dt)
        difference = (q - before.q) / dt
        qd = memory.qd + fast * (difference - memory.qd)
        qdd = memory.qdd + slow * ((difference - memory.difference) / dt - memory.qdd)
        wanted = memory.qdd_desired + slow * (memory.late - memory.qdd_desired)
        return Motion(State(q, qd), qdd, wanted), FilterMemory(
            difference, qd, qdd, qdd_desired, wanted
        )

    def lag(self, dt: float) -> float:
        """Return how late the velocity is [s]: half a step, and the delay of its filter."""
        # in NumPy: a number also where the caller is being traced
        weight = -np.expm1(-2.0 * np.pi * np.asarray(self.velocity_band) * dt)
        return float(1.0 / weight - 0.5) * dt


def share(band: Scalar, dt: float) -> Scalar:
    """Return the weight of a new sample [-] in a first-order low pass.

    ``band`` [Hz] is its cut-off and ``dt`` [s] the time step.
    """
    return -jnp.expm1(-2.0 * jnp.pi * band * dt)
