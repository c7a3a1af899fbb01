"""The strength of a hidden effect: RMS torque over RMS command of a joint.

It also gives the combined torque of the errors of links.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxidl.gap.benchmark.believed import inverse_dynamics, mujoco
from jaxidl.gap.benchmark.engine import has
from jaxidl.gap.benchmark.injected import Injected
from jaxidl.gap.benchmark.reference import Array
from jaxidl.gap.benchmark.transmission import JointElasticity

PARAMETERS = ("mass", "mx", "my", "mz", "xx", "yy", "zz", "xy", "xz", "yz")
"""A link's inertial parameters about its body's origin: mass, first moments, inertia.

The rotor's is called ``"rotor"``.
"""


class Motion(NamedTuple):
    """A motion of T instants of J joints and its torques; SI units."""

    time: Array  # (T,)
    q: Array  # (T, J)
    qd: Array  # (T, J)
    qdd: Array  # (T, J)
    tau: Array  # (T, J)


def rms(x: Array) -> Array:
    """Return the root mean square over time (J,) of ``x`` (T, J)."""
    return np.sqrt((np.asarray(x) ** 2).mean(axis=0))


def altered(xml: str, effects: Sequence[Injected]) -> Any:
    """Return the compiled model ``xml`` as the ``effects`` alter it."""
    spec = mujoco.MjSpec.from_string(xml)
    for effect in effects:
        effect.alter(spec)
    return spec.compile()


def acts(effect: Injected, xml: str, motion: Motion) -> Array:
    """Return the torque (T, J) that ``effect`` adds to the motors' on ``motion``.

    The motion is taken as it is, without the changes that the effect would cause. A changed body
    and a wrong reading count as the difference of inverse dynamics; dry friction only where the
    joint moves. What is hidden behind a spring is not counted: that needs a simulation.
    """
    added = np.zeros_like(motion.tau)
    dt = float(motion.time[1] - motion.time[0])
    j = effect.joint
    if (
        not isinstance(effect, JointElasticity)
        and has(effect, "alter")
        and not has(effect, "passive")
    ):
        body = altered(xml, [effect])
        more = inverse_dynamics(body, motion.q, motion.qd, motion.qdd)
        added -= more - inverse_dynamics(altered(xml, []), motion.q, motion.qd, motion.qdd)
    effect.start(dt, float(motion.q[0, j]), float(motion.tau[0, j]))
    late, bias = effect.encoder()
    if late or bias or has(effect, "misread"):
        read = motion.q.copy()
        read[:, j] = np.interp(motion.time - late, motion.time, motion.q[:, j]) + bias
        read[:, j] += [effect.misread(float(q)) for q in motion.q[:, j]]
        model = altered(xml, [])
        believed = inverse_dynamics(model, read, motion.qd, motion.qdd)
        added += believed - inverse_dynamics(model, motion.q, motion.qd, motion.qdd)
    for k, (t, q, qd, tau) in enumerate(
        zip(motion.time, motion.q.tolist(), motion.qd.tolist(), motion.tau.tolist(), strict=True)
    ):
        delivered = effect.actuate(float(t), tau[j])
        added[k, j] += delivered - tau[j] + effect.torque(float(t), q, qd, delivered)
        forward, backward, _ = effect.dry(q[j], qd[j], delivered)
        added[k, j] += (-forward if qd[j] > 0 else backward) if abs(qd[j]) > 1e-3 else 0.0
        other, more = effect.spread(tau)
        added[k, other] += more
        for other, torque in effect.passive(qd).items():
            added[k, other] += torque
    return added


def columns(xml: str, motion: Motion) -> tuple[list[str], Array]:
    """Return names and regressor (T, J, P) of the inertial parameters of all links and rotors.

    The regressor is the torque of a unit of each. Names are ``"link 2 mx"`` (see
    :data:`PARAMETERS`) and ``"link 2 rotor"``. Inverse dynamics is linear in them, so they come
    from small changes of a compiled model; inertia is that about the body's origin.
    """
    model = altered(xml, [])
    base = inverse_dynamics(model, motion.q, motion.qd, motion.qdd)
    names, found = [], []
    for j in range(model.njnt):
        body = int(model.jnt_bodyid[j])
        before = _inertial(model, body)
        for n, name in enumerate(PARAMETERS):
            size = 0.02 * before[0] * (1.0, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01)[n]
            after = before.copy()
            after[n] += size
            _set(model, body, after)
            found.append((inverse_dynamics(model, motion.q, motion.qd, motion.qdd) - base) / size)
            names.append(f"link {j} {name}")
        _set(model, body, before)
        rotor = np.zeros_like(base)
        rotor[:, j] = motion.qdd[:, j]
        found.append(rotor)
        names.append(f"link {j} rotor")
    return names, np.stack(found, axis=2)


def inertial(model: Any) -> Array:
    """Return the inertial parameters (J, 11) of all links of a compiled model.

    They are in the order of :func:`columns`.
    """
    rows = [
        [*_inertial(model, int(model.jnt_bodyid[j])), model.dof_armature[j]]
        for j in range(model.njnt)
    ]
    return np.array(rows)


def _inertial(model: Any, body: int) -> Array:
    """Return the ten parameters of a body and of what is fixed to it, about its origin."""
    total = _own(model, body, np.zeros(3))
    for child in range(model.nbody):
        if model.body_parentid[child] == body and model.body_jntnum[child] == 0:
            total += _own(model, child, np.array(model.body_pos[child]))
    return total


def _own(model: Any, body: int, at: Array) -> Array:
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    axes, mass, centre = (
        turn.reshape(3, 3),
        float(model.body_mass[body]),
        at + model.body_ipos[body],
    )
    about = axes @ np.diag(model.body_inertia[body]) @ axes.T + mass * (
        centre @ centre * np.eye(3) - np.outer(centre, centre)
    )
    return np.array(
        [mass, *(mass * centre), *np.diag(about), about[0, 1], about[0, 2], about[1, 2]]
    )


def _set(model: Any, body: int, ten: Array) -> None:
    """Give a body its ten parameters.

    They need not be those of a possible body, since only its inverse dynamics is used.
    """
    mass, centre = ten[0], ten[1:4] / ten[0]
    xx, yy, zz, xy, xz, yz = ten[4:]
    about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - mass * (
        centre @ centre * np.eye(3) - np.outer(centre, centre)
    )
    moments, axes = np.linalg.eigh(about)
    axes = axes * np.linalg.det(axes)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    model.body_mass[body], model.body_ipos[body] = mass, centre
    model.body_inertia[body], model.body_iquat[body] = moments, quaternion
    model.body_sameframe[body] = 0  # the axes of inertia are no longer those of the body
