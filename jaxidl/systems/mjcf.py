"""MJCF and URDF files: a rigid body, and the effects that the file has beside it."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import contextlib
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import mujoco
import numpy as np

from jaxidl.effects import CoulombFriction, Effect, OnJoint, Spring, ViscousFriction
from jaxidl.errors import EffectError, ModelError
from jaxidl.systems.mujoco_body import mujoco_body
from jaxidl.systems.plant import Plant
from jaxidl.systems.record import read_record

LARGEST = 1e30  # kg, m and their products: beyond it single precision ends


class Model(NamedTuple):
    """A plant read from a file. ``plant.body`` is a :class:`MujocoBody`; ``notes`` say what of the file plays no part."""

    plant: Plant
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    notes: tuple[str, ...]
    path: Path

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's torque: N or Nm."""
        return tuple("N" if kind == "slide" else "Nm" for kind in self.kinds)


def read_model(path: str | Path) -> Model:
    """Read an MJCF or URDF file of slides and hinges, and the ``effects.json`` beside it if that belongs to it.

    Joint damping, friction loss and stiffness become ``viscous_friction``, ``coulomb_friction`` and ``spring`` effects. Torques
    are joint torques: actuators, contacts, joint limits and sensors play no part, and a note says so.

    Raises:
        ModelError: if the file or its ``effects.json`` cannot be read, or if the file has what would be silently dropped: other
            joints, equality constraints, tendons, gravity compensation, fluid forces, polynomial damping or stiffness, inertia or
            damping of actuators, plugins, springs or friction that a flag switches off.
    """
    path = Path(path)
    with quietly() as said:
        spec = load_spec(path)
        _refuse(spec, path)
        model = compile_spec(spec, path)
        try:
            body = mujoco_body(model)
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(f"{path} to have a rigid body", f"'{_one_line(error)}'", "mend its masses and inertias") from None
        _check_inertia(body.source, path)
    effects = (*_effects(model, path), *(entry.effect for entry in read_record(path, model.njnt) if not entry.in_mjcf))
    return Model(Plant(body, effects), body.names, body.kinds, (*_notes(model), *said), path)


@contextlib.contextmanager
def quietly() -> Iterator[list[str]]:
    """MuJoCo's warnings, collected instead of printed or written into a file of the present folder."""
    said: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(said.append)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield said
        said += [" ".join(f"MuJoCo: {warning.message}".split()) for warning in caught]
        said[:] = list(dict.fromkeys(said))
    finally:
        mujoco.set_mju_user_warning(before)


def load_spec(path: Path) -> mujoco.MjSpec:
    """MuJoCo's editable model, with bodies kept that are welded to others. Raises :class:`ModelError` with MuJoCo's own words."""
    if not path.is_file():
        raise ModelError(f"a MJCF or URDF file at {path}", "a folder" if path.is_dir() else "no such file", "correct the path")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError, UnicodeError) as error:
        raise ModelError(f"{path} to be MJCF or URDF", f"'{_one_line(error)}'", "mend the file; MuJoCo must load it") from None
    spec.compiler.fusestatic = False
    return spec


def compile_spec(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """The compiled model. Raises :class:`ModelError` with MuJoCo's own words if it does not compile."""
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"{path} to compile", f"'{_one_line(error)}'", "mend the file; MuJoCo must load it") from None


def _check_inertia(model: mujoco.MjModel, path: Path) -> None:
    """Complain unless all that moves is finite, and the inertia matrix positive definite, whatever the units of its rows."""
    data, inertia, weight = mujoco.MjData(model), np.zeros((model.nv, model.nv)), np.zeros(model.nv)
    for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_crb, mujoco.mj_comVel):
        stage(model, data)
    mujoco.mj_fullM(model, data, inertia)
    mujoco.mj_rne(model, data, 0, weight)
    places = model.body_pos, model.body_ipos, model.jnt_pos, model.qpos0
    if not all(np.abs(numbers).max() < LARGEST for numbers in (inertia, weight, *places)):  # NaN fails too
        remedy = "correct its masses, lengths and gravity"
        raise ModelError(f"{path} to have lengths, inertia and weight below {LARGEST:g}", "a number that is not", remedy)
    size = np.sqrt(np.maximum(np.diag(inertia), 1.0 / LARGEST))
    if np.linalg.eigvalsh(inertia / size / size[:, None]).min() <= 1e-12:
        remedy = "give its body a mass, or the joint armature"
        raise ModelError(f"{path} to have inertia at every joint", "a joint without any", remedy)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]


def _refuse(spec: mujoco.MjSpec, path: Path) -> None:
    """Complain about the first thing that would otherwise be dropped in silence."""
    moving = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    flags = mujoco.mjtDisableBit
    off = spec.option.disableflags & int(
        flags.mjDSBL_SPRING | flags.mjDSBL_DAMPER | flags.mjDSBL_FRICTIONLOSS | flags.mjDSBL_CONSTRAINT
    )
    polynomial = any(np.any(j.damping[1:]) or np.any(j.stiffness[1:]) for j in spec.joints)
    dashpot = any(np.any(np.asarray(j.springdamper) != 0) for j in spec.joints)
    geared = any(np.any(a.armature) or np.any(a.damping) for a in spec.actuators)
    other = any(j.type not in moving for j in spec.joints)
    complaints = (
        (not spec.joints, "at least one joint", "none", "give the model its joints"),
        (other, "slide and hinge joints", "a free or ball joint", "fix the base"),
        (spec.equalities, "no equality constraints", f"{len(spec.equalities)}", "remove them; loops are not supported"),
        (spec.tendons, "no tendons", f"{len(spec.tendons)}", "remove them"),
        (spec.flexes, "no soft bodies", f"{len(spec.flexes)}", "remove them"),
        (spec.plugins, "no plugins", f"{len(spec.plugins)}", "remove them"),
        (polynomial, "linear damping and stiffness", "polynomial ones", "keep the first coefficient"),
        (dashpot, "no springdamper", "one", "give stiffness and damping"),
        (geared, "no actuator with armature or damping", "one", "give them to its joint"),
        (any(b.gravcomp for b in spec.bodies), "no gravity compensation", "gravcomp", "add its torque to the log's instead"),
        (spec.option.density or spec.option.viscosity, "no fluid", "density or viscosity", "remove them; drag is an effect"),
        (off, "no flag that switches springs, dampers or friction off", "one", "set their values to zero instead"),
    )
    for wrong, expected, got, remedy in complaints:
        if wrong:
            raise ModelError(f"{path} to have {expected}", got, remedy)


def _effects(model: mujoco.MjModel, path: Path) -> list[Effect]:
    """What the joints have beside inertia, as effects."""
    found = []
    for j in range(model.njnt):
        damping, loss, stiffness = model.dof_damping[j], model.dof_frictionloss[j], model.jnt_stiffness[j]
        if damping:
            found.append(OnJoint(ViscousFriction(jnp.array([damping])), j, model.njnt))
        if loss:
            found.append(OnJoint(CoulombFriction(jnp.array([loss])), j, model.njnt))
        if stiffness:
            found.append(OnJoint(Spring(jnp.array([stiffness]), jnp.array([model.qpos_spring[j]])), j, model.njnt))
    try:
        return [effect.check() for effect in found]
    except EffectError as error:
        raise ModelError(f"{path} to have possible friction and springs", str(error), "correct the joint") from None


def _notes(model: mujoco.MjModel) -> list[str]:
    """What of the model plays no part."""
    notes = []
    if model.nu:
        notes.append("the model's actuators play no part: the log's torques are taken as joint torques")
    if model.jnt_limited.any():
        notes.append("joint limits play no part")
    return notes
