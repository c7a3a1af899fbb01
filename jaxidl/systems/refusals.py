"""What is refused in a model's file, with what to write instead."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from pathlib import Path

import mujoco
import numpy as np

from jaxidl.errors import ModelError
from jaxidl.systems.mujoco_body import joint_names

LARGEST = 1e30  # kg, m and their products: near the limit of single precision


def check_inertia(model: mujoco.MjModel, path: Path) -> None:
    """Raise ModelError unless the moving parts are finite and the inertia matrix positive definite.

    The result does not depend on the units of its rows.
    """
    data, inertia, weight = mujoco.MjData(model), np.zeros((model.nv, model.nv)), np.zeros(model.nv)
    for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_crb, mujoco.mj_comVel):
        stage(model, data)
    mujoco.mj_fullM(model, data, inertia)
    mujoco.mj_rne(model, data, 0, weight)
    places = model.body_pos, model.body_ipos, model.jnt_pos, model.qpos0
    # NaN fails too
    if not all(np.abs(numbers).max() < LARGEST for numbers in (inertia, weight, *places)):
        remedy = "correct its masses, lengths and gravity"
        raise ModelError(
            f"{path} to have lengths, inertia and weight below {LARGEST:g}",
            "a larger number or NaN",
            remedy,
        )
    size = np.sqrt(np.maximum(np.diag(inertia), 1.0 / LARGEST))
    least, way = (part[..., 0] for part in np.linalg.eigh(inertia / size / size[:, None]))
    if least <= 1e-12:
        got = f"none at {joint_names(model)[int(np.abs(way).argmax())]}"
        remedy = (
            "give its body or a body that it carries a mass, or the joint armature, or leave it"
            " out (--joints)"
        )
        if not model.body_mass.any():
            got, remedy = (
                "no mass at all",
                "use a file with the links' masses (<inertial>); this one is for display only",
            )
        raise ModelError(f"{path} to have inertia at every joint", got, remedy)


def refuse(spec: mujoco.MjSpec, path: Path) -> None:
    """Raise ModelError for the first thing that would otherwise be dropped silently."""
    moving = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    flags = mujoco.mjtDisableBit
    off = spec.option.disableflags & int(
        flags.mjDSBL_SPRING
        | flags.mjDSBL_DAMPER
        | flags.mjDSBL_FRICTIONLOSS
        | flags.mjDSBL_CONSTRAINT
    )
    polynomial = any(np.any(j.damping[1:]) or np.any(j.stiffness[1:]) for j in spec.joints)
    dashpot = any(np.any(np.asarray(j.springdamper) != 0) for j in spec.joints)
    geared = any(np.any(a.armature) or np.any(a.damping) for a in spec.actuators)
    other = any(j.type not in moving for j in spec.joints)
    complaints = (
        (not spec.joints, "at least one joint", "none", "give the model its joints"),
        (
            other,
            "slide and hinge joints",
            "a free or ball joint",
            "fix it, or name the joints to keep (--joints)",
        ),
        (
            spec.equalities,
            "no equality constraints",
            f"{len(spec.equalities)}",
            "remove them, or name the joints to keep (--joints); loops are not supported",
        ),
        (
            spec.tendons,
            "no tendons",
            f"{len(spec.tendons)}",
            "remove them, or name the joints to keep",
        ),
        (spec.flexes, "no soft bodies", f"{len(spec.flexes)}", "remove them"),
        (spec.plugins, "no plugins", f"{len(spec.plugins)}", "remove them"),
        (
            polynomial,
            "linear damping and stiffness",
            "polynomial ones",
            "keep the first coefficient",
        ),
        (dashpot, "no springdamper", "one", "give stiffness and damping instead"),
        (geared, "no actuator with armature or damping", "one", "give them to its joint"),
        (
            any(b.gravcomp for b in spec.bodies),
            "no gravity compensation",
            "gravcomp",
            "add its torque to the log's instead",
        ),
        (
            spec.option.density or spec.option.viscosity,
            "no fluid",
            "density or viscosity",
            "remove them; drag is an effect",
        ),
        (
            off,
            "no flag that switches springs, dampers or friction off",
            "one",
            "set their values to zero instead",
        ),
    )
    for wrong, expected, got, remedy in complaints:
        if wrong:
            raise ModelError(f"{path} to have {expected}", got, remedy)
