"""A compiled model and its changes, as MJCF text in full precision.

MuJoCo rewrites the user's file, with six digits and, where frames are nested, in another order;
the values that the dynamics depend on are then rewritten at full precision and put back into their
order.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from jaxidl.effects.spec import Motor
from jaxidl.errors import ModelError
from jaxidl.systems.attributes import Numbers, Principal
from jaxidl.systems.mjcf import Model, compile_spec
from jaxidl.systems.mujoco_body import joint_names

MOTOR = "jaxidl_motor_"  # followed by the joint's number
HARD = "0.99 0.99 0.001"  # solimp of dry friction: by default a resting joint creeps
_NAMELESS = "jaxidl_body_"  # temporary name of a nameless body, to find its element
_FILES = ("file", *(f"file{side}" for side in ("right", "left", "up", "down", "front", "back")))
# settings of the compiler that concern masses
_OF_MASSES = ("inertiafromgeom", "settotalmass", "boundmass", "boundinertia", "balanceinertia")


def prepared(spec: mujoco.MjSpec, model: Model) -> mujoco.MjModel:
    """Compile, with a name for every body and joint and without the motors of an earlier patch.

    Those are created again.

    Raises:
        ModelError: if the joints are no longer those that ``model`` had when it was read.
    """
    for actuator in [a for a in spec.actuators if a.name.startswith(MOTOR)]:
        spec.delete(actuator)
    body: Any = model.plant.body
    names, following = joint_names(compile_spec(spec, model.path)), body.following
    own = names if following is None else tuple(names[j] for j in following.own)
    if own != model.names:
        raise ModelError(
            f"{model.path} to have joints {', '.join(model.names)}",
            ", ".join(own),
            "read the model again",
        )
    taken = {joint.name for joint in spec.joints}
    for joint in spec.joints:
        joint.name = joint.name or _free(names[joint.id], taken)
    for body in spec.bodies:
        body.name = body.name or f"{_NAMELESS}{body.id}"
    return compile_spec(spec, model.path)


def rewritten(
    spec: mujoco.MjSpec,
    compiled: mujoco.MjModel,
    numbers: Numbers,
    drives: Sequence[Motor],
    path: Path,
) -> str:
    """Return a prepared model as text.

    Args:
        spec: the model as :func:`prepared` left it.
        compiled: what it was compiled to.
        numbers: what its joints and bodies shall have.
        drives: a motor for each joint, or none.
        path: the model's file; meshes and textures are named by absolute paths.

    Raises:
        ModelError: if the text has other joints or masses.
    """
    root = ET.fromstring(spec.to_xml())
    _point_to_assets(root, spec, path.parent)
    _write_gravity(root, numbers)
    _write_bodies(root, compiled, numbers)
    _write_motors(root, [compiled.joint(j).name for j in numbers.joints], drives)
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode") + "\n"
    _check(text, compiled, numbers, path)
    return text


def _point_to_assets(root: ET.Element, spec: mujoco.MjSpec, folder: Path) -> None:
    """Name files by absolute paths, and drop settings that no longer apply.

    These would be applied to what is written out in full.
    """
    for element in root.iterfind("asset/*"):
        place = spec.compiler.texturedir if element.tag == "texture" else spec.compiler.meshdir
        for key in _FILES:
            if file := element.get(key):
                element.set(
                    key,
                    str((folder / place / (Path(file).name if spec.strippath else file)).resolve()),
                )
    for compiler in root.iterfind("compiler"):
        for key in (*_OF_MASSES, "meshdir", "texturedir", "strippath"):
            compiler.attrib.pop(key, None)


def _write_gravity(root: ET.Element, numbers: Numbers) -> None:
    option = root.find("option")
    if option is None:
        root.insert(0, option := ET.Element("option"))
    option.set("gravity", _text(numbers.rigid.gravity))


def _write_bodies(root: ET.Element, model: mujoco.MjModel, numbers: Numbers) -> None:
    """Write bodies in the model's order, outside their frames, with full precision.

    Payloads go to the last body that moves.
    """
    world = root.find("worldbody")
    assert world is not None  # the model has joints
    parents = {child: parent for parent in root.iter() for child in parent}
    changed = numbers.rigid.bodies()
    elements = {element.get("name"): element for element in world.iter("body")}
    bodies = [world, *(elements[model.body(b).name] for b in range(1, model.nbody))]
    joints = {element.get("name"): element for element in world.iter("joint")}
    for b in range(1, model.nbody):
        body = bodies[b]
        _take_out(body, parents, "childclass")
        bodies[model.body_parentid[b]].append(body)
        _write_pose(body, model.body_pos[b], model.body_quat[b])
        place = _write_inertial(body, model, changed.get(b), b)
        for j in np.flatnonzero(model.jnt_bodyid == b):
            joint = joints[model.joint(j).name]
            _take_out(joint, parents, "class")
            body.insert(place, joint)
            _write_joint(joint, model, numbers, int(j))
            place += 1
        if str(body.get("name")).startswith(_NAMELESS):
            del body.attrib["name"]
    taken = {model.body(b).name for b in range(model.nbody)}
    for load in numbers.rigid.carried():
        carried = ET.SubElement(bodies[numbers.rigid.flange], "body", name=_free("payload", taken))
        carried.append(_inertial(load))


def _take_out(element: ET.Element, parents: dict[ET.Element, ET.Element], inherits: str) -> None:
    """Remove an element from its parent, keeping the class that the frames around it gave it."""
    parent = above = parents[element]
    while above.tag == "frame":
        if (
            inherits not in element.attrib
            and "class" not in element.attrib
            and "childclass" in above.attrib
        ):
            element.set(inherits, above.attrib["childclass"])
        above = parents[above]
    parent.remove(element)
    while parent.tag == "frame" and len(parent) == 0:
        parent, emptied = parents[parent], parent
        parent.remove(emptied)


def _write_pose(element: ET.Element, pos: np.ndarray, quat: np.ndarray) -> None:
    for key, value, neutral in (
        ("pos", pos, np.zeros(3)),
        ("quat", quat, np.array([1.0, 0.0, 0.0, 0.0])),
    ):
        if key in element.attrib or np.any(value != neutral):
            element.set(key, _text(value))


def _write_inertial(
    body: ET.Element, model: mujoco.MjModel, changed: Principal | None, b: int
) -> int:
    """Write a body's mass if it has any; return the index behind it."""
    now = changed or Principal(
        model.body_mass[b], model.body_ipos[b], model.body_iquat[b], model.body_inertia[b]
    )
    before = body.find("inertial")
    if before is not None:
        body.remove(before)
    elif now.mass == 0.0:
        return 0
    body.insert(0, _inertial(now))
    return 1


def _inertial(of: Principal) -> ET.Element:
    inertial = ET.Element("inertial", pos=_text(of.pos))
    _write_pose(inertial, of.pos, of.quat)
    inertial.attrib |= {"mass": _text(of.mass), "diaginertia": _text(of.diag)}
    return inertial


def _write_joint(joint: ET.Element, model: mujoco.MjModel, numbers: Numbers, j: int) -> None:
    """Write a joint's numbers.

    Zeros are written too where the default or the previous value is not zero.
    """
    was = Numbers(model)
    for key in ("damping", "frictionloss", "stiffness", "springref", "armature"):
        value = getattr(numbers, key)[j]
        if key in joint.attrib or value != 0.0 or getattr(was, key)[j] != 0.0:
            joint.set(key, _text(value))
    if numbers.frictionloss[j] > was.frictionloss[j] and "solreffriction" not in joint.attrib:
        # the stiffest that MuJoCo accepts
        joint.set("solreffriction", _text([2.0 * model.opt.timestep, 1.0]))
        joint.set("solimpfriction", HARD)
    for key, value, neutral in (
        ("pos", model.jnt_pos[j], 0.0),
        ("axis", model.jnt_axis[j], None),
        ("ref", model.qpos0[j], 0.0),
    ):
        if key in joint.attrib or np.any(value != neutral):
            joint.set(key, _text(value))


def _write_motors(root: ET.Element, names: Sequence[str], drives: Sequence[Motor]) -> None:
    """Write a motor for each joint; its lag is exact for a command held over a step."""
    if not drives:
        return
    section = root.find("actuator")
    section = ET.SubElement(root, "actuator") if section is None else section
    for j, motor in enumerate(drives):
        general = {
            "name": f"{MOTOR}{j}",
            "joint": names[j],
            "gear": _text(motor.gear),
            "ctrllimited": "false",
        }
        general |= {
            "gaintype": "fixed",
            "gainprm": "1",
            "biastype": "none",
            "forcelimited": "false",
            "dyntype": "none",
        }
        if np.isfinite(motor.force):
            general |= {"forcelimited": "true", "forcerange": _text([-motor.force, motor.force])}
        if motor.lag:
            general |= {"dyntype": "filterexact", "dynprm": _text(motor.lag), "actearly": "true"}
        ET.SubElement(section, "general", general)


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _text(values: Any) -> str:
    """Return numbers as text that reads back exactly."""
    return " ".join(repr(float(x)).removesuffix(".0") for x in np.ravel(values))


def _check(text: str, model: mujoco.MjModel, numbers: Numbers, path: Path) -> None:
    """Read the text back: it must compile, with the same joints and the same mass."""
    spec = mujoco.MjSpec.from_string(text)
    again = compile_spec(spec, path)
    mass = numbers.rigid.links[:, 0].sum() + sum(load[0] for load in numbers.rigid.loads)
    if joint_names(again) != joint_names(model) or not np.isclose(
        again.body_mass.sum(), mass, rtol=1e-9
    ):
        raise ModelError(
            f"{path} to keep its joints and masses when MuJoCo writes it",
            "different joints or masses",
            "write the model without frames",
        )
