"""MuJoCo's editable model of an MJCF or URDF file, changed where needed so that it compiles."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import contextlib
import re
import warnings
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path

import mujoco

from jaxidl.errors import ModelError
from jaxidl.systems.assets import drop_missing
from jaxidl.systems.flange import name_flange
from jaxidl.systems.masses import accept_masses
from jaxidl.systems.parts import fixed_in_urdf, take_part


@contextlib.contextmanager
def quietly() -> Generator[list[str]]:
    """Collect MuJoCo's warnings.

    They are not printed or written to a file in the current folder.
    """
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


def load_part(
    path: Path,
    joints: Sequence[str] | None,
    locked: Mapping[str, float] | None,
    flange: str | None = None,
    follow: bool = False,
) -> tuple[mujoco.MjSpec, list[str]]:
    """Return MuJoCo's editable model of a file, cut down to ``joints``, and notes on changes.

    It is changed where needed so that it compiles. Joints that mimic others are locked, or
    ``follow`` them.

    Raises:
        ModelError: with MuJoCo's own message, or as :func:`read_model`.
    """
    if not path.is_file():
        raise ModelError(
            f"an MJCF or URDF file at {path}",
            "a folder" if path.is_dir() else "no such file",
            "correct the path",
        )
    urdf = _is_urdf(path)
    text, notes = fixed_in_urdf(path, joints) if urdf else (None, [])
    spec = load_spec(path, text)
    notes += drop_missing(spec, path, urdf)
    notes += accept_masses(spec, path)
    notes += take_part(spec, path, joints, locked or {}, follow)
    if flange is not None:
        name_flange(spec, flange)
    return spec, notes


def load_spec(path: Path, text: str | None = None) -> mujoco.MjSpec:
    """Return MuJoCo's editable model of a file, or of ``text`` instead.

    Bodies that are welded to others are kept.

    Raises:
        ModelError: with MuJoCo's own message, if it cannot be read.
    """
    try:
        spec = (
            mujoco.MjSpec.from_file(str(path)) if text is None else mujoco.MjSpec.from_string(text)
        )
    except (ValueError, mujoco.FatalError, UnicodeError) as error:
        got, remedy = f"'{one_line(error)}'", "correct the file; MuJoCo must load it"
        if b"<sdf" in path.read_bytes()[:10_000]:
            remedy = "convert it to URDF or MJCF; SDF is not supported"
        elif "could not find decoder" in got:  # MuJoCo goes by the ending
            got = f"a file that ends in '{path.suffix}'"
            remedy = "name the robot's .xml or .urdf file"
        raise ModelError(f"{path} to be MJCF or URDF", got, remedy) from None
    if text is not None:
        spec.modelfiledir = str(path.parent)
    spec.compiler.fusestatic = False
    return spec


def _is_urdf(path: Path) -> bool:
    """Return whether the root element is ``<robot>``.

    Raises:
        ModelError: for a file that must be expanded first.
    """
    content = path.read_bytes()
    start = min(
        (at for at in (content.find(tag) for tag in (b"<robot", b"<mujoco", b"<sdf")) if at >= 0),
        default=-1,
    )
    if start < 0 or not content.startswith(b"<robot", start):
        return False
    # expanded files keep the comments of the xacro file that they were made from
    if b"<xacro:" in re.sub(rb"<!--.*?-->", b"", content, flags=re.DOTALL):
        raise ModelError(
            f"{path} to be URDF",
            "xacro, from which URDF is made",
            f"expand it: xacro {path.name} > robot.urdf",
        )
    return True


def one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
