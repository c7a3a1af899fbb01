"""The strength of effects: the table of their sizes, and the measure behind it.

The severity of an effect is the torque error of the believed model over the commanded torque, both
RMS on the joint that the effect acts on: about 3 % weak, 8 % medium, 20 % clear.
"""

import numpy as np
from scipy import signal

from jaxidl.gap.benchmark.believed import believe, inverse_dynamics
from jaxidl.gap.benchmark.engine import Run
from jaxidl.gap.benchmark.reference import Array

SEVERITIES = {"weak": 0.03, "medium": 0.08, "clear": 0.20}
Sizes = tuple[float, float, float]
BAND = 30.0  # Hz; above it the derivatives of a log contain little information

SIZES: dict[str, tuple[Sizes | None, ...]] = {
    "viscous_friction": (
        (0.505, 1.37, 3.45),
        (0.0531, 0.143, 0.366),
        (0.129, 0.347, 0.886),
        (0.028, 0.0757, 0.195),
    ),
    "coulomb_friction": (
        (0.147, 0.396, 1.01),
        (0.0529, 0.143, 0.37),
        (0.125, 0.338, 0.876),
        (0.0326, 0.0877, 0.229),
    ),
    "asymmetric_friction": (
        (0.135, 0.363, 0.925),
        (0.0482, 0.129, 0.329),
        (0.108, 0.294, 0.774),
        (0.0292, 0.0791, 0.207),
    ),
    "stribeck_friction": (
        (0.112, 0.303, 0.787),
        (0.0403, 0.109, 0.289),
        (0.0937, 0.253, 0.668),
        (0.0249, 0.0678, 0.185),
    ),
    "stiction": ((1.83, 3.58, 6.9), (0.605, 1.19, 2.17), (1.57, 2.78, 4.79), (0.298, 0.576, 1.21)),
    "quadratic_drag": (
        (0.884, 2.42, 6.25),
        (0.0271, 0.0741, 0.194),
        (0.0652, 0.177, 0.457),
        (0.0129, 0.0356, 0.0952),
    ),
    "position_dependent_friction": (
        (0.142, 0.383, 0.968),
        (0.0511, 0.138, 0.351),
        (0.107, 0.289, 0.745),
        (0.0303, 0.0815, 0.212),
    ),
    "load_dependent_friction": (
        (0.0301, 0.081, 0.202),
        (0.0302, 0.081, 0.207),
        (0.0302, 0.081, 0.206),
        (0.0304, 0.082, 0.212),
    ),
    "coupled_friction": (None, None, (0.098, 0.264, 0.673), (0.0258, 0.0698, 0.181)),
    "inertia_error": (
        (0.0711, 0.2, 0.575),
        (0.00726, 0.0199, 0.0535),
        (0.0187, 0.0512, 0.137),
        (0.00354, 0.00956, 0.0247),
    ),
    "payload": (None, (0.0268, 0.0755, 0.218), (0.0277, 0.0778, 0.224), None),
    "constant_offset": (
        (0.147, 0.394, 1),
        (0.0529, 0.145, 0.387),
        (0.122, 0.321, 0.781),
        (0.0317, 0.0843, 0.21),
    ),
    "spring": (
        (1.16, 3.06, 7.59),
        (0.123, 0.341, 0.937),
        (0.245, 0.677, 1.87),
        (0.0642, 0.176, 0.48),
    ),
    "torque_ripple": (
        (0.212, 0.572, 1.49),
        (0.075, 0.201, 0.516),
        (0.174, 0.466, 1.19),
        (0.0455, 0.122, 0.309),
    ),
    "torque_scale": ((0.03, 0.08, 0.2), (0.03, 0.08, 0.2), (0.03, 0.08, 0.2), (0.03, 0.08, 0.2)),
    "torque_saturation": (
        (0.014, 0.034, 0.071),
        (0.014, 0.03, 0.06),
        (0.011, 0.027, 0.058),
        (0.009, 0.024, 0.056),
    ),
    "actuator_lag": (
        (0.00245, 0.00611, 0.0146),
        (0.00336, 0.00829, 0.0189),
        (0.00307, 0.0076, 0.0176),
        (0.00273, 0.00678, 0.016),
    ),
    "actuator_delay": (
        (0.00237, 0.00601, 0.014),
        (0.00326, 0.00816, 0.0179),
        (0.00296, 0.00747, 0.0168),
        (0.00262, 0.00667, 0.0153),
    ),
    "joint_elasticity": ((3.2e3, 1.3e3, 780), (169, 85, 54), (500, 240, 140), (245, 91, 36)),
    "backlash": (
        (0.00033, 0.00105, 0.00289),
        (0.00315, 0.00963, 0.024),
        (0.00234, 0.00669, 0.0144),
        (0.00115, 0.00354, 0.0111),
    ),
    "position_bias": (
        None,
        (0.0146, 0.0401, 0.108),
        (0.0161, 0.0422, 0.103),
        (0.0208, 0.055, 0.136),
    ),
    "sensor_delay": (
        (0.00237, 0.00601, 0.014),
        (0.00326, 0.00816, 0.0179),
        (0.00317, 0.008, 0.0179),
        (0.00436, 0.0109, 0.0236),
    ),
    "inertia_error/mass": (
        None,
        (0.0323, 0.091, 0.262),
        (0.102, 0.286, 0.777),
        (0.0329, 0.0925, 0.265),
    ),
    "position_dependent_friction/viscous": (
        (0.45, 1.22, 3.1),
        (0.0474, 0.128, 0.33),
        (0.109, 0.296, 0.763),
        (0.0262, 0.071, 0.186),
    ),
    "presliding_friction": (
        (0.244, 0.641, 1.56),
        (0.0885, 0.239, 0.621),
        (0.211, 0.571, 1.49),
        (0.0533, 0.145, 0.382),
    ),
    "outside/offset_drift": (
        (0.21, 0.562, 1.43),
        (0.0748, 0.201, 0.52),
        (0.175, 0.466, 1.16),
        (0.0454, 0.121, 0.302),
    ),
    "outside/scale_drift": (
        (0.0479, 0.128, 0.317),
        (0.045, 0.121, 0.303),
        (0.0459, 0.123, 0.31),
        (0.0497, 0.133, 0.333),
    ),
    "outside/disturbance": (
        (0.207, 0.554, 1.41),
        (0.0736, 0.197, 0.502),
        (0.174, 0.466, 1.19),
        (0.0452, 0.121, 0.311),
    ),
    "outside/cubic_spring": (
        (17.1, 45.5, 115),
        (0.155, 0.431, 1.21),
        (0.356, 0.994, 2.82),
        (0.0981, 0.276, 0.803),
    ),
    "outside/memory_drag": (
        (0.894, 2.34, 5.63),
        (0.0946, 0.254, 0.65),
        (0.215, 0.578, 1.48),
        (0.051, 0.138, 0.36),
    ),
    "outside/dropouts": (
        (0.00518, 0.014, 0.0386),
        (0.00524, 0.014, 0.0381),
        (0.00442, 0.0115, 0.0291),
        (0.00461, 0.0119, 0.0301),
    ),
    "inertia_tensor_error": (None, None, None, (0.00304, 0.00811, 0.0203)),
    "base_tilt": (None, None, None, None),
    "directional_load_friction": (
        (0.0408, 0.109, 0.272),
        (0.0431, 0.115, 0.288),
        (0.0411, 0.11, 0.274),
        (0.042, 0.112, 0.28),
    ),
    "thermal_friction": (
        (1.47, 3.91, 9.77),
        (0.147, 0.392, 0.98),
        (0.336, 0.896, 2.24),
        (0.0675, 0.18, 0.45),
    ),
    "torque_curve": (
        (0.00218, 0.00581, 0.0145),
        (0.00916, 0.0244, 0.0611),
        (0.00379, 0.0101, 0.0252),
        (0.0138, 0.0369, 0.0922),
    ),
    "sublinear_friction": (
        (0.349, 0.931, 2.33),
        (0.0656, 0.175, 0.437),
        (0.157, 0.419, 1.05),
        (0.0375, 0.0999, 0.25),
    ),
    "coupled_joint_friction": (None, None, (0.0761, 0.203, 0.507), None),
    "motor_coupling": (None, None, (0.00781, 0.0208, 0.052), (0.115, 0.307, 0.769)),
    "torque_ripple/harmonics": (
        (0.183, 0.487, 1.22),
        (0.0628, 0.167, 0.418),
        (0.154, 0.412, 1.03),
        (0.038, 0.101, 0.253),
    ),
    "payload/inertia": (None, (0.0284, 0.0758, 0.19), (0.027, 0.072, 0.19), None),
    "outside/acceleration_friction": (
        (0.0689, 0.184, 0.46),
        (0.00691, 0.0184, 0.0461),
        (0.0178, 0.0474, 0.118),
        (0.00386, 0.0103, 0.0258),
    ),
    "outside/position_inertia": (
        (0.0845, 0.225, 0.563),
        (0.00847, 0.0226, 0.0565),
        (0.0243, 0.0649, 0.162),
        (0.0049, 0.0131, 0.0327),
    ),
    "outside/torque_deadband": (
        (0.176, 0.483, 1.31),
        (0.0565, 0.153, 0.397),
        (0.13, 0.351, 0.921),
        (0.0338, 0.0915, 0.238),
    ),
    "outside/root_load_friction": (
        (0.087, 0.232, 0.58),
        (0.0492, 0.131, 0.328),
        (0.0742, 0.198, 0.494),
        (0.0379, 0.101, 0.253),
    ),
    "outside/elastic_coupling": (None, None, (0.131, 0.35, 0.876), (0.0342, 0.0911, 0.228)),
    "outside/cable_drag": (None, None, (0.517, 1.38, 3.44), (0.124, 0.331, 0.829)),
    "outside/coupled_ripple": (None, None, (0.187, 0.499, 1.25), (0.0477, 0.127, 0.318)),
    "outside/encoder_eccentricity": (
        None,
        (0.0248, 0.0662, 0.166),
        (0.0106, 0.0284, 0.071),
        (0.031, 0.0829, 0.209),
    ),
    "outside/fading_motor": (
        (0.076, 0.203, 0.511),
        (0.027, 0.0721, 0.188),
        (0.0299, 0.0797, 0.204),
        (0.0251, 0.067, 0.172),
    ),
    "com_error": (
        None,
        (0.00627, 0.0167, 0.0417),
        (0.0147, 0.0393, 0.098),
        (0.0039, 0.0104, 0.026),
    ),
}
"""Size (weak, medium, clear) of each effect, or kind of effect, on each joint.

The joints are those of the slider, the pendulum and the arm with two joints. The size is the
effect's own parameter (of several, the first), in its unit, with two exceptions: ``torque_scale``
is the distance from 1, and ``torque_saturation`` the share of the torque's RMS that is clipped,
since peaks differ from motion to motion. A clear elasticity, the softest that the loop tolerates,
is a torque error of only 7 % to 18 %.
"""


def residual(model_xml: str, run: Run) -> tuple[Array, Array]:
    """Return torque error of the believed model and commanded torque, each (T - 2, J).

    They are computed from noise-free readings, below 30 Hz. The command is held, so the second
    difference around an instant depends on the mean of the commands before and after it.
    """
    model, step = believe(model_xml), run.time[1] - run.time[0]
    q = run.clean
    qd, qdd = (q[2:] - q[:-2]) / (2 * step), (q[2:] - 2 * q[1:-1] + q[:-2]) / step**2
    tau = (run.tau[1:-1] + run.tau[:-2]) / 2
    low = signal.butter(4, BAND, fs=1 / step, output="sos")
    error = tau - inverse_dynamics(model, q[1:-1], qd, qdd)
    return signal.sosfiltfilt(low, error, axis=0), signal.sosfiltfilt(low, tau, axis=0)


def severity(model_xml: str, run: Run, joint: int | None) -> float:
    """Return RMS torque error over RMS command on ``joint``, or on all joints together."""
    error, tau = residual(model_xml, run)
    columns = slice(None) if joint is None else slice(joint, joint + 1)
    return float(np.sqrt((error[:, columns] ** 2).mean() / (tau[:, columns] ** 2).mean()))
