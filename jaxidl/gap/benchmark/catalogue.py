"""Hidden effects by name."""

from collections.abc import Mapping
from typing import Any

from jaxidl.gap.benchmark import injected, transmission, wider
from jaxidl.gap.benchmark.injected import Injected
from jaxidl.gap.benchmark.outside import OUTSIDE

INJECTED: dict[str, type[Injected]] = {
    "viscous_friction": injected.ViscousFriction,
    "coulomb_friction": injected.CoulombFriction,
    "asymmetric_friction": injected.AsymmetricFriction,
    "stribeck_friction": injected.StribeckFriction,
    "stiction": injected.Stiction,
    "quadratic_drag": injected.QuadraticDrag,
    "position_dependent_friction": injected.PositionDependentFriction,
    "load_dependent_friction": injected.LoadDependentFriction,
    "coupled_friction": injected.CoupledFriction,
    "inertia_error": injected.InertiaError,
    "payload": injected.Payload,
    "constant_offset": injected.ConstantOffset,
    "spring": injected.Spring,
    "torque_ripple": injected.TorqueRipple,
    "torque_scale": injected.TorqueScale,
    "torque_saturation": injected.TorqueSaturation,
    "actuator_lag": injected.ActuatorLag,
    "actuator_delay": injected.ActuatorDelay,
    "joint_elasticity": transmission.JointElasticity,
    "backlash": transmission.Backlash,
    "position_bias": injected.PositionBias,
    "sensor_delay": injected.SensorDelay,
    "com_error": wider.ComError,
    "inertia_tensor_error": wider.InertiaTensorError,
    "base_tilt": wider.BaseTilt,
    "directional_load_friction": wider.DirectionalLoadFriction,
    "thermal_friction": wider.ThermalFriction,
    "torque_curve": wider.TorqueCurve,
    "sublinear_friction": wider.SublinearFriction,
    "coupled_joint_friction": wider.CoupledJointFriction,
    "motor_coupling": wider.MotorCoupling,
}
"""The names of the catalogue, in its order."""


def make(name: str, joint: int | None, parameters: Mapping[str, Any]) -> Injected:
    """The effect ``name`` on ``joint`` (None: the whole mechanism); ``"outside"`` says which one as ``kind``."""
    if name == "outside":
        return OUTSIDE[parameters["kind"]](joint or 0, **{key: value for key, value in parameters.items() if key != "kind"})
    return INJECTED[name](joint or 0, **parameters)
