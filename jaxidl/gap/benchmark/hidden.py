"""What the cases of the benchmark hide: which effects, on which joints, and how strong."""

import zlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxidl.gap.benchmark.believed import Controller
from jaxidl.gap.benchmark.catalogue import INJECTED
from jaxidl.gap.benchmark.draw import PLACES, clipping, parameters
from jaxidl.gap.benchmark.mechanisms import JOINTS, MECHANISMS
from jaxidl.gap.benchmark.outside import OUTSIDE
from jaxidl.gap.benchmark.severity import SIZES

EXCLUDED: dict[tuple[str, str], str] = {
    ("coupled_friction", "slider"): "there is no other joint",
    ("coupled_friction", "pendulum"): "there is no other joint",
    (
        "payload",
        "slider",
    ): "the same motion as with an inertia error: no gravity along the slide, no other joint",
    ("position_bias", "slider"): "nothing on a horizontal slide depends on the position",
    ("com_error", "slider"): "a body that only slides has no lever arms",
    ("inertia_tensor_error", "slider"): "a body that only slides does not turn",
    ("inertia_tensor_error", "pendulum"): "the same motion as with an error of the rotor's inertia",
    ("base_tilt", "slider"): "the same motion as with a constant force",
    ("base_tilt", "pendulum"): "the same motion as with a bias of the encoder",
    ("base_tilt", "two_link"): "the same motion as with a bias of the first encoder",
    ("coupled_joint_friction", "slider"): "there is no other joint",
    ("coupled_joint_friction", "pendulum"): "there is no other joint",
    ("motor_coupling", "slider"): "there is no other joint",
    ("motor_coupling", "pendulum"): "there is no other joint",
}
"""Effects that cannot show on a mechanism, and why."""

VARIANTS = {"inertia_error": ["", "/mass"], "position_dependent_friction": ["", "/viscous"]}
"""Kinds that alternate from draw to draw.

On a slide a body has no inertia other than that of its joint.
"""

MERGING: tuple[frozenset[str], ...] = (
    frozenset(
        {
            "coulomb_friction",
            "asymmetric_friction",
            "stribeck_friction",
            "position_dependent_friction",
            "constant_offset",
        }
    ),
    frozenset({"stribeck_friction", "stiction"}),
    frozenset({"viscous_friction", "position_dependent_friction", "coupled_friction"}),
    frozenset({"inertia_error", "torque_scale", "payload"}),
    frozenset({"actuator_lag", "actuator_delay", "sensor_delay", "joint_elasticity", "backlash"}),
    frozenset({"inertia_error", "joint_elasticity"}),
    frozenset({"inertia_error", "backlash"}),
)
"""Groups of which no two effects are paired on one joint.

Two of a group are, or nearly are, a single effect of the catalogue, or destabilise the loop
together; and a rotor's inertia must not be both wrong and behind a spring.
"""

MERGING_LATER: tuple[frozenset[str], ...] = (
    *MERGING,
    frozenset(
        {
            "inertia_error",
            "payload",
            "com_error",
            "inertia_tensor_error",
            "position_bias",
            "spring",
            "torque_scale",
        }
    ),
    frozenset(
        {
            "load_dependent_friction",
            "directional_load_friction",
            "coulomb_friction",
            "asymmetric_friction",
        }
    ),
    frozenset(
        {
            "viscous_friction",
            "thermal_friction",
            "sublinear_friction",
            "quadratic_drag",
            "coulomb_friction",
        }
    ),
    frozenset(
        {
            "viscous_friction",
            "coupled_friction",
            "coupled_joint_friction",
            "coulomb_friction",
            "sublinear_friction",
        }
    ),
    frozenset({"torque_scale", "torque_curve", "torque_saturation", "directional_load_friction"}),
)
"""The same for the later pairs, with at least one effect of the wider catalogue."""

WHOLE = {"payload", "base_tilt"}  # effects of the whole mechanism

ONCE: dict[str, tuple[str, ...]] = {
    "inertia_tensor_error": ("two_link 1",),
    "coupled_joint_friction": ("two_link 0",),
}
"""Joints on which an effect shows, if not on all.

The inertia of a first link is that of its rotor; a coupling has two joints.
"""

LATER = ("torque_ripple/harmonics", "payload/inertia")
"""Kinds of effects that have cases in addition to those of their effects."""

# draws of each single effect and severity; cases and later pairs of each mechanism
DRAWS, NONE, PAIRS, MORE = 2, 34, 22, 10
# the catalogue's first effects; pairs drawn from them must not change
FIRST = 22


class Hidden(NamedTuple):
    """A hidden effect.

    ``joint`` is None for one of the whole mechanism; ``"outside"`` has its kind among the
    parameters.
    """

    effect: str
    joint: int | None
    parameters: Mapping[str, Any]


def plans(mechanism: str, root: int) -> Iterator[tuple[str, str, list[tuple[str, int]]]]:
    """Yield label, severity and hidden effects, case after case.

    A hidden effect is a row of the severity table and a joint.
    """
    for name, joint in _singles(mechanism):
        for severity in ("weak", "medium", "clear"):
            for draw in range(DRAWS):
                yield (
                    f"{name} {joint} {severity} {draw}",
                    severity,
                    [(_variant(name, mechanism, draw), joint)],
                )
    for draw in range(NONE):
        yield f"none {draw}", "", []
    for kind in OUTSIDE:
        for joint in range(JOINTS[mechanism]):
            if _size(f"outside/{kind}", mechanism, joint):
                for severity in ("medium", "clear"):
                    yield (
                        f"outside {kind} {joint} {severity}",
                        severity,
                        [(f"outside/{kind}", joint)],
                    )
    first = [single for single in _singles(mechanism) if single[0] in list(INJECTED)[:FIRST]]
    for draw in range(PAIRS):
        yield (
            f"pair {draw}",
            "clear",
            _pair(generator(root, mechanism, f"pick {draw}"), mechanism, first, first),
        )
    later = [single for single in _singles(mechanism) if single not in first]
    for draw in range(MORE):
        yield (
            f"later pair {draw}",
            "clear",
            _pair(generator(root, mechanism, f"later {draw}"), mechanism, later, first + later),
        )
    for row in LATER:
        for joint in range(JOINTS[mechanism]):
            if _size(row, mechanism, joint):
                for severity in ("weak", "medium", "clear"):
                    yield f"{row} {joint} {severity}", severity, [(row, joint)]


def _singles(mechanism: str) -> list[tuple[str, int]]:
    """Return effects and joints that can show on the mechanism."""
    names = [name for name in INJECTED if (name, mechanism) not in EXCLUDED]
    singles = [
        (name, joint)
        for name in names
        for joint in range(1 if name in WHOLE else JOINTS[mechanism])
    ]
    return [
        (name, joint)
        for name, joint in singles
        if name not in ONCE or f"{mechanism} {joint}" in ONCE[name]
    ]


def _size(row: str, mechanism: str, joint: int) -> tuple[float | int, ...] | None:
    """Return sizes of the severity table's ``row`` on a joint; None if it cannot show there."""
    return SIZES[row][list(PLACES).index((mechanism, joint))]


def _pair(
    rng: np.random.Generator,
    mechanism: str,
    ones: list[tuple[str, int]],
    others: list[tuple[str, int]],
) -> list[tuple[str, int]]:
    """Return two effects that are not equivalent, one of ``ones`` and one of ``others``."""
    merging = MERGING if ones is others else MERGING_LATER
    while True:
        if ones is others:
            one, other = (ones[k] for k in rng.choice(len(ones), 2, replace=False))
        else:
            one, other = ones[rng.integers(len(ones))], others[rng.integers(len(others))]
        near = one[1] == other[1] or {one[0], other[0]} & {
            "payload",
            "com_error",
            "coupled_joint_friction",
            "motor_coupling",
        }
        if one[0] != other[0] and not (
            near and any({one[0], other[0]} <= group for group in merging)
        ):
            return [
                (_variant(name, mechanism, int(rng.integers(2))), joint)
                for name, joint in (one, other)
            ]


def _variant(name: str, mechanism: str, draw: int) -> str:
    kinds = VARIANTS.get(name, [""])
    row = name + kinds[draw % len(kinds)]
    return name if row == "inertia_error/mass" and mechanism == "slider" else row


def hide(
    row: str, joint: int, severity: str, rng: np.random.Generator, mechanism: str, seed: int
) -> Hidden:
    """Return the effect of ``row`` with parameters drawn within 25 % of the table's size."""
    sizes = _size(row, mechanism, joint)
    assert sizes is not None, f"{row} cannot show on joint {joint} of {mechanism}"
    size = sizes[("weak", "medium", "clear").index(severity)] * float(
        np.exp(rng.uniform(np.log(0.8), np.log(1.25)))
    )
    name = row.partition("/")[0]
    if name == "torque_saturation":
        size = clipping(size, Controller(MECHANISMS[mechanism], seed, 24.0, 100.0).ahead[:, joint])
    return Hidden(
        name, None if name in WHOLE else joint, parameters(row, size, rng, mechanism, joint)
    )


def generator(root: int, mechanism: str, label: str) -> np.random.Generator:
    """Return a random generator that belongs to a case by its name.

    So cases can be added without changing the others.
    """
    return np.random.default_rng([root, zlib.crc32(f"{mechanism} {label}".encode())])


def number(root: int, mechanism: str, label: str) -> int:
    """Return a number that belongs to a case by its name and says nothing about it."""
    return zlib.crc32(f"{root} {mechanism} {label}".encode())
