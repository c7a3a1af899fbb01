"""The results file: labelled numbers of every run, where they came from, and a checksum over all of
it.
"""

import hashlib
import io
import json
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from jaxidl.errors import StoreError
from jaxidl.jobs.points import Point, Value, point, points

Runs = dict[Point, dict[str, np.ndarray]]


class Variable(NamedTuple):
    """What a run returns under one name."""

    dims: tuple[str, ...] = ()  # of one run's array
    units: str = "1"
    long_name: str = ""


class Origin(NamedTuple):
    """Where runs came from."""

    revision: str  # of the code
    device: str  # kind, and how many runs side by side
    seconds: float  # wall time that they took together


def merge_origins(origins: Sequence[Origin]) -> list[Origin]:
    """Return one origin for each revision and device, their seconds added up."""
    seconds: dict[tuple[str, str], float] = defaultdict(float)
    for origin in origins:
        seconds[origin.revision, origin.device] += origin.seconds
    return [Origin(*key, round(total, 3)) for key, total in sorted(seconds.items())]


def assemble(
    axes: Mapping[str, Sequence[Value]],
    variables: Mapping[str, Variable],
    runs: Runs,
    alike: Callable[[Point], Point] = lambda at: at,
) -> xr.Dataset:
    """Return the runs as one dataset: dims are the axes in their order, then those of each
    variable.

    Args:
        axes: values by name.
        variables: what each run holds.
        runs: arrays by variable, for each point.
        alike: the point whose run stands for another one's.
    """
    shape = tuple(map(len, axes.values()))
    place = {name: {value: i for i, value in enumerate(values)} for name, values in axes.items()}
    blocks: dict[str, np.ndarray] = {}
    for at in points(axes):
        run, index = runs[alike(at)], tuple(place[name][dict(at)[name]] for name in axes)
        for name in variables:
            if name not in blocks:
                blocks[name] = np.zeros((*shape, *np.shape(run[name])), np.asarray(run[name]).dtype)
            blocks[name][index] = run[name]
    columns = {
        name: (
            (*axes, *about.dims),
            blocks[name],
            {"units": about.units, "long_name": about.long_name},
        )
        for name, about in variables.items()
    }
    return xr.Dataset(columns, {name: list(values) for name, values in axes.items()})


def runs_of(data: xr.Dataset, variables: Mapping[str, Variable]) -> Runs:
    """Return the runs in a results file, by point."""
    inner = {name: about.dims for name, about in variables.items()}
    first = next(iter(variables))
    axes = {
        str(dim): tuple(data[dim].values.tolist())
        for dim in data[first].dims
        if dim not in inner[first]
    }
    columns = {name: data[name].transpose(*axes, *inner[name]).values for name in variables}
    table: Runs = {}
    for at in points(axes):
        index = tuple(values.index(dict(at)[name]) for name, values in axes.items())
        table[point(dict(at))] = {
            name: np.asarray(column[index]) for name, column in columns.items()
        }
    return table


def read(
    path: Path, lacking: Callable[[xr.Dataset], Sequence[str]] = lambda data: ()
) -> xr.Dataset:
    """Return a finished results file.

    Args:
        path: where it lies.
        lacking: what else a file of one's own must have, and this one has not.

    Raises:
        StoreError: if there is none, it cannot be read, or it is not one of ours.
    """
    path = Path(path)
    try:
        with xr.open_dataset(io.BytesIO(path.read_bytes()), engine="h5netcdf") as file:
            data = file.load()
    except FileNotFoundError:
        remedy = "run `jaxidl sweep --out` first, or correct the path"
        raise StoreError(f"a results file at {path}", "no such file", remedy) from None
    except Exception as error:  # whatever h5py makes of a broken file
        got = f"something unreadable ({type(error).__name__})"
        raise StoreError(
            f"{path} to be a NetCDF results file", got, "remove it or name another"
        ) from None
    absent = [
        *lacking(data),
        *(name for name in ("identity", "origins") if not _is_json(data.attrs.get(name))),
    ]
    if absent:
        got = f"a file without {', '.join(absent)}"
        raise StoreError(
            f"{path} to be written by `jaxidl sweep`", got, "name a results file of jaxidl"
        )
    if data.attrs.get("digest") != digest_of(data):
        got = "numbers that do not fit their checksum"
        raise StoreError(
            f"{path} as `jaxidl sweep` wrote it",
            got,
            "use an undamaged copy, or run the sweep again with --overwrite",
        )
    return data


def digest(content: Mapping[str, object]) -> str:
    """Return the SHA-256 of named texts and arrays: a bit that flips on disk must not end up in an
    average.
    """
    checksum = hashlib.sha256()
    for name, value in sorted(content.items()):
        array = np.asarray(value)
        plain = array.dtype.kind in "biuf"
        checksum.update(f"{name} {array.dtype.str if plain else 'text'} {array.shape}:".encode())
        checksum.update(
            np.ascontiguousarray(array).tobytes() if plain else json.dumps(array.tolist()).encode()
        )
    return checksum.hexdigest()


def digest_of(data: xr.Dataset) -> str:
    """Return the :func:`digest` of all of a results file but the digest itself."""
    attrs = {
        f"attribute {name}": str(value) for name, value in data.attrs.items() if name != "digest"
    }
    return digest(attrs | {str(name): column.values for name, column in data.variables.items()})


def _is_json(text: object) -> bool:
    try:
        json.loads(str(text))
    except ValueError:
        return False
    return text is not None
