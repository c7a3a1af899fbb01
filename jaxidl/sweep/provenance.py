"""Where a result came from."""

import platform
import subprocess
import sys
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import jax

PRECISION = "float64 simulation, float32 networks"


def provenance(width: int) -> dict[str, str]:
    """Versions, command, device and precision, as attributes of a results file."""
    packages = ("jaxidl", "jax", "jaxlib", "flax", "optax", "numpy", "xarray")
    return {
        "title": "Task-specific inverse dynamics learning from indirect, direct and joint data",
        "versions": ", ".join(f"{name} {version(name)}" for name in packages) + f", Python {platform.python_version()}",
        "command": command(),
        "precision": PRECISION,
        "device": f"{jax.devices()[0].device_kind} ({jax.default_backend()}), {len(jax.devices())} devices, {width} runs wide",
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def command() -> str:
    """The command line, with folders left out: a result should not tell whose machine it was made on."""
    words = [Path(word).name if "/" in word else word for word in sys.argv]
    return " ".join(words)


@lru_cache
def revision() -> str:
    """The git revision of the code that runs, "+changes" if it differs from it, "unknown" outside a checkout."""
    folder = Path(__file__).resolve().parent

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(folder), *words], capture_output=True, text=True, check=True).stdout.strip()

    try:
        return git("rev-parse", "HEAD") + ("+changes" if git("status", "--porcelain", "--", "..") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
