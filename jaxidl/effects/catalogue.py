"""The catalogue of named physical effects: built-in ones and those that a user registers."""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields
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
from jaxidl.effects.position import Spring, TorqueRipple
from jaxidl.effects.sensing import EncoderQuantisation, PositionBias, SensingNoise, SensorDelay
from jaxidl.effects.spec import Parameter, Scale
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
        TorqueScale,
        TorqueCurve,
        TorqueSaturation,
        ActuatorLag,
        ActuatorDelay,
        JointElasticity,
        Backlash,
        MotorCoupling,
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

_ORDINARY = Scale(
    1.0,
    1.0,
    -1.0,
    1.0,
    1.0,
    0.1,
    10.0,
    0.001,
    joints=2,
    lows=(-1.0, -1.0),
    highs=(1.0, 1.0),
    rest_speed=0.001,
)

C = TypeVar("C", bound=type[Effect])


def searched() -> tuple[str, ...]:
    """Return the names of the effects that the gap workflow looks for by default.

    They include those registered so far. Not among them are noise and counts of the encoders, which
    add no torque.
    """
    return tuple(name for name in searchable() if name not in _aside)


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
    stored.

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
    _check_class(cls)
    if cls not in _BUILT_IN:
        obstacle = _obstacle(cls)
        if searched and obstacle:
            raise obstacle
        for name in [
            name
            for name, old in CATALOGUE.items()
            if _title(old) == _title(cls) and name != cls.name
        ]:
            del CATALOGUE[name]  # the cell was run again with another name
        CATALOGUE[cls.name] = cls
        (_never.add if obstacle else _never.discard)(cls.name)
    (_aside.discard if searched else _aside.add)(cls.name)
    return cls


def _title(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _check_class(cls: Any) -> None:
    """Raise EffectError unless it is an effect that can be stored and has a name of its own."""
    given: Any = cls  # a user's class may have anything where an effect has text
    if not (isinstance(cls, type) and issubclass(cls, Effect)):
        raise EffectError(
            "a subclass of jaxidl.effects.Effect", repr(cls)[:100], "derive the class from Effect"
        )
    title = _title(cls)
    if not (isinstance(given.name, str) and cls.name.isidentifier()):
        raise EffectError(
            f"a name of {title}, one word",
            repr(cls.name),
            'write name: ClassVar[str] = "…", with underscores',
        )
    if not (isinstance(given.sentence, str) and cls.sentence.strip()):
        raise EffectError(
            f"a sentence of {title}", repr(cls.sentence), "say in plain words what the effect is"
        )
    specs: Mapping[str, Any] = given.parameters if isinstance(given.parameters, Mapping) else {}
    traced, named = (
        [f.name for f in fields(cls) if f.metadata.get("pytree_node", True)],
        list(specs),
    )
    if traced != named or not all(isinstance(spec, Parameter) for spec in specs.values()):
        got = (
            f"parameters {', '.join(named) or 'none'} and traced fields"
            f" {', '.join(traced) or 'none'}"
        )
        remedy = (
            "name every traced field, in their order, or make it static:"
            " struct.field(pytree_node=False)"
        )
        raise EffectError(f"a Parameter of {title} for each traced field", got, remedy)
    taken = [f.name for f in fields(cls) if callable(getattr(Effect, f.name, None))]
    if taken:
        raise EffectError(
            f"fields of {title} with names of their own",
            f"{', '.join(taken)}, which every effect has as a method",
            "rename the field",
        )
    old = CATALOGUE.get(cls.name)
    if cls.name in RESERVED or (old is not None and _title(old) != title):
        owner = "the gap workflow" if old is None else _title(old)
        raise EffectError(
            f"a name of {title} that is not taken",
            f"{cls.name!r} of {owner}",
            "choose another name",
        )


def _obstacle(cls: type[Effect]) -> EffectError | None:
    """Return why the gap workflow cannot begin a search for it; None if it can."""
    static = [f for f in fields(cls) if f.name not in cls.parameters]
    for variant in cls.variants(_ORDINARY):
        bare = [
            f.name
            for f in static
            if f.default is f.default_factory is MISSING and f.name not in variant.options
        ]
        if bare:
            return EffectError(
                f"defaults of the static fields of {cls.name}",
                f"none of {', '.join(bare)}",
                "set them",
            )
        values = variant.values
        if wrong := [
            key
            for key, value in values.items()
            if key not in cls.parameters or not np.isfinite(value).all()
        ]:
            got = ", ".join(f"{key} = {values[key]}" for key in wrong)
            expected = (
                f"guesses of {cls.name} that are finite values of"
                f" {', '.join(cls.parameters) or 'nothing'}"
            )
            return EffectError(expected, got, "write guesses or variants with finite values")
        known = {*cls.parameters}, {f.name for f in static}
        for what, names, right in zip(
            ("free", "options"), (variant.free, variant.options), known, strict=True
        ):
            if strange := [name for name in names if name not in right]:
                expected = (
                    f"variants of {cls.name} with {what} among"
                    f" {', '.join(sorted(right)) or 'nothing'}"
                )
                return EffectError(expected, ", ".join(strange), "correct the names")
    return None


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
