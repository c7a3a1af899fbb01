"""The true parameters of hidden effects in the catalogue's terms.

Names are translated where they differ, and tables are given as functions.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from jaxidl.gap.benchmark.mechanisms import MASSES
from jaxidl.gap.benchmark.reference import Array

True_ = float | Array | Callable[[Array], Array]

# which effect it is, and what a report need not give as a number
ASIDE = {"kind", "other", "difference", "power"}
AMPLITUDES = {"sine": ("sine", "cosine"), "cosine": ("sine", "cosine")}
"""Parameters that are judged relative to the size of several together."""


def expected(hidden: Mapping[str, Any], mechanism: str = "robot") -> dict[str, True_]:
    """Return the parameters that a right report has.

    They are numbers, arrays, or functions of the position for tables.
    """
    given: dict[str, Any] = dict(hidden["parameters"])
    name, kind = hidden["effect"], given.get("kind", "")
    if name == "stribeck_friction":
        given["level"] = given.pop("sliding")
    elif name == "torque_ripple":
        size, phase = np.ravel(given.pop("amplitude")), np.ravel(given.pop("phase"))
        given |= {"sine": size * np.cos(phase), "cosine": size * np.sin(phase)}
    elif name in ("position_dependent_friction", "coupled_friction"):
        viscous = kind == "viscous" or name == "coupled_friction"
        given = {"coefficient" if viscous else "level": _wave(given)}
    elif name == "inertia_error" and kind == "mass":
        given = {"mass": given["extra"] * MASSES[mechanism, hidden["joint"]]}
    elif name == "inertia_error" and not given.get("mass"):
        given.pop("mass", None)
    return {key: _plain(value) for key, value in given.items() if key not in ASIDE}


def errors(
    true: Mapping[str, True_], reported: Mapping[str, Any], joint: int | None
) -> dict[str, tuple[float, list[float]]]:
    """Return the relative error of each parameter that truth and report share.

    Also return its components in standard errors. A scale is compared by its distance from 1, a
    table by its values over the positions that it covers; standard errors that are missing in a
    report, or zero, give no components.
    """
    found: dict[str, tuple[float, list[float]]] = {}
    for name, value in true.items():
        if name not in reported or reported[name].get("value") is None:
            continue
        got = np.ravel(np.asarray(reported[name]["value"], float))
        if callable(value):
            wanted = _over(value, reported, len(got))
        else:
            wanted = np.ravel(value)
            if len(wanted) == 1 and len(got) > 1:
                got = got[[joint or 0]]  # one value for each joint
        if wanted is not None and name in AMPLITUDES and len(got) != len(wanted):
            # other harmonics are zero
            got, wanted = (
                np.pad(x, (0, max(len(got), len(wanted)) - len(x))) for x in (got, wanted)
            )
        if wanted is None or len(got) != len(wanted):
            continue
        open_ = ~np.isfinite(wanted)  # what the motion does not determine has no true value
        if open_.all():
            continue
        off = np.where(open_, np.nan, got - wanted)
        if name == "phase":
            found[name] = abs(math.remainder(float(off[0]), 2 * math.pi)) / math.pi, []
            continue
        together = (
            [np.ravel(np.asarray(true[one], float)) for one in AMPLITUDES.get(name, (name,))]
            if not callable(value)
            else [wanted]
        )
        scale = float(
            np.linalg.norm(np.nan_to_num(np.concatenate(together)) - (1 if name == "scale" else 0))
        )
        found[name] = (
            (float(np.linalg.norm(off[~open_])) / scale if scale else math.inf),
            _deviations(off, reported[name].get("stderr"), joint),
        )
    return found


def _deviations(off: Array, stderr: Any, joint: int | None) -> list[float]:
    """Return errors in standard errors, of the components that have one."""
    if stderr is None:
        return []
    sizes = np.ravel(np.array(stderr, float))
    if len(sizes) > 1 and len(off) == 1:
        sizes = sizes[[joint or 0]]
    sizes = np.broadcast_to(sizes, off.shape) if len(sizes) in (1, len(off)) else np.zeros_like(off)
    return [
        abs(float(o / s))
        for o, s in zip(off, sizes, strict=True)
        if np.isfinite(o) and np.isfinite(s) and s > 0
    ]


def _over(value: Callable[[Array], Array], reported: Mapping[str, Any], knots: int) -> Array | None:
    """Return a function's values at the knots of the reported table."""
    ends = [
        np.ravel(np.asarray(reported.get(end, {}).get("value", np.nan), float))
        for end in ("lower", "upper")
    ]
    low, high = (float(end[0]) for end in ends)
    return (
        value(np.linspace(low, high, knots))
        if math.isfinite(low) and math.isfinite(high) and knots > 1
        else None
    )


def _wave(given: Mapping[str, Any]) -> Callable[[Array], Array]:
    level, variation, period, phase = (
        float(given[key]) for key in ("level", "variation", "period", "phase")
    )
    return lambda q: level * (1 + variation * np.sin(2 * math.pi * q / period + phase))


def _plain(value: Any) -> True_:
    if isinstance(value, float | int):
        return float(value)
    return np.asarray(value, np.float64) if isinstance(value, list | np.ndarray) else value
