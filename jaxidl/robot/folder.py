"""A learned feedforward as a folder: all that a robot, the next iteration or a reader needs.

``feedforward.json`` has the numbers and a checksum of every other file; ``weights.npz`` the
networks and the optimiser's state; beside them a copy of the model's file, and of its
``effects.json`` if it has one. The format is in :doc:`/reference/files`.
"""

import contextlib
import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxidl.errors import JaxidlError, ModelError, StoreError
from jaxidl.files import as_json, check_writable, why, write_flushed
from jaxidl.robot.learned import FORMAT, WEIGHTS, Learned, described, packed, restored
from jaxidl.systems import tables
from jaxidl.systems.mjcf import Model, read_model

RECORD, PROGRAM = "feedforward.json", "feedforward.jaxexport"


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
    check_writable(folder.absolute().parent)  # the folder itself is replaced


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
    content = {**(learned.model.files or {}), WEIGHTS: packed(learned.learner), **files}
    record = described(learned) | {"files": {name: _sha(data) for name, data in content.items()}}
    record["checksum"] = _sha(_canonical(record))
    content[RECORD] = (as_json(record) + "\n").encode()
    token = secrets.token_hex(4)
    aside, old = (folder.with_name(f".{folder.name}.{token}.{end}") for end in ("tmp", "old"))
    try:
        for name, data in content.items():
            (aside / name).parent.mkdir(parents=True, exist_ok=True)
            write_flushed(aside / name, data)
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
        remedy = "free some space or choose another location"
        raise StoreError(f"to write {folder}", why(error), remedy) from None
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
            return restored(record, folder)
    except JaxidlError:
        raise
    except Exception as error:  # whatever a damaged file leads to
        got = f"{type(error).__name__}: {' '.join(str(error).split())[:150]}"
        raise StoreError(expected, got, remedy) from None


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
