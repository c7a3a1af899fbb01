"""The inertial parameters of a compiled MuJoCo model's bodies, and what changes them.

Ten for each body, as in :mod:`jaxidl.effects.ten`; gravity, too, may point elsewhere.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import copy

import mujoco
import numpy as np
from jaxtyping import Float

from jaxidl.effects.ten import COLUMNS, PLACES, ROWS


def links(source: mujoco.MjModel) -> Float[np.ndarray, "B 10"]:
    """Return the inertial parameters of all bodies of a model, in their frames."""
    turns = np.zeros((source.nbody, 9))
    for turn, quaternion in zip(turns, source.body_iquat, strict=True):
        mujoco.mju_quat2Mat(turn, quaternion)
    turns, m, c = turns.reshape(-1, 3, 3), source.body_mass[:, None, None], source.body_ipos
    about = m * _of_points(c)
    tensor = turns @ (source.body_inertia[:, :, None] * turns.transpose(0, 2, 1)) + about
    return np.concatenate([source.body_mass[:, None], m[:, 0] * c, tensor[:, ROWS, COLUMNS]], 1)


def with_links(source: mujoco.MjModel, ten: Float[np.ndarray, "B 10"]) -> mujoco.MjModel:
    """Return a copy of a model whose bodies have other inertial parameters.

    They need not be those of possible bodies: the copy is for inverse dynamics alone.
    """
    source = copy.copy(source)
    mass = ten[:, :1]
    centres = ten[:, 1:4] / np.where(mass == 0.0, 1.0, mass)
    tensors = ten[:, 4:][:, np.array(PLACES)] - mass[..., None] * _of_points(centres)
    moments, axes = np.linalg.eigh(tensors)
    axes *= np.linalg.det(axes)[:, None, None]
    source.body_mass, source.body_ipos, source.body_inertia = mass[:, 0], centres, moments
    for quaternion, turn in zip(source.body_iquat, axes, strict=True):
        mujoco.mju_mat2Quat(quaternion, turn.ravel())
    source.body_sameframe[:] = 0  # the axes of inertia are no longer those of the bodies
    return source


def _of_points(at: Float[np.ndarray, "B 3"]) -> Float[np.ndarray, "B 3 3"]:
    """Return the inertia about the origin of points of unit mass ``at`` (B, 3)."""
    return (at * at).sum(1)[:, None, None] * np.eye(3) - at[:, :, None] * at[:, None, :]


def per_mass(source: mujoco.MjModel) -> Float[np.ndarray, "B 10"]:
    """Return the inertial parameters of all bodies per unit of mass.

    For massless bodies they are those of a point at their centre.
    """
    c, massless = source.body_ipos, source.body_mass[:, None] <= 0.0
    tensor = _of_points(c)
    points = np.concatenate([np.ones((source.nbody, 1)), c, tensor[:, ROWS, COLUMNS]], 1)
    return np.where(
        massless, points, links(source) / np.where(massless, 1.0, source.body_mass[:, None])
    )


def per_moment(source: mujoco.MjModel) -> Float[np.ndarray, "B 3 10"]:
    """Return the inertial parameters of all bodies per unit of first moment.

    The centre of mass is moved, and the inertia about it stays, to first order: about the frame's
    origin it changes with the moment times the centre.
    """
    eye, c = np.eye(3), source.body_ipos[:, None, :]
    cross = eye[:, :, None] * c[:, :, None, :]
    tensor = 2.0 * np.swapaxes(c, 1, 2)[..., None] * eye - cross - np.swapaxes(cross, 2, 3)
    moments = np.broadcast_to(eye, (source.nbody, 3, 3))
    return np.concatenate(
        [np.zeros((source.nbody, 3, 1)), moments, tensor[..., ROWS, COLUMNS]], axis=2
    )


def level(source: mujoco.MjModel) -> Float[np.ndarray, "3 2"]:
    """Return the change of gravity in the base's frame per radian that the base is turned.

    It is turned about two horizontal axes: x and y where gravity points along −z; else the
    horizontal direction nearest to x, or to y, and the one perpendicular to it.
    """
    gravity = source.opt.gravity
    size = np.linalg.norm(gravity)
    up = -gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])
    first = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    first = first - (first @ up) * up
    first /= np.linalg.norm(first)
    return -np.cross([first, np.cross(up, first)], gravity).T
