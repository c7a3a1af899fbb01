"""Bodies whose masses MuJoCo rejects although the mechanism is possible."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import copy
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from jaxidl.errors import ModelError

# [kg], [kg m^2]: for a link without any; MuJoCo requires more than 1e-15 of moving bodies
LIGHT, SMALL = 1e-9, 1e-12


def compile_spec(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile a spec.

    Raises:
        ModelError: with MuJoCo's own message, if it does not compile.
    """
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())[:300]
        raise ModelError(
            f"{path} to compile", f"'{said}'", "correct the file; MuJoCo must load it"
        ) from None


def accept_masses(spec: mujoco.MjSpec, path: Path) -> list[str]:
    """Change masses that would keep a model from compiling.

    Missing ones become tiny, and impossible moments of inertia are balanced.

    Returns:
        Notes on what was changed.

    Raises:
        ModelError: with MuJoCo's own message, if the model still does not compile.
    """
    notes = []
    for _ in range(2 * len(_CHANGES)):  # one change may bring up another error
        try:
            # a spec whose compilation failed repeats the error at every later use
            spec.copy().compile()
            return notes
        except (ValueError, mujoco.FatalError) as error:
            for words, change in _CHANGES.items():
                if words in str(error):
                    notes += change(spec)
    compile_spec(spec, path)
    return notes


def _balance(spec: mujoco.MjSpec) -> list[str]:
    """Raise the two smaller moments of inertia by as little as makes them possible."""
    names = []
    for body in spec.bodies[1:]:
        moments, axes = _moments(body)
        lacking = moments[2] - moments[0] - moments[1]
        if body.explicitinertial and lacking > 0.0:
            _write(body, moments + 0.5 * lacking * (1 + 1e-9) * np.array([1.0, 1.0, 0.0]), axes)
            names.append(_called(body))
    if not names:
        return []
    return [
        f"no mass has the moments of inertia of {few(names)} (A + B < C): the smaller two were"
        " raised until A + B = C"
    ]


def _lift(spec: mujoco.MjSpec) -> list[str]:
    """Raise moments of inertia that are negative, or too small for MuJoCo.

    Most often they are rounded; files also have inertia matrices that no body has.
    """
    none, wrong = [], []
    for body in spec.bodies[1:]:
        moments, axes = _moments(body)
        if body.explicitinertial and moments[0] < SMALL:
            _write(body, np.maximum(moments, SMALL), axes)
            (none if moments[0] > -SMALL else wrong).append(_called(body))
    notes = [f"no inertia of its own: {few(none)}"] if none else []
    if wrong:
        notes.append(
            f"no mass has the inertia matrix of {few(wrong)} (a principal moment is negative): it"
            " was raised to zero"
        )
    return notes


def _fill(spec: mujoco.MjSpec) -> list[str]:
    """Give tiny mass and inertia to links that move and have none."""
    names = []
    for body in spec.bodies[1:]:
        if not body.joints or (
            not body.explicitinertial and any(geom.mass != 0.0 for geom in body.geoms)
        ):
            continue
        moments, axes = _moments(body) if body.explicitinertial else (np.zeros(3), np.eye(3))
        own = body.mass if body.explicitinertial else 0.0
        if own < LIGHT or moments[0] < SMALL:
            names.append(_called(body))
            if own < LIGHT:
                body.mass, body.ipos = LIGHT, np.zeros(3)
            if moments[0] < SMALL:
                _write(body, np.maximum(moments, SMALL), axes)
            body.explicitinertial = True
    return [f"no mass or inertia of its own: {few(names)}"] if names else []


# changes by a fragment of MuJoCo's error message
_CHANGES = {
    "positive eigenvalues": _lift,
    "balanceinertia": _balance,
    "larger than mjMINVAL": _fill,
}


def _moments(body: mujoco.MjsBody) -> tuple[np.ndarray, np.ndarray]:
    """Return principal moments (3,) [kg m^2] as the file gives them, and their axes (3, 3).

    The smallest comes first; the axes are columns.
    """
    if np.isfinite(body.fullinertia).all():
        xx, yy, zz, xy, xz, yz = body.fullinertia
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return moments, axes
    order = np.argsort(body.inertia)
    return np.asarray(body.inertia, float)[order], np.eye(3)[:, order]


def _write(body: mujoco.MjsBody, moments: np.ndarray, axes: np.ndarray) -> None:
    """Write principal moments (3,) about ``axes`` (3, 3) in the file's own form."""
    tensor = (axes * moments) @ axes.T
    if np.isfinite(body.fullinertia).all():
        body.fullinertia = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    else:
        body.inertia = np.diag(tensor)


def _called(body: mujoco.MjsBody) -> str:
    return body.name or "a body without a name"


def few(names: Sequence[str], most: int = 8) -> str:
    """Return names in words; of many names only the first."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def bare(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a compiled model without the tiny masses that :func:`accept_masses` adds."""
    true = copy.copy(model)
    true.body_mass[true.body_mass <= LIGHT] = 0.0
    true.body_inertia[true.body_inertia <= 2 * SMALL] = 0.0
    return true
