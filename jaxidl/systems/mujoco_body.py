"""A mechanism of slides and hinges as a rigid body: MuJoCo's model, its dynamics in MJX.

Only smooth rigid-body dynamics are computed in MJX, M(q)·qdd + bias(q, qd) = tau: no constraint
solver, which reverse mode cannot differentiate, no passive forces and no actuators. Those are
effects of the plant (:mod:`jaxidl.systems.mjcf` reads them).
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import contextlib
import functools
import io
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jaxtyping import Array, Float

from jaxidl.effects.ten import moved
from jaxidl.systems.flange import flange_of, name_flange, named_flange
from jaxidl.systems.following import Following, following_of
from jaxidl.systems.inertial import level, per_mass, per_moment
from jaxidl.systems.kinematics import place
from jaxidl.types import Joints, Scalar

with contextlib.redirect_stdout(io.StringIO()):  # it prints which optional packages are missing
    from mujoco import mjx


@functools.lru_cache(maxsize=64)
def _constants(source: mujoco.MjModel) -> Any:
    """Return MJX's form of a compiled model, in float64."""
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        return mjx.put_model(source)


class MujocoBody(struct.PyTreeNode):
    """A rigid body with the dynamics of a MuJoCo model.

    Body number ``bodies[j]`` moves with joint j. The methods are those of
    :class:`jaxidl.systems.PointMass`. Its leaves are what effects change, of B bodies
    and J joints; all else of the model is constant in compiled programs. The dynamics are linear in
    what is added to bodies.
    """

    # inertial parameters of the bodies in addition to the source, in their frames
    added: Float[Array, "B 10"]
    armature: Joints  # (J,) rotor inertia [kg or kg m^2]
    gravity: Float[Array, "3"]  # [m/s^2]
    source: mujoco.MjModel = struct.field(pytree_node=False)  # MuJoCo's model in C, as loaded
    names: tuple[str, ...] = struct.field(pytree_node=False)
    kinds: tuple[str, ...] = struct.field(pytree_node=False)  # slide or hinge
    bodies: tuple[int, ...] = struct.field(pytree_node=False)
    body_names: tuple[str, ...] = struct.field(pytree_node=False)  # of all B bodies
    # with the joints that follow these, which ``source`` has locked
    following: Following | None = struct.field(pytree_node=False, default=None)

    @property
    def carrier(self) -> str:
        """Name of the body in whose frame a payload is given."""
        b, source = flange_of(self.source), self.source
        while (
            b not in self.bodies and not source.body_pos[b].any() and source.body_quat[b][0] == 1.0
        ):
            # the frame is the same, as for the body of a load that was found before
            b = int(source.body_parentid[b])
        return self.body_names[b]

    def equation_of_motion(self, q: Joints, qd: Joints) -> tuple[Float[Array, "J J"], Joints]:
        """Return inertia matrix M (J, J) and bias torque (J,).

        The bias is gravity, Coriolis and centrifugal torque [N or Nm].
        """
        # MJX treats NumPy arrays as constants
        return _equation_of_motion(self, jnp.asarray(q), jnp.asarray(qd))

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints:
        """Return the torque (J,) [N or Nm] for the acceleration ``qdd`` (J,)."""
        inertia, bias = self.equation_of_motion(q, qd)
        return inertia @ qdd + bias

    def forward_dynamics(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        """Return the acceleration (J,) [m/s^2 or rad/s^2] under joint torque ``tau`` (J,)."""
        inertia, bias = self.equation_of_motion(q, qd)
        return jax.scipy.linalg.solve(inertia, tau - bias, assume_a="pos")

    def mobility(self, q: Joints) -> Float[Array, "J J"]:
        """Return the inverse of the inertia matrix (J, J)."""
        return jnp.linalg.inv(self.equation_of_motion(q, jnp.zeros_like(q))[0])

    def add_inertia(self, extra: Joints) -> "MujocoBody":
        """Return the body with additional rotor inertia on its joints.

        ``extra`` (J,) is in kg or kg m^2.
        """
        return self.replace(armature=self.armature + extra)

    def add_link(self, extra: Float[Array, "J 10"]) -> "MujocoBody":
        """Return the body with additional inertial parameters of its joints' bodies.

        ``extra`` (J, 10) has one row per joint; see :mod:`jaxidl.effects.ten`.
        """
        return self.replace(added=self.added.at[jnp.asarray(self.bodies)].add(extra))

    def add_mass(self, extra: Joints | Scalar) -> "MujocoBody":
        """Return the body with additional mass of its joints' bodies.

        ``extra`` (J,) is in kg; a body's inertia changes in proportion.
        """
        share = per_mass(self.source)[list(self.bodies)]
        return self.add_link((extra + jnp.zeros(len(share)))[:, None] * share)

    def add_moment(self, extra: Float[Array, "J 3"]) -> "MujocoBody":
        """Return the body with additional first moments of its joints' bodies.

        ``extra`` (J, 3) is in kg m; see :func:`per_moment`.
        """
        share = per_moment(self.source)[list(self.bodies)]
        return self.add_link(jnp.einsum("ja,jap->jp", extra, share))

    def add_payload(self, extra: Float[Array, "10"]) -> "MujocoBody":
        """Return the body with additional inertial parameters of the last body that moves.

        ``extra`` (10,) is given in that body's frame.
        """
        return self.replace(added=self.added.at[flange_of(self.source)].add(extra))

    def tilt(self, angles: Float[Array, "2"]) -> "MujocoBody":
        """Return the body on a base turned by small ``angles`` (2,) [rad].

        They are about the axes of :func:`level`; gravity is linear in them.
        """
        return self.replace(gravity=self.gravity + level(self.source) @ angles)


@functools.partial(jax.jit, inline=True)  # a program asks for it several times: MJX is traced once
def _equation_of_motion(
    body: MujocoBody, q: Joints, qd: Joints
) -> tuple[Float[Array, "J J"], Joints]:
    all_joints, source, armature = body.following, body.source, body.armature
    if all_joints is not None:
        source, (q, qd, _) = all_joints.source, all_joints.motion(q, qd, qd)
        rotors = jnp.asarray(source.dof_armature, armature.dtype)
        armature = rotors.at[jnp.asarray(all_joints.own)].set(armature)
    model = _constants(source)
    model = model.replace(dof_armature=armature, opt=model.opt.replace(gravity=body.gravity))
    # float64 only where JAX has enabled it
    model = jax.tree.map(
        lambda x: jnp.asarray(x, q.dtype) if jnp.issubdtype(x.dtype, jnp.floating) else x, model
    )
    with jax.numpy_rank_promotion("allow"):  # MJX relies on rank promotion
        data = mjx.make_data(model).replace(qpos=q, qvel=qd, **place(source, q))
        data = _heavier(body, mjx.com_pos(model, data), q.dtype)
        for stage in (mjx.crb, mjx.com_vel):
            data = stage(model, data)
        inertia, bias = mjx.full_m(model, data), mjx.rne(model, data).qfrc_bias
    if all_joints is None:
        return inertia, bias
    ratio = jnp.asarray(all_joints.ratio, q.dtype)
    return ratio.T @ inertia @ ratio, ratio.T @ bias


def _heavier(body: MujocoBody, data: Any, dtype: Any) -> Any:
    """Return MJX's data with what is ``added`` to a body, in MJX's form of inertias.

    They are about the tree's centre of mass, along the world's axes.
    """
    offset = data.xpos - data.subtree_com[body.source.body_rootid]
    more = jax.vmap(moved)(jnp.asarray(body.added, dtype), data.xmat, offset)
    order = jnp.concatenate([more[:, 4:], more[:, 1:4], more[:, :1]], 1)
    return data.tree_replace({"_impl.cinert": data._impl.cinert + order})


def mujoco_body(model: mujoco.MjModel, whole: mujoco.MjModel | None = None) -> MujocoBody:
    """Return the body of a compiled MuJoCo model that has only slides and hinges.

    ``whole`` also has the joints that follow others by equality constraints.

    Raises:
        ValueError: with MuJoCo's message, if it rejects the model's numbers when compiled again.
    """
    bare = skeleton(model)
    kinds = tuple(
        "slide" if kind == mujoco.mjtJoint.mjJNT_SLIDE else "hinge" for kind in bare.jnt_type
    )
    _constants(bare)  # MuJoCo raises here if at all
    found = None if whole is None else following_of(whole)
    return MujocoBody(
        added=jnp.zeros((bare.nbody, 10)),
        armature=jnp.asarray(bare.dof_armature),
        gravity=jnp.asarray(bare.opt.gravity),
        source=bare,
        names=joint_names(model),
        kinds=kinds,
        bodies=tuple(int(b) for b in bare.jnt_bodyid),
        body_names=tuple(model.body(b).name or f"body{b}" for b in range(model.nbody)),
        following=None if found is None else replace(found, source=skeleton(found.source)),
    )


def joint_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Return the names (J) of a compiled model's joints.

    Joints without a name are named after their number.
    """
    return tuple(model.joint(j).name or f"joint{j}" for j in range(model.njnt))


def skeleton(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return bodies, joints and gravity of a compiled model, without geometry.

    Geometry costs time, and MJX does not support all of it.
    """
    spec = mujoco.MjSpec()
    weightless = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    spec.option.gravity = np.zeros(3) if weightless else model.opt.gravity
    spec.compiler.degree = False
    bodies = [spec.worldbody]
    for b in range(1, model.nbody):
        inertial = {"mass": model.body_mass[b], "inertia": model.body_inertia[b]}
        inertial |= {
            "ipos": model.body_ipos[b],
            "iquat": model.body_iquat[b],
            "explicitinertial": True,
        }
        parent = bodies[model.body_parentid[b]]
        bodies.append(parent.add_body(pos=model.body_pos[b], quat=model.body_quat[b], **inertial))
    for j in range(model.njnt):
        frame = {"pos": model.jnt_pos[j], "axis": model.jnt_axis[j], "ref": model.qpos0[j]}
        bodies[model.jnt_bodyid[j]].add_joint(
            name=model.joint(j).name,
            type=model.jnt_type[j],
            armature=model.dof_armature[j],
            **frame,
        )
    if name := named_flange(model):
        bodies[model.body(name).id].name = name
        name_flange(spec, name)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(
        mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    )
    return spec.compile()
