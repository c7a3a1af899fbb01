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
from jaxidl.systems.inertial import level, links, per_mass, per_moment, with_links
from jaxidl.systems.motion import by_body, by_gravity_of, motion_of
from jaxidl.systems.point import PointMass

Rows = Float[np.ndarray, "T J"]

LEAST = 1e-3  # mass of a link, over its largest inertial parameter, for a centre nearby


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
    more, still = _by_body(body, change), np.zeros_like(q)
    turns = level(body.source).T
    return np.stack([_needed(body, more, gravity, q, still, still) for gravity in turns], -1)


def heavier(
    body: Any, q: Rows, qd: Rows, qdd: Rows, change: np.ndarray, angles: np.ndarray
) -> Rows:
    """Return inverse dynamics (T, J) [N or Nm] of ``body`` with changed links on a turned base.

    ``change`` (J + 1, 10) has the additional inertial parameters of the joints' bodies and of the
    last body that moves; the base is turned by small ``angles`` (2,) [rad], with the links as they
    were.
    """
    source, still = _whole(body), np.zeros_like(q)
    own, gravity = links(source), np.array(source.opt.gravity)
    torque = _needed(body, own + _by_body(body, change), gravity, q, qd, qdd)
    if angles.any():
        torque += _needed(body, own, level(body.source) @ angles, q, still, still)
    return torque + _rotors(body, qdd)


def _whole(body: Any) -> mujoco.MjModel:
    """Return the model of a body with the joints that follow others."""
    return body.source if body.following is None else body.following.source


def _rotors(body: Any, qdd: Rows) -> Rows:
    """Return the torque (T, J) that the rotors of all joints need."""
    rotors = _whole(body).dof_armature
    if body.following is None:
        return rotors * qdd
    return (qdd @ body.following.ratio.T * rotors) @ body.following.ratio


def _by_body(body: Any, change: np.ndarray) -> np.ndarray:
    """Return the change (B, 10) of all bodies; ``change`` (J + 1, 10) is by joint, and a load."""
    out = np.zeros((_whole(body).nbody, 10))
    np.add.at(out, [*body.bodies, flange_of(body.source)], change)
    return out


def _needed(body: Any, ten: np.ndarray, gravity: np.ndarray, q: Rows, qd: Rows, qdd: Rows) -> Rows:
    """Return the torque (T, J) that links with inertial parameters (B, 10) need, without rotors.

    The torque is linear in them. So where a link has hardly any mass, and its centre would be far
    away, it gets some more for a while.
    """
    size = np.abs(ten).max(1)
    extra = np.zeros_like(ten)
    extra[:, 0] = np.where(ten[:, 0] < LEAST * size, 2.0 * size, 0.0)

    def torque(ten: np.ndarray) -> Rows:
        source = with_links(_whole(body), ten)
        source.opt.gravity = gravity
        return _independent(body, source, q, qd, qdd)

    return torque(ten + extra) - torque(extra) if extra.any() else torque(ten)


def inverse_dynamics(body: Any, q: Rows, qd: Rows, qdd: Rows) -> Rows:
    """Return inverse dynamics (T, J) [N or Nm] of ``body`` along a log, in float64 NumPy."""
    if isinstance(body, PointMass):
        return np.asarray(body.mass, float) * qdd
    return _independent(body, _whole(body), q, qd, qdd) + _rotors(body, qdd)


def _independent(body: Any, source: mujoco.MjModel, q: Rows, qd: Rows, qdd: Rows) -> Rows:
    """Return the torque (T, J) that the bodies of ``source``, with a body's joints, need."""
    if body.following is None:
        return _inverse(source, q, qd, qdd)
    return _inverse(source, *body.following.motion(q, qd, qdd)) @ body.following.ratio


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
    """Return the torque (T, J) that bodies need along a log, without rotors.

    Of ``mj_inverse`` these are the steps that need no inverse of the inertia matrix, which links
    that cannot be built may not have.
    """
    out, data = np.empty(q.shape), mujoco.MjData(source)
    position, velocity, acceleration = data.qpos, data.qvel, data.qacc
    place, centre, speed, newton_euler = (
        mujoco.mj_kinematics,
        mujoco.mj_comPos,
        mujoco.mj_comVel,
        mujoco.mj_rne,
    )
    for t, force in enumerate(out):
        position[:], velocity[:], acceleration[:] = q[t], qd[t], qdd[t]
        place(source, data)
        centre(source, data)
        speed(source, data)
        newton_euler(source, data, 1, force)
    return out
