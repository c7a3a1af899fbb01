"""What a class must be to join the catalogue, and to be searched for."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from jaxidl.effects.base import Effect
from jaxidl.effects.spec import Parameter, Scale
from jaxidl.errors import EffectError

# of a machine whose numbers are about one: shapes are asked for before there is a log
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


def qualified(cls: type) -> str:
    """Return the full name of a class."""
    return f"{cls.__module__}.{cls.__qualname__}"


def check_class(cls: Any) -> None:
    """Raise EffectError unless it is an effect that can be stored."""
    given: Any = cls  # a user's class may have anything where an effect has text
    if not (isinstance(cls, type) and issubclass(cls, Effect)):
        raise EffectError(
            "a subclass of jaxidl.effects.Effect", repr(cls)[:100], "derive the class from Effect"
        )
    title = qualified(cls)
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


def obstacle(cls: type[Effect]) -> EffectError | None:
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
