"""The grid of the study, declared as named axes. Imports nothing heavy: the command line reads its
arguments here.
"""

import operator
from dataclasses import dataclass, fields
from typing import Any

from jaxidl.errors import ConfigurationError, EffectError, one_of

CONTROLLERS = ("pid", "doomed")
GAINS = ("low", "high")
SOURCES = ("indirect", "direct", "joint")  # the paper's
EVERY_SOURCE = (*SOURCES, "weighted")  # imports nothing heavy: a test compares it
NOISE_LEVELS = {
    "program": (1e-4, 5e-4, 7e-4, 8e-4),  # what the reference program used
    # what the paper prints: accelerations of 10^4 m/s^2 by finite differences
    "printed": (1e-4, 5e-4, 7e-3, 8e-3),
}
LEVELS = ("noise", "friction", "stiction")
COUNTS = {"epochs": (1, 100_000), "seeds": (0, 2**31), "executions": (1, 10_000)}
# that every results file has
AXES = ("controller", "gain", "noise", "friction", "stiction", "epochs", "seed", "source")
Value = float | int | str


@dataclass(frozen=True)
class Axes:
    """Values on each axis of the study. The defaults are the paper's 1280 configurations × 3
    sources.
    """

    controllers: tuple[str, ...] = CONTROLLERS
    """Feedback laws: pid, doomed."""
    gains: tuple[str, ...] = GAINS
    """Gain settings: low, high."""
    noise: tuple[float, ...] = NOISE_LEVELS["program"]
    """Sensing noise scales [m]."""
    friction: tuple[float, ...] = (5.0, 8.0)
    """Friction levels."""
    stiction: tuple[float, ...] = (5.0, 8.0)
    """Stiction levels."""
    epochs: tuple[int, ...] = (20, 50)
    """Training epochs of each iteration."""
    seeds: tuple[int, ...] = tuple(range(1, 11))
    """Run seeds."""
    sources: tuple[str, ...] = SOURCES
    """Data sources: indirect, direct, joint, weighted."""
    executions: int = 20
    """Number of executions of each learning run. It is an axis of the results, not of the grid."""


@dataclass(frozen=True)
class Grid(Axes):
    """Named axes; every combination is one learning run. The defaults are the paper's 1280
    configurations × 3 sources.

    ``vary`` adds axes: names of the study's numbers (:mod:`jaxidl.paper.vary`), each with its
    values.

    Raises:
        ConfigurationError: for an empty axis, a value twice on an axis, an unknown name, or a value
            out of bounds.
    """

    vary: tuple[tuple[str, tuple[Value, ...]], ...] = ()
    """Numbers of the study, each with its values, as more axes."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "vary", tuple((name, tuple(values)) for name, values in self.vary))
        for name in (f.name for f in fields(self) if f.name != "vary"):
            given: Any = getattr(self, name)  # lists, ranges, arrays are welcome
            plain = (
                _plain(name, given)
                if name == "executions"
                else tuple(_plain(name, value) for value in given)
            )
            object.__setattr__(self, name, plain)
        added = [name for name, _ in self.vary]
        if len(set(added)) < len(added) or set(added) & {*AXES, *self.axes(), "iteration"}:
            raise ConfigurationError(
                "each number to vary once, and no axis of the grid",
                ", ".join(added),
                "drop one of them",
            )
        for name, values in (*self.axes().items(), *self.vary):
            if len(values) == 0:
                raise ConfigurationError(
                    f"at least one value for {name}",
                    "none",
                    f"give --{name} a value or leave it out",
                )
            if len(set(values)) < len(values):
                raise ConfigurationError(
                    f"each value of {name} once", str(list(values)), "drop the repeated ones"
                )
        for name, valid in (
            ("controllers", CONTROLLERS),
            ("gains", GAINS),
            ("sources", EVERY_SOURCE),
        ):
            for value in getattr(self, name):
                if value not in valid:
                    raise one_of(name, value, valid)
        check_levels(self.noise, self.friction, self.stiction)
        for name, (low, high) in COUNTS.items():
            values = getattr(self, name)
            for value in values if isinstance(values, tuple) else (values,):
                if not low <= value <= high:
                    raise ConfigurationError(
                        f"{name} between {low} and {high}", str(value), "correct the value"
                    )

    @classmethod
    def quick(cls) -> "Grid":
        """Return a grid for minutes instead of hours: the extremes of the noise, one seed."""
        return cls(noise=(1e-4, 8e-4), seeds=(1,))

    def axes(self) -> dict[str, tuple[Any, ...]]:
        """Return the axes of configurations by the names of their fields."""
        return {
            f.name: getattr(self, f.name)
            for f in fields(self)
            if f.name not in ("executions", "vary")
        }

    def dims(self) -> dict[str, tuple[Any, ...]]:
        """Return all axes of configurations by their names in a results file."""
        return dict(zip(AXES, self.axes().values(), strict=True)) | dict(self.vary)

    def __len__(self) -> int:
        size = 1
        for values in self.dims().values():
            size *= len(values)
        return size


def _plain(axis: str, value: Any) -> Any:
    """A value as plain Python has it: labels are stored as JSON, which knows no NumPy numbers, and
    1.5 is no seed.
    """
    try:
        return (
            operator.index(value) if axis in COUNTS else float(value) if axis in LEVELS else value
        )
    except (TypeError, ValueError, OverflowError):
        kind = "whole numbers" if axis in COUNTS else "numbers"
        raise ConfigurationError(f"{kind} for {axis}", repr(value), "correct the value") from None


def check_levels(
    noise: tuple[float, ...], friction: tuple[float, ...], stiction: tuple[float, ...]
) -> None:
    """Raise :class:`ConfigurationError` unless every level is within its effect's bounds."""
    # JAX: not for a help text
    from jaxidl.effects import SensingNoise
    from jaxidl.paper.effects import STICTION_LEVEL, PaperFriction

    bounds = (SensingNoise.parameters["scale"], PaperFriction.parameters["level"], STICTION_LEVEL)
    for axis, values, bound in zip(LEVELS, (noise, friction, stiction), bounds, strict=True):
        for value in values:
            try:
                bound.check(axis, value)
            except EffectError as error:
                raise ConfigurationError(error.expected, error.got, error.remedy) from None
