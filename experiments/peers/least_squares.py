"""Least squares: viscous and dry friction, offset and rotor inertia of every joint, on the nominal
body or with free links.

``python least_squares.py CASE nominal|links ANSWER.json``. With free links every body has its ten
inertial parameters in the fit (drawn to nominal a little: a log tells only sums apart). With a
reference the old log is fitted, too, with the same parameters but for a load at the last body,
which only the new log has.
"""

# MuJoCo's names are made when it is imported, where a type checker does not see them
# pyright: reportAttributeAccessIssue=false

import sys

import mujoco
import numpy as np
from cases import CASES, Run, held_out_error, inverse_dynamics, prepare, save


# >>> what a user writes
def friction(run: Run) -> np.ndarray:
    """Columns (T, J, J·4): viscous, dry, rotor, offset of each joint."""
    samples, joints = run.q.shape
    columns = np.zeros((samples, joints, joints, 4))
    for j in range(joints):
        columns[:, j, j] = np.stack(
            [run.qd[:, j], np.sign(run.qd[:, j]), run.qdd[:, j], np.ones(samples)], axis=-1
        )
    return columns.reshape(samples, joints, -1)


# <<<
# >>> with free links
def cross(a: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def on_inertia(w: np.ndarray) -> np.ndarray:
    """Matrix (3, 6) with inertia·w = matrix @ (xx, yy, zz, xy, xz, yz)."""
    x, y, z = w
    return np.array([[x, 0, 0, y, z, 0], [0, y, 0, x, 0, z], [0, 0, z, 0, x, y]])


def links(model: mujoco.MjModel, run: Run) -> np.ndarray:
    """Columns (T, J, J·10): torque per mass, first moment (3) and inertia (6) of each joint's body
    about its frame's origin.
    """
    data, (samples, joints) = mujoco.MjData(model), run.q.shape
    out = np.zeros((samples, joints, joints, 10))
    velocity, acceleration, jp, jr = (
        np.zeros(6),
        np.zeros(6),
        np.zeros((3, model.nv)),
        np.zeros((3, model.nv)),
    )
    for t in range(samples):
        data.qpos[:], data.qvel[:], data.qacc[:] = run.q[t], run.qd[t], run.qdd[t]
        mujoco.mj_inverse(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        for j in range(joints):
            b = int(model.jnt_bodyid[j])
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, b, velocity, 1)
            # gravity is in it
            mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_XBODY, b, acceleration, 1)
            mujoco.mj_jacBody(model, data, jp, jr, b)
            w, dw, a = velocity[:3], acceleration[:3], acceleration[3:]
            force, moment = np.zeros((3, 10)), np.zeros((3, 10))
            force[:, 0], force[:, 1:4] = a, cross(dw) + cross(w) @ cross(w)
            moment[:, 1:4], moment[:, 4:] = -cross(a), on_inertia(dw) + cross(w) @ on_inertia(w)
            frame = data.xmat[b].reshape(3, 3)
            out[t, :, j] = (frame.T @ jp).T @ force + (frame.T @ jr).T @ moment
    return out.reshape(samples, joints, -1)


# <<<
# >>> what a user writes
def solve(columns: np.ndarray, target: np.ndarray, free: int) -> np.ndarray:
    """Parameters (P,) for columns (N, J, P) and torques (N, J), each joint weighted by what is left
    on it.

    All but the first ``free`` are drawn to zero a little: links stay nominal where the log cannot
    tell them from rotors.
    """
    scale = np.sqrt((columns**2).mean(axis=(0, 1))) + 1e-12
    found, weight, drawn = (
        np.zeros(len(scale)),
        np.ones(target.shape[1]),
        np.arange(len(scale)) >= free,
    )
    for _ in range(3):
        weighted = (columns / scale / weight[:, None]).reshape(-1, len(scale))
        gram = weighted.T @ weighted + np.diag(
            np.where(drawn, 1e-6, 1e-9) * len(weighted) / weight.min() ** 2
        )
        found = np.linalg.solve(gram, weighted.T @ (target / weight).ravel()) / scale
        weight = (target - columns @ found).std(axis=0)
    return found


# <<<


def main(name: str, body: str, answer: str) -> None:
    case = CASES[name]
    runs = [prepare(case, file) for file in case.runs]
    if case.reference:
        runs.append(prepare(case, case.reference))
    joints, nominal = case.body.nv, [inverse_dynamics(case.body, r) for r in runs]
    columns = [friction(r) for r in runs]
    each = [links(case.body, r) for r in runs] if body == "links" or case.reference else []
    if body == "links":
        columns = [np.concatenate([c, x], axis=2) for c, x in zip(columns, each, strict=True)]
    if case.reference:  # what the new log alone has: a load at the last body
        only_new = [x[:, :, -10:] * (k < len(case.runs)) for k, x in enumerate(each)]
        columns = [np.concatenate([c, x], axis=2) for c, x in zip(columns, only_new, strict=True)]
    columns = [
        r.smooth(c.reshape(len(c), -1)).reshape(c.shape) for r, c in zip(runs, columns, strict=True)
    ]
    left = [r.tau - r.smooth(n) for r, n in zip(runs, nominal, strict=True)]
    rows = [r.fitted for r in runs]
    stack = lambda parts: np.concatenate([p[k] for p, k in zip(parts, rows, strict=True)])
    found = solve(stack(columns), stack(left), 4 * joints)
    new = slice(len(case.runs))
    # measured minus left is the smoothed nominal torque: columns are smoothed already, so the error
    # is formed here
    errors = np.concatenate(
        [
            (y - c @ found)[r.held_out]
            for y, c, r in zip(left[new], columns[new], runs[new], strict=True)
        ]
    )
    spread = np.concatenate([r.tau[r.held_out] for r in runs[new]]).std(axis=0)
    four = found[: 4 * joints].reshape(joints, 4)
    estimated: dict[str, object] = dict(
        zip(("viscous", "dry", "rotor", "offset"), four.T.tolist(), strict=True)
    )
    if case.reference:
        load = found[-10:]
        estimated |= {"payload": load[0], "payload_centre": (load[1:4] / load[0]).tolist()}
    save(
        answer,
        held_out=(np.sqrt((errors**2).mean(axis=0)) / spread).tolist(),
        before=held_out_error(runs[new], nominal[new]),
        estimated=estimated,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
