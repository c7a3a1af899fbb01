"""The inertial regressor of a mechanism of slides and hinges in JAX, differentiable by its motion.

:func:`jaxidl.systems.tables.tables` computes the same along a log with MuJoCo in C.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from jaxidl.effects.ten import PLACES
from jaxidl.systems.flange import flange_of
from jaxidl.systems.inertial import level, per_mass, per_moment
from jaxidl.systems.kinematics import matrices
from jaxidl.systems.mujoco_body import MujocoBody
from jaxidl.systems.tables import Tables
from jaxidl.types import Joints

# the alternating symbol: of two vectors, their cross product
LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    LEVI_CIVITA[_i, _j, _k], LEVI_CIVITA[_i, _k, _j] = 1.0, -1.0


def inverse_dynamics(body: MujocoBody, q: Joints, qd: Joints, qdd: Joints) -> Joints:
    """Return the torque (J,) [N or Nm] of the body, as its table has it."""
    return table(body, q, qd, qdd).torque


def table(body: MujocoBody, q: Joints, qd: Joints, qdd: Joints) -> Tables:
    """Return torque and regressors at one instant, by Newton's and Euler's equations.

    The derivatives by acceleration, position and velocity are left zero: JAX differentiates
    through the torque itself.
    """
    source, whole, motion, ratio = body.source, body.following, (q, qd, qdd), jnp.eye(len(q))
    rotors = body.armature * qdd
    if whole is not None:
        source, motion, ratio = whole.source, whole.motion(q, qd, qdd), jnp.asarray(whole.ratio)
        others = np.where(np.isin(np.arange(source.njnt), whole.own), 0.0, source.dof_armature)
        rotors = rotors + ratio.T @ (others * motion[2])
    at = _along(source, body.gravity, *motion)
    by_body = jnp.einsum("bmp,mj->bjp", _by_body(source, at), ratio)
    numbers = jnp.asarray(_links(source)) + body.added
    none = jnp.zeros((len(body.bodies), len(body.bodies)))
    by_link = jnp.moveaxis(by_body[np.array(body.bodies)], 0, 1)
    gravity = ratio.T @ _by_gravity(source, at)
    return Tables(
        torque=jnp.einsum("bjp,bp->j", by_body, numbers) + rotors,
        inertia=none,
        by_q=none,
        by_qd=none,
        by_mass=jnp.einsum("ijp,jp->ij", by_link, per_mass(source)[list(body.bodies)]),
        by_moment=jnp.einsum("ijp,jap->ija", by_link, per_moment(source)[list(body.bodies)]),
        by_link=by_link,
        by_payload=by_body[flange_of(body.source)],
        by_gravity=gravity,
        by_tilt=gravity @ jnp.asarray(level(source)),
    )


def _links(source: mujoco.MjModel) -> np.ndarray:
    return source.body_mass[:, None] * per_mass(source)


def carried(source: mujoco.MjModel) -> np.ndarray:
    """Return which joints move which bodies (B, J)."""
    out = np.zeros((source.nbody, source.njnt), bool)
    for b in range(1, source.nbody):
        out[b] = out[source.body_parentid[b]] | (source.jnt_bodyid == b)
    return out


def _along(source: mujoco.MjModel, gravity: Any, q: Any, qd: Any, qdd: Any) -> dict[str, Any]:
    """Return frames of bodies and joints, and the bodies' rotation and acceleration.

    One loop over the bodies, as a scan: unrolled, the program of seven joints takes minutes to
    compile with its derivatives. Acceleration is that of the frames' origins less gravity.
    """
    joints, bodies = source.njnt, source.nbody
    most = max(int(np.bincount(source.jnt_bodyid).max()), 1)
    which = np.full((bodies, most), joints)  # the last place stands for no joint
    for b in range(bodies):
        own = np.flatnonzero(source.jnt_bodyid == b)
        which[b, : len(own)] = own
    more = lambda x: np.concatenate([x, np.zeros((1, *x.shape[1:]))])[which].astype(q.dtype)
    slides = source.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
    entries = (
        np.arange(bodies),
        source.body_parentid,
        matrices(source.body_quat).astype(q.dtype),
        source.body_pos.astype(q.dtype),
        which,
        more(source.jnt_axis),
        more(source.jnt_pos),
        more(slides.astype(float)),
        more((~slides).astype(float)),
    )
    zero = jnp.zeros(1, q.dtype)
    move, speed, push = (
        jnp.concatenate([x, zero]) for x in (q - source.qpos0.astype(q.dtype), qd, qdd)
    )

    def step(carry: Any, entry: Any) -> Any:
        pos, rot, omegas, alphas, linears, axes, anchors = carry
        b, parent, still, place, numbers, local, arms, slide, hinge = entry
        turn, origin = rot[parent] @ still, pos[parent] + rot[parent] @ place
        omega, alpha, linear = omegas[parent], alphas[parent], linears[parent]
        here = pos[parent]
        for n in range(most):
            j = numbers[n]
            anchor, axis = origin + turn @ arms[n], turn @ local[n]
            axes, anchors = axes.at[j].set(axis), anchors.at[j].set(anchor)
            turn = turn @ _rotation(local[n], hinge[n] * move[j])
            origin = anchor - turn @ arms[n] + axis * (slide[n] * move[j])
            linear, here = _moved(omega, alpha, linear, anchor - here), anchor
            rate = axis * speed[j]
            across = jnp.cross(omega, rate)
            linear = linear + slide[n] * (2.0 * across + axis * push[j])
            alpha = alpha + hinge[n] * (axis * push[j] + across)
            omega = omega + hinge[n] * rate
        linear = _moved(omega, alpha, linear, origin - here)
        fresh = (origin, turn, omega, alpha, linear)
        kept = (pos, rot, omegas, alphas, linears)
        return (
            *(x.at[b].set(new) for x, new in zip(kept, fresh, strict=True)),
            axes,
            anchors,
        ), None

    none = jnp.zeros((bodies, 3), q.dtype)
    begin = (
        none,
        jnp.zeros((bodies, 3, 3), q.dtype).at[0].set(jnp.eye(3, dtype=q.dtype)),
        none,
        none,
        none.at[0].set(-jnp.asarray(gravity, q.dtype)),
        *(jnp.zeros((joints + 1, 3), q.dtype),) * 2,
    )
    after, _ = jax.lax.scan(step, begin, tuple(jnp.asarray(x[1:]) for x in entries))
    pos, turn, omega, alpha, linear, axes, anchors = after
    centre = pos + jnp.einsum("bij,bj->bi", turn, source.body_ipos.astype(q.dtype))
    return {
        "xpos": pos,
        "xmat": turn,
        "xipos": centre,
        "xaxis": axes[:-1],
        "xanchor": anchors[:-1],
        "omega": omega,
        "alpha": alpha,
        "linear": linear,
    }


def _rotation(axis: Any, angle: Any) -> Any:
    """Return the matrix (3, 3) that turns by ``angle`` about ``axis`` (3,), by Rodrigues."""
    cross = _cross(axis)
    return (
        jnp.eye(3, dtype=cross.dtype)
        + jnp.sin(angle) * cross
        + (1.0 - jnp.cos(angle)) * (cross @ cross)
    )


def _by_body(source: mujoco.MjModel, at: dict[str, Any]) -> Any:
    """Return the torque per inertial parameter of each body (B, J, 10)."""
    into = jnp.swapaxes(at["xmat"], 1, 2)
    local = lambda x: jnp.einsum("bij,bj->bi", into, x)
    wrench = jax.vmap(_wrench)(local(at["omega"]), local(at["alpha"]), local(at["linear"]))
    moves = jnp.concatenate(_moves(source, at, at["xpos"]), 2)  # (B, J, 6)
    turned = jnp.einsum("bik,bjlk->bjli", into, moves.reshape(*moves.shape[:2], 2, 3))
    return jnp.einsum("bjm,bmp->bjp", turned.reshape(moves.shape), wrench)


def _moves(source: mujoco.MjModel, at: dict[str, Any], points: Any) -> tuple[Any, Any]:
    """Return rotation and motion (B, J, 3) of each body's point per speed of each joint."""
    slides = (source.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE)[None, :, None]
    there = carried(source)[:, :, None]
    axes = at["xaxis"][None]
    lever = jnp.cross(axes + 0.0 * points[:, None], points[:, None] - at["xanchor"][None])
    return jnp.where(there & ~slides, axes, 0.0), jnp.where(
        there, jnp.where(slides, axes, lever), 0.0
    )


def _by_gravity(source: mujoco.MjModel, at: dict[str, Any]) -> Any:
    _, motion = _moves(source, at, at["xipos"])
    return -jnp.einsum("b,bjk->jk", jnp.asarray(source.body_mass), motion)


def _moved(omega: Any, alpha: Any, linear: Any, arm: Any) -> Any:
    """Return the acceleration (3,) of a point of a rigid body at ``arm`` from a known one."""
    return linear + jnp.cross(alpha, arm) + jnp.cross(omega, jnp.cross(omega, arm))


def _wrench(omega: Any, alpha: Any, linear: Any) -> Any:
    """Return torque and force (6, 10) per inertial parameter of a body, in its frame."""
    turn = _cross(omega)
    force = jnp.concatenate(
        [linear[:, None], _cross(alpha) + turn @ turn, jnp.zeros((3, 6), linear.dtype)], 1
    )
    torque = jnp.concatenate(
        [
            jnp.zeros((3, 1), linear.dtype),
            -_cross(linear),
            _inertia_of(alpha) + turn @ _inertia_of(omega),
        ],
        1,
    )
    return jnp.concatenate([torque, force])


def _cross(v: Any) -> Any:
    """Return the matrix (3, 3) of the cross product with ``v`` (3,)."""
    return jnp.einsum("ijk,j->ik", LEVI_CIVITA, v)


def _inertia_of(omega: Any) -> Any:
    """Return (3, 6): times the six elements of an inertia tensor, its product with ``omega``."""
    places = np.array(PLACES)
    return jnp.einsum("ijk,j->ik", np.eye(6)[places].astype(omega.dtype), omega)
