"""What a rigid body contributes along a log, and how that changes with everything that may be wrong about it."""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import copy
from typing import Any, NamedTuple

import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jaxtyping import Array, Float
from scipy.interpolate import interp1d

from jaxidl.systems.mujoco_body import LOAD
from jaxidl.systems.point_mass import PointMass
from jaxidl.types import Joints, Scalar

Rows = Float[np.ndarray, "T J"]

_POINTS = np.array(
    [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 0], [0, 1, 1], [1, 0, 1]], float
)


def _monomials(com: Any) -> Any:
    """1, the three coordinates, and their six products: a point mass's torque is linear in these times its mass."""
    x, y, z = com
    return jnp.stack([jnp.ones_like(x), x, y, z, x * x, y * y, z * z, x * y, y * z, x * z])


_FROM_POINTS = np.linalg.inv(
    np.stack([[1, x, y, z, x * x, y * y, z * z, x * y, y * z, x * z] for x, y, z in _POINTS])
)  # (10, 10)


class Tables(NamedTuple):
    """One row per instant (T rows, or none inside a ``vmap``). Inverse dynamics is linear in everything but the state.

    Arrays are NumPy's along a log, and JAX's in what is compiled.
    """

    torque: Float[Any, "*T J"]  # inverse dynamics [N or Nm]
    inertia: Float[Any, "*T J J"]  # its derivative by acceleration: the inertia matrix
    by_q: Float[Any, "*T J J"]  # ... by position
    by_qd: Float[Any, "*T J J"]  # ... by velocity
    by_mass: Float[Any, "*T J J"]  # ... by the mass of each joint's body
    by_load: Float[Any, "*T J 10"]  # ... by a load times the monomials of its place


def tables(body: Any, q: Rows, qd: Rows, qdd: Rows, stride: int = 1) -> Tables:
    """Tables of ``body`` along a log (T, J), in float64 NumPy.

    ``torque`` is exact at every instant; the others are computed at every ``stride``-th and interpolated.
    """
    if isinstance(body, PointMass):
        return _of_point_mass(np.asarray(body.mass, float), qdd)
    coarse = np.unique(np.append(np.arange(0, len(q), stride), len(q) - 1))
    model = _Inverse(body.source)
    torque = model(q, qd, qdd)
    parts = _derivatives(body, q[coarse], qd[coarse], qdd[coarse])
    if len(coarse) < len(q):
        spread = interp1d(coarse, np.concatenate([p.reshape(len(coarse), -1) for p in parts], 1), axis=0, assume_sorted=True)
        flat = np.split(spread(np.arange(len(q))), np.cumsum([p[0].size for p in parts])[:-1], axis=1)
        parts = [values.reshape(len(q), *p.shape[1:]) for values, p in zip(flat, parts, strict=True)]
    return Tables(torque, *parts)


def inverse_dynamics(body: Any, q: Rows, qd: Rows, qdd: Rows) -> Rows:
    """Inverse dynamics (T, J) [N or Nm] of ``body`` along a log, in float64 NumPy."""
    if isinstance(body, PointMass):
        return np.asarray(body.mass, float) * qdd
    return _Inverse(body.source)(q, qd, qdd)


def _of_point_mass(mass: np.ndarray, qdd: np.ndarray) -> Tables:
    eye, none = np.eye(len(mass)), np.zeros((*qdd.shape, len(mass)))
    by_load = np.zeros((*qdd.shape, 10))
    by_load[..., 0] = qdd
    return Tables(mass * qdd, none + np.diag(mass), none, none, qdd[..., None] * eye, by_load)


def _derivatives(body: Any, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> list[np.ndarray]:
    """Central differences by position and velocity; exact ones by what inverse dynamics is linear in.

    MuJoCo in C does this in seconds where MJX's derivatives take minutes to compile; the test compares both.
    """
    model, joints = _Inverse(body.source), q.shape[1]
    plain, still = model(q, qd, qdd), model(q, qd, 0.0 * qdd)
    columns = np.eye(joints)

    def central(which: int, step: float) -> np.ndarray:
        def moved(column: np.ndarray) -> np.ndarray:
            return model(q + step * column, qd, qdd) if which == 0 else model(q, qd + step * column, qdd)

        return np.stack([(moved(c) - moved(-c)) / (2.0 * step) for c in columns], -1)

    inertia = np.stack([model(q, qd, np.broadcast_to(c, q.shape)) - still for c in columns], -1)
    by_mass = np.stack([_Inverse(body.source, body.bodies[j])(q, qd, qdd) - plain for j in range(joints)], -1)
    load = mujoco.mj_name2id(body.source, mujoco.mjtObj.mjOBJ_BODY, LOAD)
    at_points = np.stack([_Inverse(body.source, load, point)(q, qd, qdd) - plain for point in _POINTS], -1)
    by_load = at_points @ _FROM_POINTS.T
    by_load[np.abs(by_load) < 1e-9 * np.abs(by_load).max()] = 0.0  # rounding is no information
    return [inertia, central(0, 1e-5), central(1, 1e-5), by_mass, by_load]


class _Inverse:
    """MuJoCo's inverse dynamics along a log, of the model with one body 1 kg heavier if one is named."""

    def __init__(self, source: mujoco.MjModel, body: int | None = None, place: np.ndarray | None = None):
        self.model = source
        if body is not None:
            self.model = copy.copy(source)
            mass = source.body_mass[body]
            self.model.body_mass[body] = mass + 1.0
            self.model.body_inertia[body] *= (mass + 1.0) / mass if mass > 0.0 else 1.0
            if place is not None:
                self.model.body_ipos[body] = place
        self.data = mujoco.MjData(self.model)

    def __call__(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
        out = np.empty(q.shape)
        model, data, inverse = self.model, self.data, mujoco.mj_inverse
        position, velocity, acceleration, force = data.qpos, data.qvel, data.qacc, data.qfrc_inverse
        for t in range(len(q)):
            position[:], velocity[:], acceleration[:] = q[t], qd[t], qdd[t]
            inverse(model, data)
            out[t] = force
        return out


class TabledBody(struct.PyTreeNode):
    """A body at one instant of a log: it can be altered as any other, and tells by how much its inverse dynamics then differs."""

    table: Tables
    qdd: Joints
    extra: Joints  # (J,) [N or Nm] what the alterations add

    def add_inertia(self, extra: Joints) -> "TabledBody":
        return self.replace(extra=self.extra + extra * self.qdd)

    def add_mass(self, extra: Joints | Scalar) -> "TabledBody":
        return self.replace(extra=self.extra + self.table.by_mass @ (extra + jnp.zeros_like(self.qdd)))

    def add_payload(self, mass: Scalar, com: Float[Array, "3"]) -> "TabledBody":
        return self.replace(extra=self.extra + mass * (self.table.by_load @ _monomials(com)))
