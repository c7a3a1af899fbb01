"""Which joints an effect concerns, and how it changes links.

It concerns its own joint alone, two, or all that carry what it changes. An effect of one joint is
computed as if the mechanism had no other, so that one program serves all joints. Links are given by
their ten inertial parameters, by how large a change is plausible, and by which are physical: a body
of positive density has a positive definite pseudo-inertia (Wensing, Kim and Slotine, IEEE RA-L
2018).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxidl.effects import Effect, OnJoint
from jaxidl.effects.ten import PLACES
from jaxidl.logs.encoders import on_encoders
from jaxidl.systems.flange import flange_of
from jaxidl.systems.inertial import per_mass, per_moment
from jaxidl.systems.mujoco_body import MujocoBody

# standard deviation of a model's errors, relative to a link's mass, and to that times its length
# once and twice
PLAUSIBLE = 0.5
Columns = slice | list[int]  # joints
COMPACT = 0.1  # radius of gyration of a load about its own centre, relative to the robot's reach


class Links(NamedTuple):
    """The links of a model: those of J joints, followed by the last body that moves."""

    nominal: np.ndarray  # (J + 1, 10)
    unit: np.ndarray  # (J, 10) of one additional kilogram, with inertia in proportion
    moved: np.ndarray  # (J, 3, 10) of a first moment of 1 kg m, with inertia about the new centre
    plausible: np.ndarray  # (J + 1, 10) standard deviations of changes, the last that of a load
    same: bool  # true if the last joint's body is the last that moves, not one welded to it
    reach: float  # sum of the links' lengths [m]

    def loaded(self, mass: float) -> "Links":
        """Return the links with a plausible load of ``mass`` [kg]: a compact body."""
        width = self.plausible.copy()
        width[-1, 4:] = mass * (COMPACT * self.reach) ** 2
        return self._replace(plausible=width)


def links_of(body: Any) -> Links | None:
    """Return the links of a model; None for a point mass."""
    if not isinstance(body, MujocoBody):
        return None
    source, each = body.source, per_mass(body.source)
    last = flange_of(source)
    ids = [*body.bodies, last]
    mass = source.body_mass
    typical = np.mean(mass[mass > 0.0]) if np.any(mass > 0.0) else 1.0
    apart = np.linalg.norm(source.body_pos, axis=1)  # of each body from the one that carries it
    reach = [max([0.05, *apart[source.body_parentid == b]]) for b in ids]
    heavy = np.maximum(mass[ids], 0.2 * typical)[:, None]
    length = np.maximum(reach, np.sqrt(np.abs(each[ids, 4:7]).max(1)))[:, None]
    ten = lambda mass, far: mass * np.repeat(far ** np.arange(3), [1, 3, 6], -1)
    far = float(length[:-1].sum())
    load = ten(heavy[:-1].sum(), far)  # it may be as heavy and long as the robot
    return Links(
        mass[ids][:, None] * each[ids],
        each[list(body.bodies)],
        per_moment(source)[list(body.bodies)],
        np.concatenate([PLAUSIBLE * ten(heavy, length)[:-1], load[None]]),
        last == body.bodies[-1],
        far,
    )


def change_of(effect: Effect, links: Links) -> np.ndarray:
    """Return by how much an effect changes the links (J + 1, 10)."""
    out = np.zeros_like(links.nominal)
    for name, extra in alterations(effect):
        if name == "add_mass":
            out[:-1] += np.broadcast_to(extra, len(out) - 1)[:, None] * links.unit
        elif name == "add_moment":
            out[:-1] += np.einsum("ja,jap->jp", extra, links.moved)
        elif name == "add_link":
            out[:-1] += extra
        elif name == "add_payload":
            out[-1] += extra
    return out


def pseudo_inertia(ten: np.ndarray) -> np.ndarray:
    """Return the pseudo-inertia (..., 4, 4) of inertial parameters (..., 10)."""
    tensor = ten[..., 4:][..., np.array(PLACES)]
    out = np.zeros((*ten.shape[:-1], 4, 4))
    out[..., :3, :3] = (
        0.5 * np.trace(tensor, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - tensor
    )
    out[..., :3, 3] = out[..., 3, :3] = ten[..., 1:4]
    out[..., 3, 3] = ten[..., 0]
    return out


def physical(ten: np.ndarray) -> np.ndarray:
    """Return which links (..., 10) have a positive definite pseudo-inertia, or are zero."""
    least = np.linalg.eigvalsh(pseudo_inertia(ten))[..., 0]
    return np.asarray(least > -1e-9 * np.maximum(np.abs(ten).max(-1), 1e-12))


def narrowed(effects: Sequence[Effect]) -> tuple[Columns, list[Effect], list[int]]:
    """Return the joints that effects concern, the effects on those alone, and where they reach.

    The last result is the joint of each effect that reaches other joints.
    """
    first, nowhere = effects[0], [0] * len(effects)
    if isinstance(first, OnJoint) and not any(reaches(e.effect) for e in effects):  # type: ignore[attr-defined]
        return slice(first.joint, first.joint + 1), [e.effect for e in effects], nowhere  # type: ignore[attr-defined]
    if isinstance(first, OnJoint):
        return slice(None), [e.replace(joint=0) for e in effects], [e.joint for e in effects]  # type: ignore[attr-defined]
    if hasattr(first, "other"):
        return [first.joint, first.other], [e.replace(joint=0, other=1) for e in effects], nowhere  # type: ignore[attr-defined]
    return slice(None), list(effects), nowhere


def reaches(effect: Effect) -> bool:
    """Return whether an effect changes the body that its joint carries, or the joint's position."""
    carried = (x for name, x in alterations(effect) if name != "add_inertia")
    return any(map(np.any, carried)) or on_encoders(effect)


def alterations(effect: Effect) -> list[tuple[str, np.ndarray]]:
    """Return how an effect alters a body: names of the body's methods, and their arguments."""
    body = _Altered()
    effect.alter(body)
    return body.made


class _Altered:
    """A body that notes how it is altered."""

    def __init__(self) -> None:
        self.made: list[tuple[str, np.ndarray]] = []

    def __getattr__(self, name: str) -> Any:
        return lambda extra: self.made.append((name, np.asarray(extra))) or self
