"""Files that are whole or not there."""

import os
import tempfile
from pathlib import Path

from jaxidl.errors import StoreError


def write_bytes(path: Path, content: bytes) -> None:
    """Write a whole file or nothing: temporary name, flush to disk, rename.

    Raises:
        StoreError: if the disk is full or the place cannot be written; an existing file is left as it was.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.name, suffix=".tmp", delete=False) as file:
            temporary = file.name
            os.fchmod(file.fileno(), 0o644)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        if temporary:
            Path(temporary).unlink(missing_ok=True)
        reason = error.strerror or str(error)
        raise StoreError(f"to write {path}", reason.lower(), "make room or choose another place, then run it again") from None
