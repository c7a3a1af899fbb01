"""What to do about effects that one log cannot tell apart."""

from collections.abc import Sequence

from jaxidl.gap.diagnosis import Key

_ADVICE: tuple[tuple[frozenset[str], str], ...] = (
    (
        frozenset({"inertia_error", "torque_scale", "payload"}),
        "repeat the motion with a known mass attached, or hold the joint still against gravity or a force gauge: a wrong torque "
        "scale shows at rest, a wrong inertia only under acceleration, a payload in both and in every posture",
    ),
    (
        frozenset({"actuator_delay", "sensor_delay"}),
        "log a second position sensor, or the motor's own current: the log knows only that torque and position are late "
        "against each other",
    ),
    (
        frozenset({"actuator_lag", "actuator_delay", "sensor_delay", "joint_elasticity", "backlash"}),
        "command faster motion (a chirp beyond the present band, or small steps of torque): lag, dead time and compliance differ "
        "only at high frequency",
    ),
    (
        frozenset({"asymmetric_friction", "constant_offset", "coulomb_friction"}),
        "measure the torque that just starts the joint in each direction with the motor's offset zeroed, and move at several "
        "constant speeds in both directions",
    ),
    (
        frozenset(
            {"coulomb_friction", "stribeck_friction", "viscous_friction", "quadratic_drag", "stiction", "asymmetric_friction"}
        ),
        "move at several constant speeds from creeping to fast, in both directions, with reversals and rests in between",
    ),
    (
        frozenset(
            {"position_dependent_friction", "coupled_friction", "load_dependent_friction", "coulomb_friction", "viscous_friction"}
        ),
        "run the same speeds through the whole range of every joint, with the other joints in several postures and with a load",
    ),
    (
        frozenset({"constant_offset", "spring", "position_bias", "torque_ripple", "payload", "torque_scale", "inertia_error"}),
        "hold still at many positions over the whole range, in several postures: offset, spring, ripple, encoder bias and "
        "payload differ in how the holding torque changes with position",
    ),
)


def experiment(candidates: Sequence[Key]) -> str:
    """The motion or load that would separate the candidates."""
    names = {name for name, _ in candidates}
    if len(names) == 1:
        return "move one joint at a time, with the others held still"
    for group, advice in _ADVICE:
        if names <= group:
            return advice
    timing = {"actuator_lag", "actuator_delay", "sensor_delay", "joint_elasticity", "backlash"}
    if names & timing:
        return "record the same motion slowly and fast: what depends on time grows with speed, what depends on position does not"
    return "cover the whole range of position, speed and acceleration in both directions, with rests, and once with a known load"
