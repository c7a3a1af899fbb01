"""MuJoCo's motion of all bodies along a log, and the torque per inertial parameter of each."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from jaxidl.effects.ten import PLACES

Rows = Float[np.ndarray, "T J"]

SMALL = 1e-12  # share of the largest value: smaller ones are rounding errors


class Motion(NamedTuple):
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


def motion_of(body: Any, q: Rows, qd: Rows, qdd: Rows) -> tuple[Motion, mujoco.MjModel]:
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
    found = Motion(torque, inertia, ratio, axes, speed, acceleration, place, turn, centre)
    return found, source


def _carries(source: mujoco.MjModel, body: int) -> np.ndarray:
    """Return which joints (J,) move a body."""
    above = []
    while body:
        above.append(body)
        body = int(source.body_parentid[body])
    return np.isin(source.dof_bodyid, above)


def by_body(motion: Motion, b: int, source: mujoco.MjModel) -> np.ndarray:
    """Return the torque (T, J, 10) per inertial parameter of a body.

    It follows from Newton's and Euler's equations about the origin of its frame, along its axes.
    """
    turned = motion.turn[:, b]
    arm = motion.place[:, b] - motion.centre[:, source.body_rootid[b]]
    local = lambda vectors: (vectors[:, None] @ turned)[:, 0]
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
    moved = axes[..., 3:] + np.cross(axes[..., :3], arm[:, None])
    moves = np.concatenate([axes[..., :3] @ turned, moved @ turned], 2)
    return _without_rounding(_independent(motion, moves @ wrench))


def by_gravity_of(motion: Motion, source: mujoco.MjModel) -> np.ndarray:
    """Return the torque (T, J, 3) per unit of gravity.

    It is minus the mass of each joint's subtree times the motion of its centre.
    """
    on = source.dof_bodyid
    arm = motion.centre[:, on] - motion.centre[:, source.body_rootid[on]]
    moves = motion.axes[..., 3:] + np.cross(motion.axes[..., :3], arm)
    weight = -source.body_subtreemass[on][:, None] * moves
    return _without_rounding(_independent(motion, weight))


def _independent(motion: Motion, x: np.ndarray) -> np.ndarray:
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
