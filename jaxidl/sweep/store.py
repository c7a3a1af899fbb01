"""Results on disk: every finished chunk is safe at once, and what is finished is never mixed with anything else.

Beside ``RESULTS.nc`` lies the folder ``RESULTS.nc.parts`` while a sweep is under way, one file per finished chunk. Runs are
known by their labels, not by their place in a grid, so a sweep continues whatever its chunk size, device count or order, and
a finished file can be extended by more values on an axis. Files are written under another name and then renamed.
"""

import glob
import io
import json
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from filelock import FileLock, Timeout

from jaxidl.errors import StoreError
from jaxidl.files import write_bytes
from jaxidl.learning.iterate import Metrics
from jaxidl.sweep.grid import Grid, Label
from jaxidl.sweep.results import META, Origin, assemble, digest, digest_of, merge_origins, read, runs_of

FORMAT = "jaxidl-sweep-1"


class Store:
    """The finished runs of one results file. Use as a context manager: it holds the file's lock.

    Args:
        path: where the results go.
        identity: everything besides the axes that determines a result, ready for JSON.
        overwrite: begin anew; what lies there is moved to ``RESULTS.nc.old``.

    Raises:
        StoreError: when another process is at work on the file, or what lies there is unreadable or another study's.
    """

    def __init__(self, path: Path, identity: dict, overwrite: bool = False):
        self.path, self.parts = Path(path), Path(f"{path}.parts")
        self.overwrite = overwrite
        self.identity = json.dumps({"format": FORMAT, **identity}, sort_keys=True)
        self.runs: dict[Label, dict[str, np.ndarray]] = {}
        self.finished: set[Label] = set()  # those in the results file itself
        self.damaged: list[Path] = []
        self._origins: list[Origin] = []  # of what the results file holds
        self._parts: dict[Path, tuple[list[Label], Origin]] = {}
        self._lock = FileLock(self.parts / "lock", timeout=0)

    def __enter__(self) -> "Store":
        try:
            self.parts.mkdir(parents=True, exist_ok=True)
            self._lock.acquire()
        except Timeout:
            raise StoreError("to be alone on " + str(self.path), "another sweep at work", "wait or take another --out") from None
        except OSError as error:
            raise StoreError(f"to write beside {self.path}", str(error.strerror).lower(), "choose another --out") from None
        try:
            self._load()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        # emptied and removed while the lock is held, so that nobody can lock a file that is about to vanish
        if {entry.name for entry in self.parts.iterdir()} <= {"lock"}:
            (self.parts / "lock").unlink(missing_ok=True)
            self.parts.rmdir()
        self._lock.release()

    def _load(self) -> None:
        results = self.path.parent.glob(f".{glob.escape(self.path.name)}.*.tmp")
        for torn in [*self.parts.glob(".*.tmp"), *results]:  # of a process that was killed while writing
            torn.unlink()
        if self.overwrite:
            self._set_aside()
        if self.path.exists():
            data = read(self.path)
            self._check_identity(self.path, data.attrs["identity"], "choose another --out, or --overwrite it")
            self.runs.update(runs_of(data))
            self.finished.update(self.runs)
            self._origins += [Origin(*row) for row in json.loads(data.attrs["origins"])]
        self.damaged += [part for part in sorted(self.parts.glob("*.npz")) if not self._load_part(part)]

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
            raise StoreError(f"{where} to hold this study", f"one that differs in {what}", remedy)

    def _load_part(self, part: Path) -> bool:
        """Take in a part; False, and the part is gone, if it is damaged."""
        try:
            with np.load(io.BytesIO(part.read_bytes()), allow_pickle=False) as file:
                about = {name: str(file[name]) for name in ("identity", "labels", "origin")}
                columns = {name: file[name] for name in META}
                if digest(about | columns) != str(file["digest"]):
                    raise ValueError("changed on disk")
                identity, origin = about["identity"], Origin(*json.loads(about["origin"]))
                labels = [Label.of(row) for row in json.loads(about["labels"])]
        except Exception:  # whatever zipfile and numpy make of a broken file: its runs are computed again
            part.unlink(missing_ok=True)
            return False
        self._check_identity(self.parts, identity, "continue with the old settings, choose another --out, or --overwrite")
        if self.finished.issuperset(labels):
            part.unlink()  # of a process that was killed between writing the file and removing its parts
            return True
        self._parts[part] = labels, origin
        for row, label in enumerate(labels):
            self.runs[label] = {name: column[row] for name, column in columns.items()}
        return True

    def add(self, labels: Sequence[Label], metrics: Metrics, origin: Origin) -> None:
        """Save finished runs; ``metrics`` has leaves (R, K)."""
        self.adopt(write_part(self.parts, self.identity, labels, metrics, origin))

    def adopt(self, part: Path) -> None:
        """Take in a part that :func:`write_part` has put into the folder, here or on another machine.

        Raises:
            StoreError: if it is not there or damaged.
        """
        if not self._load_part(part):
            remedy = "give --out a folder that all machines share, then run it again"
            raise StoreError(f"a sound part at {part}", "none", remedy)

    def missing(self, grid: Grid) -> list[Label]:
        """The grid's runs that are not finished, in the grid's order."""
        return [label for label in grid.labels() if label not in self.runs]

    def holds(self, grid: Grid) -> bool:
        """Is the results file just what ``grid`` asks for?

        Raises:
            StoreError: if finishing ``grid`` would drop runs that the file holds.
        """
        wanted = set(grid.labels())
        dropped = sorted(self.finished - wanted)
        if dropped:
            got = f"{len(dropped)} finished runs there that this grid leaves out, e.g. {tuple(dropped[0])}"
            raise StoreError(f"a grid that covers {self.path}", got, "choose another --out, or --overwrite it")
        return self.finished == wanted

    def finish(self, grid: Grid, attrs: dict[str, str], extra: xr.Dataset) -> xr.Dataset:
        """Assemble the grid's results, write them as one file, and remove the parts that it contains."""
        wanted = set(grid.labels())
        used = {part: origin for part, (labels, origin) in self._parts.items() if wanted.intersection(labels)}
        origins = merge_origins([*self._origins, *used.values()])
        data = assemble(grid, self.runs)
        data.attrs |= attrs | {"identity": self.identity, "origins": json.dumps(origins)}
        data.attrs["git_revision"] = ", ".join(sorted({origin.revision for origin in origins}))
        data.attrs["device"] = ", ".join(sorted({origin.device for origin in origins}))
        data.attrs["seconds"] = round(sum(origin.seconds for origin in origins), 1)
        data = data.merge(extra, combine_attrs="no_conflicts")
        data.attrs["digest"] = digest_of(data)
        encoding = {str(name): {"zlib": True, "shuffle": True} for name, column in data.data_vars.items() if column.ndim}
        write_bytes(self.path, bytes(data.to_netcdf(engine="h5netcdf", encoding=encoding)))
        for part in used:
            if wanted.issuperset(self._parts[part][0]):
                part.unlink(missing_ok=True)
                del self._parts[part]
        return data


def write_part(folder: Path, identity: str, labels: Sequence[Label], metrics: Metrics, origin: Origin) -> Path:
    """Write finished runs as one part file and return its path.

    The name is made of the labels and the content follows from them, so writing a chunk twice does no harm.
    """
    columns = {name: np.asarray(value) for name, value in metrics._asdict().items()}
    buffer, text = io.BytesIO(), json.dumps(labels)
    about = {"identity": identity, "labels": text, "origin": json.dumps(origin)}
    np.savez(buffer, allow_pickle=False, **about, **columns, digest=digest(about | columns))
    part = folder / f"{zlib.crc32(text.encode()):08x}.npz"
    write_bytes(part, buffer.getvalue())
    return part


def difference(old: dict, new: dict, prefix: str = "") -> str:
    """The first few settings in which two identities differ, for an error message."""
    found = []
    for key in sorted(old.keys() | new.keys()):
        a, b = old.get(key), new.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            inner = difference(a, b, f"{prefix}{key}.")
            found += [inner] if inner else []
        elif a != b:
            found.append(f"{prefix}{key} ({a} there, {b} here)")
    return ", ".join(found[:3])
