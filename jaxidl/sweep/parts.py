"""Finished pieces of a long job, each a file of named arrays: what is there need not be computed again."""

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from jaxidl.errors import StoreError
from jaxidl.files import write_bytes
from jaxidl.sweep.results import digest

Arrays = dict[str, np.ndarray]


class Parts:
    """A folder of pieces, by name. Use as a context manager: it holds the folder's lock.

    Every piece carries the ``identity`` of what made it (all that determines a result, ready for JSON) and a checksum; one that
    is damaged is as good as none. Pieces of one name made otherwise lie beside each other: their files' names tell them apart.

    Raises:
        StoreError: when another process is at work in the folder, or it cannot be written.
    """

    def __init__(self, folder: Path, identity: Mapping[str, Any]):
        self.folder, self.identity = folder, json.dumps(identity, sort_keys=True)
        self._lock = FileLock(folder / "lock", timeout=0)

    def of(self, identity: Mapping[str, Any]) -> "Parts":
        """Pieces of another identity in the same folder; this one's lock covers them."""
        return Parts(self.folder, identity)

    def __enter__(self) -> "Parts":
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock.acquire()
        except Timeout:
            raise StoreError(f"to be alone in {self.folder}", "another process at work", "wait or take another --out") from None
        except OSError as error:
            raise StoreError(f"to write in {self.folder}", str(error.strerror).lower(), "choose another --out") from None
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def load(self, name: str) -> Arrays | None:
        """The piece ``name`` if it is there, whole, and of the same identity."""
        try:
            with np.load(io.BytesIO(self.path(name).read_bytes()), allow_pickle=False) as file:
                arrays = {key: file[key] for key in file.files}
        except Exception:  # whatever a broken file makes of NumPy, zip and zlib
            return None
        checksum, identity = str(arrays.pop("digest", "")), str(arrays.pop("identity", ""))
        return arrays if identity == self.identity and checksum == digest(arrays) else None

    def save(self, name: str, arrays: Arrays) -> None:
        """Keep a piece, safe at once."""
        buffer = io.BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, identity=self.identity, digest=digest(arrays), **arrays)
        write_bytes(self.path(name), buffer.getvalue())

    def path(self, name: str) -> Path:
        """Where a piece lies."""
        return self.folder / f"{name}.{hashlib.sha256(self.identity.encode()).hexdigest()[:8]}.npz"
