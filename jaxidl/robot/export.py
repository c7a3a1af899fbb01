"""A learned feedforward's folder as a C program."""

import hashlib
import re
from pathlib import Path

import jax.numpy as jnp

from jaxidl import __version__
from jaxidl.control import FeedbackLaw, Filtered, FiniteDifference
from jaxidl.errors import ConfigurationError
from jaxidl.files import write_bytes
from jaxidl.jobs.provenance import revision
from jaxidl.robot.c import Code, Controller, generate
from jaxidl.robot.folder import RECORD, load
from jaxidl.robot.learned import Learned


def write_c(
    folder: Path,
    out: Path,
    name: str | None = None,
    gains: Path | None = None,
    bands: tuple[float, float] | None = None,
) -> tuple[Path, Path]:
    """Write the feedforward in ``folder`` as ``NAME.h`` and ``NAME.c`` and return both paths.

    Args:
        folder: the learned feedforward.
        out: folder for the two files.
        name: prefix of all that the program declares. Default: the folder's name.
        gains: file of the feedback law; None: the program commands no feedback.
        bands: cut-offs [Hz] of the filters of velocity and acceleration. Default: those of the
            estimator with which the feedforward was learned.

    Raises:
        StoreError: if the folder cannot be read, or the files cannot be written.
        ConfigurationError: if a part of the controller has no C, or an option is wrong.
    """
    if bands is not None and not all(0.0 < band < float("inf") for band in bands):
        raise ConfigurationError("--bands > 0 (Hz)", str(bands), "correct the cut-offs")
    learned = load(folder)
    law = _law(gains, len(learned.model.names))
    estimator = FiniteDifference() if learned.motion == "finite_difference" else Filtered()
    if bands is not None:
        estimator = Filtered(*bands)
    code = as_c(learned, law, estimator, name or _word(folder), about(folder, learned, gains))
    paths = out / f"{name or _word(folder)}.h", out / f"{name or _word(folder)}.c"
    for path, text in zip(paths, code, strict=True):
        write_bytes(path, text.encode("ascii"))
    return paths


def as_c(
    learned: Learned,
    law: FeedbackLaw | None,
    estimator: Filtered | FiniteDifference,
    name: str,
    source: str,
) -> Code:
    """Return a learned feedforward with a feedback law as C; see :func:`jaxidl.robot.c.generate`.

    Raises:
        ConfigurationError: if a part of the controller has no C.
    """
    own = Controller(
        learned.model.plant,
        law,
        estimator,
        learned.model.names,
        learned.dt,
        jnp.asarray(learned.torque_limit),
        jnp.asarray(learned.feedforward_limit),
        learned.error_model,
        learned.learner.params,
        learned.region,
    )
    return generate(own, name, source)


def about(folder: Path, learned: Learned, gains: Path | None) -> str:
    """Return lines that say which model and revision a program comes from."""
    files = learned.model.files or {}
    model = _sha(files.get(learned.model.path.name, b""))
    record = _sha((folder / RECORD).read_bytes())
    law = f"of {gains.name} ({_sha(gains.read_bytes())})" if gains else "none"
    return "\n".join(
        (
            f"Model: {learned.model.path.name} ({model})",
            f"Feedforward: {folder.resolve().name}, iteration {learned.iteration}, learned from"
            f" {learned.source} data",
            f"Its {RECORD}: {record}",
            f"Feedback law: {law}",
            f"Written by jaxidl {__version__}, revision {revision()}",
        )
    )


def _law(gains: Path | None, joints: int) -> FeedbackLaw | None:
    if gains is None:
        return None
    from jaxidl.robot.gains import read_gains

    return read_gains(gains, joints)


def _sha(content: bytes) -> str:
    return f"SHA-256 {hashlib.sha256(content).hexdigest()[:16]}"


def _word(folder: Path) -> str:
    """Return a folder's name as a word of C."""
    word = re.sub(r"\W+", "_", folder.resolve().name, flags=re.ASCII).strip("_")
    return word if re.match(r"[a-zA-Z]", word) else f"robot_{word}".rstrip("_")
