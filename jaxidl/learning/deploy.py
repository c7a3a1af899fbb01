"""A trained feedforward as one file for a robot's control computer.

The computer needs JAX and flatbuffers but not this package. The paper's control loop runs at 1 kHz
in hard real time, and all networks' predictions take less than 1 ms of it. There, ::

    feedforward = jax.export.deserialize(bytearray(Path("feedforward.jaxexport").read_bytes()))
    # seconds, once, before the loop
    torque = jax.jit(feedforward.call).lower(*feedforward.in_avals).compile()

and in the loop ``np.asarray(torque(q, qd, qdd_desired))`` on float32 arrays. ``feedforward.call``
by itself is dispatched again at every call, which takes most of a millisecond.
``experiments/bench/real_time.py`` shows how to keep a loop on time.

The file is in single precision, because one in double precision can only be called in a process
that has set ``jax_enable_x64``, and is no faster. Rounding changes the arm's torques by up to 4e-5
Nm.
"""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
from jax import export
from jax.typing import ArrayLike
from jaxtyping import Array

from jaxidl.learning.execute import Task
from jaxidl.learning.guard import Region
from jaxidl.models import ErrorModel, Params
from jaxidl.systems import Plant, RigidBody
from jaxidl.types import Joints, State

PLATFORMS = ("cpu", "cuda")  # one file runs on all of these; JAX selects the one available
DTYPE = jnp.float32
Inverse = RigidBody | Plant  # both have inverse dynamics


def feedforward(
    task: Task,
    model: Inverse,
    error_model: ErrorModel,
    params: Params,
    region: Region | None = None,
    parts: bool = False,
) -> Callable[..., Array]:
    """Return the whole command except feedback, as a function.

    It is what :func:`jaxidl.learning.execute.execute` computes from a sensed state.

    Args:
        task: its limits bound the torques.
        model: the modelled rigid body.
        error_model: J networks.
        params: their weights, as trained.
        region: where the guard lets the model drive (:mod:`jaxidl.learning.guard`); the function
            then needs desired positions, too. Default: no guard.
        parts: keep the two torques apart, as a log of an execution needs them.

    Returns:
        A function of position ``q`` (J,) [rad], velocity ``qd`` (J,) [rad/s], desired acceleration
            (J,) [rad/s^2], with a ``region`` desired position (J,) [rad] and, if the error model
            uses any, circumstances (C,), to torque (J,) [Nm]: ``model``'s inverse dynamics within
            ``task.torque_limit`` plus the error model's torque within ``task.feedforward_limit``
            and ``task.torque_limit``; with ``parts`` (2, J), these two one below the other.
    """

    def bounded(tau: Joints) -> Joints:
        return task.clip(jnp.clip(tau, -task.feedforward_limit, task.feedforward_limit))

    def torque(q: Joints, qd: Joints, qdd_desired: Joints, *more: Array) -> Array:
        tau_rbd = task.clip(model.inverse_dynamics(q, qd, qdd_desired))
        if region is None:
            learned = error_model.torque(params, State(q, qd), qdd_desired, *more)
        else:
            desired, *circumstances = more
            drive = region.feedforward(error_model, params)
            learned = drive(State(q, qd), qdd_desired, *(circumstances or (None,)))
            learned = region.fade(State(q, qd), State(desired, qd)) * bounded(learned)
        tau_ff = bounded(learned)
        return jnp.stack([tau_rbd, tau_ff]) if parts else tau_rbd + tau_ff

    return torque


def export_feedforward(
    task: Task,
    model: Inverse,
    error_model: ErrorModel,
    params: Params,
    platforms: Sequence[str] = PLATFORMS,
    region: Region | None = None,
    parts: bool = False,
) -> bytes:
    """Return :func:`feedforward` in float32 as a file's content.

    Weights and limits are constants in it. Write it with ``files.write_bytes``. JAX can read it
    back for half a year of its releases; a JAX older than the one that wrote it may not be able to.

    Args:
        task: its limits bound the torques [Nm].
        model: the modelled rigid body.
        error_model: J networks; those that use C circumstances give the function a fourth argument
            (C,).
        params: their weights, as trained.
        platforms: the platforms that the file is to run on, by JAX's names.
        region: of the guard, as for :func:`feedforward`; so are ``parts``.
    """
    bounds = {"torque_limit": task.torque_limit, "feedforward_limit": task.feedforward_limit}
    bounds, model, params, region = jax.tree.map(_single, (bounds, model, params, region))
    shapes = [(error_model.joints,)] * (3 if region is None else 4)
    if error_model.circumstance_scales:
        shapes.append((len(error_model.circumstance_scales),))
    # without float64, as in the process that will load it; a GPU would round the inputs of
    # products to 10 bits (TF32)
    with jax.enable_x64(False), jax.default_matmul_precision("float32"):
        program = jax.jit(
            feedforward(task.replace(**bounds), model, error_model, params, region, parts)
        )
        exported = export.export(program, platforms=platforms)(
            *(jax.ShapeDtypeStruct(shape, DTYPE) for shape in shapes)
        )
    return bytes(exported.serialize())


def _single(leaf: ArrayLike) -> Array:
    leaf = jnp.asarray(leaf)
    return leaf.astype(DTYPE) if jnp.issubdtype(leaf.dtype, jnp.floating) else leaf
