"""A learned feedforward, as a record ready for JSON and as arrays."""

import io
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl import __version__
from jaxidl.errors import StoreError
from jaxidl.jobs.provenance import revision
from jaxidl.learning.guard import Guard, Region, Strayed
from jaxidl.models import ErrorModel, Learner, Training, start
from jaxidl.systems.mjcf import Model, read_model

FORMAT = 1
WEIGHTS = "weights.npz"


@dataclass(frozen=True)
class Learned:
    """A learned feedforward, and what the next iteration continues from."""

    model: Model  # inverse dynamics are those of ``model.plant``, effects of the file included
    error_model: ErrorModel
    learner: Learner  # weights and the optimiser's state, leaves (J, ...)
    training: Training
    source: str
    iteration: int  # k: so many trainings so far
    seed: int
    kept: int  # earlier executions that are learned from, too
    dt: float  # [s] control step
    torque_limit: np.ndarray  # (J,) bound of each part of the command [N or Nm]; inf: none
    feedforward_limit: np.ndarray  # (J,) bound of the learned torque [N or Nm]; inf: none
    motion: str  # how velocities and accelerations were estimated
    logs: tuple[str, ...] = ()  # SHA-256 of the logs of all executions so far
    history: tuple[dict[str, Any], ...] = ()  # one record of errors for each iteration
    strayed: Strayed | None = None  # over all executions so far, if desired positions are known
    guard: Guard | None = None
    region: Region | None = None  # with a guard: where the model may drive
    smoothing: float | None = None  # weight of a new sample in the learning feedback, if known


def described(learned: Learned) -> dict[str, Any]:
    """Return all but the files' checksums, ready for JSON."""
    model, region = learned.model, learned.region
    number = lambda leaf: np.asarray(leaf, float).tolist()
    return {
        "format": FORMAT,
        "jaxidl": __version__,
        "revision": revision(),
        "model": model.path.name,
        "joints": list(model.names),
        "part": model.part and list(model.part),
        "units": list(model.units),
        "dt": learned.dt,
        "network": asdict(learned.error_model),
        "torque_limit": number(learned.torque_limit),
        "feedforward_limit": number(learned.feedforward_limit),
        "source": learned.source,
        "smoothing": learned.smoothing,
        "motion": learned.motion,
        "iteration": learned.iteration,
        "seed": learned.seed,
        "kept": learned.kept,
        "training": asdict(learned.training),
        "logs": list(learned.logs),
        "history": list(learned.history),
        "strayed": learned.strayed and {k: number(v) for k, v in learned.strayed._asdict().items()},
        "guard": learned.guard and asdict(learned.guard),
        "region": region and {k: number(getattr(region, k)) for k in _REGION},
    }


_REGION = ("lowest", "highest", "least", "most", "reach")


def restored(record: dict[str, Any], folder: Path) -> Learned:
    """Return what :func:`described` describes, with the folder's files.

    Raises:
        StoreError: if the joints are not those of the model's file.
        Exception: of any kind if a file is damaged; :func:`jaxidl.robot.folder.load` says so.
    """
    network = record["network"]
    for name in ("layers", "circumstance_scales"):
        network[name] = tuple(network[name])
    error_model, training = ErrorModel(**network), Training(**record["training"])
    model = read_model(folder / record["model"], record["part"])
    if list(model.names) != record["joints"] or error_model.joints != len(model.names):
        got = f"{', '.join(model.names[:8])} in {record['model']}"
        raise StoreError(f"joints {', '.join(record['joints'][:8])}", got, "learn again")
    numbers = lambda part: {name: jnp.asarray(value) for name, value in part.items()}
    guard = Guard(**record["guard"]) if record["guard"] else None
    region = None
    if guard is not None and record["region"]:
        region = Region(**numbers(record["region"]), near=guard.near, far=guard.far)
    return Learned(
        model,
        error_model,
        _unpacked(folder / WEIGHTS, error_model, training),
        training,
        source=record["source"],
        smoothing=record["smoothing"],
        iteration=int(record["iteration"]),
        seed=int(record["seed"]),
        kept=int(record["kept"]),
        dt=float(record["dt"]),
        torque_limit=_bound(record["torque_limit"]),
        feedforward_limit=_bound(record["feedforward_limit"]),
        motion=record["motion"],
        logs=tuple(record["logs"]),
        history=tuple(record["history"]),
        strayed=Strayed(**numbers(record["strayed"])) if record["strayed"] else None,
        guard=guard,
        region=region,
    )


def _bound(limits: list[float | None]) -> np.ndarray:
    """Return limits (J,); JSON has no infinity."""
    return np.array([np.inf if limit is None else limit for limit in limits], float)


def _parts(learner: Learner) -> dict[str, Any]:
    """Return the learner's arrays by name: ``weights_0``, ..., ``mu/weights_0``, ..., ``count``."""
    adam = learner.optimiser
    trees = {"": learner.params["params"], "mu/": adam.mu["params"], "nu/": adam.nu["params"]}
    found = {f"{part}{name}": leaf for part, tree in trees.items() for name, leaf in tree.items()}
    return found | {"count": adam.count}


def packed(learner: Learner) -> bytes:
    buffer = io.BytesIO()
    arrays = {name: np.asarray(leaf) for name, leaf in _parts(learner).items()}
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _unpacked(path: Path, model: ErrorModel, training: Training) -> Learner:
    """Return the learner in a file, of the shapes that its networks have."""
    like = jax.eval_shape(lambda: start(training, model.init(jax.random.key(0))))
    with np.load(path, allow_pickle=False) as stored:
        found = {name: jnp.asarray(stored[name]) for name in _parts(like)}
    for name, leaf in _parts(like).items():
        if found[name].shape != leaf.shape or not np.isfinite(found[name]).all():
            raise ValueError(f"{name} of shape {found[name].shape} instead of {leaf.shape}, or NaN")
    tree = lambda part: {"params": {name: found[part + name] for name in like.params["params"]}}
    optimiser = like.optimiser._replace(mu=tree("mu/"), nu=tree("nu/"), count=found["count"])
    return Learner(tree(""), optimiser)
