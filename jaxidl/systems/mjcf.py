"""MJCF and URDF files: a rigid body, and the effects that the file has beside it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import mujoco
import numpy as np

from jaxidl.effects import CoulombFriction, Effect, OnJoint, Spring, ViscousFriction, from_dict
from jaxidl.errors import EffectError, ModelError
from jaxidl.systems.mujoco_body import LOAD, MujocoBody, mujoco_body
from jaxidl.systems.plant import Plant

EFFECTS = "effects.json"


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

    Joint damping, friction loss and stiffness become the effects ``viscous_friction``, ``coulomb_friction`` and ``spring``. Torques are
    joint torques: actuators, contacts, joint limits and sensors play no part, and a note says so.

    Raises:
        ModelError: if the file cannot be read, or has what would be silently dropped: other joints, equality constraints, tendons,
            gravity compensation, fluid forces, polynomial damping or stiffness.
    """
    path = Path(path)
    spec = load_spec(path)
    _refuse(spec, path)
    notes, effects = _strip(spec)
    model = compile_spec(spec, path)
    body = mujoco_body(model)
    return Model(Plant(body, (*effects, *_beside(path))), body.names, body.kinds, tuple(notes), path)


def load_spec(path: Path) -> mujoco.MjSpec:
    """MuJoCo's editable model. Raises :class:`ModelError` with MuJoCo's own words if there is none."""
    if not path.is_file():
        raise ModelError(f"a MJCF or URDF file at {path}", "a folder" if path.is_dir() else "no such file", "correct the path")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError, UnicodeError) as error:
        raise ModelError(f"{path} to be MJCF or URDF", f"'{_one_line(error)}'", "mend the file; MuJoCo must load it") from None


def compile_spec(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """The compiled model. Raises :class:`ModelError` with MuJoCo's own words if it does not compile."""
    try:
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f"{path} to compile", f"'{_one_line(error)}'", "mend the file; MuJoCo must load it") from None
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    if not np.isfinite(inertia).all() or np.linalg.eigvalsh(inertia).min() <= 0.0:
        raise ModelError(
            f"{path} to have inertia at every joint", "a joint without any", "give its body a mass, or the joint armature"
        )
    return model


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]


def _refuse(spec: mujoco.MjSpec, path: Path) -> None:
    """Complain about the first thing that would otherwise be dropped in silence."""
    moving = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    polynomial: Callable[[mujoco.MjsJoint], bool] = lambda j: bool(np.any(j.damping[1:]) or np.any(j.stiffness[1:]))  # noqa: E731
    complaints = (
        (not spec.joints, "at least one joint", "none", "give the model its joints"),
        (any(j.type not in moving for j in spec.joints), "slide and hinge joints", "a free or ball joint", "fix the base"),
        (bool(spec.equalities), "no equality constraints", f"{len(spec.equalities)}", "remove them; loops are not supported"),
        (bool(spec.tendons), "no tendons", f"{len(spec.tendons)}", "remove them"),
        (bool(spec.flexes), "no soft bodies", f"{len(spec.flexes)}", "remove them"),
        (
            any(polynomial(j) for j in spec.joints),
            "linear damping and stiffness",
            "polynomial ones",
            "keep the first coefficient",
        ),
        (
            any(np.any(np.asarray(j.springdamper) != 0) for j in spec.joints),
            "no springdamper",
            "one",
            "give stiffness and damping",
        ),
        (any(b.gravcomp for b in spec.bodies), "no gravity compensation", "gravcomp", "add its torque to the log's instead"),
        (spec.option.density or spec.option.viscosity, "no fluid", "density or viscosity", "remove them; drag is an effect"),
    )
    for wrong, expected, got, remedy in complaints:
        if wrong:
            raise ModelError(f"{path} to have {expected}", got, remedy)


def _strip(spec: mujoco.MjSpec) -> tuple[list[str], list[Effect]]:
    """Take from the model all that is not its rigid body; return notes and effects."""
    effects, joints = [], spec.joints
    for j, joint in enumerate(joints):
        on = lambda effect, j=j: OnJoint(effect, j, len(joints))  # noqa: E731
        if joint.damping[0]:
            effects.append(on(ViscousFriction(jnp.array([joint.damping[0]]))))
        if joint.frictionloss:
            effects.append(on(CoulombFriction(jnp.array([joint.frictionloss]))))
        if joint.stiffness[0]:
            effects.append(on(Spring(jnp.array([joint.stiffness[0]]), jnp.array([joint.springref]))))
        joint.damping, joint.stiffness, joint.frictionloss = np.zeros(3), np.zeros(3), 0.0
    notes = []
    if spec.actuators:
        notes.append("the model's actuators play no part: the log's torques are taken as joint torques")
    if any(joint.limited == 1 for joint in joints):
        notes.append("joint limits play no part")
    for part in (*spec.actuators, *spec.sensors, *spec.keys):
        spec.delete(part)
    last = spec.bodies[-1]
    # away from the body's origin and turned, or MuJoCo would note that the two frames are one and ignore where the load goes
    last.add_body(name=LOAD, mass=0.0, explicitinertial=True, inertia=np.zeros(3), ipos=np.ones(3), iquat=[0.8, 0.6, 0.0, 0.0])
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    return notes, effects


def _beside(path: Path) -> list[Effect]:
    """Effects of the ``effects.json`` in the model's folder that MJCF does not hold, if it was written for this model."""
    record = path.with_name(EFFECTS)
    if not record.is_file():
        return []
    try:
        content = json.loads(record.read_text())
        if content["model"] != path.name:
            return []
        return [from_dict(entry) for entry in content["effects"] if not entry.get("in_mjcf")]
    except EffectError as error:
        raise ModelError(f"{record} as the gap workflow writes it", str(error), "mend it, or remove it") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        got = f"{type(error).__name__} {_one_line(error)}"
        raise ModelError(f"{record} as the gap workflow writes it", got, "mend it, or remove it") from None
