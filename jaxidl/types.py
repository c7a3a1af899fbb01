"""Array aliases and the records that packages share.

Axis letters, used in every docstring of the package: **J** joints, **T** control steps of one
execution, **K** executions of a learning run, **N** rows of a data set, **F** network inputs,
**B** rows of a batch, **S** training steps of one iteration, **C** circumstances. No signature
below the sweep has an axis for configurations: that axis comes from ``vmap`` or ``lax.map``
outside.
"""

from typing import NamedTuple

from flax import struct
from jaxtyping import Array, Bool, Float, PRNGKeyArray

Joints = Float[Array, " J"]
JointMask = Bool[Array, " J"]
# (T, J); inside a scan one instant (J,), and (K, T, J) over iterations
History = Float[Array, "*T J"]
# (T, C) conditions set from outside; inside a scan one instant (C,)
Circumstances = Float[Array, "*T C"]
Scalar = Float[Array, ""] | float  # a float is a constant of the program
Key = PRNGKeyArray


class State(NamedTuple):
    """Position and velocity of a mechanism at one instant."""

    q: Joints  # (J,) joint positions [m or rad]
    qd: Joints  # (J,) joint velocities [m/s or rad/s]


@struct.dataclass
class Trajectory:
    """One execution as histories over its control steps.

    Entry t of every field belongs to control step t; states are those *before* the step.
    """

    q: History  # (T, J) true position [m]
    qd: History  # (T, J) true velocity [m/s]
    q_sensing: History  # (T, J) sensed position [m]
    qd_sensing: History  # (T, J) finite difference of sensed positions [m/s]
    qdd_desired: History  # (T, J) desired by the policy [m/s^2]
    qdd_actual: History  # (T, J) finite difference of sensed velocities over the step [m/s^2]
    tau: History  # (T, J) commanded torque: rigid body + feedback + feedforward [N]
    tau_inverse_desired: History  # (T, J) modelled rigid body at the desired acceleration [N]
    tau_inverse_actual: History  # (T, J) modelled rigid body at the actual acceleration [N]
    tau_feedback: History  # (T, J) learning feedback: filtered, high gain, never applied [N]
    tau_feedback_applied: History  # (T, J) feedback that the plant receives [N]
    tau_feedforward: History  # (T, J) the error model's torque [N]
    circumstances: Circumstances | None = None  # (T, C) conditions set from outside, if any


class Dataset(NamedTuple):
    """Rows that an error model is trained on."""

    # (N, F = 3J + C) position, velocity, acceleration, circumstances if any
    x: Float[Array, "N F"]
    y: Float[Array, "N J"]  # (N, J) torque that the modelled rigid body lacks [N]
