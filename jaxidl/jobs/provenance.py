"""Where a result came from."""

import platform
import re
import subprocess
import sys
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import jax


def provenance() -> dict[str, str]:
    """Return versions, command and time, as attributes of a results file."""
    packages = ("jaxidl", "jax", "jaxlib", "flax", "optax", "numpy", "xarray")
    return {
        "versions": ", ".join(f"{name} {version(name)}" for name in packages)
        + f", Python {platform.python_version()}",
        "command": command(),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def command() -> str:
    """Return the command line, with folders left out: a result should not tell whose machine it was
    made on.
    """
    return " ".join(re.sub(r"[^=]*/", "", word) for word in sys.argv)


def device(width: int) -> str:
    """Return what computed: kind of device, and how many runs side by side."""
    return f"{jax.devices()[0].device_kind}, {width} wide"


@lru_cache
def revision() -> str:
    """Return the git revision of the code that runs, "+changes" if it differs from it, "unknown"
    outside a checkout.
    """
    folder = Path(__file__).resolve().parent

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, check=True
        ).stdout.strip()

    try:
        return git("rev-parse", "HEAD") + (
            "+changes" if git("status", "--porcelain", "--", "..") else ""
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
