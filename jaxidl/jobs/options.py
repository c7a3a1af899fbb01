"""How a sweep is run: what every command that sweeps has in common. Imports nothing heavy."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Options:
    """Keyword arguments of :func:`jaxidl.jobs.sweep`."""

    devices: int | None = None
    """CPU cores or accelerators to use; None: all."""
    per_device: int | None = None
    """Runs of one chunk on each, a chunk being what an interruption can lose; None: 4 on a CPU, 320
    on a GPU.
    """
    width: int | None = None
    """Runs side by side in a device's program; None: 1 on a CPU, a whole chunk on a GPU."""
    cluster: str | None = None
    """Ray cluster to run on, its address or "local"; needs the extra jaxidl[cluster], and an --out
    that all machines share.
    """
    overwrite: bool = False
    """Begin anew; what lies at --out is kept as FILE.nc.old."""

    def keywords(self) -> dict[str, Any]:
        """Return the arguments by name."""
        return dict(vars(self))
