"""The catalogue of named physical effects."""

from jaxidl.effects.actuator import (
    ActuatorDelay,
    ActuatorLag,
    ConstantOffset,
    TorqueCurve,
    TorqueSaturation,
    TorqueScale,
)
from jaxidl.effects.base import Effect
from jaxidl.effects.catalogue import CATALOGUE, from_dict, place_of, register, searchable, searched
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
from jaxidl.effects.on_joint import OnJoint, added_to, placed
from jaxidl.effects.position import Spring, TorqueRipple
from jaxidl.effects.presliding import PreslidingFriction
from jaxidl.effects.sensing import EncoderQuantisation, PositionBias, SensingNoise, SensorDelay
from jaxidl.effects.spec import Guess, Parameter, Scale, Variant
from jaxidl.effects.stiction import Stiction
from jaxidl.effects.transmission import Backlash, JointElasticity
from jaxidl.effects.varying import CoupledFriction, LoadDependentFriction, PositionDependentFriction

__all__ = [
    "CATALOGUE",
    "ActuatorDelay",
    "ActuatorLag",
    "AsymmetricFriction",
    "Backlash",
    "BaseTilt",
    "ComError",
    "ConstantOffset",
    "CoulombFriction",
    "CoupledFriction",
    "CoupledJointFriction",
    "DirectionalLoadFriction",
    "Effect",
    "EncoderQuantisation",
    "Guess",
    "InertiaError",
    "InertiaTensorError",
    "JointElasticity",
    "LoadDependentFriction",
    "MotorCoupling",
    "OnJoint",
    "Parameter",
    "Payload",
    "PositionBias",
    "PositionDependentFriction",
    "PreslidingFriction",
    "QuadraticDrag",
    "Scale",
    "SensingNoise",
    "SensorDelay",
    "Spring",
    "Stiction",
    "StribeckFriction",
    "SublinearFriction",
    "ThermalFriction",
    "TorqueCurve",
    "TorqueRipple",
    "TorqueSaturation",
    "TorqueScale",
    "Variant",
    "ViscousFriction",
    "added_to",
    "from_dict",
    "place_of",
    "placed",
    "register",
    "searchable",
    "searched",
]
