"""What `jaxidl simulate` is asked for. Imports nothing heavy: the command line reads its arguments
here.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg


@dataclass(frozen=True)
class Request:
    """One execution, or one learning run where a source is named."""

    controller: str
    """Feedback law, pid or doomed."""
    gain: str
    """Gain setting, low or high."""
    friction: float = 5.0
    """Friction level f; the paper uses 5 and 8."""
    stiction: float = 5.0
    """Stiction level s; the paper uses 5 and 8."""
    noise: float = 5e-4
    """Sensing noise scale [m]."""
    seed: int = 1
    """Run seed; its noise is that of the reference program."""
    standard_normal: Annotated[
        Path | None, arg(metavar="FILE.npy", help_behavior_hint="(optional)")
    ] = None
    """File of (1000, 2) or (executions, 1000, 2) noise draws to use instead of the seed's."""
    source: Annotated[
        str | None,
        arg(metavar="indirect|direct|joint|weighted", help_behavior_hint="(optional)"),
    ] = None
    """Data source to learn from: indirect, direct, joint or weighted."""
    executions: Annotated[int | None, arg(metavar="N", help_behavior_hint="(default: 20)")] = None
    """Executions of the learning run."""
    epochs: int = 20
    """Training epochs of each iteration."""
    guard: bool = False
    """Limit learned torques to the range of their data, and fade them out where the robot strays
    from the desired trajectory."""
    schedule: bool = False
    """Let the applied gains fall while tracking stays close to that of the best execution, and
    raise them again where the robot strays."""
