"""MJCF and URDF files: a rigid body, and the effects that the file contains."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import contextlib
import tempfile
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco

from jaxidl.effects import CATALOGUE, Effect, OnJoint
from jaxidl.errors import EffectError, ModelError
from jaxidl.systems.attributes import Numbers
from jaxidl.systems.flange import check_flange
from jaxidl.systems.loading import load_part, one_line, quietly
from jaxidl.systems.masses import bare, compile_spec
from jaxidl.systems.mujoco_body import joint_names, mujoco_body
from jaxidl.systems.plant import Plant
from jaxidl.systems.record import EFFECTS, Entry, read_record
from jaxidl.systems.refusals import check_inertia, refuse


class Model(NamedTuple):
    """A plant read from a file.

    ``plant.body`` is a :class:`MujocoBody`; ``notes`` list what was ignored or changed.
    """

    plant: Plant
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    notes: tuple[str, ...]
    path: Path
    part: tuple[str, ...] | None = None  # names of the requested joints; None: all
    # [m or rad] requested positions of locked joints, by name
    locked: Mapping[str, float] | None = None
    flange: str | None = None  # name of the body that was requested to carry a payload
    # contents of the file and of effects.json when they were read, by name
    files: Mapping[str, bytes] | None = None

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's torque: N or Nm."""
        return tuple("N" if kind == "slide" else "Nm" for kind in self.kinds)


def read_model(
    path: str | Path,
    joints: Sequence[str] | None = None,
    locked: Mapping[str, float] | None = None,
    flange: str | None = None,
) -> Model:
    """Read an MJCF or URDF file of slides and hinges, and the ``effects.json`` beside it.

    The latter is read only if it belongs to the file. Joint damping, friction loss and stiffness
    become ``viscous_friction``, ``coulomb_friction`` and ``spring`` effects. Torques are joint
    torques: actuators, contacts, joint limits and sensors are ignored, and a note says so. Notes
    also say what was left out or changed: missing meshes, links without mass, impossible moments of
    inertia, joints that mimic others.

    Args:
        path: the file.
        joints: names of the joints that move, in any order; the model has them in the order of the
            file. The others are locked. Default: all.
        locked: positions [m or rad] of locked joints, by name. Default: as in the file.
        flange: name of the body that carries a payload. Default: as in the file, or the last that
            moves; see :mod:`jaxidl.systems.flange`.

    Raises:
        ModelError: if the file or its ``effects.json`` cannot be read, if it has no such joints, or
            if the file contains something that would otherwise be dropped silently: other joints,
            other equality constraints, tendons, gravity compensation, fluid forces, polynomial
            damping or stiffness, inertia or damping of actuators, plugins, springs or friction that
            a flag switches off.
    """
    path, files = Path(path), contents(Path(path))
    with quietly() as said:
        part = None if joints is None else tuple(joints)
        spec, changed = load_part(path, part, locked, flange)
        refuse(spec, path)
        model = compile_spec(spec, path)
        check_flange(model, path)
        whole = None
        if any("it follows" in note for note in changed):
            whole = compile_spec(load_part(path, part, locked, flange, follow=True)[0], path)
        try:
            body = mujoco_body(model, whole)
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(
                f"{path} to have a rigid body",
                f"'{one_line(error)}'",
                "correct its masses and inertias",
            ) from None
        check_inertia(bare(body.source), path)
    effects = (
        *_effects(model, path),
        *(e.effect for e in _recorded(path, model.njnt, part) if not e.in_mjcf),
    )
    notes = (*changed, *_notes(model), *said)
    return Model(
        Plant(body, effects), body.names, body.kinds, notes, path, part, locked, flange, files
    )


def contents(path: Path) -> dict[str, bytes]:
    """Return the contents of a model's file and of the ``effects.json`` beside it, by name.

    Files that do not exist are left out.
    """
    found = {}
    for file in (path, path.with_name(EFFECTS)):
        with contextlib.suppress(OSError):
            found[file.name] = file.read_bytes()
    return found


@contextlib.contextmanager
def as_read(model: Model) -> Generator[Path]:
    """Give the path of the model's file as it was read.

    It is the file itself or, if that has changed or is gone, a temporary copy. Beside the copy is
    everything else that the original folder contains now.
    """
    files = model.files or {}
    if model.path.name not in files or contents(model.path) == files:
        yield model.path
        return
    with tempfile.TemporaryDirectory() as folder:
        if model.path.parent.is_dir():
            for file in model.path.absolute().parent.iterdir():
                if file.name not in (model.path.name, EFFECTS):
                    Path(folder, file.name).symlink_to(file)
        for name, content in files.items():
            Path(folder, name).write_bytes(content)
        yield Path(folder, model.path.name)


def _recorded(path: Path, joints: int, part: Sequence[str] | None) -> list[Entry]:
    """Return entries of ``effects.json`` beside the model.

    Those of a whole robot do not fit a part of it.
    """
    try:
        return read_record(path, joints)
    except ModelError as error:
        if part is None:
            raise
        remedy = f"move {EFFECTS} away, or use all joints"
        raise ModelError(
            f"{path.with_name(EFFECTS)} for the chosen joints", error.got, remedy
        ) from None


def names_of(path: str | Path) -> tuple[str, ...]:
    """Return names (J,) of all joints of an MJCF or URDF file, in its order.

    Joints that mimic others are left out.

    Raises:
        ModelError: if the file cannot be read, or has no joint.
    """
    with quietly():
        spec, _ = load_part(Path(path), None, None)
        names = joint_names(compile_spec(spec, Path(path)))
    if not names:
        expected, remedy = f"a slide or a hinge in {Path(path).name}", "name the robot's model"
        raise ModelError(expected, "no joint", remedy)
    return names


def _effects(model: mujoco.MjModel, path: Path) -> list[Effect]:
    """Return what the joints have in addition to inertia, as effects."""
    numbers = Numbers(model)
    own = (
        (j, cls.read_mjcf(numbers.own(j))) for j in range(model.njnt) for cls in CATALOGUE.values()
    )
    found = []
    for joint, effect in own:
        if effect is None:
            continue
        try:
            found.append(OnJoint(effect, joint, model.njnt).check())
        except EffectError as error:
            raise ModelError(
                f"{path} to have physically possible friction and springs",
                str(error),
                f"correct the joint {joint_names(model)[joint]}",
            ) from None
    return found


def _notes(model: mujoco.MjModel) -> list[str]:
    """Return notes on the parts of the model that are ignored."""
    notes = []
    if model.nu:
        notes.append(
            "the model's actuators are ignored: the log's torques are taken as joint torques"
        )
    if model.jnt_limited.any():
        notes.append("joint limits are ignored")
    return notes
