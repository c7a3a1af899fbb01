"""A learned feedforward as a folder: all that a robot, the next iteration or a reader needs.

``feedforward.json`` has the numbers and a checksum of every other file; ``weights.npz`` the
networks and the optimiser's state; beside them a copy of the model's file, and of its
``effects.json`` if it has one. The format is in :doc:`/reference/files`.
"""

import contextlib
import hashlib
import io
import json
import os
import secrets
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl import __version__
from jaxidl.errors import JaxidlError, ModelError, StoreError
from jaxidl.files import as_json
from jaxidl.jobs.provenance import revision
from jaxidl.learning.guard import Guard, Region, Strayed
from jaxidl.models import ErrorModel, Learner, Training, start
from jaxidl.systems import tables
from jaxidl.systems.mjcf import Model, read_model

FORMAT = 1
RECORD, WEIGHTS, PROGRAM = "feedforward.json", "weights.npz", "feedforward.jaxexport"


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


def check_folder(folder: Path) -> None:
    """Check that a feedforward can be written at ``folder``: nothing there, or an older one.

    Raises:
        StoreError: if there is something else, or it cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise StoreError(f"a folder at {folder}", "a file", "choose another folder")
    if folder.is_dir():
        there = {str(p.relative_to(folder)) for p in folder.rglob("*") if not p.is_dir()}
        try:
            ours = {RECORD, *_record(folder)["files"]} if there else set[str]()
        except (OSError, ValueError, LookupError, TypeError):
            ours = set[str]()
        if foreign := sorted(there - ours):
            raise StoreError(
                f"an empty folder at {folder}, or one that jaxidl learn wrote",
                f"{foreign[0]}" + f" and {len(foreign) - 1} more" * (len(foreign) > 1),
                "choose another folder",
            )
    above = next(path for path in folder.absolute().parents if path.exists())
    if not (above.is_dir() and os.access(above, os.W_OK | os.X_OK)):
        raise StoreError(f"to write into {above}", "no permission", "choose another folder")


def save(learned: Learned, folder: str | Path, files: Mapping[str, bytes] = {}) -> Path:
    """Write a feedforward whole or not at all; an older one at ``folder`` is replaced.

    Args:
        learned: the feedforward.
        folder: where to.
        files: contents of further files by name, such as a report and its pictures.

    Raises:
        StoreError: if it cannot be written.
        ModelError: if a copy of the model's file alone is another model.
    """
    folder = Path(folder)
    check_folder(folder)
    content = {**(learned.model.files or {}), WEIGHTS: _packed(learned.learner), **files}
    record = _described(learned) | {"files": {name: _sha(data) for name, data in content.items()}}
    record["checksum"] = _sha(_canonical(record))
    content[RECORD] = (as_json(record) + "\n").encode()
    token = secrets.token_hex(4)
    aside, old = (folder.with_name(f".{folder.name}.{token}.{end}") for end in ("tmp", "old"))
    try:
        for name, data in content.items():
            (aside / name).parent.mkdir(parents=True, exist_ok=True)
            with (aside / name).open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        _check_copy(learned.model, aside)
        if folder.exists():
            os.replace(folder, old)
        try:
            os.replace(aside, folder)
        except BaseException:
            if old.exists():
                os.replace(old, folder)
            raise
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise StoreError(
            f"to write {folder}", reason, "free some space or choose another location"
        ) from None
    finally:
        for path in (aside, old):
            with contextlib.suppress(OSError):
                shutil.rmtree(path)
    return folder


def load(folder: str | Path) -> Learned:
    """Return the feedforward in a folder.

    Raises:
        StoreError: if there is none, a file is missing or damaged, or another format is meant.
        ModelError: if its model cannot be read.
    """
    folder = Path(folder)
    expected = f"a feedforward that jaxidl learn wrote at {folder}"
    if not (folder / RECORD).is_file():
        got = "no such folder" if not folder.exists() else f"no {RECORD}"
        raise StoreError(expected, got, "correct the path, or begin without it")
    remedy = "copy the whole folder again, or learn again"
    try:
        record = _record(folder)
        if record["format"] != FORMAT:
            got = f"format {record['format']!r}, written by jaxidl {record.get('jaxidl')}"
            raise StoreError(f"format {FORMAT} in {folder / RECORD}", got, "use that version")
        stated = record.pop("checksum")
        if stated != _sha(_canonical(record)):
            raise StoreError(expected, f"a changed or damaged {RECORD}", remedy)
        for name, sha in record["files"].items():
            if not (folder / name).is_file():
                raise StoreError(expected, f"no {name}", remedy)
            if _sha((folder / name).read_bytes()) != sha:
                raise StoreError(expected, f"a changed or damaged {name}", remedy)
        with jax.enable_x64(True):
            return _restored(record, folder)
    except JaxidlError:
        raise
    except Exception as error:  # whatever a damaged file leads to
        got = f"{type(error).__name__}: {' '.join(str(error).split())[:150]}"
        raise StoreError(expected, got, remedy) from None


def _described(learned: Learned) -> dict[str, Any]:
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


def _restored(record: dict[str, Any], folder: Path) -> Learned:
    """Return what :func:`_described` describes, with the folder's files."""
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


def _packed(learner: Learner) -> bytes:
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


def _check_copy(model: Model, folder: Path) -> None:
    """Raise ModelError unless the copied files alone are the same model."""
    try:
        copy = read_model(folder / model.path.name, model.part)
    except ModelError as error:
        got, same = error.got, False
    else:
        draws = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 8, len(model.names)))
        ours, theirs = (tables.inverse_dynamics(m.plant.body, *draws) for m in (model, copy))
        got, same = "another model", ours.shape == theirs.shape and np.allclose(ours, theirs)
    if not same:
        raise ModelError(
            f"{model.path} to be a whole model by itself",
            f"{got} when it is copied without its folder",
            "merge included files and give links their inertia (<inertial>)",
        )


def _record(folder: Path) -> dict[str, Any]:
    return json.loads((folder / RECORD).read_text(encoding="utf-8"))


def _canonical(record: dict[str, Any]) -> bytes:
    """Return the record as it is after a round trip through JSON."""
    return json.dumps(json.loads(as_json(record)), sort_keys=True).encode()


def _sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
