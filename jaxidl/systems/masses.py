"""Bodies whose masses MuJoCo does not take, though the mechanism is a possible one."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import copy
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from jaxidl.errors import ModelError

LIGHT, SMALL = 1e-9, 1e-12  # [kg], [kg m^2]: of a link without any, since MuJoCo asks for more than 1e-15 of what moves


def compile_spec(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile a spec. Raises :class:`ModelError` with MuJoCo's own words if it does not compile."""
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())[:300]
        raise ModelError(f"{path} to compile", f"'{said}'", "correct the file; MuJoCo must load it") from None


def accept_masses(spec: mujoco.MjSpec, path: Path) -> list[str]:
    """Change masses that would keep a model from compiling: nearly none where there is none, and balanced inertias.

    Returns:
        Notes on what was changed.

    Raises:
        ModelError: with MuJoCo's own words, if the model does not compile all the same.
    """
    notes = []
    for words, change in (("balanceinertia", _balance), ("larger than mjMINVAL", _fill), ("balanceinertia", _balance)):
        try:
            spec.copy().compile()  # a spec whose compilation failed repeats the error at whatever is asked of it
            return notes
        except (ValueError, mujoco.FatalError) as error:
            if words in str(error):
                notes += change(spec)
    compile_spec(spec, path)
    return notes


def _balance(spec: mujoco.MjSpec) -> list[str]:
    spec.compiler.balanceinertia = True
    names = []
    for body in spec.bodies[1:]:
        a, b, c = np.sort(_moments(body))
        if body.explicitinertial and a + b < c:
            names.append(body.name or "without a name")
    of = few(names) or "a body"
    return [f"no mass has the moments of inertia of {of} (A + B < C): their mean is used for all three axes"]


def few(names: Sequence[str], most: int = 8) -> str:
    """Return names in words, the first of many."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _moments(body: mujoco.MjsBody) -> np.ndarray:
    """Principal moments (3,) [kg m^2] as the file gives them."""
    xx, yy, zz, xy, xz, yz = body.fullinertia
    if not np.isfinite(body.fullinertia).all():
        return np.asarray(body.inertia, float)
    return np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _fill(spec: mujoco.MjSpec) -> list[str]:
    names = []
    for body in spec.bodies[1:]:
        if not body.joints or (not body.explicitinertial and any(geom.mass != 0.0 for geom in body.geoms)):
            continue
        least, own = _moments(body).min(), body.mass if body.explicitinertial else 0.0
        if own < LIGHT or least < SMALL:
            names.append(body.name or "without a name")
            if own < LIGHT:
                body.mass, body.ipos = LIGHT, np.zeros(3)
            if least < SMALL:
                body.fullinertia = np.full(6, np.nan)
                body.inertia = np.maximum(_moments(body), SMALL)
            body.explicitinertial = True
    return [f"no mass or inertia of its own: {few(names)}"] if names else []


def bare(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a compiled model without the traces of mass that :func:`accept_masses` leaves."""
    true = copy.copy(model)
    true.body_mass[true.body_mass <= LIGHT] = 0.0
    true.body_inertia[true.body_inertia <= SMALL] = 0.0
    return true
