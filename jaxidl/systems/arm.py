"""The seven-joint arm of the robot experiments: its file, poses and the position of its flange."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable
from functools import cache
from importlib.resources import as_file, files

import jax
import mujoco
import numpy as np
from jaxtyping import Float

from jaxidl.errors import ConfigurationError
from jaxidl.systems.mjcf import Model, read_model

JOINTS = 7
FLANGE = np.array([0.0, 0.0, 0.06])  # position in the last link's frame [m]


@cache
def arm() -> Model:
    """Return the modelled arm: a rigid body and nothing else."""
    with (
        as_file(files("jaxidl.systems") / "arm.xml") as path,
        jax.ensure_compile_time_eval(),
        jax.enable_x64(True),
    ):
        return read_model(path)


@cache
def compiled() -> mujoco.MjModel:
    """Return the same model compiled by MuJoCo in C, with its shapes."""
    return mujoco.MjModel.from_xml_string((files("jaxidl.systems") / "arm.xml").read_text())


def torque_limits() -> Float[np.ndarray, "7"]:
    """Return the largest torque of each joint [Nm]."""
    return compiled().jnt_actfrcrange[:, 1].copy()


def inertia(q: Float[np.ndarray, "7"]) -> Float[np.ndarray, "7"]:
    """Return the diagonal (7,) of the modelled inertia matrix [kg m^2].

    ``q`` (7,) are the joint positions [rad].
    """
    model, data = compiled(), mujoco.MjData(compiled())
    data.qpos[:], matrix = q, np.zeros((JOINTS, JOINTS))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, matrix)
    return np.diag(matrix).copy()


def inverse_dynamics_in_c() -> Callable[..., Float[np.ndarray, "7"]]:
    """Return a function that computes the modelled torque by MuJoCo in C, as a reference.

    It maps positions, velocities and accelerations (7,) each to the torque (7,) [Nm].
    """
    model = arm().plant.body.source
    data = mujoco.MjData(model)

    def torque(q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse.copy()

    return torque


def flange(q: Float[np.ndarray, "*T 7"]) -> Float[np.ndarray, "*T 3"]:
    """Return positions (..., 3) of the flange [m] at joint positions (..., 7) [rad]."""
    data, poses = mujoco.MjData(compiled()), np.reshape(q, (-1, JOINTS))
    return np.stack([_flange(data, pose)[0] for pose in poses]).reshape(*np.shape(q)[:-1], 3)


def _flange(data: mujoco.MjData, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return position (3,) and frame (3, 3) of the flange."""
    data.qpos[:] = pose
    mujoco.mj_kinematics(compiled(), data)
    frame = data.xmat[-1].reshape(3, 3)
    return data.xpos[-1] + frame @ FLANGE, frame.copy()


def reach(
    place: Float[np.ndarray, "3"], near: Float[np.ndarray, "7"], rounds: int = 300
) -> Float[np.ndarray, "7"]:
    """Return joint positions (7,) that put the flange at ``place`` (3,) [m], pointing down.

    They are close to the pose ``near`` (7,): damped least squares on position, direction of the
    tool and, weakly, distance from ``near``.

    Raises:
        ConfigurationError: if the flange does not get within a millimetre of the place and a degree
            of pointing down.
    """
    model, data, q = compiled(), mujoco.MjData(compiled()), np.array(near, float)
    low, high = model.jnt_range.T
    along, turn = np.zeros((3, JOINTS)), np.zeros((3, JOINTS))
    for _ in range(rounds):
        at, frame = _flange(data, q)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jac(model, data, along, turn, at, model.nbody - 1)
        off = np.concatenate(
            [place - at, np.cross(frame[:, 2], [0.0, 0.0, -1.0]), 1e-3 * (near - q)]
        )
        slope = np.vstack([along, turn, 1e-3 * np.eye(JOINTS)])
        q = np.clip(
            q + np.linalg.solve(slope.T @ slope + 1e-4 * np.eye(JOINTS), slope.T @ off), low, high
        )
    at, frame = _flange(data, q)
    if np.linalg.norm(at - place) > 1e-3 or frame[2, 2] > -np.cos(np.deg2rad(1.0)):
        got = f"{np.round(place, 3).tolist()} m"
        raise ConfigurationError(
            "a place that the arm reaches with its tool pointing down",
            got,
            "choose one closer to its base",
        )
    return q
