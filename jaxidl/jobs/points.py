"""The points of a sweep: each run is one value on every axis."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from jaxidl.errors import ConfigurationError

Value = str | int | float
Point = tuple[tuple[str, Value], ...]
"""(axis, value) in the order of the axes' names: a run's identity, whatever grid it stands in."""


def point(at: Mapping[str, Value]) -> Point:
    """Return the point with these values by axis."""
    return tuple(sorted(at.items()))


def axes_of(given: Mapping[str, Sequence[Any]]) -> dict[str, tuple[Value, ...]]:
    """Return axes with plain Python values, which a file can hold.

    Raises:
        ConfigurationError: for an axis without values, one with a value twice, or a value that is
            neither text nor number.
    """
    found: dict[str, tuple[Value, ...]] = {}
    for name, values in given.items():
        plain = tuple(value.item() if hasattr(value, "item") else value for value in values)
        for value in plain:
            if isinstance(value, bool) or not isinstance(value, str | int | float):
                raise ConfigurationError(
                    f"texts or numbers on axis {name}",
                    repr(value),
                    "name each value by a text or a number",
                )
        if not plain:
            raise ConfigurationError(
                f"at least one value for {name}", "none", "give it one or leave the axis out"
            )
        if len(set(plain)) < len(plain):
            raise ConfigurationError(
                f"each value of {name} once", str(list(plain)), "drop the repeated ones"
            )
        found[name] = plain
    return found


def points(axes: Mapping[str, Sequence[Value]]) -> Iterator[Point]:
    """Yield all points, the axis ``seed`` slowest: an interrupted sweep then has whole seeds
    finished.
    """
    order = sorted(axes, key=lambda name: name != "seed")
    for values in itertools.product(*(axes[name] for name in order)):
        yield point(dict(zip(order, values, strict=True)))
