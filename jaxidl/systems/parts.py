"""A part of a robot: joints that are not named are locked, as are joints that mimic another."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

from jaxidl.errors import ModelError
from jaxidl.systems.masses import compile_spec, few
from jaxidl.systems.mujoco_body import joint_names

_MOVING = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))


def take_part(
    spec: mujoco.MjSpec,
    path: Path,
    wanted: Sequence[str] | None,
    locked: Mapping[str, float],
    follow: bool = False,
) -> list[str]:
    """Lock the joints of a spec that are not ``wanted``, and those that mimic another one.

    ``wanted`` None means all. In MJCF a joint mimics another by an equality constraint.

    Args:
        locked: positions [m or rad] at which joints are locked, by name; the others as in the file.
            A joint that mimics another is locked where that one is locked, or where it is in the
            file.
        follow: keep those that are proportional to one that moves, with their constraint.

    Returns:
        Notes on what was locked.

    Raises:
        ModelError: for names that the file does not have, or a joint that cannot be locked there.
    """
    mimics = [e for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT and e.name2]
    if wanted is None and not mimics:
        return []
    model = compile_spec(spec, path)
    names = joint_names(model)
    _known(wanted, names, path)
    ties = {e.name1: (e.name2, np.array(e.data[:5], float)) for e in mimics}
    if wrong := [name for name in wanted or () if name in ties]:
        got = f"{wrong[0]}, which mimics {ties[wrong[0]][0]}"
        raise ModelError(
            f"joints of {path} that move freely",
            got,
            "leave it out, then it is locked, or remove its <mimic> or <equality>",
        )
    moving = {name for name in names if name not in ties and (wanted is None or name in wanted)}
    if not moving:
        raise ModelError(
            f"{path} to have a joint that moves",
            "only joints that mimic others",
            "remove a <mimic> or <equality>",
        )
    followers = {n for n, (of, p) in ties.items() if of in moving and not np.any(p[2:])}
    kept = followers if follow else set[str]()
    where, notes = {}, []
    for j, name in enumerate(names):
        if name in moving or name in kept:
            continue
        kind, reference = int(model.jnt_type[j]), float(model.qpos0[model.jnt_qposadr[j]])
        where[name] = float(locked.get(name, reference)) if kind in _MOVING else reference
        if name in ties and name not in locked:
            master, polynomial = ties[name]
            zero = float(model.qpos0[model.joint(master).qposadr[0]])
            turned = locked.get(master, zero) - zero
            where[name] = reference + float(np.polynomial.Polynomial(polynomial)(turned))
    # removed joints must not be referred to; the numbers are still those of the compiled model
    joints = {names[joint.id]: joint for joint in spec.joints}
    for name, at in where.items():
        _lock(joints, names.index(name), names, at, model, path)
    for mimic in mimics:  # first, because deleting an element twice crashes
        if mimic.name1 not in kept:
            spec.delete(mimic)
    _forget(spec, {joints[name].name for name in where})
    for name in where:
        spec.delete(joints[name])
    if free := [f"{name} at {at:.4g}" for name, at in where.items() if name not in ties]:
        notes.append(f"locked, because they were not chosen or not logged: {few(free)}")
    for name, (master, _) in ties.items():
        ignored = f"its own motion is ignored, it is locked at {where.get(name, 0.0):.4g}"
        notes.append(
            f"joint {name} mimics {master}: {'it follows' if name in followers else ignored}"
        )
    return notes


def fixed_in_urdf(path: Path, wanted: Sequence[str] | None) -> tuple[str | None, list[str]]:
    """Return the text of a URDF file with floating and planar joints fixed, and notes.

    The text is None where the file has no such joint.

    Raises:
        ModelError: if such a joint is wanted.
    """
    try:
        root = ET.fromstring(path.read_bytes())
    except (ET.ParseError, ValueError, LookupError):
        return None, []  # MuJoCo will report what is wrong
    loose = [
        joint for joint in root.iterfind("joint") if joint.get("type") in ("floating", "planar")
    ]
    for joint in loose:
        name, kind = joint.get("name", "without a name"), joint.get("type")
        if wanted is None or name in wanted:
            remedy = (
                'write type="fixed" if it does not move in the log, or give only the joints that do'
                " (--joints)"
            )
            raise ModelError(
                f"joints of {path} to be revolute, continuous, prismatic or fixed",
                f"{name}, {kind}",
                remedy,
            )
        joint.set("type", "fixed")
    notes = (
        [
            "fixed, because they were not chosen or not logged:"
            f" {few([j.get('name', '') for j in loose])}"
        ]
        if loose
        else []
    )
    return ET.tostring(root, encoding="unicode") if loose else None, notes


def _known(wanted: Sequence[str] | None, names: Sequence[str], path: Path) -> None:
    if wanted is None:
        return
    if not wanted:
        raise ModelError(f"at least one joint of {path}", "none", f"name some of {few(names, 20)}")
    for i, name in enumerate(wanted):
        if name not in names:
            raise ModelError(
                f"a joint of {path}", repr(name)[:100], f"choose among {few(names, 20)}"
            )
        if name in wanted[:i]:
            raise ModelError(f"each joint of {path} once", f"{name} twice", "name it once")


def _lock(
    joints: Mapping[str, mujoco.MjsJoint],
    j: int,
    names: Sequence[str],
    at: float,
    model: mujoco.MjModel,
    path: Path,
) -> None:
    """Move a joint's body to where the joint is at ``at`` [m or rad].

    The joint itself stays, and must be removed.
    """
    if int(model.jnt_type[j]) not in _MOVING or at == model.qpos0[model.jnt_qposadr[j]]:
        return
    joint = joints[names[j]]
    body, move = joint.parent, at - model.qpos0[model.jnt_qposadr[j]]
    others = [i for i in np.flatnonzero(model.jnt_bodyid == model.jnt_bodyid[j]) if i != j]
    plain = body.alt.type == mujoco.mjtOrientation.mjORIENTATION_QUAT
    if not plain or others or not np.isfinite(at):
        remedy = (
            "give its body a quat and no other joint, or lock it at"
            f" {model.qpos0[model.jnt_qposadr[j]]:g}"
        )
        raise ModelError(
            f"joint {names[j]} of {path} to be locked at {at:g}",
            "a body with another kind of orientation, or with other joints",
            remedy,
        )
    rotation, shift = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)  # of the body, in its own frame
    if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE:
        shift = move * model.jnt_axis[j]
    else:
        mujoco.mju_axisAngle2Quat(rotation, model.jnt_axis[j], move)
        anchor = model.jnt_pos[j]
        mujoco.mju_rotVecQuat(shift, anchor, rotation)
        shift = anchor - shift
    turned, moved = np.zeros(4), np.zeros(3)
    mujoco.mju_rotVecQuat(moved, shift, np.asarray(body.quat, float))
    mujoco.mju_mulQuat(turned, np.asarray(body.quat, float), rotation)
    body.pos, body.quat = np.asarray(body.pos, float) + moved, turned


def _forget(spec: mujoco.MjSpec, gone: set[str]) -> None:
    """Remove elements that refer only to joints that are ``gone``.

    Elements that also act on others stay, for the caller to refuse.
    """
    tendons = [t for t in spec.tendons if len(t.path) and all(_of(wrap) in gone for wrap in t.path)]
    strings = {tendon.name for tendon in tendons}
    actuators = [
        a
        for a in spec.actuators
        if (a.trntype in _ON_JOINTS and a.target in gone)
        or (a.trntype == mujoco.mjtTrn.mjTRN_TENDON and a.target in strings)
    ]
    drives = {actuator.name for actuator in actuators}
    lost = {
        mujoco.mjtObj.mjOBJ_JOINT: gone,
        mujoco.mjtObj.mjOBJ_TENDON: strings,
        mujoco.mjtObj.mjOBJ_ACTUATOR: drives,
    }
    sensors = [s for s in spec.sensors if s.objname in lost.get(s.objtype, ())]
    for element in (*sensors, *_moot(spec, gone, strings), *actuators, *tendons, *spec.keys):
        spec.delete(element)


def _moot(spec: mujoco.MjSpec, gone: set[str], tendons: set[str]) -> list[mujoco.MjsEquality]:
    """Return constraints between parts that no longer move against each other."""
    found, kinds = [], mujoco.mjtEq
    for equality in spec.equalities:
        names = {equality.name1, equality.name2} - {""}
        if equality.type in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
            sites = equality.objtype == mujoco.mjtObj.mjOBJ_SITE
            bodies = [spec.site(name).parent if sites else spec.body(name) for name in names]
            moot = (
                len(
                    {
                        _carrier(body, gone)
                        for body in (*bodies, *[spec.worldbody] * (len(names) == 1))
                    }
                )
                == 1
            )
        else:
            moot = names <= {kinds.mjEQ_JOINT: gone, kinds.mjEQ_TENDON: tendons}.get(
                equality.type, set()
            )
        if moot:
            found.append(equality)
    return found


def _carrier(body: mujoco.MjsBody | None, gone: set[str]) -> str | None:
    """Return the name of a joint of the body that carries this one, without joints ``gone``.

    None if nothing moves it.
    """
    while body is not None and body.name != "world":
        if left := [joint.name for joint in body.joints if joint.name not in gone]:
            return left[0]
        body = body.parent
    return None


_ON_JOINTS = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)


def _of(wrap: mujoco.MjsWrap) -> str | None:
    """Return the name of the joint that a tendon acts on there."""
    target = wrap.target
    return target.name if isinstance(target, mujoco.MjsJoint) else None
