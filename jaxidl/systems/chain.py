"""A mechanism of slides and hinges as a list of links, one for each joint, with constant numbers.

This is the form that a recursion from link to link needs. Bodies without a joint of their own are
part of the link that carries them; a body with several joints becomes several links, of which only
the last has mass. A link's frame has its origin on the joint's axis and its z axis along it.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float

from jaxidl.effects.ten import moved
from jaxidl.systems.inertial import links
from jaxidl.systems.mujoco_body import MujocoBody


class Chain(NamedTuple):
    """Links of a tree, of J joints; every link comes after its parent."""

    parent: tuple[int, ...]  # number of the link that carries each link; -1: the base
    kinds: tuple[str, ...]  # slide or hinge
    # frame of each link in its parent's frame where the joint is at ``reference``: columns are axes
    turn: Float[np.ndarray, "J 3 3"]
    place: Float[np.ndarray, "J 3"]  # [m]
    reference: Float[np.ndarray, " J"]  # [m or rad]
    ten: Float[np.ndarray, "J 10"]  # inertial parameters in the link's frame
    armature: Float[np.ndarray, " J"]  # rotor inertia [kg or kg m^2]
    gravity: Float[np.ndarray, "3"]  # in the base's frame [m/s^2]


class _Frame(NamedTuple):
    """Where a body is: its pose in the frame of the link that carries it."""

    link: int
    turn: np.ndarray
    place: np.ndarray


def chain(body: MujocoBody) -> Chain:
    """Return the links of ``body``, with what effects have changed of it.

    It is computed on the host in float64. Inverse dynamics is linear in the inertial parameters, so
    what was ``added`` to bodies only adds to them.
    """
    source, numbers = body.source, links(body.source) + np.asarray(body.added, float)
    frames = [_Frame(-1, np.eye(3), np.zeros(3))]
    parent, turns, places = [], [], []
    ten = np.zeros((source.njnt, 10))
    for b in range(1, source.nbody):
        carrier = frames[source.body_parentid[b]]
        turn, place = (
            carrier.turn @ _matrix(source.body_quat[b]),
            carrier.place + carrier.turn @ source.body_pos[b],
        )
        link = carrier.link
        for j in np.flatnonzero(source.jnt_bodyid == b).tolist():
            align, anchor = _along(source.jnt_axis[j]), source.jnt_pos[j]
            parent.append(link)
            turns.append(turn @ align)
            places.append(place + turn @ anchor)
            link, turn, place = j, align.T, -align.T @ anchor
        frames.append(_Frame(link, turn, place))
        if link >= 0:
            with jax.enable_x64(True):
                own = moved(*map(jnp.asarray, (numbers[b], turn, place)))
            ten[link] += np.asarray(own)
    return Chain(
        tuple(parent),
        body.kinds,
        np.array(turns),
        np.array(places),
        np.array(source.qpos0, float),
        ten,
        np.asarray(body.armature, float),
        np.asarray(body.gravity, float),
    )


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    return flat.reshape(3, 3)


def _along(axis: np.ndarray) -> np.ndarray:
    """Return a rotation (3, 3) that takes z to the unit vector ``axis`` (3,), by the least turn."""
    x, y, z = axis / np.linalg.norm(axis)
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + z)
