"""The log of one execution, as a controller recorded it, read as a ``Trajectory``.

One row for each control step: time, sensed positions, desired accelerations, commanded torque and
its parts. Titles, units and formats are those of :mod:`jaxidl.logs`; the names beyond that are
``CONTROL`` in :mod:`jaxidl.logs.words`, and the how-to page "Learn from recorded executions".
"""

import hashlib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.control import FeedbackLaw, Pid
from jaxidl.errors import LogError
from jaxidl.logs import checks
from jaxidl.logs.families import Wanted
from jaxidl.logs.formats import load
from jaxidl.logs.mending import Samples
from jaxidl.logs.missing import near
from jaxidl.logs.numeric import samples
from jaxidl.logs.ros_bag import is_bag, load_bag
from jaxidl.logs.speeds import check_speeds
from jaxidl.logs.table import listed
from jaxidl.robot.checks import balanced, plausible, step_of
from jaxidl.robot.gains import feedback_of
from jaxidl.robot.motion import Moved, moved
from jaxidl.systems import Plant, tables
from jaxidl.systems.mjcf import Model
from jaxidl.types import State, Trajectory

TOLERANCE = 0.05  # of a joint's largest torque: so much may be missing in the sum of its parts
Clip = Callable[[np.ndarray], np.ndarray]
LOGGED = ("qdd_desired", "tau", "tau_feedback", "tau_feedback_applied", "tau_feedforward")
BLOCK = 1024  # rows are padded to a multiple, so that logs of similar length share a program


class Execution(NamedTuple):
    """A recorded execution of T control steps."""

    run: Trajectory  # (T, J); the true state is not known: it is the sensed one
    desired: np.ndarray | None  # (T, J) desired positions [m or rad], if they were logged
    dt: float  # [s] control step
    sha: str  # SHA-256 of the file, or of a bag's files
    name: str  # of the file
    notes: tuple[str, ...]


def read_execution(
    path: Path,
    model: Model,
    *,
    law: FeedbackLaw | None = None,
    columns: Sequence[str] = (),
    motion: str = "offline",
    torque_limit: np.ndarray | float = np.inf,
    tolerance: float = TOLERANCE,
    topic: str | None = None,
) -> Execution:
    """Return the execution in a log.

    Args:
        path: CSV, NPZ, Parquet, or a ROS bag.
        model: of the robot; its plant's inverse dynamics are part of the command.
        law: feedback law, from which feedback that was not logged is computed.
        columns: which column is which, as for :func:`jaxidl.logs.read`.
        motion: how velocities and accelerations are estimated that were not logged.
        torque_limit: (J,) bound of each part of the command [N or Nm].
        tolerance: largest difference between the command and the sum of its parts, as a share of
            the joint's largest command.
        topic: topic of a ROS bag.

    Raises:
        LogError: if the log cannot be used.
        ConfigurationError: for an unknown ``motion``.
    """
    found = _samples(path, model, columns, topic)
    dt = step_of(found)
    signals = {kind: values.astype(float) for kind, values in found.signals.items()}
    _complete(found, law)
    if "qd" in signals:
        check_speeds(signals["q"], signals["qd"], dt, [slice(0, len(found.time))])
    notes = [*found.notes, *_odd(found, dt)]
    plausible(found, model, dt)
    estimate = moved(motion, signals, model, dt)
    signals = {kind: values[: len(estimate.qd)] for kind, values in signals.items()}
    clip = lambda tau: np.clip(tau, -np.asarray(torque_limit), np.asarray(torque_limit))
    if "tau_feedforward" not in signals:
        signals["tau_feedforward"] = np.zeros_like(signals["tau"])
        notes.append(f"no tau_feedforward in {found.table.name}: taken as zero")
    if law is not None:
        _add_feedback(signals, law, estimate, dt, clip)
    _sums(found, signals, estimate.qd, model, clip, tolerance)
    run = _trajectory(signals, estimate, model.plant, clip)
    files = sorted(path.iterdir()) if path.is_dir() else [path]  # a bag may be a folder
    sha = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    return Execution(run, signals.get("q_desired"), dt, sha, found.table.name, tuple(notes))


def _samples(path: Path, model: Model, columns: Sequence[str], topic: str | None) -> Samples:
    """Return the signals in a file that are those of the model's joints."""
    joints = len(model.names)
    wanted = Wanted(joints, model.names, tuple(range(joints)), tuple(columns), control=True)
    table = load_bag(path, wanted, topic) if is_bag(path) else load(path, wanted)
    return samples(table, joints, exact=True)


def _trajectory(
    signals: dict[str, np.ndarray], estimate: Moved, plant: Plant, clip: Clip
) -> Trajectory:
    """Return all signals (T, J) of an execution, with the model's torques."""
    motions = (estimate.qdd, signals["qdd_desired"])
    actual, rigid = (clip(along(plant, signals["q"], estimate.qd, x)) for x in motions)
    q, qd = jnp.asarray(signals["q"]), jnp.asarray(estimate.qd)
    return Trajectory(
        q=q,
        qd=qd,
        q_sensing=q,
        qd_sensing=qd,
        qdd_actual=jnp.asarray(estimate.qdd),
        tau_inverse_desired=jnp.asarray(rigid),
        tau_inverse_actual=jnp.asarray(actual),
        **{name: jnp.asarray(signals[name]) for name in LOGGED},
    )


def along(plant: Plant, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> np.ndarray:
    """Return a plant's inverse dynamics (T, J) along states and accelerations (T, J) each."""
    rows = len(qdd)
    pad = partial(np.pad, pad_width=((0, -rows % BLOCK), (0, 0)), mode="edge")
    return np.asarray(_along(plant, *(pad(part) for part in (q, qd, qdd))))[:rows]


@jax.jit
def _along(plant: Plant, q: jax.Array, qd: jax.Array, qdd: jax.Array) -> jax.Array:
    return jax.vmap(plant.inverse_dynamics)(q, qd, qdd)


def _complete(found: Samples, law: FeedbackLaw | None) -> None:
    """Raise LogError if a signal is missing that cannot be computed."""
    table, there = found.table, found.signals
    needed = {"qdd_desired": "log what the policy demands in every control step"}
    if law is None:
        remedy = "log it, or give the gains to compute it (--gains FILE)"
        needed |= {"tau_feedback_applied": remedy, "tau_feedback": remedy}
    elif isinstance(law, Pid) and not {"tau_feedback_applied", "tau_feedback"} <= there.keys():
        needed["q_desired"] = "log the desired positions, to which the gains apply"
    for kind, remedy in needed.items():
        if kind not in there:
            last = there["q"].shape[1] - 1
            span = f"column {kind}0" if not last else f"columns {kind}0..{kind}{last}"
            got = f"columns {listed([*table.columns, *table.ignored], 20)}"
            raise LogError(f"{span} in {table.name}", got, near(table, f"{kind}0") or remedy)


def _odd(found: Samples, dt: float) -> list[str]:
    """Return notes on what is odd; raise LogError if nothing moved or no torque acted."""
    signals, time = found.signals, found.time
    notes = checks.motion(signals["q"], signals["tau"], time, [slice(0, len(time))])
    off = float(np.abs(np.diff(time) - dt).max() / dt)
    if off > 0.02:
        notes.append(f"time stamps are up to {off:.0%} of a step off: taken as one row a step")
    return notes


def _add_feedback(
    signals: dict[str, np.ndarray], law: FeedbackLaw, estimate: Moved, dt: float, clip: Clip
) -> None:
    """Compute the feedback (T, J) that was not logged, from the law's gains."""
    sensed = State(jnp.asarray(signals["q"]), jnp.asarray(estimate.qd))
    desired = sensed
    if "q_desired" in signals:
        speed = signals.get("qd_desired", np.gradient(signals["q_desired"], dt, axis=0))
        desired = State(jnp.asarray(signals["q_desired"]), jnp.asarray(speed))
    accelerations = map(jnp.asarray, (estimate.qdd_desired, estimate.qdd))
    feedback = feedback_of(law, desired, sensed, *accelerations)
    signals.setdefault("tau_feedback_applied", clip(np.asarray(feedback.applied)))
    signals.setdefault("tau_feedback", clip(np.asarray(feedback.learning)))


def _sums(
    found: Samples,
    signals: dict[str, np.ndarray],
    qd: np.ndarray,
    model: Model,
    clip: Clip,
    tolerance: float,
) -> None:
    """Raise LogError unless the command is the sum of its parts."""
    state = signals["q"], qd, signals["qdd_desired"]
    # without effects MuJoCo in C will do: nothing to compile for a log that is refused
    rigid = (
        along(model.plant, *state)
        if model.plant.effects
        else tables.inverse_dynamics(model.plant.body, *state)
    )
    more = signals["tau_feedback_applied"] + signals["tau_feedforward"]
    logged = signals.get("tau_inverse_desired")
    check = partial(balanced, found, tolerance=tolerance, model=model)
    if logged is not None:
        what = "tau = tau_inverse_desired + tau_feedback_applied + tau_feedforward"
        check(what, signals["tau"], logged + more, remedy="check signs, units and order of columns")
        check(
            "tau_inverse_desired as the model gives it",
            logged,
            clip(rigid),
            remedy="give the model by which the robot was commanded, and --torque-limit if it has",
        )
    check(
        "tau = inverse dynamics of the model + tau_feedback_applied + tau_feedforward",
        signals["tau"],
        clip(rigid) + more,
        remedy=(
            "check signs, units and joints' order, that all parts were logged, --model and"
            " --torque-limit"
        ),
    )
