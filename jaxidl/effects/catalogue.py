"""The catalogue of named physical effects: built-in ones and those that a user registers."""

from collections.abc import Callable
from typing import Any, TypeVar, overload

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.effects.actuator import (
    ActuatorDelay,
    ActuatorLag,
    ConstantOffset,
    TorqueCurve,
    TorqueSaturation,
    TorqueScale,
)
from jaxidl.effects.base import Effect
from jaxidl.effects.dry import AsymmetricFriction, CoulombFriction, StribeckFriction
from jaxidl.effects.friction import QuadraticDrag, ViscousFriction
from jaxidl.effects.gears import (
    CoupledJointFriction,
    DirectionalLoadFriction,
    MotorCoupling,
    SublinearFriction,
    ThermalFriction,
)
from jaxidl.effects.inertia import BaseTilt, ComError, InertiaError, InertiaTensorError, Payload
from jaxidl.effects.on_joint import OnJoint
from jaxidl.effects.own import check_class, obstacle, qualified
from jaxidl.effects.position import Spring, TorqueRipple
from jaxidl.effects.presliding import PreslidingFriction
from jaxidl.effects.sensing import EncoderQuantisation, PositionBias, SensingNoise, SensorDelay
from jaxidl.effects.stiction import Stiction
from jaxidl.effects.transmission import Backlash, JointElasticity
from jaxidl.effects.varying import CoupledFriction, LoadDependentFriction, PositionDependentFriction
from jaxidl.errors import EffectError

CATALOGUE: dict[str, type[Effect]] = {
    cls.name: cls
    for cls in (
        ViscousFriction,
        CoulombFriction,
        AsymmetricFriction,
        StribeckFriction,
        Stiction,
        QuadraticDrag,
        SublinearFriction,
        PositionDependentFriction,
        LoadDependentFriction,
        DirectionalLoadFriction,
        CoupledFriction,
        CoupledJointFriction,
        ThermalFriction,
        InertiaError,
        ComError,
        InertiaTensorError,
        Payload,
        BaseTilt,
        ConstantOffset,
        Spring,
        TorqueRipple,
        # in the order in which a command passes them: it comes late, the drive limits it, its
        # current follows, the motor turns that into torque, the gear passes it on, and what gives
        # way before it slides takes its part
        ActuatorDelay,
        TorqueSaturation,
        ActuatorLag,
        TorqueCurve,
        TorqueScale,
        MotorCoupling,
        JointElasticity,
        Backlash,
        PreslidingFriction,
        PositionBias,
        SensorDelay,
        SensingNoise,
        EncoderQuantisation,
    )
}

_BUILT_IN = frozenset(CATALOGUE.values())

RESERVED = ("alignment",)  # what the gap workflow calls its own correction of a log's timing

# they add no torque
_never: set[str] = {SensingNoise.name, EncoderQuantisation.name}
_aside: set[str] = set()  # registered with ``searched=False``: sought only where they are named

C = TypeVar("C", bound=type[Effect])


def searched() -> tuple[str, ...]:
    """Return the names of the effects that the gap workflow looks for by default.

    They include those registered so far. Not among them are noise and counts of the encoders, which
    add no torque.
    """
    return tuple(name for name in searchable() if name not in _aside)


def place_of(name: str) -> int:
    """Return the place of an effect in the catalogue; a command passes effects in this order."""
    return list(CATALOGUE).index(name)


def searchable() -> tuple[str, ...]:
    """Return the names of the effects that the gap workflow can look for.

    They are ``searched()`` and those registered with ``searched=False``.
    """
    return tuple(name for name in CATALOGUE if name not in _never)


@overload
def register(cls: C, *, searched: bool = True) -> C: ...
@overload
def register(*, searched: bool = True) -> Callable[[C], C]: ...
def register(cls: Any = None, *, searched: bool = True) -> Any:
    """Add your own effect to the catalogue.

    Write ``@register`` or ``@register(searched=False)`` above the class. From then on, in this
    process, :func:`from_dict`, ``effects.json`` beside a model, the gap workflow and its reports
    know it. A class of the same module and qualified name replaces the earlier one, so a notebook's
    cell can be run again. An effect's static fields must be whole numbers or flags if it is to be
    stored. What it does to a command comes after what the built-in ones do.

    Args:
        cls: a subclass of :class:`Effect` with ``name``, ``sentence``, and ``parameters`` that name
            its traced fields in order.
        searched: whether the gap workflow looks for it by default; if not, it does so only where
            the effect is named. Effects of the whole mechanism (``whole``) are searched for as well
            as those of a joint. Effects whose static fields have no values, or whose ``variants``
            or ``guesses`` are not numbers, can be simulated and stored, but not searched for.

    Returns:
        The class, unchanged.

    Raises:
        EffectError: if it is not such a class; if its name is that of another class; if it is to be
            searched for and cannot be.
    """
    if cls is None:
        return lambda decorated: register(decorated, searched=searched)
    check_class(cls)
    _check_name(cls)
    if cls not in _BUILT_IN:
        reason = obstacle(cls)
        if searched and reason:
            raise reason
        for name in [
            name
            for name, old in CATALOGUE.items()
            if qualified(old) == qualified(cls) and name != cls.name
        ]:
            del CATALOGUE[name]  # the cell was run again with another name
        CATALOGUE[cls.name] = cls
        (_never.add if reason else _never.discard)(cls.name)
    (_aside.discard if searched else _aside.add)(cls.name)
    return cls


def _check_name(cls: type[Effect]) -> None:
    """Raise EffectError unless the class has a name of its own."""
    old = CATALOGUE.get(cls.name)
    if cls.name in RESERVED or (old is not None and qualified(old) != qualified(cls)):
        owner = "the gap workflow" if old is None else qualified(old)
        raise EffectError(
            f"a name of {qualified(cls)} that is not taken",
            f"{cls.name!r} of {owner}",
            "choose another name",
        )


def from_dict(record: dict[str, Any], check: bool = True) -> Effect:
    """Return the effect that :meth:`Effect.to_dict` wrote.

    Args:
        record: the effect's record.
        check: false for a change of an effect that a model has already: it may leave the bounds.

    Raises:
        EffectError: for an unknown name, a missing parameter, or a value out of bounds.
    """
    name = record.get("effect")
    if name not in CATALOGUE:
        raise EffectError(
            f"an effect among {', '.join(CATALOGUE)}",
            repr(name),
            "correct the name, or load the module that registers it (--plugin FILE.py)",
        )
    cls = CATALOGUE[name]
    missing = [key for key in cls.parameters if key not in record.get("parameters", {})]
    if missing:
        raise EffectError(
            f"{name} with {', '.join(cls.parameters)}",
            f"no {', '.join(missing)}",
            "add what is missing",
        )
    try:
        values = {
            key: jnp.asarray(np.asarray(record["parameters"][key]["value"], float))
            for key in cls.parameters
        }
        if (joint := record.get("joint")) is None:
            effect = cls(**values, **record.get("options", {}))
        else:
            alone = cls(**jax.tree.map(lambda x: x[None], values), **record.get("options", {}))
            effect = OnJoint(alone, joint, record["joints"])
        return effect.check() if check else effect
    except (TypeError, KeyError, ValueError) as error:
        raise EffectError(
            f"a record of {name} as its to_dict writes it", f"{error}", "correct the record"
        ) from None
