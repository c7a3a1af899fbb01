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

from jaxidl.effects.ten import PLACES
from jaxidl.systems.flange import flange_of
from jaxidl.systems.inertial import level, per_mass, per_moment
from jaxidl.systems.point import PointMass

Rows = Float[np.ndarray, "T J"]

SMALL = 1e-12  # share of the largest value: smaller ones are rounding errors


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
    motion, source = _motion(body, q, qd, qdd)
    by_payload = _by_body(motion, flange_of(body.source), source)
    by_link = np.stack([_by_body(motion, b, source) for b in body.bodies], 2)
    by_mass = np.einsum("tijp,jp->tij", by_link, per_mass(source)[list(body.bodies)])
    share = per_moment(source)[list(body.bodies)]
    by_moment = np.einsum("tijp,jap->tija", by_link, share, optimize=True)
    by_gravity = _by_gravity(motion, source)
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
    motion, source = _motion(body, q, np.zeros_like(q), np.zeros_like(q))
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
    motion, source = _motion(body, q, qd, qdd)
    torque = motion.torque + _of_links(motion, body, source, change)
    return torque + _by_gravity(motion, source) @ (level(body.source) @ angles)


def _of_links(motion: "_Motion", body: Any, source: mujoco.MjModel, change: np.ndarray) -> Rows:
    """Return the torque (T, J) that changed links (J + 1, 10) need."""
    bodies = zip((*body.bodies, flange_of(body.source)), change, strict=True)
    parts = (_by_body(motion, b, source) @ numbers for b, numbers in bodies if numbers.any())
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


class _Motion(NamedTuple):
    """MuJoCo's data along a log, of B bodies, J joints, and M with those that follow them.

    Spatial vectors are angular, then linear at the tree's centre of mass.
    """

    torque: np.ndarray  # (T, J)
    inertia: np.ndarray  # (T, J, J)
    ratio: np.ndarray  # (M, J) of speeds
    axes: np.ndarray  # (T, M, 6) of the joints
    speed: np.ndarray  # (T, B, 6)
    acceleration: np.ndarray  # (T, B, 6) less gravity
    place: np.ndarray  # (T, B, 3) of the frames
    turn: np.ndarray  # (T, B, 3, 3)
    centre: np.ndarray  # (T, B, 3) of mass of the subtrees


def _motion(body: Any, q: Rows, qd: Rows, qdd: Rows) -> tuple[_Motion, mujoco.MjModel]:
    """Return MuJoCo's intermediate results of inverse dynamics, and the model they are of."""
    source, ratio, whole = body.source, np.eye(q.shape[1]), body.following
    if whole is not None:
        source, ratio, (q, qd, qdd) = whole.source, whole.ratio, whole.motion(q, qd, qdd)
    T, J, B = len(q), source.nv, source.nbody
    shapes = (J,), (J, J), (J, 6), (B, 6), (B, 6), (B, 3), (B, 9), (B, 3)
    out = [np.empty((T, *shape)) for shape in shapes]
    torque, inertia, axes, speed, acceleration, place, turn, centre = out
    data = mujoco.MjData(source)
    position, velocity, wanted, force = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
    cdof, cvel, cacc, xpos, xmat, subtree = (
        data.cdof,
        data.cvel,
        data.cacc,
        data.xpos,
        data.xmat,
        data.subtree_com,
    )
    inverse, accelerations, full = mujoco.mj_inverse, mujoco.mj_rnePostConstraint, mujoco.mj_fullM
    for t in range(T):
        position[:], velocity[:], wanted[:] = q[t], qd[t], qdd[t]
        inverse(source, data)
        accelerations(source, data)
        full(source, data, inertia[t])
        torque[t], axes[t], speed[t], acceleration[t] = force, cdof, cvel, cacc
        place[t], turn[t], centre[t] = xpos, xmat, subtree
    torque, inertia = torque @ ratio, ratio.T @ inertia @ ratio
    turn = turn.reshape(T, B, 3, 3)
    found = _Motion(torque, inertia, ratio, axes, speed, acceleration, place, turn, centre)
    return found, source


def _carries(source: mujoco.MjModel, body: int) -> np.ndarray:
    """Return which joints (J,) move a body."""
    above = []
    while body:
        above.append(body)
        body = int(source.body_parentid[body])
    return np.isin(source.dof_bodyid, above)


def _by_body(motion: _Motion, b: int, source: mujoco.MjModel) -> np.ndarray:
    """Return the torque (T, J, 10) per inertial parameter of a body.

    It follows from Newton's and Euler's equations about the origin of its frame, along its axes.
    """
    into = motion.turn[:, b].transpose(0, 2, 1)
    arm = motion.place[:, b] - motion.centre[:, source.body_rootid[b]]
    local = lambda vectors: np.einsum("tij,t...j->t...i", into, vectors)
    omega, alpha = motion.speed[:, b, :3], motion.acceleration[:, b, :3]
    speed = motion.speed[:, b, 3:] + np.cross(omega, arm)
    linear = local(motion.acceleration[:, b, 3:] + np.cross(alpha, arm) + np.cross(omega, speed))
    omega, alpha = local(omega), local(alpha)
    turn, spin = _cross(omega), _inertia_of(omega)
    wrench = np.zeros((len(arm), 6, 10))  # torque, then force
    wrench[:, 3:, 0] = linear
    wrench[:, 3:, 1:4] = _cross(alpha) + turn @ turn
    wrench[:, :3, 1:4] = -_cross(linear)
    wrench[:, :3, 4:] = _inertia_of(alpha) + turn @ spin
    axes = motion.axes * _carries(source, b)[:, None]
    moves = np.concatenate(
        [local(axes[..., :3]), local(axes[..., 3:] + np.cross(axes[..., :3], arm[:, None]))], 2
    )
    return _without_rounding(_independent(motion, moves @ wrench))


def _by_gravity(motion: _Motion, source: mujoco.MjModel) -> np.ndarray:
    """Return the torque (T, J, 3) per unit of gravity.

    It is minus the mass of each joint's subtree times the motion of its centre.
    """
    on = source.dof_bodyid
    arm = motion.centre[:, on] - motion.centre[:, source.body_rootid[on]]
    moves = motion.axes[..., 3:] + np.cross(motion.axes[..., :3], arm)
    weight = -source.body_subtreemass[on][:, None] * moves
    return _without_rounding(_independent(motion, weight))


def _independent(motion: _Motion, x: np.ndarray) -> np.ndarray:
    """Return torques (T, J, P) of the independent joints for those of all (T, M, P)."""
    return x if len(motion.ratio) == motion.ratio.shape[1] else motion.ratio.T @ x


def _cross(vectors: np.ndarray) -> np.ndarray:
    """Return matrices (T, 3, 3) of cross products with vectors (T, 3)."""
    return np.cross(vectors[:, None, :], np.eye(3)).transpose(0, 2, 1)


def _inertia_of(omega: np.ndarray) -> np.ndarray:
    """Return (T, 3, 6): times the six elements of an inertia tensor, its product with omega.

    ``omega`` is (T, 3).
    """
    out = np.zeros((len(omega), 3, 6))
    for i, places in enumerate(PLACES):
        for j, place in enumerate(places):
            out[:, i, place] = omega[:, j]
    return out


def _without_rounding(x: np.ndarray) -> np.ndarray:
    x[np.abs(x) < SMALL * np.abs(x).max(initial=0.0)] = 0.0
    return x


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
