"""Experiments that separate effects which one log cannot tell apart."""

import shlex
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from jaxidl.effects import CATALOGUE
from jaxidl.gap.evidence.gram import Key

MOST = 2  # most pieces of advice


def experiment(candidates: Sequence[Key]) -> str:
    """Return the motion or load that would separate the candidates.

    It is the advice of the rarest among them.
    """
    names = list(dict.fromkeys(name for name, _ in candidates))
    if len(names) == 1:
        return "move all joints at once, at different speeds, and each of them alone"
    ordered = sorted((CATALOGUE[name] for name in names), key=lambda cls: cls.prior)
    return "; or ".join(list(dict.fromkeys(cls.advice for cls in ordered))[:MOST])


def designed(model: Path, folder: Path, names: Iterable[str]) -> str:
    """Return the command that designs the motion to settle the diagnosis in ``folder``.

    ``names`` are those of the effects in question.
    """
    where = shlex.join(["--model", str(model), "--for", str(folder)])
    return f"jaxidl excite {where}{plugins(names)} --out motion.csv"


def plugins(names: Iterable[str]) -> str:
    """Return the option that loads the user's own effects among those of the given names."""
    modules = dict.fromkeys(CATALOGUE[name].__module__ for name in names)
    own = [name for name in modules if not name.startswith("jaxidl.")]
    files = [str(getattr(sys.modules.get(name), "__file__", None) or name) for name in own]
    return f" --plugin {shlex.join(files)}" if files else ""
