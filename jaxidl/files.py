"""Files that are whole or not there, and JSON that is strict."""

import contextlib
import json
import os
import secrets
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxidl.errors import StoreError


def write_bytes(path: Path, content: bytes) -> None:
    """Write a whole file or nothing: temporary name beside it, flush to disk, rename. Missing
    folders are made.

    Raises:
        StoreError: if the disk is full or the place cannot be written; an existing file is left as
            it was.
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
        raise StoreError(
            f"to write {path}", reason, "make room or choose another place, then run it again"
        ) from None
    finally:
        with contextlib.suppress(OSError):  # renamed, or never made
            temporary.unlink()


def as_json(value: Any, indent: int | None = 1) -> str:
    """Return strict JSON of what :func:`plain` makes of ``value``."""
    return json.dumps(plain(value), indent=indent, allow_nan=False)


def markdown(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table."""
    line = lambda cells: "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"
    return "\n".join([line(heads), line("---" for _ in heads), *map(line, rows)])


def plain(value: Any) -> Any:
    """Return plain numbers, lists and dictionaries as JSON has them; what is not finite becomes
    None.
    """
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value
