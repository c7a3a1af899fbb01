"""Files that a model refers to.

The dynamics need none of them, except where an inertia is inferred from a mesh.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from pathlib import Path

import mujoco
import numpy as np

from jaxidl.errors import ModelError

MESHES = (".stl", ".obj", ".msh")  # formats that MuJoCo reads


def drop_missing(spec: mujoco.MjSpec, path: Path, urdf: bool) -> list[str]:
    """Remove meshes, height fields, skins and textures whose files are missing.

    The geometry made of them is removed too. A link of a URDF file has the mass given by its
    ``<inertial>``, whether or not its shape is there.

    Returns:
        Notes on what was removed.

    Raises:
        ModelError: if the inertia of a body that moves was to be inferred from a missing file.
    """
    notes = _weightless(spec) if urdf else []
    shapes = spec.compiler.meshdir
    gone = {
        mesh.name: mesh
        for mesh in spec.meshes
        if mesh.file and not _usable(spec, path, shapes, mesh.file)
    }
    fields = {
        field.name: field
        for field in spec.hfields
        if field.file and not _there(spec, path, shapes, field.file)
    }
    for geom in list(spec.geoms):
        mesh = geom.meshname in gone and geom.type in (mujoco.mjtGeom.mjGEOM_MESH, *_FITTED)
        if mesh or geom.hfieldname in fields:
            if mesh and _weighs(spec, geom) and _moves(geom.parent):
                file, name = gone[geom.meshname].file, _called(geom.parent)
                remedy = "give it an <inertial>, or provide the file"
                raise ModelError(
                    f"{path} to have the inertia of body {name}",
                    f"a mesh {file} that cannot be read",
                    remedy,
                )
            spec.delete(geom)
    skins = [skin for skin in spec.skins if skin.file and not _there(spec, path, shapes, skin.file)]
    count = len(gone) + len(fields) + len(skins)
    for element in (*gone.values(), *fields.values(), *skins):
        spec.delete(element)
    if count:
        notes.append(
            f"{count} mesh file{'s' * (count > 1)} not found or not readable: left out, the"
            " dynamics need no geometry"
        )
    if textures := [
        t
        for t in spec.textures
        if any(f and not _there(spec, path, spec.compiler.texturedir, f) for f in _files(t))
    ]:
        names = {texture.name for texture in textures}
        for material in spec.materials:
            material.textures = ["" if name in names else name for name in material.textures]
        for texture in textures:
            spec.delete(texture)
        notes.append(f"{len(textures)} texture file{'s' * (len(textures) > 1)} not found: left out")
    return notes


_FITTED = (
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_ELLIPSOID,
    mujoco.mjtGeom.mjGEOM_CYLINDER,
    mujoco.mjtGeom.mjGEOM_BOX,
)  # these primitives may be fitted to a mesh


def _weightless(spec: mujoco.MjSpec) -> list[str]:
    """Keep MuJoCo from inferring masses that a URDF file does not give."""
    named = []
    for body in spec.bodies[1:]:
        if not body.explicitinertial and body.geoms:
            for geom in body.geoms:
                geom.mass = 0.0
            if _moves(body):
                named.append(body.name)
    return [f"link {name} has a shape but no <inertial>: it has no mass" for name in named]


def _called(body: mujoco.MjsBody) -> str:
    """Return how to refer to a body."""
    return body.name or next(
        (f"of joint {joint.name}" for joint in body.joints if joint.name), "without a name"
    )


def _files(texture: mujoco.MjsTexture) -> list[str]:
    return [texture.file, *texture.cubefiles]


def _usable(spec: mujoco.MjSpec, path: Path, folder: str, file: str) -> bool:
    return Path(file).suffix.lower() in MESHES and _there(spec, path, folder, file)


def _there(spec: mujoco.MjSpec, path: Path, folder: str, file: str) -> bool:
    """Return whether the file is where MuJoCo looks for it."""
    try:
        return (path.parent / folder / (Path(file).name if spec.strippath else file)).is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Return whether a geom's mass is part of its body's."""
    infer = spec.compiler.inertiafromgeom
    if infer == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE:
        return False
    if infer == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO and geom.parent.explicitinertial:
        return False
    lowest, highest = spec.compiler.inertiagrouprange
    return bool(
        lowest <= geom.group <= highest
        and (geom.mass > 0.0 or (np.isnan(geom.mass) and geom.density > 0.0))
    )


def _moves(body: mujoco.MjsBody) -> bool:
    while body is not None and body.name != "world":
        if body.joints:
            return True
        body = body.parent
    return False
