"""What a model's file says about the limits of its joints, and which of its shapes come close."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import re
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from jaxidl.systems.loading import load_part, quietly
from jaxidl.systems.masses import compile_spec
from jaxidl.systems.mjcf import Model, as_read


class Bounds(NamedTuple):
    """Limits of J joints as a file gives them; infinite where it gives none."""

    lower: Float[np.ndarray, " J"]  # [m or rad]
    upper: Float[np.ndarray, " J"]
    speed: Float[np.ndarray, " J"]  # [m/s or rad/s]; only URDF has it
    torque: Float[np.ndarray, " J"]  # [N or Nm]


class Near(NamedTuple):
    """M places of a motion where two shapes are close."""

    row: np.ndarray  # (M,) instants
    distance: np.ndarray  # (M,) [m]; negative inside each other
    slope: np.ndarray  # (M, J) of the distance by the joints' positions
    bodies: tuple[str, ...]  # (M,) both bodies' names


def compiled(model: Model) -> mujoco.MjModel:
    """Return MuJoCo's model of a file with its shapes, cut down to the model's joints."""
    with as_read(model) as path, quietly():
        spec, _ = load_part(path, model.part, model.locked)
        return compile_spec(spec, path)


def bounds(model: Model) -> Bounds:
    """Return the limits in a model's file: ranges, torques of joints and motors, URDF's speeds."""
    source = compiled(model)
    limited = source.jnt_limited.astype(bool)
    lower, upper = np.where(limited[:, None], source.jnt_range, [[-np.inf, np.inf]]).T
    torque = np.where(
        source.jnt_actfrclimited.astype(bool), np.abs(source.jnt_actfrcrange).min(1), np.inf
    )
    for a in range(source.nu):
        j, kind = int(source.actuator_trnid[a, 0]), source.actuator_trntype[a]
        if kind == mujoco.mjtTrn.mjTRN_JOINT and source.actuator_forcelimited[a]:
            force = np.abs(source.actuator_forcerange[a]).min() * abs(source.actuator_gear[a, 0])
            torque[j] = min(torque[j], force)
    return Bounds(lower, upper, _speeds(model), np.where(torque > 0.0, torque, np.inf))


def _speeds(model: Model) -> np.ndarray:
    """Return URDF's largest speeds (J,), which MuJoCo does not read."""
    text = (model.files or {}).get(model.path.name, b"").decode(errors="replace")
    found = np.full(len(model.names), np.inf)
    for j, name in enumerate(model.names):
        joint = re.search(rf'<joint[^>]*name="{re.escape(name)}".*?</joint>', text, re.DOTALL)
        if joint and (speed := re.search(r'<limit[^>]*velocity="([^"]+)"', joint.group())):
            found[j] = abs(float(speed.group(1))) or np.inf
    return found


class Shapes:
    """The shapes of a model and of what stands around it."""

    def __init__(self, model: Model, clearance: float):
        """Take a ``clearance`` [m] that shapes of different bodies are to keep.

        Pairs that MuJoCo never lets touch (a body and its parent, those excluded in the file) do
        not count.
        """
        self.source, self.clearance = compiled(model), clearance
        self.source.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        self.data = mujoco.MjData(self.source)

    @property
    def any(self) -> bool:
        """Whether any two shapes could touch."""
        return self.source.ngeom > 1 and bool(
            np.any(self.source.geom_contype | self.source.geom_conaffinity)
        )

    def near(self, q: Float[np.ndarray, "T J"], within: float | None = None) -> Near:
        """Return where shapes come closer than ``within`` [m], the clearance if it is not given."""
        source, data = self.source, self.data
        far = self.clearance if within is None else within
        source.geom_margin[:] = far
        rows, distances, slopes, names = [], [], [], []
        forward, back = np.zeros((3, source.nv)), np.zeros((3, source.nv))
        for t, position in enumerate(q):
            data.qpos[:] = position
            mujoco.mj_kinematics(source, data)
            mujoco.mj_comPos(source, data)
            mujoco.mj_collision(source, data)
            for contact in data.contact[: data.ncon]:
                if contact.dist > far:  # MuJoCo adds both shapes' margins
                    continue
                one, other = (int(source.geom_bodyid[g]) for g in contact.geom)
                for jacobian, body in ((back, one), (forward, other)):
                    mujoco.mj_jac(source, data, jacobian, None, contact.pos, body)
                rows.append(t)
                distances.append(contact.dist)
                slopes.append(contact.frame[:3] @ (forward - back))
                names.append(f"{source.body(one).name} and {source.body(other).name}")
        return Near(
            np.array(rows, int),
            np.array(distances, float),
            np.array(slopes, float).reshape(-1, source.nv),
            tuple(names),
        )
