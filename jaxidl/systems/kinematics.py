"""Positions of the bodies and joint axes of a mechanism of slides and hinges.

The result is that of ``mjx.kinematics``. With JAX 0.10 XLA fuses that function's chain of
quaternions into every element of its result, each of which recomputes the chain: milliseconds
for seven joints. Here each frame is computed once.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Float

from jaxidl.types import Joints, Scalar


def place(source: mujoco.MjModel, q: Joints) -> dict[str, Array]:
    """Return fields of MuJoCo's data at positions ``q`` (J,).

    They are the frames of bodies, ``xpos`` (B, 3) and ``xmat`` (B, 3, 3), those of their inertia
    about its centre of mass, ``xipos`` and ``ximat``, and of joints ``xanchor`` and ``xaxis`` (J,
    3) [m].
    """
    still, turn = matrices(source.body_quat), matrices(source.body_iquat)
    pos, rot = [jnp.zeros(3, q.dtype)], [jnp.eye(3, dtype=q.dtype)]
    anchors, axes = [], []
    for b in range(1, source.nbody):
        at = source.body_parentid[b]
        r, p = (
            rot[at] @ still[b].astype(q.dtype),
            pos[at] + rot[at] @ source.body_pos[b].astype(q.dtype),
        )
        # in the order of their numbers, as MuJoCo applies them
        for j in np.flatnonzero(source.jnt_bodyid == b):
            own, arm = (x[j].astype(q.dtype) for x in (source.jnt_axis, source.jnt_pos))
            anchors.append(p + r @ arm)
            axes.append(r @ own)
            move = q[j] - source.qpos0[j].astype(q.dtype)
            if source.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE:
                p = p + axes[-1] * move
            else:
                r = r @ rotation(own, move)
                p = anchors[-1] - r @ arm
        p, r = jax.lax.optimization_barrier((p, r))
        pos.append(p)
        rot.append(r)
    xpos, xmat = jnp.stack(pos), jnp.stack(rot)
    return {
        "xpos": xpos,
        "xmat": xmat,
        "xipos": xpos + jnp.einsum("bij,bj->bi", xmat, source.body_ipos.astype(q.dtype)),
        "ximat": xmat @ turn.astype(q.dtype),
        "xanchor": jnp.stack(anchors),
        "xaxis": jnp.stack(axes),
    }


def rotation(axis: np.ndarray, angle: Scalar) -> Float[Array, "3 3"]:
    """Return the matrix (3, 3) that turns by ``angle`` [rad] about the unit vector ``axis`` (3,).

    It is computed by Rodrigues' formula.
    """
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], axis.dtype)
    return (
        jnp.eye(3, dtype=axis.dtype)
        + jnp.sin(angle) * cross
        + (1 - jnp.cos(angle)) * (cross @ cross)
    )


def matrices(quaternions: np.ndarray) -> np.ndarray:
    """Return rotation matrices (B, 3, 3) of unit quaternions (B, 4)."""
    flat = np.zeros((len(quaternions), 9))
    for row, quaternion in zip(flat, quaternions, strict=True):
        mujoco.mju_quat2Mat(row, quaternion)
    return flat.reshape(-1, 3, 3)
