"""Options that every command that sweeps has in common."""

from dataclasses import dataclass
from typing import Annotated, Any

from jaxidl.cli.arguments import optional


@dataclass(frozen=True)
class Options:
    """Keyword arguments of :func:`jaxidl.jobs.sweep`."""

    devices: Annotated[int | None, optional("N", "all")] = None
    """Number of CPU cores or accelerators to use."""
    per_device: Annotated[int | None, optional("N", "4 on a CPU, 320 on a GPU")] = None
    """Number of runs of a chunk on each device. An interruption can lose one chunk."""
    width: Annotated[int | None, optional("N", "1 on a CPU, a whole chunk on a GPU")] = None
    """Number of runs that a device computes side by side."""
    cluster: Annotated[str | None, optional("ADDRESS")] = None
    """Address of a Ray cluster to run on, or "local". Needs the extra jaxidl[cluster], and an --out
    that all machines share.
    """
    overwrite: bool = False
    """Start again; existing results at --out are kept as FILE.nc.old."""

    def keywords(self) -> dict[str, Any]:
        """Return the arguments by name."""
        return dict(vars(self))
