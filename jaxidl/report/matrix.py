"""The findings as a table of joints × kinds of effect, for terminal and page.

A kind is what conventional identification fits on every joint. It is recognised by an effect's own
declarations, so effects that a user registers are sorted in as well. All others are in the last
column.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jaxidl.effects import CATALOGUE, Effect
from jaxidl.gap.choice.objections import EXCLUDED
from jaxidl.gap.result.diagnosis import Diagnosis, Estimate, Finding
from jaxidl.gap.result.words import number, plus_minus, squared
from jaxidl.report.words import readable

VISCOUS, DRY, ROTOR, LINK, OFFSET, OTHER = range(6)
KINDS = ("viscous friction", "dry friction", "rotor inertia", "link errors", "offset", "other")
# columns of single numbers; units as in the catalogue
ALIKE = {VISCOUS: "N s/m", DRY: "N", ROTOR: "kg", OFFSET: "N"}


class Entry(NamedTuple):
    """A parameter of a finding, in one cell."""

    what: str  # the effect, or the link's error; empty if it follows from the column
    label: str  # which of several parameters
    value: str  # with standard error; with the unit unless the column has it
    finding: Finding
    own: bool = True  # False: only a reference to another column

    @property
    def sure(self) -> bool:
        """Return whether its effect is named rather than suspected."""
        return self.finding.sure


class Matrix(NamedTuple):
    """Cells by joint and kind. J joints, K kinds."""

    units: tuple[str, ...]  # (K) units of columns of single numbers, where all joints have the same
    rows: tuple[tuple[tuple[Entry, ...], ...], ...]  # (J, K)


def matrix(d: Diagnosis) -> Matrix:
    """Return the findings on joints, sorted into cells, named ones first within a cell."""
    found = [f for f in d.findings if f.joint is not None]
    units = []
    for kind in range(len(KINDS)):
        here = {
            p.unit
            for f in found
            for n, p in f.parameters.items()
            if kind_of(CATALOGUE[f.name], n) == kind
        }
        units.append(squared(here.pop()) if kind in ALIKE and len(here) == 1 else "")
    cells: list[list[list[Entry]]] = [[[] for _ in KINDS] for _ in d.model.names]
    for f in sorted(found, key=lambda f: not f.sure):
        for kind, entry in _entries(f, units):
            cells[f.joint or 0][kind].append(entry)
    # a number says more than where another one is
    rows = ([[e for e in cell if e.own] or cell for cell in row] for row in cells)
    return Matrix(tuple(units), tuple(tuple(tuple(cell) for cell in row) for row in rows))


def kind_of(cls: type[Effect], parameter: str) -> int:
    """Return the column of an effect's parameter."""
    unit = cls.parameters[parameter].unit
    if not cls.common:
        return OTHER
    for kind, alike in ALIKE.items():
        if unit == alike and cls.friction == (kind in (VISCOUS, DRY)):
            return kind
    return LINK if cls.rigid() else OTHER


def _entries(f: Finding, units: list[str]) -> Iterator[tuple[int, Entry]]:
    cls = CATALOGUE[f.name]
    kinds = {name: kind_of(cls, name) for name in f.parameters}
    for kind in dict.fromkeys(_contained(cls, tuple(f.parameters))):
        yield kind, Entry("", "", f"see {KINDS[OTHER]}", f, own=False)
    for name, p in f.parameters.items():
        kind = kinds[name]
        if kind in ALIKE and not isinstance(p.value, list):
            yield kind, Entry("", "", number(p._replace(unit="1")) if units[kind] else number(p), f)
            continue
        what = short_name(cls, name) if kind == LINK else readable(f.name)
        alone = len(f.parameters) == 1 or kind == LINK
        yield kind, Entry(what, "" if alone else readable(name), spelled(p), f)


def _contained(cls: type[Effect], free: tuple[str, ...]) -> Iterator[int]:
    """Return columns whose effect is a part of this one, which is in another."""
    for part in cls.contains(free):
        name, _, parameter = part.partition(".")
        if name in CATALOGUE and name != cls.name:
            kinds = {
                kind_of(CATALOGUE[name], p)
                for p in ([parameter] if parameter else CATALOGUE[name].parameters)
            }
            yield from sorted(kinds - {OTHER, LINK})


def short_name(cls: type[Effect], parameter: str) -> str:
    """Return what is wrong about a link, from the parameter's meaning.

    For example, "the missing mass of the body" is its mass.
    """
    return (
        cls.parameters[parameter]
        .meaning.removeprefix("the ")
        .removeprefix("missing ")
        .removesuffix(" of the body")
    )


def axes_of(unit: str, count: int) -> tuple[str, ...] | None:
    """Return the axes of a link's vector or tensor; None for a table of forces over position."""
    if "N" in unit:
        return None
    return {3: ("x", "y", "z"), 6: ("xx", "yy", "zz", "xy", "xz", "yz")}.get(count)


def spelled(p: Estimate) -> str:
    """Return a parameter with unit and standard error.

    A vector is given by its axes, a tensor that may be zero only by how large it may be.
    """
    axes = axes_of(p.unit, len(p.value)) if isinstance(p.value, list) else None
    if axes is None or not isinstance(p.value, list):
        return number(p)
    errors = p.stderr if isinstance(p.stderr, list) else [p.stderr] * len(axes)
    unit = "" if p.unit == "1" else f" {squared(p.unit)}"
    if len(axes) > 3 and np.all(np.abs(p.value) <= EXCLUDED * np.array(errors)):
        return f"zero within its error, at most ± {max(errors):.2g}{unit}"
    return (
        ", ".join(f"{a} {plus_minus(v, e)}" for a, v, e in zip(axes, p.value, errors, strict=True))
        + unit
    )
