"""Formats of logs: the reader of a file is chosen by the ending of its name.

The contents of the columns are checked elsewhere.
"""

from collections.abc import Callable
from pathlib import Path

from jaxidl.errors import LogError
from jaxidl.logs.array_tables import LARGEST_FILE, read_npz, read_parquet
from jaxidl.logs.families import Wanted
from jaxidl.logs.table import Table, listed, name_of, reading, shown
from jaxidl.logs.text_tables import read_text

LARGEST_TEXT = 2**28  # bytes; reading text takes ten times as much

READERS: dict[str, Callable[[Path, Wanted], Table]] = {
    ".csv": read_text,
    ".tsv": read_text,
    ".txt": read_text,
    ".npz": read_npz,
    ".parquet": read_parquet,
    ".pq": read_parquet,
}


def load(path: Path, wanted: Wanted) -> Table:
    """Return the table in a file, as far as it is ``wanted``.

    Raises:
        LogError: if there is no such file, or it is not of the kind that its name says.
    """
    name, reader = name_of(path), READERS.get(path.suffix.lower())
    kind, remedy = path.suffix.lstrip(".").upper(), "export it again, it may be damaged or cut off"
    with reading(name, f"{kind} file", remedy):
        if not path.is_file():
            got = (
                "a folder"
                if path.is_dir()
                else "something else of that name"
                if path.exists()
                else "no such file"
            )
            raise LogError(f"a log at {name}", got, "name a CSV, NPZ or Parquet file that exists")
        if reader is None:
            got = f"a name that ends in {shown(path.suffix)}"
            raise LogError(
                f"{listed(list(READERS))} at the end of {name}", got, "save the log as one of these"
            )
        size = path.stat().st_size
        if not size:
            raise LogError(f"a log in {name}", "an empty file", "record or export it again")
        if size > (LARGEST_TEXT if reader is read_text else LARGEST_FILE):
            got = f"{size / 2**20:.0f} MiB"
            raise LogError(
                f"a log that fits into memory in {name}",
                got,
                "shorten it, or save it as Parquet",
            )
        return reader(path, wanted)
