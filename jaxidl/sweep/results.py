"""The results file: labelled averages of every run, where they came from, and a checksum over all of it."""

import hashlib
import io
import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from jaxidl.errors import StoreError
from jaxidl.sweep.grid import AXES, Grid, Label

DIMS = (*AXES, "iteration")  # of every file; an ablation's has more before the last
META = {
    "q_error": ("m", "mean |position - frictionless reference|"),
    "feedback_applied": ("N", "mean |applied feedback|"),
    "qdd_error": ("m s-2", "mean |desired - actual acceleration|"),
    "torque": ("N", "mean |commanded torque|"),
    "finite": ("1", "did execution and training stay finite? false: keep the iteration out of averages"),
}
UNITS = {"noise": "m"}


class Origin(NamedTuple):
    """Where runs came from."""

    revision: str  # of the code
    device: str  # kind, and how many runs side by side
    seconds: float  # wall time that they took together


def merge_origins(origins: Sequence[Origin]) -> list[Origin]:
    """One origin for each revision and device, their seconds added up."""
    seconds: dict[tuple[str, str], float] = defaultdict(float)
    for origin in origins:
        seconds[origin.revision, origin.device] += origin.seconds
    return [Origin(*key, round(total, 3)) for key, total in sorted(seconds.items())]


def assemble(grid: Grid, runs: dict[Label, dict[str, np.ndarray]]) -> xr.Dataset:
    """The labelled results of ``grid``: dims (controller, …, source, what an ablation varies, iteration)."""
    coords = {dim: list(values) for dim, values in grid.dims().items()}
    shape = tuple(len(values) for values in coords.values())
    place = {dim: {value: i for i, value in enumerate(values)} for dim, values in coords.items()}
    variables = {}
    for name, (unit, text) in META.items():
        kind = bool if name == "finite" else np.float64
        block = np.zeros((*shape, grid.iterations), kind)
        for label in grid.labels():
            block[tuple(place[dim][value] for dim, value in label.place().items())] = runs[label][name]
        variables[name] = ((*coords, "iteration"), block, {"units": unit, "long_name": text})
    data = xr.Dataset(variables, coords | {"iteration": np.arange(grid.iterations)})
    for dim, unit in UNITS.items():
        data[dim].attrs["units"] = unit
    return data


def read(path: Path) -> xr.Dataset:
    """A finished results file.

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
        raise StoreError(f"{path} to be a NetCDF results file", got, "remove it or name another") from None
    lacking = [name for name in (*META, *DIMS) if name not in data.variables]
    lacking += [name for name in ("identity", "origins") if not _is_json(data.attrs.get(name))]
    if lacking:
        got = f"a file without {', '.join(lacking)}"
        raise StoreError(f"{path} to be written by `jaxidl sweep`", got, "name a results file of jaxidl")
    data["finite"] = data["finite"].astype(bool)
    if data.attrs.get("digest") != digest_of(data):
        got = "numbers that do not fit their checksum"
        raise StoreError(f"{path} as `jaxidl sweep` wrote it", got, "take a sound copy, or run the sweep again with --overwrite")
    return data


def digest(content: Mapping[str, object]) -> str:
    """SHA-256 of named texts and arrays: a bit that flips on disk must not end up in an average."""
    checksum = hashlib.sha256()
    for name, value in sorted(content.items()):
        array = np.asarray(value)
        plain = array.dtype.kind in "biuf"
        checksum.update(f"{name} {array.dtype.str if plain else 'text'} {array.shape}:".encode())
        checksum.update(np.ascontiguousarray(array).tobytes() if plain else json.dumps(array.tolist()).encode())
    return checksum.hexdigest()


def digest_of(data: xr.Dataset) -> str:
    """:func:`digest` of all variables, coordinates and attributes of a results file, but the digest itself."""
    attrs = {f"attribute {name}": str(value) for name, value in data.attrs.items() if name != "digest"}
    return digest(attrs | {str(name): column.values for name, column in data.variables.items()})


def _is_json(text: object) -> bool:
    try:
        json.loads(str(text))
    except ValueError:
        return False
    return text is not None


def added(data: xr.Dataset) -> list[str]:
    """The axes that an ablation has added to those of every results file."""
    return [str(dim) for dim in data["q_error"].dims if dim not in DIMS]


def runs_of(data: xr.Dataset) -> dict[Label, dict[str, np.ndarray]]:
    """The runs in a results file, by label."""
    table = {}
    values = {dim: tuple(data[dim].values.tolist()) for dim in (*AXES, *added(data))}
    vary = tuple((dim, values[dim]) for dim in added(data))
    grid = Grid(*(values[dim] for dim in AXES), iterations=data.sizes["iteration"], vary=vary)
    columns = {name: data[name].transpose(*values, "iteration").values for name in META}
    for label in grid.labels():
        index = tuple(values[dim].index(value) for dim, value in label.place().items())
        table[label] = {name: column[index] for name, column in columns.items()}
    return table
