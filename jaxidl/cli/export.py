"""The command ``jaxidl export``."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from jaxidl.cli.arguments import optional
from jaxidl.errors import ConfigurationError


def export(
    folder: Annotated[Positional[Path], arg(metavar="DIR", help_behavior_hint="(required)")],
    /,
    *,
    c: Annotated[bool, arg(help_behavior_hint="")] = False,
    out: Annotated[Path, optional("DIR", "the current one")] = Path("."),
    name: Annotated[str | None, optional("NAME", "the folder's name")] = None,
    gains: Annotated[
        Path | None, optional("FILE.yaml", "no feedback; the robot has its own")
    ] = None,
    bands: Annotated[
        tuple[float, float] | None,
        optional(
            "VELOCITY ACCELERATION",
            "80 and 30, or no filters where the feedforward was learned without",
        ),
    ] = None,
) -> None:
    """Write a learned feedforward for a robot's control computer.

    Args:
        folder: the feedforward, as `jaxidl learn` wrote it.
        c: write one C99 file and its header, which need only libm. It has the rigid body with the
            effects of the corrected model, networks, limits, guard and feedback law.
        out: folder for NAME.c and NAME.h.
        name: name of the files, and prefix of all that they declare.
        gains: file of the feedback law, pid or doomed.
        bands: cut-offs [Hz] of the filters of velocity and acceleration.
    """
    if not c:
        raise ConfigurationError("a form to export to", "none", "add --c")
    from jaxidl.backend import choose_devices
    from jaxidl.robot.export import write_c

    choose_devices(None)
    for path in write_c(folder, out, name, gains, bands):
        print(f"wrote {path}")
