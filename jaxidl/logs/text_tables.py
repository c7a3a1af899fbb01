"""Tables in text files: columns separated by commas, semicolons or tabs, under a header."""

import csv
from collections.abc import Sequence
from pathlib import Path

from jaxidl.errors import LogError
from jaxidl.logs.columns import MOST, choose
from jaxidl.logs.families import Wanted
from jaxidl.logs.table import Table, name_of, shown

MAGIC = {
    b"PAR1": "Parquet",
    b"PK": "a ZIP archive, such as NPZ or a spreadsheet",
    b"\x93NUMPY": "an array of NumPy",
    b"\x1f\x8b": "compressed data",
    b"\xff\xfe": "UTF-16",
    b"\xfe\xff": "UTF-16",
}


def read_text(path: Path, wanted: Wanted) -> Table:
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
    return Table(
        name,
        {key: points(columns[place]) for key, place in chosen.places.items()},
        chosen.ignored,
        lines,
        chosen.factors,
        chosen.titles,
        (*chosen.notes, *notes),
    )


def _with_points(cells: Sequence[str]) -> list[str]:
    """Return cells whose decimals follow a comma with a point instead."""
    text = "".join(cells)
    commas = "," in text and "." not in text
    return [cell.replace(",", ".") if commas else cell for cell in cells]


def _are_numbers(row: str) -> bool:
    """Return whether a line of text holds numbers only, with any separators."""
    try:
        return (
            len([float(cell) for cell in row[:10_000].replace(";", " ").replace(",", " ").split()])
            > 0
        )
    except ValueError:
        return False
