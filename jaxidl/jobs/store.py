"""Results on disk: every finished chunk is saved at once, and results of different settings are
never mixed.

Beside ``RESULTS.nc`` lies the folder ``RESULTS.nc.parts`` while a sweep is under way, one file per
finished chunk. Runs are identified by their points, not by their place in a grid, so a sweep
continues whatever its chunk size, device count or order, and a finished file can be extended by
more values on an axis. Files are written under another name and then renamed.
"""

import contextlib
import glob
import json
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jaxidl.errors import ConfigurationError, StoreError
from jaxidl.files import write_bytes
from jaxidl.jobs.pieces import alone, read_piece, write_piece
from jaxidl.jobs.points import Point
from jaxidl.jobs.results import Origin, Runs, Variable, digest_of, merge_origins, read, runs_of

FORMAT = "jaxidl-sweep-1"


class Store:
    """The finished runs of one results file. Use as a context manager: it holds the file's lock.

    Args:
        path: where the results go.
        identity: everything besides the axes that determines a result, ready for JSON.
        variables: what each run holds.
        overwrite: start again; existing results are moved to ``RESULTS.nc.old``.
        alike: the point whose run stands for another one's, which is not kept.

    Raises:
        StoreError: when another process is at work on the file, or what lies there is unreadable or
            of other settings.
    """

    def __init__(
        self,
        path: Path,
        identity: Mapping[str, Any],
        variables: Mapping[str, Variable],
        overwrite: bool = False,
        alike: Callable[[Point], Point] = lambda at: at,
    ):
        self.path, self.parts = Path(path), Path(f"{path}.parts")
        self.variables, self.overwrite, self.alike = variables, overwrite, alike
        self.identity = json.dumps({"format": FORMAT, **identity}, sort_keys=True)
        self.runs: Runs = {}
        self.finished: set[Point] = set()  # those in the results file itself
        self.damaged: list[Path] = []
        self._origins: list[Origin] = []  # of what the results file holds
        self._parts: dict[Path, tuple[list[Point], Origin]] = {}
        self._held = contextlib.ExitStack()

    def __enter__(self) -> "Store":
        with contextlib.ExitStack() as held:
            held.enter_context(alone(self.parts, self.path))
            self._load()
            self._held = held.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._held.close()

    def _load(self) -> None:
        results = self.path.parent.glob(f".{glob.escape(self.path.name)}.*.tmp")
        # of a process that was killed while writing
        for torn in [*self.parts.glob(".*.tmp"), *results]:
            torn.unlink()
        if self.overwrite:
            self._set_aside()
        if self.path.exists():
            data = read(self.path)
            self._check_identity(
                self.path, data.attrs["identity"], "choose another --out, or --overwrite it"
            )
            self.runs.update(
                {
                    at: run
                    for at, run in runs_of(data, self.variables).items()
                    if self.alike(at) == at
                }
            )
            self.finished.update(self.runs)
            self._origins += [Origin(*row) for row in json.loads(data.attrs["origins"])]
        self.damaged += [
            part for part in sorted(self.parts.glob("*.npz")) if not self._load_part(part)
        ]

    def _set_aside(self) -> None:
        if self.path.is_dir():
            raise StoreError(f"a file at {self.path}", "a folder", "choose another --out")
        if self.path.exists():
            self.path.replace(f"{self.path}.old")
        for part in self.parts.glob("*.npz"):
            part.unlink()

    def _check_identity(self, where: Path, identity: str, remedy: str) -> None:
        if identity != self.identity:
            what = difference(json.loads(identity), json.loads(self.identity))
            raise StoreError(
                f"{where} to hold these settings", f"some that differ in {what}", remedy
            )

    def _load_part(self, part: Path) -> bool:
        """Take in a part; False, and the part is gone, if it is damaged."""
        found = read_piece(part)
        if found is None:
            part.unlink(missing_ok=True)
            return False
        identity, arrays = found
        self._check_identity(
            self.parts,
            identity,
            "continue with the old settings, choose another --out, or --overwrite",
        )
        held: list[Point] = [
            tuple((name, value) for name, value in row)
            for row in json.loads(str(arrays.pop("points")))
        ]
        origin = Origin(*json.loads(str(arrays.pop("origin"))))
        if self.finished.issuperset(held):
            # of a process that was killed between writing the file and removing its parts
            part.unlink()
            return True
        self._parts[part] = held, origin
        for row, at in enumerate(held):
            self.runs[at] = {name: np.asarray(column[row]) for name, column in arrays.items()}
        return True

    def add(
        self, points: Sequence[Point], arrays: Mapping[str, np.ndarray], origin: Origin
    ) -> None:
        """Save finished runs; ``arrays`` have leaves (R, ...).

        Raises:
            ConfigurationError: if they are not the variables announced.
        """
        self._check_variables(arrays)
        self.adopt(write_part(self.parts, self.identity, points, arrays, origin))

    def _check_variables(self, arrays: Mapping[str, np.ndarray]) -> None:
        if self.variables.keys() != arrays.keys():
            raise ConfigurationError(
                f"variables for all that a run returns ({', '.join(arrays)})",
                ", ".join(self.variables),
                "give each of them a Variable, or leave variables out",
            )
        for name, array in arrays.items():
            if array.ndim - 1 != len(self.variables[name].dims):
                raise ConfigurationError(
                    f"{array.ndim - 1} dims for {name}, one for each axis of what a run returns",
                    f"{len(self.variables[name].dims)}",
                    "correct its Variable",
                )

    def adopt(self, part: Path) -> None:
        """Take in a part that :func:`write_part` has put into the folder, here or on another
        machine.

        Raises:
            StoreError: if it is not there or damaged.
        """
        if not self._load_part(part):
            remedy = "give --out a folder that all machines share, then run it again"
            raise StoreError(f"an undamaged part at {part}", "none", remedy)

    def holds(self, wanted: Iterable[Point]) -> bool:
        """Return whether the runs in the results file are just the ``wanted`` ones.

        Raises:
            StoreError: if finishing these would drop runs that the file holds.
        """
        wanted = set(wanted)
        dropped = sorted(self.finished - wanted, key=str)
        if dropped:
            got = (
                f"{len(dropped)} finished runs there that these leave out, e.g. {dict(dropped[0])}"
            )
            raise StoreError(
                f"axes that cover {self.path}", got, "choose another --out, or --overwrite it"
            )
        return self.finished == wanted

    def finish(
        self, data: xr.Dataset, wanted: Iterable[Point], attrs: Mapping[str, str]
    ) -> xr.Dataset:
        """Write the results ``data`` of the ``wanted`` runs as one file, and remove the parts that
        it contains.
        """
        wanted = set(wanted)
        used = {
            part: origin
            for part, (held, origin) in self._parts.items()
            if wanted.intersection(held)
        }
        origins = merge_origins([*self._origins, *used.values()])
        data.attrs |= {**attrs, "identity": self.identity, "origins": json.dumps(origins)}
        data.attrs["git_revision"] = ", ".join(sorted({origin.revision for origin in origins}))
        data.attrs["device"] = ", ".join(sorted({origin.device for origin in origins}))
        data.attrs["seconds"] = round(sum(origin.seconds for origin in origins), 1)
        data.attrs["digest"] = digest_of(data)
        encoding = {
            str(name): {"zlib": True, "shuffle": True}
            for name, column in data.data_vars.items()
            if column.ndim
        }
        write_bytes(self.path, bytes(data.to_netcdf(engine="h5netcdf", encoding=encoding)))
        for part in used:
            if wanted.issuperset(self._parts[part][0]):
                part.unlink(missing_ok=True)
                del self._parts[part]
        return data


def write_part(
    folder: Path, identity: str, points: Sequence[Point], arrays: Mapping[str, Any], origin: Origin
) -> Path:
    """Write finished runs as one part file and return its path.

    The name is made of the points and the content follows from them, so writing a chunk twice does
    no harm.
    """
    text = json.dumps(points)
    part = folder / f"{zlib.crc32(text.encode()):08x}.npz"
    write_piece(part, identity, {**arrays, "points": text, "origin": json.dumps(origin)})
    return part


def difference(old: dict[str, Any], new: dict[str, Any], prefix: str = "") -> str:
    """Return the first few settings in which two identities differ, for an error message."""
    found = []
    for key in sorted(old.keys() | new.keys()):
        a, b = old.get(key), new.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            inner = difference(a, b, f"{prefix}{key}.")
            found += [inner] if inner else []
        elif a != b:
            found.append(f"{prefix}{key} ({a} there, {b} here)")
    return ", ".join(found[:3])
