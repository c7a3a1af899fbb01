"""Tables in files: CSV, NPZ or Parquet, read into columns by name.

The contents of the columns are checked elsewhere.
"""

import csv
import warnings
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.columns import MOST, choose
from jaxidl.logs.families import INSTANTS, Chosen, Wanted
from jaxidl.logs.words import UNITS

LARGEST_TEXT, LARGEST_FILE = 2**28, 2**32  # bytes; reading text takes ten times as much
MAGIC = {
    b"PAR1": "Parquet",
    b"PK": "a ZIP archive, such as NPZ or a spreadsheet",
    b"\x93NUMPY": "an array of NumPy",
    b"\x1f\x8b": "compressed data",
    b"\xff\xfe": "UTF-16",
    b"\xfe\xff": "UTF-16",
}


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


def load(path: Path, wanted: Wanted) -> Table:
    """Return the table in a file, as far as it is ``wanted``.

    Raises:
        LogError: if there is no such file, or it is not of the kind that its name says.
    """
    name, reader = name_of(path), READERS.get(path.suffix.lower())
    try:
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
        if size > (LARGEST_TEXT if reader is _csv else LARGEST_FILE):
            got = f"{size / 2**20:.0f} MiB"
            raise LogError(
                f"a log of a size that fits memory in {name}",
                got,
                "shorten it, or save it as Parquet",
            )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # ignore a parser's guesses about a damaged file
            return reader(path, wanted)
    except LogError:
        raise
    except PermissionError:
        raise LogError(
            f"to read {name}", "no permission", "change its permissions or owner, or copy it"
        ) from None
    except Exception as error:  # parsers raise nearly anything on a damaged file
        kind, remedy = (
            path.suffix.lstrip(".").upper(),
            "export it again, it may be damaged or cut off",
        )
        raise LogError(f"a readable {kind} file at {name}", reason(error), remedy) from None


def _csv(path: Path, wanted: Wanted) -> Table:
    name, content = name_of(path), path.read_bytes()
    for magic, kind in MAGIC.items():
        if content.startswith(magic):
            raise LogError(
                f"text in {name}", kind, "give it the right ending, or export it as CSV in UTF-8"
            )
    if b"\0" in content:
        raise LogError(f"text in {name}", "binary data", "export it as CSV in UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        got = f"byte 0x{content[error.start]:02x} in line {line}"
        raise LogError(f"UTF-8 text in {name}", got, "save it with that encoding") from None
    rows = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    lines = [
        i for i, row in enumerate(rows, 1) if row and not row.isspace() and not row.startswith("#")
    ]
    if not lines:
        raise LogError(f"a header and rows of data in {name}", "neither", "export the log again")
    first = lines.pop(0)
    header = rows[first - 1]
    # as numpy.savetxt writes it
    if first > 1 and _are_numbers(header) and "time" in rows[first - 2].lower():
        lines, header = [first, *lines], rows[first - 2].lstrip("# ")
    delimiter = max(",;\t", key=header.count)
    if _are_numbers(header) or (delimiter not in header and len(header.split()) > 1):
        remedy = "begin with a line time,q0,tau0 and separate columns by commas"
        raise LogError(f"a header with the names of the columns in {name}", shown(header), remedy)
    if header.count(delimiter) > MOST:  # before it is split
        raise LogError(
            f"at most {MOST} columns in {name}",
            f"{header.count(delimiter)}",
            "keep time, q*, tau* and run",
        )

    def cells(row: str) -> list[str]:
        return (
            next(csv.reader([row], delimiter=delimiter, skipinitialspace=True))
            if '"' in row
            else row.split(delimiter)
        )

    headers, notes = cells(header), []
    for i, line in enumerate(list(lines)):
        row = rows[line - 1]
        width = len(cells(row)) if '"' in row else row.count(delimiter) + 1
        last = 0 < i == len(lines) - 1 and not wanted.control  # learning mends nothing
        if width < len(headers) and last:  # as when the recorder was stopped
            notes.append(f"the last row of {name} is cut off: left out")
            lines.pop()
        elif width != len(headers):
            raise LogError(
                f"{len(headers)} cells in each row of {name}, as in its header",
                f"{width} in row {i + 1} (line {line})",
                "complete or remove that row",
            )
    chosen = choose(name, headers, wanted)
    columns = list(zip(*[cells(rows[line - 1]) for line in lines], strict=True)) or [()] * len(
        headers
    )
    points = list if delimiter == "," else _with_points
    table = _table(
        name,
        {key: points(columns[place]) for key, place in chosen.places.items()},
        chosen,
        lines,
    )
    return replace(table, notes=(*table.notes, *notes))


def _with_points(cells: Sequence[str]) -> list[str]:
    """Return cells whose decimals follow a comma with a point instead."""
    text = "".join(cells)
    commas = "," in text and "." not in text
    return [cell.replace(",", ".") if commas else cell for cell in cells]


def _table(
    name: str,
    columns: dict[str, np.ndarray | list[str]],
    chosen: Chosen,
    lines: list[int] | None = None,
) -> Table:
    return Table(name, columns, chosen.ignored, lines, chosen.factors, chosen.titles, chosen.notes)


def _are_numbers(row: str) -> bool:
    """Return whether a line of text holds numbers only, with any separators."""
    try:
        return (
            len([float(cell) for cell in row[:10_000].replace(";", " ").replace(",", " ").split()])
            > 0
        )
    except ValueError:
        return False


def _npz(path: Path, wanted: Wanted) -> Table:
    name = name_of(path)
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        _fits(name, sum(member.file_size for member in members))
        chosen = choose(
            name, [member.filename.removesuffix(".npy") for member in members], wanted, bare=True
        )
        arrays = {}
        for key, place in chosen.places.items():
            try:
                with archive.open(members[place]) as file:
                    arrays[key] = np.lib.format.read_array(file, allow_pickle=False)
            except Exception as error:  # as above, but the column is known
                raise LogError(
                    f"an array {key} in {name}", reason(error), "store it again, as float64"
                ) from None
    return expanded(name, arrays, wanted, chosen)


def _parquet(path: Path, wanted: Wanted) -> Table:
    name = name_of(path)
    try:
        import pyarrow.parquet as parquet  # optional, and slow to load
    except ImportError:
        remedy = "pip install pyarrow, or save the log as CSV or NPZ"
        raise LogError(f"pyarrow to read {name}", "none installed", remedy) from None
    with parquet.ParquetFile(path) as file:
        headers = file.schema_arrow.names
        _fits(
            name,
            sum(
                file.metadata.row_group(i).total_byte_size
                for i in range(file.metadata.num_row_groups)
            ),
        )
        chosen = choose(name, headers, wanted)
        table = file.read(
            columns=list(dict.fromkeys(headers[place] for place in chosen.places.values())),
            use_threads=False,
        )
    return _table(
        name,
        {key: table.column(headers[place]).to_numpy() for key, place in chosen.places.items()},
        chosen,
    )


def _fits(name: str, size: int) -> None:
    if size > LARGEST_FILE:
        raise LogError(
            f"a log of a size that fits memory in {name}",
            f"{size / 2**20:.0f} MiB unpacked",
            "cut it",
        )


def name_of(path: Path) -> str:
    """Return a file's name as text that any terminal prints."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in str(path))


def reason(error: Exception) -> str:
    """Return a parser's message, short enough for a line."""
    text = getattr(error, "strerror", None) or str(error)[:1000] or type(error).__name__
    return shown(" ".join(text.split()), 160)[1:-1].rstrip(".")


def expanded(
    name: str, arrays: dict[str, np.ndarray], wanted: Wanted, chosen: Chosen | None = None
) -> Table:
    """Return arrays (T, J) of all joints split into columns.

    Of a whole robot's joints, those that are used are returned.

    Raises:
        LogError: if they have no such shape.
    """
    chosen = Chosen({}, {}, {}, ()) if chosen is None else chosen
    rows = arrays["time"].size if "time" in arrays else 0
    columns: dict[str, np.ndarray | list[str]] = {}
    factors, titles = dict(chosen.factors), dict(chosen.titles)
    for key, array in arrays.items():
        wide = array[:, None] if array.ndim == 1 else array
        many = key in UNITS and key not in INSTANTS
        if wide.ndim != 2 or wide.shape[1] > (MOST if many else 1) or (rows and len(wide) != rows):
            got, shape = f"shape {array.shape}", "(T, J) or (T,)" if many else "(T,)"
            remedy = (
                "transpose it"
                if rows and array.ndim == 2 and array.shape[1] == rows
                else "store one row for each instant"
            )
            raise LogError(
                f"shape {shape} of {key} in {name}" + f", with T = {rows} as in time" * (rows > 0),
                got,
                remedy,
            )
        part = many and 0 < len(wanted.taken) < len(wanted.names) == wide.shape[1]
        for j, column in enumerate(wide.T):
            place = wanted.place(j) if part else j
            title = (
                key
                if not many
                else f"{key}{place}"
                if place is not None
                else f"{key}@{wanted.names[j]}"
            )
            if place is None and key != "q":
                continue
            if title in columns or (title != key and title in arrays):
                raise LogError(
                    f"one column {title} in {name}", f"both {key} and {title}", "remove one of them"
                )
            columns[title] = column
            if key in chosen.factors:
                factors[title] = chosen.factors[key]
            if chosen.titles.get(key, key).lower() != key:
                titles[title] = chosen.titles[key]
    return Table(name, columns, chosen.ignored, None, factors, titles, chosen.notes)


READERS: dict[str, Callable[[Path, Wanted], Table]] = {
    ".csv": _csv,
    ".tsv": _csv,
    ".txt": _csv,
    ".npz": _npz,
    ".parquet": _parquet,
    ".pq": _parquet,
}
