"""What `jaxidl simulate` is asked for. Imports nothing heavy: the command line reads its arguments
here.
"""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Request:
    """One execution, or one learning run where a source is named."""

    controller: str
    """Feedback law, pid or doomed."""
    gain: str
    """Gain setting, low or high."""
    friction: float = 5.0
    """Friction level f; the paper has 5 and 8."""
    stiction: float = 5.0
    """Stiction level s; the paper has 5 and 8."""
    noise: float = 5e-4
    """Sensing noise scale [m]."""
    seed: int = 1
    """Run seed; its noise is the reference program's own stream."""
    standard_normal: Path | None = None
    """File of (1000, 2) or (executions, 1000, 2) draws to use instead of the seed's."""
    source: str | None = None
    """Data source to learn from: indirect, direct, joint or weighted."""
    executions: int | None = None
    """Executions of the learning run (default: 20)."""
    epochs: int = 20
    """Training epochs of each iteration."""
    guard: bool = False
    """Limit learned torques to the range of their data, and fade them out where the robot strays
    from the desired trajectory."""
    schedule: bool = False
    """Let the applied gains fall while tracking stays close to the best execution's, and return
    where the robot strays."""
