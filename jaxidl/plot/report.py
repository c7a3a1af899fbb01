"""The report of a diagnosis as a folder: JSON, a page, figures and the patched model."""

import contextlib
import json
import os
import tempfile
from pathlib import Path

from jaxidl.errors import StoreError
from jaxidl.gap.diagnosis import Diagnosis
from jaxidl.plot.gap import FIGURES, draw
from jaxidl.plot.page import page
from jaxidl.systems.export import write_patched

MODEL, EFFECTS, PAGE, REPORT, PICTURES = "model.xml", "effects.json", "report.html", "report.json", "figures"


def write(d: Diagnosis, folder: Path) -> Path:
    """Write the report into ``folder``, which is made; return the path of ``report.html``.

    Everything is first written aside and then moved into place file by file, ``report.json`` last. An older report there is
    replaced; other files stay as they are.

    Raises:
        StoreError: if the folder cannot be written, or has a model or report that is not ours; nothing has changed then.
        ModelError: if the model's file has gone or changed since it was read.
    """
    made = [p for p in (folder, *folder.parents) if not p.exists()]  # deepest first
    done = False
    try:
        _check(d, folder)
        folder.mkdir(parents=True, exist_ok=True)
        # inside the folder: the one beside it may be another disk, or not ours to write
        with tempfile.TemporaryDirectory(prefix=".report-", dir=folder) as aside:
            names = _compose(d, folder, Path(aside))
            _move(Path(aside), folder, names)
        done = True
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise StoreError(f"to write a report into {folder}", reason, "make room or choose another folder with --out") from None
    finally:
        for path in made if not done else ():
            with contextlib.suppress(OSError):
                path.rmdir()
    return folder / PAGE


def _check(d: Diagnosis, folder: Path) -> None:
    """Complain of what is in the way before anything is done."""
    if folder.exists() and not folder.is_dir():
        raise StoreError(f"a folder at {folder}", "a file", "choose another folder with --out")
    for name in (MODEL, EFFECTS, PAGE, REPORT):
        if (folder / name).is_dir():
            raise StoreError(f"to write {folder / name}", "a folder of that name", "move it, or choose another folder with --out")
    if (folder / PICTURES).exists() and not (folder / PICTURES).is_dir():
        raise StoreError(f"a folder at {folder / PICTURES}", "a file", "move it, or choose another folder with --out")
    model = folder / MODEL
    if model.exists() and d.model.path.exists() and os.path.samefile(model, d.model.path):
        remedy = "choose another folder with --out: its model.xml would be lost"
        raise StoreError("another folder than the model's own", f"{folder}", remedy)
    foreign = [name for name in (MODEL, EFFECTS, PAGE, REPORT) if (folder / name).exists()]
    if foreign and not _ours(folder / REPORT):
        got = f"{' and '.join(foreign)} of another origin in {folder}"
        raise StoreError("an empty folder or one with a report of jaxidl gap", got, "choose another folder with --out")


def _ours(path: Path) -> bool:
    """Is this a report.json as we write it?"""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {"verdict", "effects", "gap", "files"} <= content.keys()
    except (OSError, ValueError, AttributeError, RecursionError):
        return False


def _compose(d: Diagnosis, folder: Path, aside: Path) -> list[str]:
    """Write all files into ``aside``; their names in the order in which they are to be moved."""
    figures = draw(d)
    (aside / PICTURES).mkdir()
    pictures = [f"{PICTURES}/{name}.png" for name in figures]
    for name, content in zip(pictures, figures.values(), strict=True):
        (aside / name).write_bytes(content)
    _, effects = write_patched(d.model, [f.effect for f in d.findings], aside)
    record = json.loads(effects.read_text(encoding="utf-8"))["effects"]
    (aside / PAGE).write_text(page(d, figures, record, folder), encoding="utf-8")
    files = {"model": MODEL, "effects": EFFECTS, "report": PAGE, "figures": pictures}
    (aside / REPORT).write_text(d.to_json(files=files) + "\n", encoding="utf-8")
    return [*pictures, MODEL, EFFECTS, PAGE, REPORT]


def _move(aside: Path, folder: Path, names: list[str]) -> None:
    for name in names:
        with (aside / name).open("rb") as file:
            os.fsync(file.fileno())
    (folder / PICTURES).mkdir(exist_ok=True)
    for name in names:
        os.replace(aside / name, folder / name)
    for name in FIGURES:
        if f"{PICTURES}/{name}.png" not in names:  # of an earlier report
            (folder / PICTURES / f"{name}.png").unlink(missing_ok=True)
