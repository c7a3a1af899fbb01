"""What effects add to the torque along a motion, differentiable by the motion.

The gap finder computes the same along a measured log (:mod:`jaxidl.gap.evidence.additions`),
filtered as the log is. A planned motion has no noise, so nothing is filtered here; dry friction
changes its sign within a narrow range of speeds instead of at once, so that derivatives see
reversals.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.effects import Effect, OnJoint
from jaxidl.effects.load import dissipates
from jaxidl.gap.evidence.additions import Drive, along
from jaxidl.gap.evidence.links import alterations, narrowed, reaches
from jaxidl.logs.encoders import on_encoders
from jaxidl.systems.free import inner
from jaxidl.systems.mujoco_body import MujocoBody
from jaxidl.systems.regressor import inverse_dynamics, table
from jaxidl.systems.tables import Tables


class Family(NamedTuple):
    """G effects of one class and structure, on joints ``where`` (G, n)."""

    structure: Any
    leaves: tuple[np.ndarray, ...]  # (G, ...) each
    where: np.ndarray
    whole: bool  # they see all joints
    sensors: bool  # they change what the encoders read
    friction: bool
    places: tuple[int, ...]  # (G,) in the list that they come from


class Rigid(NamedTuple):
    """G effects that only alter the rigid body: by how much, per effect."""

    link: np.ndarray  # (G, J, 10) of the joints' bodies
    mass: np.ndarray  # (G, J)
    moment: np.ndarray  # (G, J, 3)
    payload: np.ndarray  # (G, 10)
    inertia: np.ndarray  # (G, J) of rotors
    tilt: np.ndarray  # (G, 2)
    places: tuple[int, ...]


def families(effects: Sequence[Effect], joints: int) -> tuple[Rigid | Family, ...]:
    """Return effects of a mechanism of ``joints`` joints, those of one structure together."""
    rigid = [n for n, e in enumerate(effects) if type(inner(e)).rigid()]
    found: list[Rigid | Family] = []
    if rigid:
        altered = [alterations(effects[n]) for n in rigid]
        shapes = {
            "link": (joints, 10),
            "mass": (joints,),
            "moment": (joints, 3),
            "payload": (10,),
            "inertia": (joints,),
        }

        def total(how: str, shape: tuple[int, ...]) -> np.ndarray:
            """Return what each effect adds in one way (G, ...)."""
            return np.stack(
                [sum((x for way, x in made if way == how), np.zeros(shape)) for made in altered]
            )

        added = {part: total(f"add_{part}", shape) for part, shape in shapes.items()}
        found.append(Rigid(**added, tilt=total("tilt", (2,)), places=tuple(rigid)))
    together: dict[Any, list[int]] = {}
    for n, effect in enumerate(effects):
        if n not in rigid:
            bare = inner(effect) if isinstance(effect, OnJoint) else effect
            shapes = str([np.shape(x) for x in jax.tree.leaves(bare)])
            free = bare.replace(joint=0, other=1) if hasattr(bare, "other") else bare
            together.setdefault((jax.tree.structure(free), shapes), []).append(n)
    found += [_family([effects[n] for n in places], tuple(places)) for places in together.values()]
    return tuple(found)


def _family(effects: list[Any], places: tuple[int, ...]) -> Family:
    _, alone, joints = narrowed(effects)
    first = effects[0]
    whole = not hasattr(first, "other") and not (
        isinstance(first, OnJoint) and not any(reaches(e.effect) for e in effects)
    )
    if hasattr(first, "other"):
        where = np.array([[e.joint, e.other] for e in effects])
    elif whole:
        where = np.array(joints)[:, None]
    else:
        where = np.array([[e.joint] for e in effects])
    leaves = tuple(
        np.stack([np.asarray(x, float) for x in each])
        for each in zip(*map(jax.tree.leaves, alone), strict=True)
    )
    return Family(
        jax.tree.structure(alone[0]),
        leaves,
        where,
        whole,
        any(map(on_encoders, effects)),
        dissipates(first),
        places,
    )


def driven(
    body: MujocoBody, own: Sequence[Rigid | Family], q: Any, qd: Any, qdd: Any, rest: Any, dt: float
) -> Drive:
    """Return what drives effects along a motion (T, J) sampled every ``dt`` [s].

    The torque is that of the ``body`` and of the model's ``own`` effects, friction included, whose
    sign changes within about ``rest`` (J,) [m/s or rad/s]; the load is that torque without
    friction, and without what accelerates the rotors.
    """
    tables = jax.vmap(lambda *x: table(body, *x))(q, qd, qdd)
    torque = tables.torque
    drive = Drive(q, qd, qdd, torque, torque, torque, tables)
    load = torque - body.armature[None] * qdd
    for f in own:
        more = added(f, drive, body, rest, dt).sum(0)
        torque = torque + more
        if isinstance(f, Rigid):
            load = load + more - f.inertia.sum(0)[None] * qdd
        elif not f.friction:
            load = load + more
    return drive._replace(tau=torque, predicted=torque, load=load)


def added(
    family: Rigid | Family, drive: Drive, body: MujocoBody, rest: Any, dt: float
) -> jax.Array:
    """Return the torque (G, T, J) [N or Nm] that each effect adds to the command needed."""
    if isinstance(family, Rigid):
        t = drive.table
        return (
            jnp.einsum("tijp,gjp->gti", t.by_link, family.link)
            + jnp.einsum("tij,gj->gti", t.by_mass, family.mass)
            + jnp.einsum("tija,gja->gti", t.by_moment, family.moment)
            + jnp.einsum("tip,gp->gti", t.by_payload, family.payload)
            + jnp.einsum("tj,gj->gtj", drive.qdd, family.inertia)
            + jnp.einsum("tia,ga->gti", t.by_tilt, family.tilt)
        )
    rest, starts = jnp.asarray(rest), np.zeros(len(drive.q), bool)
    starts[0] = True

    def one(values: Any, where: Any) -> jax.Array:
        effect = jax.tree.unflatten(family.structure, values)
        if family.whole and isinstance(effect, OnJoint):
            effect = effect.replace(joint=where[0])
        seen = drive if family.whole else _of(drive, where)
        speeds = rest if family.whole else rest[where]
        net = _net(effect, seen, starts, speeds, dt)
        if family.sensors:
            net = net + _moved(effect, drive, body, dt)
        return net if family.whole else jnp.zeros_like(drive.q).at[:, where].set(net)

    return jax.vmap(one)(tuple(map(jnp.asarray, family.leaves)), jnp.asarray(family.where))


def _of(drive: Drive, where: Any) -> Drive:
    """Return the drive of some joints, as if they were alone; nothing there reads the tables."""
    T, n = len(drive.q), where.shape[0]
    sizes = ((n,), *((n, n),) * 4, (n, n, 3), (n, n, 10), (n, 10), (n, 3), (n, 2))
    blank = Tables(*(jnp.zeros((T, *size)) for size in sizes))
    return Drive._make([*(x[:, where] for x in drive[:-1]), blank])


def _net(effect: Any, drive: Drive, starts: Any, rest: Any, dt: float) -> jax.Array:
    terms = along(effect, drive, starts, dt)
    slide = terms.level * jnp.tanh(drive.qd / rest[None])
    return slide - terms.torque - terms.change + terms.inertia


def _moved(effect: Any, drive: Drive, body: MujocoBody, dt: float) -> jax.Array:
    """Return the change (T, J) of the torque where the true positions are not the read ones."""
    shift = effect.true_position(drive.q, dt) - drive.q
    speed: Any = jnp.gradient(shift, dt, axis=0)
    step = shift, speed, jnp.gradient(speed, dt, axis=0)
    torque = jax.vmap(lambda *x: inverse_dynamics(body, *x))
    return jax.jvp(torque, (drive.q, drive.qd, drive.qdd), step)[1]
