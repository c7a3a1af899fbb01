"""The grid of a study, declared as named axes."""

import itertools
import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

from jaxidl.effects import STICTION_LEVEL, PaperFriction, SensingNoise
from jaxidl.errors import ConfigurationError, EffectError, one_of
from jaxidl.learning.paper import CONTROLLERS, GAINS
from jaxidl.learning.sources import SOURCES
from jaxidl.learning.vary import ALIASES, Value

NOISE_LEVELS = {
    "program": (1e-4, 5e-4, 7e-4, 8e-4),  # what the reference program used
    "printed": (1e-4, 5e-4, 7e-3, 8e-3),  # what the paper prints: accelerations of 10^4 m/s^2 by finite differences
}


LEVELS = {
    "noise": SensingNoise.parameters["scale"],
    "friction": PaperFriction.parameters["level"],
    "stiction": STICTION_LEVEL,
}
COUNTS = {"epochs": (1, 100_000), "seeds": (0, 2**31), "iterations": (1, 10_000)}


class Label(NamedTuple):
    """One learning run by the values on its axes: the run's identity, whatever grid it is part of."""

    controller: str
    gain: str
    noise: float
    friction: float
    stiction: float
    epochs: int
    seed: int
    source: str
    varied: tuple[tuple[str, Value], ...] = ()  # numbers of the study by name, for the axes that an ablation adds

    @classmethod
    def of(cls, row: Sequence[Any]) -> "Label":
        """The label that JSON has made a list of."""
        plain: Any = row[: len(AXES)]
        return cls(*plain, varied=tuple((name, value) for name, value in (row[len(AXES)] if len(row) > len(AXES) else ())))

    def place(self) -> dict[str, Any]:
        """Where the run stands in a results file: its value on each axis, by the axis' name."""
        return dict(zip(AXES, self, strict=False)) | dict(self.varied)


AXES = Label._fields[:-1]  # that every results file has


@dataclass(frozen=True)
class Grid:
    """Named axes; every combination is one learning run. The defaults are the paper's 1280 configurations × 3 sources.

    ``vary`` adds axes: names of the study's numbers (:mod:`jaxidl.learning.vary`), each with its values.

    Raises:
        ConfigurationError: for an empty axis, a value twice on an axis, an unknown name, or a value out of bounds.
    """

    controllers: tuple[str, ...] = CONTROLLERS
    gains: tuple[str, ...] = GAINS
    noise: tuple[float, ...] = NOISE_LEVELS["program"]  # [m]
    friction: tuple[float, ...] = (5.0, 8.0)
    stiction: tuple[float, ...] = (5.0, 8.0)
    epochs: tuple[int, ...] = (20, 50)
    seeds: tuple[int, ...] = tuple(range(1, 11))
    sources: tuple[str, ...] = tuple(SOURCES)
    iterations: int = 20  # executions of each run; not an axis of configurations but of the results
    vary: tuple[tuple[str, tuple[Value, ...]], ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "vary", tuple((name, tuple(values)) for name, values in self.vary))
        for name in (f.name for f in fields(self) if f.name != "vary"):
            given: Any = getattr(self, name)  # lists, ranges, arrays are welcome
            plain = _plain(name, given) if name == "iterations" else tuple(_plain(name, value) for value in given)
            object.__setattr__(self, name, plain)
        added = [name for name, _ in self.vary]
        if len({ALIASES.get(name, name) for name in added}) < len(added) or set(added) & {*AXES, *self.axes(), "iteration"}:
            raise ConfigurationError("each number to vary once, and no axis of the grid", ", ".join(added), "drop one of them")
        for name, values in (*self.axes().items(), *self.vary):
            if len(values) == 0:
                raise ConfigurationError(f"at least one value for {name}", "none", f"give --{name} a value or leave it out")
            if len(set(values)) < len(values):
                raise ConfigurationError(f"each value of {name} once", str(list(values)), "drop the repeated ones")
        for name, valid in (("controllers", CONTROLLERS), ("gains", GAINS), ("sources", SOURCES)):
            for value in getattr(self, name):
                if value not in valid:
                    raise one_of(name, value, valid)
        check_levels(self.noise, self.friction, self.stiction)
        for name, (low, high) in COUNTS.items():
            values = getattr(self, name)
            for value in values if isinstance(values, tuple) else (values,):
                if not low <= value <= high:
                    raise ConfigurationError(f"{name} between {low} and {high}", str(value), "correct the value")

    def axes(self) -> dict[str, tuple]:
        """The axes of configurations by name, in the order of :class:`Label`."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("iterations", "vary")}

    def dims(self) -> dict[str, tuple]:
        """All axes of configurations by their names in a results file."""
        return dict(zip(AXES, self.axes().values(), strict=True)) | dict(self.vary)

    def labels(self) -> Iterator[Label]:
        """All runs, the seed slowest: with chunks smaller than a seed, an interrupted sweep has whole seeds finished."""
        values = self.dims()
        order = ["seed", *(name for name in values if name != "seed")]
        for combination in itertools.product(*(values[name] for name in order)):
            at = dict(zip(order, combination, strict=True))
            plain: Any = (at[name] for name in AXES)
            yield Label(*plain, varied=tuple((name, at[name]) for name, _ in self.vary))

    def __len__(self) -> int:
        size = 1
        for values in self.dims().values():
            size *= len(values)
        return size


def _plain(axis: str, value: Any) -> Any:
    """A value as plain Python has it: labels are stored as JSON, which knows no NumPy numbers, and 1.5 is no seed."""
    try:
        return operator.index(value) if axis in COUNTS else float(value) if axis in LEVELS else value
    except (TypeError, ValueError, OverflowError):
        kind = "whole numbers" if axis in COUNTS else "numbers"
        raise ConfigurationError(f"{kind} for {axis}", repr(value), "correct the value") from None


def check_levels(noise: tuple[float, ...], friction: tuple[float, ...], stiction: tuple[float, ...]) -> None:
    """Raise :class:`ConfigurationError` unless every level is within its effect's bounds."""
    for axis, values in (("noise", noise), ("friction", friction), ("stiction", stiction)):
        for value in values:
            try:
                LEVELS[axis].check(axis, value)
            except EffectError as error:
                raise ConfigurationError(error.expected, error.got, error.remedy) from None


QUICK = Grid(noise=(1e-4, 8e-4), seeds=(1,))  # the extremes of the noise, one seed
