"""Errors of links, which a log can distinguish only in combinations.

They are judged by the torque that they cause, not by their names. The truth holds the Gram matrix
of the regressor of all links' inertial parameters on the case's own motion, so what a motion cannot
distinguish is decided by its rank and not by a list: an inertia about the joint's axis is a
rotor's, a load is an error of the last link, the mass of a link may appear in another link's
parameters.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxidl.gap.benchmark.reference import Array

INERTIAL = ("inertia_error", "com_error", "inertia_tensor_error", "payload")
Mask = np.ndarray[Any, np.dtype[np.bool_]]
TEN = 10  # number of a link's parameters before its rotor's


class Links:
    """The true errors of a robot's links, and the part of their torque that effects can explain.

    Errors are vectors (P,) of all links' inertial parameters, in the order of
    :func:`.worth.columns`.
    """

    def __init__(self, record: Mapping[str, Any]):
        """Take the ``inertial`` part of a robot's truth."""
        self.size = len(record["names"])
        self.gram = np.zeros((self.size, self.size))
        rows, columns = np.tril_indices(self.size)
        self.gram[rows, columns] = self.gram[columns, rows] = record["gram"]
        self.believed = np.array(record["believed"], float).reshape(-1, TEN + 1)
        self.error = np.array(record["error"], float)

    def directions(self, name: str, joint: int | None) -> dict[str, Array]:
        """Return the directions (P, n) in which an effect's parameters change the links.

        The effect is ``name`` on ``joint``; there is an entry for each parameter.
        """
        last = len(self.believed) - 1
        start = (TEN + 1) * (last if joint is None or name == "payload" else joint)
        unit = np.eye(self.size)
        if name == "inertia_error":
            heavier = np.zeros((self.size, 1))
            ten = self.believed[joint or 0, :TEN]
            heavier[start : start + TEN, 0] = ten / ten[0]
            return {"extra": unit[:, [start + TEN]], "mass": heavier}
        if name == "com_error":
            block = unit[:, start + 1 : start + 4].copy()
            block[start + 4 : start + TEN] = shifted(self.believed[joint or 0])
            return {"moment": block}
        if name == "inertia_tensor_error":
            return {"tensor": unit[:, start + 4 : start + TEN]}
        return {"ten": unit[:, start : start + TEN]}

    def vector(self, record: Mapping[str, Any]) -> Array:
        """Return the change (P,) of the links due to an effect with its parameters.

        The effect may be hidden or reported.
        """
        name, total = record["effect"], np.zeros(self.size)
        given = {key: _value(value) for key, value in record["parameters"].items()}
        for key, block in self.directions(name, record["joint"]).items():
            if key == "ten":
                total += block @ load(given)
            elif key in given:
                values = given[key]
                if (
                    len(values) != block.shape[1]
                    and len(values) == len(self.believed) * block.shape[1]
                ):
                    values = values.reshape(len(self.believed), -1)[record["joint"] or 0]
                total += block @ values
        return total

    def energy(self, error: Array) -> float:
        """Return the mean square of the torque of an ``error`` (P,).

        It is in shares of the joints' commands, added over joints.
        """
        return float(max(error @ self.gram @ error, 0.0))

    def left(self, error: Array, names: Sequence[tuple[str, int | None]]) -> float:
        """Return the root mean square torque of ``error`` (P,) that effects cannot explain.

        The effects are those of the given names.
        """
        blocks = [block for name in names for block in self.directions(*name).values()]
        if not blocks:
            return self.energy(error) ** 0.5
        basis = np.concatenate(blocks, axis=1)
        return self.energy(error - basis @ self._fit(basis, error)[0]) ** 0.5

    def fitted(
        self, reported: Sequence[Mapping[str, Any]]
    ) -> dict[tuple[str, int | None], dict[str, Array]]:
        """Return the result of a perfect fit of the parameters that a report's effects give.

        A component that the report leaves at zero without an error was not fitted. What was not,
        or what the motion does not determine, is NaN.
        """
        parts: list[tuple[tuple[str, int | None], str, Array, Mask]] = []
        found: dict[tuple[str, int | None], dict[str, Array]] = {}
        for record in reported:
            name = record["effect"], record["joint"]
            for key, block in self.directions(*name).items():
                free = _free(record["parameters"], key, block.shape[1])
                found.setdefault(name, {})[key] = np.full(block.shape[1], np.nan)
                parts.append((name, key, block[:, free], free))
        if not parts:
            return found
        values, known = self._fit(np.concatenate([p[2] for p in parts], axis=1), self.error)
        values = np.where(known, values, np.nan)
        for name, key, block, free in parts:
            found[name][key][free], values = np.split(values, [block.shape[1]])
        return found

    def _fit(self, basis: Array, error: Array) -> tuple[Array, Mask]:
        """Fit the torque of ``error`` by that of the ``basis`` (P, n), by least squares.

        Returns values (n,), and which of them are unique.
        """
        normal = basis.T @ self.gram @ basis
        size = np.diag(normal)
        # for example, a first moment about a vertical axis causes no torque at all
        seen = size > 1e-10 * size.max()
        scale = np.where(seen, np.sqrt(np.maximum(size, 0)), np.inf)
        eigen, turn = np.linalg.eigh(normal / np.outer(scale, scale))
        large = eigen > 1e-9 * eigen[-1]
        inverse = (turn[:, large] / eigen[large]) @ turn[:, large].T
        values = inverse @ (basis.T @ self.gram @ error / scale) / scale
        known = seen & ((turn[:, ~large] ** 2).sum(axis=1) < 1e-8)
        return values, known


def shifted(ten: Array) -> Array:
    """Return the change of a body's inertia about its origin (6, 3) per unit of first moment.

    The body has parameters ``ten`` (10,); to first order the inertia about its centre stays.
    """
    x, y, z = ten[1:4] / ten[0]
    return np.array(
        [
            [0.0, 2 * y, 2 * z],
            [2 * x, 0.0, 2 * z],
            [2 * x, 2 * y, 0.0],
            [-y, -x, 0.0],
            [-z, 0.0, -x],
            [0.0, -z, -y],
        ]
    )


def load(given: Mapping[str, Array]) -> Array:
    """Return the ten parameters of a load about the body's origin.

    They follow from its mass, its centre, and its inertia about that.
    """
    mass, centre = float(given.get("mass", np.zeros(1))[0]), given.get("com", np.zeros(3))
    six = given.get("inertia", np.zeros(6))
    xx, yy, zz, xy, xz, yz = six if len(six) == 6 else np.zeros(6)
    x, y, z = centre
    about = [xx + mass * (y * y + z * z), yy + mass * (x * x + z * z), zz + mass * (x * x + y * y)]
    return np.array(
        [mass, *(mass * centre), *about, xy - mass * x * y, xz - mass * x * z, yz - mass * y * z]
    )


def _free(given: Mapping[str, Any], key: str, count: int) -> Mask:
    """Return which of a parameter's components (n,) a report gives."""
    if key == "ten":  # a load: without its inertia it is a point
        return np.arange(count) < (count if "inertia" in given else 4)
    if key not in given:
        return np.zeros(count, bool)
    stderr = given[key].get("stderr") if isinstance(given[key], Mapping) else None
    sizes = [np.abs(_value(part)) for part in (given[key], stderr)]
    there = [np.nan_to_num(size, nan=1.0) > 0.0 for size in sizes if len(size) == count]
    return np.any(there, axis=0) if there else np.ones(count, bool)


def _value(value: Any) -> Array:
    """Return the numbers of a parameter, hidden (plain) or reported (with unit and error)."""
    given = value.get("value") if isinstance(value, Mapping) else value
    return (
        np.zeros(0)
        if given is None or isinstance(given, str)
        else np.ravel(np.asarray(given, float))
    )
