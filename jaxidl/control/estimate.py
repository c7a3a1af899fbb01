"""What a controller makes of encoder readings: velocity, acceleration, and the desired acceleration
to compare it with.
"""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax.numpy as jnp
from flax import struct

from jaxidl.types import Joints, Scalar, State


class Motion(NamedTuple):
    """What is known after a reading."""

    sensed: State  # position as read, estimated velocity
    qdd: Joints  # (J,) estimated acceleration [m/s^2 or rad/s^2]
    # (J,) what the estimate is to be compared with: desired acceleration, as late as the estimate
    # is
    qdd_desired: Joints


@runtime_checkable
class Estimator(Protocol):
    """``start`` once, then ``update`` with every reading."""

    def start(self, sensed: State) -> Any:
        """Memory at rest in the ``sensed`` state."""
        ...

    def update(
        self, memory: Any, before: State, q: Joints, qdd_desired: Joints, dt: float
    ) -> tuple[Motion, Any]:
        """Motion and new memory after the reading ``q`` (J,), ``dt`` [s] after the state
        ``before``; ``qdd_desired`` (J,) was wanted there.
        """
        ...


class FiniteDifference(struct.PyTreeNode):
    """The paper's simulation: finite differences of readings and of velocities, and nothing
    else.
    """

    def start(self, sensed: State) -> tuple[()]:
        return ()

    def update(
        self, memory: tuple[()], before: State, q: Joints, qdd_desired: Joints, dt: float
    ) -> tuple[Motion, tuple[()]]:
        qd = (q - before.q) / dt
        return Motion(State(q, qd), (qd - before.qd) / dt, qdd_desired), ()


class FilterMemory(NamedTuple):
    """What :class:`Filtered` remembers, (J,) each."""

    difference: Joints  # of the last two readings over the step [m/s or rad/s]
    qd: Joints
    qdd: Joints
    late: Joints  # the desired acceleration of one step before
    qdd_desired: Joints  # the filtered one


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


def share(band: Scalar, dt: float) -> Scalar:
    """Weight of a new sample [-] in a first-order low pass with cut-off ``band`` [Hz] and time step
    ``dt`` [s].
    """
    return -jnp.expm1(-2.0 * jnp.pi * band * dt)
