"""The flange: the body that carries a payload.

A model's file names it by a text, in MJCF ``<custom><text name="flange" data="BODY"/></custom>``.
If there is none, it is the last body that moves.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from pathlib import Path

import mujoco
import numpy as np

from jaxidl.errors import ModelError

FLANGE = "flange"


def flange_of(model: mujoco.MjModel) -> int:
    """Return the number of the body that carries a payload.

    If none is named, it is the body of the last joint, or what is welded to it, up to where that
    branches, such as into fingers. A body that comes after it in the file, such as a table or a
    cover of an earlier link, carries no payload.
    """
    if name := named_flange(model):
        return model.body(name).id
    body = int(model.jnt_bodyid[-1])
    while True:
        welded = (model.body_parentid == body) & (model.body_weldid == model.body_weldid[body])
        welded[body] = False
        if welded.sum() != 1:
            return body
        body = int(np.flatnonzero(welded)[0])


def named_flange(model: mujoco.MjModel) -> str | None:
    """Return the name of the body that the model's text calls the flange; None without a text."""
    at = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, FLANGE)
    if at < 0:
        return None
    start = model.text_adr[at]
    return bytes(model.text_data[start : start + model.text_size[at] - 1]).decode()


def name_flange(spec: mujoco.MjSpec, name: str) -> None:
    """Write the flange's name into a spec, in place of one that is there."""
    for text in [text for text in spec.texts if text.name == FLANGE]:
        spec.delete(text)
    spec.add_text(name=FLANGE, data=name)


def check_flange(model: mujoco.MjModel, path: Path) -> None:
    """Raise ModelError unless the flange that a model's text names is a body that moves."""
    moving = [model.body(b).name for b in range(model.nbody) if model.body_weldid[b] > 0]
    name = named_flange(model)
    if name is not None and name not in moving:
        raise ModelError(
            f"a body of {path} that moves as the flange",
            repr(name),
            f"choose among {', '.join(filter(None, moving))}",
        )


def ends(model: mujoco.MjModel) -> int:
    """Return how many bodies with joints carry no other body with joints."""
    bodies, carrying = set(model.jnt_bodyid.tolist()), set[int]()
    for b in bodies:
        above = int(model.body_parentid[b])
        while above:
            carrying.add(above)
            above = int(model.body_parentid[above])
    return len(bodies - carrying)
