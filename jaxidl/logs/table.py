"""A table that was read from a file, and how a person is told of a part of it."""

import contextlib
import warnings
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from jaxidl.errors import LogError


@dataclass(frozen=True)
class Table:
    """The columns of one file, not checked yet."""

    name: str  # name of the file
    columns: dict[str, np.ndarray | list[str]]  # each (T,); text where the format has nothing else
    ignored: tuple[str, ...] = ()  # names of columns that are not needed
    lines: list[int] | None = None  # (T,) line of the file that holds each row
    # factors into SI units, by column; 1 if not listed
    factors: Mapping[str, float] = field(default_factory=dict)
    # titles of columns that have another name in the file
    titles: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # on how columns were understood
    rows: np.ndarray | None = None  # (T,) number of each row in the file, where some were dropped

    def called(self, key: str) -> str:
        """Return a name of the column by which a person finds it."""
        title = self.titles.get(key, key)
        return key if title.lower() == key else f"{key} ({shown(title, 44)[1:-1]})"

    def row(self, i: int) -> str:
        """Return a name of row i, counted from 0, by which a person finds it."""
        i = i if self.rows is None else int(self.rows[i])
        return f"row {i + 1}" if self.lines is None else f"row {i + 1} (line {self.lines[i]})"


def shown(value: object, most: int = 30) -> str:
    """Return a value as Python writes it, cut to a length that fits a line."""
    try:
        text = repr(value[: 4 * most] if isinstance(value, str | bytes) else value)
    except Exception:  # such as an integer of thousands of digits, or a foreign object
        text = f"a {type(value).__name__}"
    return text if len(text) <= most else text[: most - 4] + "..." + text[-1]


def listed(names: Sequence[str], most: int = 8) -> str:
    """Return a few names in words."""
    text = ", ".join(shown(name)[1:-1] for name in names[:most])
    return (text or "none") + (f" and {len(names) - most} more" if len(names) > most else "")


def name_of(path: Path) -> str:
    """Return a file's name as text that any terminal prints."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in str(path))


def reason(error: Exception) -> str:
    """Return a parser's message, short enough for a line."""
    text = getattr(error, "strerror", None) or str(error)[:1000] or type(error).__name__
    return shown(" ".join(text.split()), 160)[1:-1].rstrip(".")


@contextlib.contextmanager
def reading(name: str, kind: str, remedy: str) -> Generator[None]:
    """Turn whatever a parser raises on a damaged file into a LogError, and hide its guesses.

    Args:
        name: the file's name, as messages give it.
        kind: what the file should be, such as ``CSV file``.
        remedy: what to do if it cannot be read.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except LogError:
        raise
    except PermissionError:
        raise LogError(
            f"to read {name}", "no permission", "change its permissions or owner, or copy it"
        ) from None
    except Exception as error:  # parsers raise nearly anything
        raise LogError(f"a readable {kind} at {name}", reason(error), remedy) from None
