"""Physical changes of a link.

They are given by its ten inertial parameters, how large a change is plausible, and which links are
consistent. A body of positive density has a positive definite pseudo-inertia (Wensing, Kim and
Slotine, IEEE RA-L 2018).
"""

from typing import Any, NamedTuple

import numpy as np

from jaxidl.effects import Effect
from jaxidl.effects.ten import PLACES
from jaxidl.gap.evidence.reach import alterations
from jaxidl.systems.flange import flange_of
from jaxidl.systems.mujoco_body import MujocoBody, per_mass, per_moment

# standard deviation of a model's errors, relative to a link's mass, and to that times its length
# once and twice
PLAUSIBLE = 0.5
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
    reach: Any = [
        max(
            [
                0.05,
                *(
                    np.linalg.norm(source.body_pos[c])
                    for c in range(source.nbody)
                    if source.body_parentid[c] == b
                ),
            ]
        )
        for b in ids
    ]
    heavy = np.maximum(mass[ids], 0.2 * typical)[:, None]
    length = np.maximum(reach, np.sqrt(np.abs(each[ids, 4:7]).max(1)))[:, None]
    spread = np.concatenate(
        [heavy, np.repeat(heavy * length, 3, 1), np.repeat(heavy * length**2, 6, 1)], 1
    )
    total, far = heavy[:-1].sum(), length[:-1].sum()  # a load may be as heavy and long as the robot
    load = total * np.repeat([1.0, far, far**2], [1, 3, 6])
    return Links(
        mass[ids][:, None] * each[ids],
        each[list(body.bodies)],
        per_moment(source)[list(body.bodies)],
        np.concatenate([PLAUSIBLE * spread[:-1], load[None]]),
        last == body.bodies[-1],
        float(far),
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
    """Return which links (..., 10) are physical.

    Their pseudo-inertia is positive definite, or they are zero.
    """
    least = np.linalg.eigvalsh(pseudo_inertia(ten))[..., 0]
    return np.asarray(least > -1e-9 * np.maximum(np.abs(ten).max(-1), 1e-12))
