"""The report of a diagnosis as a folder: JSON, a page, figures and the corrected model."""

import contextlib
import json
import os
import tempfile
from pathlib import Path

import jax

from jaxidl.errors import StoreError
from jaxidl.files import check_writable, why
from jaxidl.gap.result.diagnosis import Diagnosis
from jaxidl.report.document import page
from jaxidl.report.figures import FIGURES, draw
from jaxidl.systems.export import write_patched

MODEL, EFFECTS, PAGE, REPORT, PICTURES = (
    "model.xml",
    "effects.json",
    "report.html",
    "report.json",
    "figures",
)


def save(d: Diagnosis, folder: str | Path) -> Path:
    """Write report.json, report.html, figures and the corrected model into ``folder``.

    The folder is created. Everything is first written to a temporary folder and then moved into
    place file by file, ``report.json`` last. An older report in the folder is replaced; other files
    stay as they are.

    Returns:
        The page's path.

    Raises:
        StoreError: if the folder cannot be written, or has a model or report that jaxidl did not
            write; nothing has changed then.
        ModelError: if the model's file is gone or has changed since it was read.
    """
    folder, made = Path(folder), list[Path]()
    try:
        made = [path for path in (folder, *folder.parents) if not path.exists()]  # deepest first
        check_folder(folder, d.model.path)
        folder.mkdir(parents=True, exist_ok=True)
        # inside the folder: its parent may be on another disk, or not writable
        with tempfile.TemporaryDirectory(prefix=".report-", dir=folder) as aside:
            with jax.enable_x64(True):  # keeps the parameters' precision
                names = _compose(d, folder, Path(aside))
            _move(Path(aside), folder, names)
    except OSError as error:
        remedy = "free some space or choose another folder"
        raise StoreError(f"to write a report into {folder}", why(error), remedy) from None
    finally:
        for path in made:  # only those that are still empty
            with contextlib.suppress(OSError):
                path.rmdir()
    return folder / PAGE


def check_folder(folder: Path, model: Path) -> None:
    """Check that a report on the model file ``model`` can be written into ``folder``.

    It is meant for use before long computations.

    Raises:
        StoreError: if it cannot be written.
    """
    if folder.exists() and not folder.is_dir():
        raise StoreError(f"a folder at {folder}", "a file", "choose another folder")
    for name in (MODEL, EFFECTS, PAGE, REPORT):
        if (folder / name).is_dir():
            raise StoreError(
                f"to write {folder / name}",
                "a folder of that name",
                "move it, or choose another folder",
            )
    if (folder / PICTURES).exists() and not (folder / PICTURES).is_dir():
        raise StoreError(
            f"a folder at {folder / PICTURES}", "a file", "move it, or choose another folder"
        )
    if (folder / MODEL).exists() and model.exists() and os.path.samefile(folder / MODEL, model):
        raise StoreError(
            "a folder other than the model's own",
            f"{folder}",
            "choose another folder: its model.xml would be lost",
        )
    foreign = [name for name in (MODEL, EFFECTS, PAGE, REPORT) if (folder / name).exists()]
    if foreign and not _ours(folder / REPORT):
        got = f"{' and '.join(foreign)} of another origin in {folder}"
        raise StoreError(
            "an empty folder or one with a report of jaxidl gap", got, "choose another folder"
        )
    check_writable(folder)


def _ours(path: Path) -> bool:
    """Return whether this is a report.json that jaxidl wrote."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return {"verdict", "effects", "gap", "files"} <= content.keys()
    except (OSError, ValueError, AttributeError, RecursionError):
        return False


def _compose(d: Diagnosis, folder: Path, aside: Path) -> list[str]:
    """Write all files into ``aside``; return their names in the order to move them."""
    figures = draw(d)
    (aside / PICTURES).mkdir()
    pictures = [f"{PICTURES}/{name}.png" for name in figures]
    for name, content in zip(pictures, figures.values(), strict=True):
        (aside / name).write_bytes(content)
    _, effects = write_patched(d.model, d.added, aside)
    record = json.loads(effects.read_text(encoding="utf-8"))["effects"]
    # an option may be a path
    (aside / PAGE).write_bytes(page(d, figures, record, folder).encode(errors="replace"))
    files = {"model": MODEL, "effects": EFFECTS, "report": PAGE, "figures": pictures}
    (aside / REPORT).write_text(d.to_json(files=files) + "\n", encoding="utf-8")
    return [*pictures, MODEL, EFFECTS, PAGE, REPORT]


def _move(aside: Path, folder: Path, names: list[str]) -> None:
    """Move the files.

    If that fails or is interrupted, remove those that were not there before.
    """
    for name in names:
        with (aside / name).open("rb") as file:
            os.fsync(file.fileno())
    fresh = [name for name in names if not (folder / name).exists()]
    try:
        (folder / PICTURES).mkdir(exist_ok=True)
        for name in names:
            os.replace(aside / name, folder / name)
    except BaseException:
        with contextlib.suppress(OSError):
            for name in fresh:
                (folder / name).unlink(missing_ok=True)
            (folder / PICTURES).rmdir()
        raise
    for name in FIGURES:
        if f"{PICTURES}/{name}.png" not in names:  # of an earlier report
            (folder / PICTURES / f"{name}.png").unlink(missing_ok=True)
