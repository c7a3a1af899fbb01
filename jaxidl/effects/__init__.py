"""The catalogue of named physical effects."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxidl.effects.actuator import ActuatorDelay, ActuatorLag, ConstantOffset, TorqueSaturation, TorqueScale
from jaxidl.effects.base import Effect, Guess, Parameter, Scale, regressor
from jaxidl.effects.dry import AsymmetricFriction, CoulombFriction, StribeckFriction
from jaxidl.effects.friction import PaperFriction, QuadraticDrag, ViscousFriction
from jaxidl.effects.inertia import InertiaError, Payload
from jaxidl.effects.on_joint import OnJoint
from jaxidl.effects.position import Spring, TorqueRipple
from jaxidl.effects.sensing import EncoderQuantisation, PositionBias, SensingNoise, SensorDelay
from jaxidl.effects.stiction import STICTION_LEVEL, Stiction, paper_stiction
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
        PositionDependentFriction,
        LoadDependentFriction,
        CoupledFriction,
        InertiaError,
        Payload,
        ConstantOffset,
        Spring,
        TorqueRipple,
        TorqueScale,
        TorqueSaturation,
        ActuatorLag,
        ActuatorDelay,
        JointElasticity,
        Backlash,
        PositionBias,
        SensorDelay,
        PaperFriction,
        SensingNoise,
        EncoderQuantisation,
    )
}

SEARCHED: tuple[str, ...] = tuple(
    name for name in CATALOGUE if name not in (PaperFriction.name, SensingNoise.name, EncoderQuantisation.name)
)
"""Effects that the gap workflow looks for: the paper's friction is two of them in one, noise and counts are no torque."""


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
        if (joint := record.get("joint")) is None:
            return cls(**values, **record.get("options", {})).check()
        alone = cls(**jax.tree.map(lambda x: x[None], values), **record.get("options", {}))
        return OnJoint(alone, joint, record["joints"]).check()
    except (TypeError, KeyError, ValueError) as error:
        raise EffectError(f"a record of {name} as its to_dict writes it", f"{error}", "mend its parameters and options") from None


__all__ = [
    "CATALOGUE",
    "SEARCHED",
    "STICTION_LEVEL",
    "ActuatorDelay",
    "ActuatorLag",
    "AsymmetricFriction",
    "Backlash",
    "ConstantOffset",
    "CoulombFriction",
    "CoupledFriction",
    "Effect",
    "EncoderQuantisation",
    "Guess",
    "InertiaError",
    "JointElasticity",
    "LoadDependentFriction",
    "OnJoint",
    "PaperFriction",
    "Parameter",
    "Payload",
    "PositionBias",
    "PositionDependentFriction",
    "QuadraticDrag",
    "Scale",
    "SensingNoise",
    "SensorDelay",
    "Spring",
    "Stiction",
    "StribeckFriction",
    "TorqueRipple",
    "TorqueSaturation",
    "TorqueScale",
    "ViscousFriction",
    "from_dict",
    "paper_stiction",
    "regressor",
]
