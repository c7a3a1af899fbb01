"""``effects.json`` beside a model: the plant's effects.

It says which of them the model's own file does not contain.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxidl.effects import Effect, OnJoint, from_dict
from jaxidl.errors import EffectError, ModelError
from jaxidl.systems.free import unit_of
from jaxidl.types import Joints, Scalar

EFFECTS = "effects.json"
MOST_STEPS = 10_000  # of a buffer of dead time: a limit on what a damaged file may allocate


class Entry(NamedTuple):
    """An effect and where it is written."""

    effect: Effect
    in_mjcf: bool  # true if reading the model's file restores it
    mjcf: str | None  # the attribute that it is written to

    def to_dict(self, kinds: Sequence[str]) -> dict[str, Any]:
        """Return the effect's record and where it is written, ready for JSON.

        Units are those of its joint, or of all ``kinds`` (J,) of joints.
        """
        record = self.effect.to_dict()
        joint: int | None = record.get("joint")
        on: Sequence[str] = kinds if joint is None else [kinds[joint]]
        for value in record["parameters"].values():
            value["unit"] = " or ".join(dict.fromkeys(unit_of(value["unit"], kind) for kind in on))
        return {**record, "in_mjcf": self.in_mjcf, "mjcf": self.mjcf}


def read_record(path: Path, joints: int) -> list[Entry]:
    """Return the entries of the ``effects.json`` beside the model file ``path``.

    None are returned if it was not written for this model.

    Raises:
        ModelError: if it is damaged, or has effects that do not fit ``joints`` joints.
    """
    record = path.with_name(EFFECTS)
    if not record.is_file():
        return []
    try:
        content = json.loads(record.read_text(encoding="utf-8"), parse_constant=_refuse_constant)
        if content["model"] != path.name:
            return []
        return [_entry(entry, joints) for entry in content["effects"]]
    except EffectError as error:
        raise ModelError(
            f"{record} as the gap workflow writes it", str(error), "correct it, or remove it"
        ) from None
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        got = " ".join(f"{type(error).__name__} {error}".split())[:300]
        raise ModelError(
            f"{record} as the gap workflow writes it", got, "correct it, or remove it"
        ) from None


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not JSON")


def _entry(entry: dict[str, Any], joints: int) -> Entry:
    in_mjcf, place = entry.get("in_mjcf", False), entry.get("mjcf")
    if not isinstance(in_mjcf, bool) or not isinstance(place, str | None):
        raise TypeError("in_mjcf must be true or false, mjcf a text or null")
    for key, value in entry.get("options", {}).items():
        most = {"steps": MOST_STEPS, "joint": joints - 1, "other": joints - 1}.get(key, math.inf)
        kind = int | float if key == "width" else int
        if (
            not isinstance(value, kind)
            or not math.isfinite(value)
            or not (key == "steps") <= value <= most
        ):
            raise EffectError(f"an option {key} that fits", repr(value)[:100], "correct it")
    # what is in the model's file may be a change, such as friction that is less
    effect = from_dict(entry, check=not in_mjcf)
    check_fits(effect, joints, bounded=not in_mjcf)
    return Entry(effect, in_mjcf, place)


class _Probe:
    """A body that only checks that what it is given has the right shape."""

    def __init__(self, joints: int):
        self.joints = joints

    def add_inertia(self, extra: Joints | Scalar) -> "_Probe":
        jnp.broadcast_to(jnp.asarray(extra), (self.joints,))
        return self

    add_mass = add_inertia

    def add_moment(self, extra: Any) -> "_Probe":
        jnp.reshape(extra, (self.joints, 3))
        return self

    def add_link(self, extra: Any) -> "_Probe":
        jnp.reshape(extra, (self.joints, 10))
        return self

    def add_payload(self, extra: Any) -> "_Probe":
        jnp.reshape(extra, (10,))
        return self

    def tilt(self, angles: Any) -> "_Probe":
        jnp.reshape(angles, (2,))
        return self


def check_fits(effect: Effect, joints: int, bounded: bool = True) -> None:
    """Raise unless the effect is within its bounds and acts on a mechanism of ``joints`` joints.

    All its methods are traced, not computed, and must return one value per joint. Changes of what a
    model has already need not be ``bounded``.

    Raises:
        EffectError: naming the effect or the parameter.
    """
    if bounded:
        effect.check()
    if isinstance(effect, OnJoint) and not (
        _whole(effect.joint) and effect.joints == joints and 0 <= effect.joint < joints
    ):
        raise EffectError(
            f"an effect on one of {joints} joints",
            f"{effect.joint!r} of {effect.joints!r}",
            "correct the joint",
        )

    def everything(q: Joints) -> tuple[Joints, ...]:
        effect.alter(_Probe(joints))
        tau, memory = effect.actuate(effect.start(q), q, q, q, 1e-3)
        return (
            tau,
            effect.torque(q, q, q),
            effect.dry(q, q, q, q),
            effect.sense(memory, q, q),
            1.0 * effect.holds(q, q, q),
        )

    name = effect.to_dict()["effect"]
    try:
        shapes = {value.shape for value in jax.eval_shape(everything, jnp.zeros(joints))}
    except (TypeError, ValueError, IndexError, ZeroDivisionError) as error:
        shapes = {str(error).splitlines()[0][:200]}
    if shapes != {(joints,)}:
        raise EffectError(
            f"{name} with one value for each of {joints} joints",
            str(shapes),
            "correct its parameters",
        )


def _whole(number: object) -> bool:
    return isinstance(number, int) and not isinstance(number, bool)
