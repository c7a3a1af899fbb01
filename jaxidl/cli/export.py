"""The command ``jaxidl export``."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from jaxidl.errors import ConfigurationError


def export(
    folder: Annotated[Positional[Path], arg(metavar="DIR", help_behavior_hint="(required)")],
    /,
    *,
    c: Annotated[bool, arg(help_behavior_hint="")] = False,
    out: Annotated[Path, arg(metavar="DIR", help_behavior_hint="")] = Path("."),
    name: Annotated[str | None, arg(metavar="NAME", help_behavior_hint="")] = None,
    gains: Annotated[Path | None, arg(metavar="FILE.yaml", help_behavior_hint="")] = None,
    bands: Annotated[
        tuple[float, float] | None,
        arg(metavar="VELOCITY ACCELERATION", help_behavior_hint=""),
    ] = None,
) -> None:
    """Write a learned feedforward for a robot's control computer.

    Args:
        folder: the feedforward, as `jaxidl learn` wrote it.
        c: as one C99 file and its header, which need only libm: rigid body with the effects of the
            corrected model, networks, limits, guard and feedback law.
        out: folder for NAME.c and NAME.h (default: the present one).
        name: of the files, and prefix of all that they declare (default: the folder's name).
        gains: file of the feedback law, pid or doomed (default: no feedback; the robot has its
            own).
        bands: cut-offs [Hz] of the filters of velocity and acceleration (default: 80 and 30, or no
            filters where the feedforward was learned without).
    """
    if not c:
        raise ConfigurationError("a form to export to", "none", "add --c")
    from jaxidl.backend import choose_devices
    from jaxidl.robot.export import write_c

    choose_devices(None)
    for path in write_c(folder, out, name, gains, bands):
        print(f"wrote {path}")
