"""Hidden effects by name."""

from collections.abc import Mapping
from typing import Any

from jaxidl.gap.benchmark import drive, friction, injected, transmission, wider
from jaxidl.gap.benchmark.injected import Injected
from jaxidl.gap.benchmark.outside import OUTSIDE

INJECTED: dict[str, type[Injected]] = {
    "viscous_friction": friction.ViscousFriction,
    "coulomb_friction": friction.CoulombFriction,
    "asymmetric_friction": friction.AsymmetricFriction,
    "stribeck_friction": friction.StribeckFriction,
    "stiction": friction.Stiction,
    "quadratic_drag": friction.QuadraticDrag,
    "position_dependent_friction": friction.PositionDependentFriction,
    "load_dependent_friction": friction.LoadDependentFriction,
    "coupled_friction": friction.CoupledFriction,
    "inertia_error": injected.InertiaError,
    "payload": injected.Payload,
    "constant_offset": injected.ConstantOffset,
    "spring": injected.Spring,
    "torque_ripple": injected.TorqueRipple,
    "torque_scale": drive.TorqueScale,
    "torque_saturation": drive.TorqueSaturation,
    "actuator_lag": drive.ActuatorLag,
    "actuator_delay": drive.ActuatorDelay,
    "joint_elasticity": transmission.JointElasticity,
    "backlash": transmission.Backlash,
    "position_bias": drive.PositionBias,
    "sensor_delay": drive.SensorDelay,
    "com_error": wider.ComError,
    "inertia_tensor_error": wider.InertiaTensorError,
    "base_tilt": wider.BaseTilt,
    "directional_load_friction": wider.DirectionalLoadFriction,
    "thermal_friction": wider.ThermalFriction,
    "torque_curve": wider.TorqueCurve,
    "sublinear_friction": wider.SublinearFriction,
    "coupled_joint_friction": wider.CoupledJointFriction,
    "motor_coupling": wider.MotorCoupling,
    "presliding_friction": friction.PreslidingFriction,
}
"""The names of the catalogue."""


def make(name: str, joint: int | None, parameters: Mapping[str, Any]) -> Injected:
    """Return the effect ``name`` on ``joint`` (None: the whole mechanism).

    For ``"outside"`` the parameter ``kind`` says which one.
    """
    if name == "outside":
        return OUTSIDE[parameters["kind"]](
            joint or 0, **{key: value for key, value in parameters.items() if key != "kind"}
        )
    return INJECTED[name](joint or 0, **parameters)
