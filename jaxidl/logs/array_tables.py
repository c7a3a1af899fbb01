"""Tables in files of arrays: NPZ and Parquet."""

import zipfile
from pathlib import Path

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.columns import MOST, choose
from jaxidl.logs.families import INSTANTS, Chosen, Wanted
from jaxidl.logs.table import Table, name_of, reason
from jaxidl.logs.words import UNITS

LARGEST_FILE = 2**32  # bytes


def read_npz(path: Path, wanted: Wanted) -> Table:
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


def read_parquet(path: Path, wanted: Wanted) -> Table:
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
    columns = {key: table.column(headers[at]).to_numpy() for key, at in chosen.places.items()}
    return Table(
        name,
        dict(columns),
        chosen.ignored,
        None,
        chosen.factors,
        chosen.titles,
        chosen.notes,
    )


def _fits(name: str, size: int) -> None:
    if size > LARGEST_FILE:
        raise LogError(
            f"a log that fits into memory in {name}",
            f"{size / 2**20:.0f} MiB unpacked",
            "shorten it",
        )


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
