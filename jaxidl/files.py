"""Files that are written whole or not at all, where they can be written, and strict JSON."""

import contextlib
import json
import os
import secrets
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jaxidl.errors import StoreError

LARGEST_BY_HAND = 2**20  # bytes; a file that a person writes has less


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all.

    The content goes to a temporary file beside it, is flushed to disk and then renamed. Missing
    folders are created.

    Raises:
        StoreError: if the disk is full or the location cannot be written to; an existing file is
            left unchanged.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_flushed(temporary, content)
        os.replace(temporary, path)
    except OSError as error:
        remedy = "free some space or choose another location, then run again"
        raise StoreError(f"to write {path}", why(error), remedy) from None
    finally:
        with contextlib.suppress(OSError):  # already renamed, or never created
            temporary.unlink()


def write_flushed(path: Path, content: bytes) -> None:
    """Write a file that is on the disk when this returns; OSError passes."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def why(error: OSError) -> str:
    """Return the system's reason, to stand within a sentence."""
    return (error.strerror or str(error)).lower()


def check_writable(folder: Path) -> None:
    """Check that a folder, or the nearest one above it that exists, can be written into.

    Raises:
        StoreError: if it cannot.
    """
    there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not (there.is_dir() and os.access(there, os.W_OK | os.X_OK)):
        got = "no permission" if there.is_dir() else "a file"
        raise StoreError(f"to write into {there}", got, "choose another folder")


def as_json(value: Any, indent: int | None = 1) -> str:
    """Return ``value``, made plain by :func:`plain`, as strict JSON."""
    return json.dumps(plain(value), indent=indent, allow_nan=False)


def markdown(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table."""
    line = lambda cells: "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"
    return "\n".join([line(heads), line("---" for _ in heads), *map(line, rows)])


def plain(value: Any) -> Any:
    """Return ``value`` as plain numbers, lists and dictionaries, ready for JSON.

    Numbers that are not finite become None.
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
