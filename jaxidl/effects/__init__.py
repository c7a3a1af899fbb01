"""The catalogue of named physical effects."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxidl.effects.actuator import ActuatorLag, ConstantOffset
from jaxidl.effects.base import Effect, Parameter, regressor
from jaxidl.effects.friction import PaperFriction, ViscousFriction
from jaxidl.effects.inertia import InertiaError
from jaxidl.effects.sensing import SensingNoise
from jaxidl.effects.stiction import STICTION_LEVEL, Stiction, paper_stiction
from jaxidl.errors import EffectError

CATALOGUE: dict[str, type[Effect]] = {
    cls.name: cls for cls in (ViscousFriction, PaperFriction, Stiction, InertiaError, ConstantOffset, ActuatorLag, SensingNoise)
}


def from_dict(record: dict[str, Any]) -> Effect:
    """The effect that :meth:`Effect.to_dict` wrote.

    Raises:
        EffectError: for an unknown name, a missing parameter, or a value out of bounds.
    """
    name = record.get("effect")
    if name not in CATALOGUE:
        raise EffectError(f"an effect among {', '.join(CATALOGUE)}", repr(name), "correct the name")
    cls = CATALOGUE[name]
    missing = [key for key in cls.parameters if key not in record.get("parameters", {})]
    if missing:
        raise EffectError(f"{name} with {', '.join(cls.parameters)}", f"no {', '.join(missing)}", "add what is missing")
    try:
        values = {key: jnp.asarray(np.asarray(record["parameters"][key]["value"], float)) for key in cls.parameters}
        return cls(**values, **record.get("options", {})).check()
    except (TypeError, KeyError, ValueError) as error:
        raise EffectError(f"a record of {name} as its to_dict writes it", f"{error}", "mend its parameters and options") from None


__all__ = [
    "CATALOGUE",
    "STICTION_LEVEL",
    "ActuatorLag",
    "ConstantOffset",
    "Effect",
    "InertiaError",
    "PaperFriction",
    "Parameter",
    "SensingNoise",
    "Stiction",
    "ViscousFriction",
    "from_dict",
    "paper_stiction",
    "regressor",
]
