"""A mechanism of slides and hinges as a rigid body: MuJoCo's model, its dynamics in MJX.

Only smooth rigid-body dynamics is asked of MJX, M(q)·qdd + bias(q, qd) = tau: no constraint solver, which reverse mode cannot
pass, no passive forces and no actuators. Those are effects of the plant (:mod:`jaxidl.systems.mjcf` reads them).
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import contextlib
import functools
import io
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jaxtyping import Array, Float

from jaxidl.errors import EffectError
from jaxidl.systems.kinematics import place
from jaxidl.types import Joints, Scalar

with contextlib.redirect_stdout(io.StringIO()):  # it announces what optional packages are missing
    from mujoco import mjx

LOAD = "jaxidl_payload"  # a massless body on the last one that moves, in every loaded model: a payload's place
LOADS = (LOAD, f"{LOAD}_2", f"{LOAD}_3")  # a place for each payload; as siblings they cost MJX next to nothing


@functools.lru_cache(maxsize=64)
def _constants(source: mujoco.MjModel) -> Any:
    """What MJX makes of a compiled model, in float64."""
    with jax.ensure_compile_time_eval(), jax.enable_x64(True):
        return mjx.put_model(source)


class MujocoBody(struct.PyTreeNode):
    """Body number ``bodies[j]`` moves with joint j. Shares its methods with :class:`jaxidl.systems.point_mass.PointMass`.

    Its leaves are what effects change, of B bodies and J joints; all else of the model is constant in compiled programs.
    """

    mass: Float[Array, " B"]  # [kg]
    inertia: Float[Array, "B 3"]  # principal moments [kg m^2]
    centre: Float[Array, "B 3"]  # of mass, in the body's frame [m]
    armature: Joints  # (J,) rotor inertia [kg or kg m^2]
    source: mujoco.MjModel = struct.field(pytree_node=False)  # the body in C, as loaded
    names: tuple[str, ...] = struct.field(pytree_node=False)
    kinds: tuple[str, ...] = struct.field(pytree_node=False)  # slide or hinge
    bodies: tuple[int, ...] = struct.field(pytree_node=False)
    loads: int = struct.field(pytree_node=False, default=0)  # payloads added so far

    def equation_of_motion(self, q: Joints, qd: Joints) -> tuple[Float[Array, "J J"], Joints]:
        """Inertia matrix M (J, J) and bias torque (J,): gravity, Coriolis, centrifugal [N or Nm]."""
        q, qd = jnp.asarray(q), jnp.asarray(qd)  # in NumPy's arrays MJX sees constants of the model
        model = _constants(self.source).replace(
            body_mass=self.mass, body_inertia=self.inertia, body_ipos=self.centre, dof_armature=self.armature
        )
        # float64 only where JAX has it
        model = jax.tree.map(lambda x: jnp.asarray(x, q.dtype) if jnp.issubdtype(x.dtype, jnp.floating) else x, model)
        with jax.numpy_rank_promotion("allow"):  # MJX relies on it
            data = mjx.make_data(model).replace(qpos=q, qvel=qd, **place(self.source, model.body_ipos, q))
            for stage in (mjx.com_pos, mjx.crb, mjx.com_vel):
                data = stage(model, data)
            return mjx.full_m(model, data), mjx.rne(model, data).qfrc_bias

    def inverse_dynamics(self, q: Joints, qd: Joints, qdd: Joints) -> Joints:
        """Torque (J,) [N or Nm] that makes acceleration ``qdd`` (J,)."""
        inertia, bias = self.equation_of_motion(q, qd)
        return inertia @ qdd + bias

    def forward_dynamics(self, q: Joints, qd: Joints, tau: Joints) -> Joints:
        """Acceleration (J,) [m/s^2 or rad/s^2] under the joint torque ``tau`` (J,)."""
        inertia, bias = self.equation_of_motion(q, qd)
        return jax.scipy.linalg.solve(inertia, tau - bias, assume_a="pos")

    def mobility(self, q: Joints) -> Float[Array, "J J"]:
        """Inverse of the inertia matrix (J, J)."""
        return jnp.linalg.inv(self.equation_of_motion(q, jnp.zeros_like(q))[0])

    def add_inertia(self, extra: Joints) -> "MujocoBody":
        """The body with rotor inertia ``extra`` (J,) more on its joints [kg or kg m^2]."""
        return self.replace(armature=self.armature + extra)

    def add_mass(self, extra: Joints | Scalar) -> "MujocoBody":
        """The body whose j-th joint's body weighs ``extra`` (J,) [kg] more; its inertia changes in proportion."""
        heavier = self.mass.at[jnp.asarray(self.bodies)].add(extra)
        weighty = self.mass > 0.0
        factor = jnp.where(weighty, heavier / jnp.where(weighty, self.mass, 1.0), 1.0)
        return self.replace(mass=heavier, inertia=factor[:, None] * self.inertia)

    def add_payload(self, mass: Scalar, com: Float[Array, "3"]) -> "MujocoBody":
        """The body with a point of ``mass`` [kg] more at ``com`` (3,) [m] in the frame of its last body that moves.

        Raises:
            EffectError: for more payloads than there are places.
        """
        if self.loads == len(LOADS):
            raise EffectError(f"at most {len(LOADS)} payloads", "one more", "put them together in one")
        load = mujoco.mj_name2id(self.source, mujoco.mjtObj.mjOBJ_BODY, LOADS[self.loads])
        place = self.centre.at[load].set(jnp.asarray(com, self.centre.dtype))
        return self.replace(mass=self.mass.at[load].add(mass), centre=place, loads=self.loads + 1)


def mujoco_body(model: mujoco.MjModel) -> MujocoBody:
    """The body of a compiled MuJoCo model that has nothing but slides and hinges.

    Raises:
        ValueError: with MuJoCo's words, if it does not take the model's numbers a second time.
    """
    bare = skeleton(model)
    kinds = tuple("slide" if kind == mujoco.mjtJoint.mjJNT_SLIDE else "hinge" for kind in bare.jnt_type)
    _constants(bare)  # MuJoCo complains here if at all
    return MujocoBody(
        mass=jnp.asarray(bare.body_mass),
        inertia=jnp.asarray(bare.body_inertia),
        centre=jnp.asarray(bare.body_ipos),
        armature=jnp.asarray(bare.dof_armature),
        source=bare,
        names=joint_names(model),
        kinds=kinds,
        bodies=tuple(int(b) for b in bare.jnt_bodyid),
    )


def joint_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names (J) of a compiled model's joints; those without one are called after their number."""
    return tuple(model.joint(j).name or f"joint{j}" for j in range(model.njnt))


def last_moving(model: mujoco.MjModel) -> int:
    """Number of the last body that some joint moves: what comes after it in the file, a table say, carries no payload."""
    return int(np.flatnonzero(model.body_weldid)[-1])


def skeleton(model: mujoco.MjModel) -> mujoco.MjModel:
    """Bodies, joints and gravity of a compiled model, without geometry, and with places for payloads.

    Geometry costs time, MJX does not know all of it, and the compiler's settings (a least mass, a total mass) would be applied
    to the places for payloads too.
    """
    spec = mujoco.MjSpec()
    weightless = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    spec.option.gravity = np.zeros(3) if weightless else model.opt.gravity
    spec.compiler.degree = False
    bodies = [spec.worldbody]
    for b in range(1, model.nbody):
        inertial = {"mass": model.body_mass[b], "inertia": model.body_inertia[b]}
        inertial |= {"ipos": model.body_ipos[b], "iquat": model.body_iquat[b], "explicitinertial": True}
        parent = bodies[model.body_parentid[b]]
        bodies.append(parent.add_body(pos=model.body_pos[b], quat=model.body_quat[b], **inertial))
    for j in range(model.njnt):
        frame = {"pos": model.jnt_pos[j], "axis": model.jnt_axis[j], "ref": model.qpos0[j]}
        bodies[model.jnt_bodyid[j]].add_joint(
            name=model.joint(j).name, type=model.jnt_type[j], armature=model.dof_armature[j], **frame
        )
    for name in LOADS:
        # away from the body's origin and turned, or MuJoCo would note that the two frames are one and ignore where the load goes
        turned = {"ipos": np.ones(3), "iquat": [0.8, 0.6, 0.0, 0.0]}
        bodies[last_moving(model)].add_body(name=name, mass=0.0, explicitinertial=True, inertia=np.zeros(3), **turned)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    return spec.compile()
