"""What MuJoCo has for the effects: numbers of joints and bodies, and a motor for each joint."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from jaxidl.effects import (
    ActuatorDelay,
    ActuatorLag,
    CoulombFriction,
    Effect,
    InertiaError,
    OnJoint,
    Payload,
    SensorDelay,
    Spring,
    TorqueSaturation,
    TorqueScale,
    ViscousFriction,
)

DRIVES = (TorqueScale, TorqueSaturation, ActuatorLag)


def kind(effect: Effect) -> type[Effect]:
    """The effect's class, whether it is on one joint or on all."""
    return type(effect.effect) if isinstance(effect, OnJoint) else type(effect)


def per_joint(effect: Effect, parameter: str, joints: int, neutral: float) -> np.ndarray:
    """An effect's parameter as one number per joint (J,), ``neutral`` where it does not act."""
    if not isinstance(effect, OnJoint):
        return np.broadcast_to(np.asarray(getattr(effect, parameter), float), (joints,)).copy()
    values = np.full(joints, neutral)
    values[effect.joint] = np.asarray(getattr(effect.effect, parameter), float).reshape(-1)[0]
    return values


class Numbers:
    """The attributes of a compiled model that effects are written into; J joints, B bodies."""

    def __init__(self, model: mujoco.MjModel):
        self.damping, self.frictionloss = model.dof_damping.copy(), model.dof_frictionloss.copy()  # (J,)
        self.stiffness, self.springref = model.jnt_stiffness.copy(), model.qpos_spring.copy()  # (J,)
        self.armature = model.dof_armature.copy()  # (J,)
        self.mass, self.inertia = model.body_mass.copy(), model.body_inertia.copy()  # (B,), (B, 3)
        self.payloads: list[tuple[float, np.ndarray]] = []  # mass and place (3,) in the frame of the last body that moves
        self._body_of = model.jnt_bodyid

    def write(self, effect: Effect) -> str | None:
        """Add an effect to the numbers and tell where; None, and nothing is changed, if they cannot hold it."""
        joints = len(self.damping)
        match kind(effect):
            case cls if cls is ViscousFriction:
                self.damping += per_joint(effect, "coefficient", joints, 0.0)
                return "joint/damping"
            case cls if cls is CoulombFriction:
                self.frictionloss += per_joint(effect, "level", joints, 0.0)
                return "joint/frictionloss"
            case cls if cls is Spring:
                return self._spring(per_joint(effect, "stiffness", joints, 0.0), per_joint(effect, "rest", joints, 0.0))
            case cls if cls is InertiaError:
                return self._inertia(per_joint(effect, "extra", joints, 0.0), per_joint(effect, "mass", joints, 0.0))
            case cls if cls is Payload and isinstance(effect, Payload):
                if np.any(np.asarray(effect.moment)) or np.any(np.asarray(effect.inertia)) or float(effect.mass) < 0.0:
                    return None
                self.payloads.append((float(effect.mass), np.asarray(effect.com, float)))
                return "body/inertial"
        return None

    def _spring(self, stiffness: np.ndarray, rest: np.ndarray) -> str | None:
        """A joint has one spring; a second one would need another rest position."""
        if np.any((stiffness != 0.0) & (self.stiffness != 0.0)):
            return None
        self.springref = np.where(stiffness != 0.0, rest, self.springref)
        self.stiffness += stiffness
        return "joint/stiffness, joint/springref"

    def _inertia(self, extra: np.ndarray, mass: np.ndarray) -> str | None:
        """Less than no armature, or a body without mass, is not MJCF."""
        armature, heavier = self.armature + extra, self.mass.copy()
        np.add.at(heavier, self._body_of, mass)
        changed = heavier != self.mass
        if np.any(armature < 0.0) or np.any(heavier[changed] <= mujoco.mjMINVAL) or np.any(self.mass[changed] == 0.0):
            return None
        self.inertia[changed] *= (heavier[changed] / self.mass[changed])[:, None]
        self.armature, self.mass = armature, heavier
        return ", ".join(["joint/armature"] * bool(extra.any()) + ["body/inertial"] * bool(mass.any())) or "joint/armature"


class Motor(NamedTuple):
    """Of one joint: command, lag, clipped to ``force``, times ``gear``, torque."""

    gear: float = 1.0
    force: float = np.inf  # [N or Nm] before the gear
    lag: float = 0.0  # [s]


def motors(effects: Sequence[Effect], joints: int) -> list[Motor]:
    """A motor for each joint that does what the effects do between command and torque, in their order.

    None at all if there is nothing to be done, or if a motor cannot do it: a lag behind a saturation or another lag, or anything
    behind the transmission. Dead times may stand anywhere in the order; the motors do not have them.
    """
    made = [Motor() for _ in range(joints)]
    behind = np.zeros(joints, bool)  # the transmission
    for effect in effects:
        cls = kind(effect)
        if cls in DRIVES:
            (parameter,) = cls.parameters
            values = per_joint(effect, parameter, joints, np.nan)
            for j in np.flatnonzero(np.isfinite(values)):
                better = None if behind[j] else _with(made[j], cls, values[j])
                if better is None:
                    return []
                made[j] = better
        elif cls.actuate is not Effect.actuate and cls not in (ActuatorDelay, SensorDelay):
            behind[effect.joint if isinstance(effect, OnJoint) else slice(None)] = True
    return made if any(motor != Motor() for motor in made) else []


def _with(motor: Motor, cls: type[Effect], value: float) -> Motor | None:
    if cls is TorqueScale:
        return motor._replace(gear=motor.gear * value)
    if cls is TorqueSaturation:
        return motor._replace(force=min(motor.force, value / motor.gear))
    return motor._replace(lag=value) if motor.lag == 0.0 and motor.force == np.inf else None
