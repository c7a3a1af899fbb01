"""Files that are whole or not there."""

import contextlib
import os
import secrets
from pathlib import Path

from jaxidl.errors import StoreError


def write_bytes(path: Path, content: bytes) -> None:
    """Write a whole file or nothing: temporary name beside it, flush to disk, rename. Missing folders are made.

    Raises:
        StoreError: if the disk is full or the place cannot be written; an existing file is left as it was.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise StoreError(f"to write {path}", reason, "make room or choose another place, then run it again") from None
    finally:
        with contextlib.suppress(OSError):  # renamed, or never made
            temporary.unlink()
