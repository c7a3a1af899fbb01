"""Options that every command that sweeps has in common."""

from dataclasses import dataclass
from typing import Annotated, Any

from jaxidl.cli.arguments import optional


@dataclass(frozen=True)
class Options:
    """Keyword arguments of :func:`jaxidl.jobs.sweep`."""

    devices: Annotated[int | None, optional("N", "all")] = None
    """CPU cores or accelerators to use."""
    per_device: Annotated[int | None, optional("N", "4 on a CPU, 320 on a GPU")] = None
    """Runs of one chunk on each, a chunk being what an interruption can lose."""
    width: Annotated[int | None, optional("N", "1 on a CPU, a whole chunk on a GPU")] = None
    """Runs side by side in a device's program."""
    cluster: Annotated[str | None, optional("ADDRESS")] = None
    """Ray cluster to run on, its address or "local"; needs the extra jaxidl[cluster], and an --out
    that all machines share.
    """
    overwrite: bool = False
    """Begin anew; what lies at --out is kept as FILE.nc.old."""

    def keywords(self) -> dict[str, Any]:
        """Return the arguments by name."""
        return dict(vars(self))
