"""MuJoCo's attributes for effects: numbers of joints and bodies, and a motor for each joint."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import copy
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from jaxidl.effects import Effect, OnJoint
from jaxidl.effects.spec import Motor
from jaxidl.effects.ten import PLACES
from jaxidl.systems.flange import flange_of
from jaxidl.systems.inertial import level, links, per_mass, per_moment


class Numbers:
    """The attributes of a compiled model into which effects on J of its joints are written.

    Effects add to them in place. ``own`` gives those of one joint, as arrays of one element, and
    ``alter`` writes effects that alter the rigid body.
    """

    def __init__(
        self, model: mujoco.MjModel, joints: Sequence[int] | None = None, flange: int | None = None
    ):
        """Take the numbers of a model.

        Args:
            model: the model, of M joints.
            joints: numbers of the J joints, if others follow them. Default: all.
            flange: number of the body that carries a payload. Default: that of the model.
        """
        self.joints = tuple(range(model.njnt)) if joints is None else tuple(joints)
        # (M,)
        self.damping, self.frictionloss = model.dof_damping.copy(), model.dof_frictionloss.copy()
        # (M,)
        self.stiffness, self.springref = model.jnt_stiffness.copy(), model.qpos_spring.copy()
        self.rigid = Rigid(
            model,
            self.joints,
            flange_of(model) if flange is None else flange,
            model.dof_armature.copy(),
            links(model),
            model.opt.gravity.copy(),
        )
        self._together = False

    def expect(self, effects: Sequence[Effect]) -> None:
        """Prepare for ``effects``.

        The rigid body that they produce together may be possible where that of one alone is not.
        """
        altered = self.rigid
        for effect in effects:
            altered = effect.alter(altered) if kind(effect).rigid() else altered
        self._together = altered.possible()

    def own(self, joint: int) -> "Numbers":
        """Return a view of the numbers of one joint; adding to it adds to these."""
        one, at = copy.copy(self), self.joints[joint]
        for name in ("damping", "frictionloss", "stiffness", "springref"):
            setattr(one, name, getattr(self, name)[at : at + 1])
        return one

    @property
    def armature(self) -> np.ndarray:
        """Rotor inertia (M,)."""
        return self.rigid.armature

    def alter(self, effect: Effect) -> str | None:
        """Write the change that an effect makes to the rigid body, and return where.

        None, with nothing changed, if MJCF cannot express it.
        """
        altered = effect.alter(self.rigid)
        if not self._together and not altered.possible():
            return None
        names = {
            "armature": "joint/armature",
            "links": "body/inertial",
            "loads": "body/inertial",
            "gravity": "option/gravity",
        }
        same = {
            name: np.array_equal(getattr(altered, name), getattr(self.rigid, name))
            for name in names
        }
        places = dict.fromkeys(names[name] for name in names if not same[name])
        self.rigid = altered
        return ", ".join(places) or next(iter(kind(effect).mjcf.values()), "body/inertial")


class Principal(NamedTuple):
    """A body's inertia as MJCF gives it."""

    mass: float  # [kg]
    pos: np.ndarray  # (3,) centre of mass [m]
    quat: np.ndarray  # (4,)
    diag: np.ndarray  # (3,) [kg m^2]


class Rigid(NamedTuple):
    """A rigid body as numbers, altered as any other body; J of M joints, B bodies."""

    model: mujoco.MjModel
    joints: tuple[int, ...]  # numbers of the J joints
    flange: int  # number of the body that carries a load
    armature: np.ndarray  # (M,)
    links: np.ndarray  # (B, 10) inertial parameters
    gravity: np.ndarray  # (3,)
    loads: tuple[np.ndarray, ...] = ()  # (10,) each, of the last body that moves

    @property
    def on(self) -> np.ndarray:
        """Numbers (J,) of the joints' bodies."""
        return self.model.jnt_bodyid[list(self.joints)]

    def add_inertia(self, extra: Any) -> "Rigid":
        armature = self.armature.copy()
        armature[list(self.joints)] += np.asarray(extra, float)
        return self._replace(armature=armature)

    def add_link(self, extra: Any) -> "Rigid":
        changed = self.links.copy()
        np.add.at(changed, self.on, np.asarray(extra, float))
        return self._replace(links=changed)

    def add_mass(self, extra: Any) -> "Rigid":
        share = per_mass(self.model)[self.on]
        return self.add_link(np.broadcast_to(np.asarray(extra, float), len(share))[:, None] * share)

    def add_moment(self, extra: Any) -> "Rigid":
        share = per_moment(self.model)[self.on]
        return self.add_link(np.einsum("ja,jap->jp", np.asarray(extra, float), share))

    def add_payload(self, extra: Any) -> "Rigid":
        return self._replace(loads=(*self.loads, np.asarray(extra, float)))

    def tilt(self, angles: Any) -> "Rigid":
        return self._replace(gravity=self.gravity + level(self.model) @ np.asarray(angles, float))

    def carried(self) -> list[Principal]:
        """Return the loads that can be bodies of their own.

        The others are added to the body that carries them.
        """
        return [found for load in self.loads if (found := principal(load, 0.0))]

    def bodies(self) -> dict[int, Principal | None]:
        """Return the bodies that were changed, by number.

        The value is None where no body has such numbers.
        """
        numbers = self.links.copy()
        for load in self.loads:
            if principal(load, 0.0) is None:
                numbers[self.flange] += load
        before = links(self.model)
        changed = np.flatnonzero(np.any(numbers != before, axis=1)).tolist()
        return {b: self._body(numbers[b], before[b], b) for b in changed}

    def possible(self) -> bool:
        """Return whether MJCF can express such a body."""
        return not np.any(self.armature < 0.0) and None not in self.bodies().values()

    def _body(self, numbers: np.ndarray, before: np.ndarray, b: int) -> Principal | None:
        """Return a changed body; one that became heavier or lighter all over keeps its axes."""
        model, share = self.model, numbers[0] / before[0] if before[0] else 0.0
        if share * before[0] > mujoco.mjMINVAL and np.allclose(
            numbers, share * before, rtol=1e-12, atol=0.0
        ):
            return Principal(
                share * before[0],
                model.body_ipos[b],
                model.body_iquat[b],
                share * model.body_inertia[b],
            )
        return principal(numbers, mujoco.mjMINVAL)


def principal(numbers: np.ndarray, least: float) -> Principal | None:
    """Return mass, centre, axes and principal moments of ten inertial parameters.

    None if no body has them. Moments must be larger than ``least``, or zero where that is zero.
    """
    mass = float(numbers[0])
    if not mass > mujoco.mjMINVAL:
        return None
    com = numbers[1:4] / mass
    about = mass * (com @ com * np.eye(3) - np.outer(com, com))
    values, axes = np.linalg.eigh(numbers[4:][np.array(PLACES)] - about)
    rounding = 1e-12 * (np.abs(numbers[4:]).max() + mass * (com @ com))
    if least == 0.0:
        values = np.where(np.abs(values) < rounding, 0.0, values)
    if (
        np.any(values < least)
        or (least and np.any(values <= least))
        or values[0] + values[1] < values[2]
    ):
        return None
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    return Principal(mass, com, quat, values)


def kind(effect: Effect) -> type[Effect]:
    """Return the effect's class, whether it is on one joint or on all."""
    return type(effect.effect) if isinstance(effect, OnJoint) else type(effect)


def drives(effect: Effect, joints: int) -> bool:
    """Return whether the effect is one that MuJoCo's motors can have."""
    return any(effect.mjcf_motor(Motor(), j) not in (None, Motor()) for j in range(joints))


def motors(effects: Sequence[Effect], joints: int) -> list[Motor]:
    """Return a motor for each joint that acts as the effects between command and torque.

    The effects act in their order. The list is empty if there is nothing to be done, or if a motor
    cannot do it: a lag behind a saturation or another lag, or anything behind the transmission.
    """
    made = [Motor()] * joints
    behind = np.zeros(joints, bool)  # joints whose transmission has been passed
    for effect in effects:
        for j in range(joints):
            alone = effect.mjcf_motor(Motor(), j)
            if alone is None:
                behind[j] = True
            elif alone != Motor():
                better = None if behind[j] else effect.mjcf_motor(made[j], j)
                if better is None:
                    return []
                made[j] = better
    return made if any(motor != Motor() for motor in made) else []
