"""A rigid body's inverse dynamics along a log, and its derivatives.

The derivatives are by everything that may be wrong about the body.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.interpolate import interp1d

from jaxidl.systems.flange import flange_of
from jaxidl.systems.inertial import level, per_mass, per_moment
from jaxidl.systems.motion import Motion, by_body, by_gravity_of, motion_of
from jaxidl.systems.point import PointMass

Rows = Float[np.ndarray, "T J"]


class Tables(NamedTuple):
    """Inverse dynamics and its derivatives, one row per instant.

    There are T rows, or none inside a ``vmap``. Inverse dynamics is linear in everything but the
    state. Arrays are NumPy's along a log, and JAX's in compiled programs.
    """

    torque: Float[Any, "*T J"]  # inverse dynamics [N or Nm]
    inertia: Float[Any, "*T J J"]  # derivative of the torque by acceleration, the inertia matrix
    by_q: Float[Any, "*T J J"]  # derivative of the torque by position
    by_qd: Float[Any, "*T J J"]  # derivative of the torque by velocity
    # derivative of the torque by the mass of each joint's body, whose inertia changes in proportion
    by_mass: Float[Any, "*T J J"]
    # derivative of the torque by the first moment of each joint's body, whose centre of mass moves
    by_moment: Float[Any, "*T J J 3"]
    # derivative of the torque by the ten inertial parameters of each joint's body (second J)
    by_link: Float[Any, "*T J J 10"]
    # derivative of the torque by those of the last body that moves, maybe welded to a joint's
    by_payload: Float[Any, "*T J 10"]
    by_gravity: Float[Any, "*T J 3"]  # derivative of the torque by gravity
    by_tilt: Float[Any, "*T J 2"]  # derivative of the torque by small turns of the base

    def part(self, joints: slice | list[int]) -> "Tables":
        """Return the tables (T rows) of some joints, as if the others did not move."""
        square = ("inertia", "by_q", "by_qd", "by_mass", "by_moment", "by_link")
        own = {name: values[:, joints] for name, values in self._asdict().items()}
        return Tables(**{name: x[:, :, joints] if name in square else x for name, x in own.items()})


def tables(body: Any, q: Rows, qd: Rows, qdd: Rows, stride: int = 1) -> Tables:
    """Return tables of ``body`` along a log (T, J), in float64 NumPy.

    All are exact at every instant, except the derivatives by position and velocity: these are
    central differences at every ``stride``-th instant, interpolated in between.
    """
    if isinstance(body, PointMass):
        return _of_point_mass(np.asarray(body.mass, float), qdd)
    motion, source = motion_of(body, q, qd, qdd)
    by_payload = by_body(motion, flange_of(body.source), source)
    by_link = np.stack([by_body(motion, b, source) for b in body.bodies], 2)
    by_mass = np.einsum("tijp,jp->tij", by_link, per_mass(source)[list(body.bodies)])
    share = per_moment(source)[list(body.bodies)]
    by_moment = np.einsum("tijp,jap->tija", by_link, share, optimize=True)
    by_gravity = by_gravity_of(motion, source)
    coarse = np.unique(np.append(np.arange(0, len(q), stride), len(q) - 1))
    along = lambda part: interp1d(coarse, part, axis=0, assume_sorted=True)(np.arange(len(q)))
    by_q, by_qd = (
        x if len(x) == len(q) else along(x)
        for x in _differences(body, q[coarse], qd[coarse], qdd[coarse])
    )
    by_tilt = by_gravity @ level(body.source)
    return Tables(
        motion.torque,
        motion.inertia,
        by_q,
        by_qd,
        by_mass,
        by_moment,
        by_link,
        by_payload,
        by_gravity,
        by_tilt,
    )


def leaning(body: Any, q: Rows, change: np.ndarray) -> np.ndarray:
    """Return the torque (T, J, 2) per small turn of the base that changed links add [Nm].

    ``change`` (J + 1, 10) has the additional inertial parameters of the joints' bodies and of the
    last body that moves: the turn changes the direction of their weight, too.
    """
    out = np.zeros((*q.shape, 2))
    motion, source = motion_of(body, q, np.zeros_like(q), np.zeros_like(q))
    for a, gravity in enumerate(level(source).T):
        falling = np.zeros_like(motion.acceleration)
        falling[..., 3:] = -gravity
        still = motion._replace(speed=0.0 * motion.speed, acceleration=falling)
        out[..., a] = _of_links(still, body, source, change)
    return out


def heavier(
    body: Any, q: Rows, qd: Rows, qdd: Rows, change: np.ndarray, angles: np.ndarray
) -> Rows:
    """Return inverse dynamics (T, J) [N or Nm] of ``body`` with changed links on a turned base.

    ``change`` (J + 1, 10) has the additional inertial parameters of the joints' bodies and of the
    last body that moves; the base is turned by small ``angles`` (2,) [rad], with the links as they
    were.
    """
    motion, source = motion_of(body, q, qd, qdd)
    torque = motion.torque + _of_links(motion, body, source, change)
    return torque + by_gravity_of(motion, source) @ (level(body.source) @ angles)


def _of_links(motion: Motion, body: Any, source: mujoco.MjModel, change: np.ndarray) -> Rows:
    """Return the torque (T, J) that changed links (J + 1, 10) need."""
    bodies = zip((*body.bodies, flange_of(body.source)), change, strict=True)
    parts = (by_body(motion, b, source) @ numbers for b, numbers in bodies if numbers.any())
    return sum(parts, np.zeros(motion.torque.shape))


def inverse_dynamics(body: Any, q: Rows, qd: Rows, qdd: Rows) -> Rows:
    """Return inverse dynamics (T, J) [N or Nm] of ``body`` along a log, in float64 NumPy."""
    if isinstance(body, PointMass):
        return np.asarray(body.mass, float) * qdd
    if body.following is None:
        return _inverse(body.source, q, qd, qdd)
    whole = body.following
    return _inverse(whole.source, *whole.motion(q, qd, qdd)) @ whole.ratio


def _of_point_mass(mass: np.ndarray, qdd: np.ndarray) -> Tables:
    joints = len(mass)
    eye, none = np.eye(joints), np.zeros((*qdd.shape, joints))
    by_mass, by_link, by_payload = (
        qdd[..., None] * eye,
        np.zeros((*none.shape, 10)),
        np.zeros((*qdd.shape, 10)),
    )
    by_link[..., 0], by_payload[..., 0] = by_mass, qdd
    gravity = np.zeros((*qdd.shape, 3))
    return Tables(
        mass * qdd,
        none + np.diag(mass),
        none,
        none,
        by_mass,
        np.zeros((*none.shape, 3)),
        by_link,
        by_payload,
        gravity,
        gravity[..., :2],
    )


def _differences(body: Any, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> list[np.ndarray]:
    """Return derivatives (T, J, J) by position and by velocity.

    MuJoCo in C does this in seconds where MJX's derivatives take minutes to compile; a test
    compares both.
    """
    columns = np.eye(q.shape[1])

    def central(by_q: float, by_qd: float) -> np.ndarray:
        def moved(c: np.ndarray) -> np.ndarray:
            return inverse_dynamics(body, q + by_q * c, qd + by_qd * c, qdd)

        return np.stack([(moved(c) - moved(-c)) / (2.0 * (by_q + by_qd)) for c in columns], -1)

    return [central(1e-5, 0.0), central(0.0, 1e-5)]


def _inverse(source: mujoco.MjModel, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Return MuJoCo's inverse dynamics along a log."""
    out, data, inverse = np.empty(q.shape), mujoco.MjData(source), mujoco.mj_inverse
    position, velocity, acceleration, force = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
    for t in range(len(q)):
        position[:], velocity[:], acceleration[:] = q[t], qd[t], qdd[t]
        inverse(source, data)
        out[t] = force
    return out
