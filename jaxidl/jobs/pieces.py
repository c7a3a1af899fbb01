"""Finished pieces of a long job, each a file of named arrays: what is there need not be computed
again.
"""

import contextlib
import hashlib
import io
import json
import shutil
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from jaxidl.errors import StoreError
from jaxidl.files import write_bytes
from jaxidl.jobs.results import digest

Arrays = dict[str, np.ndarray]


@contextlib.contextmanager
def alone(folder: Path, where: Path | None = None) -> Generator[None]:
    """Hold the lock of a folder, which is made if need be; ``where`` is what a complaint names
    instead.

    A folder with nothing but the lock in it is removed at the end.

    Raises:
        StoreError: when another process is at work there, or it cannot be written.
    """
    lock, where = FileLock(folder / "lock", timeout=0), where or folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout:
        raise StoreError(
            f"no other process to write {where}",
            "another process at work",
            "wait or take another --out",
        ) from None
    except OSError as error:
        raise StoreError(
            f"to write beside {folder}", str(error.strerror).lower(), "choose another --out"
        ) from None
    try:
        yield
    finally:
        # emptied and removed while the lock is held, so that nobody can lock a file that is about
        # to vanish
        if {entry.name for entry in folder.iterdir()} <= {"lock"}:
            (folder / "lock").unlink(missing_ok=True)
            folder.rmdir()
        lock.release()


def set_aside(folder: Path, marks: tuple[str, ...]) -> None:
    """Move a folder of results to ``FOLDER.old``, in place of an earlier one; do nothing where
    there is none.

    Args:
        folder: where results lie.
        marks: names of what such a folder holds; one of them must be there.

    Raises:
        StoreError: when another process is at work there, or it holds something else.
    """
    if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
        return
    if not any((folder / mark).exists() for mark in marks):
        raise StoreError(
            f"results of this command in {folder}", "something else", "choose another --out"
        )
    for lock in folder.glob("**/lock"):
        with alone(lock.parent, folder):
            pass
    old = folder.with_name(f"{folder.name}.old")
    try:
        shutil.rmtree(old, ignore_errors=True)
        folder.replace(old)
    except OSError as error:
        raise StoreError(
            f"to move {folder} to {old}", str(error.strerror).lower(), "move it yourself"
        ) from None


def write_piece(path: Path, identity: str, arrays: Mapping[str, Any]) -> None:
    """Write arrays and texts with a checksum over them and what made them, safe at once."""
    buffer, whole = io.BytesIO(), {"identity": identity, **arrays}
    np.savez(buffer, allow_pickle=False, **whole, digest=digest(whole))
    write_bytes(path, buffer.getvalue())


def read_piece(path: Path) -> tuple[str, Arrays] | None:
    """Return the identity and the arrays of a piece, or None if there is none or it is damaged."""
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        return (
            None
            if str(arrays.pop("digest")) != digest(arrays)
            else (str(arrays.pop("identity")), arrays)
        )
    except Exception:  # whatever a broken file makes of NumPy, zip and zlib
        return None


class Pieces:
    """A folder of pieces, by name. Use as a context manager: it holds the folder's lock.

    Every piece carries the ``identity`` of what made it (all that determines a result, ready for
    JSON) and a checksum; one that is damaged is as good as none. Pieces of one name made otherwise
    lie beside each other: their files' names tell them apart.

    Raises:
        StoreError: when another process is at work in the folder, or it cannot be written.
    """

    def __init__(self, folder: Path, identity: Mapping[str, Any]):
        self.folder, self.identity = folder, json.dumps(identity, sort_keys=True)
        self._held = contextlib.ExitStack()

    def of(self, identity: Mapping[str, Any]) -> "Pieces":
        """Return pieces of another identity in the same folder; this one's lock covers them."""
        return Pieces(self.folder, identity)

    def __enter__(self) -> "Pieces":
        self._held.enter_context(alone(self.folder))
        return self

    def __exit__(self, *_: object) -> None:
        self._held.close()

    def load(self, name: str) -> Arrays | None:
        """Return the piece ``name`` if it is there, whole, and of the same identity."""
        found = read_piece(self.path(name))
        return found[1] if found is not None and found[0] == self.identity else None

    def save(self, name: str, arrays: Arrays) -> None:
        """Keep a piece."""
        write_piece(self.path(name), self.identity, arrays)

    def path(self, name: str) -> Path:
        """Return where a piece lies."""
        return self.folder / f"{name}.{hashlib.sha256(self.identity.encode()).hexdigest()[:8]}.npz"
