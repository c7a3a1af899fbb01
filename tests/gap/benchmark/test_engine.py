"""The benchmark's engine: each hidden effect does what its formula says, and the shipped cases are
what they say they are.
"""

import json
import math

import numpy as np
import pytest
from scipy import signal

from jaxidl.gap.benchmark.arm_engine import Sensors, run_arm
from jaxidl.gap.benchmark.believed import (
    NOISE,
    QUANTUM,
    Diverged,
    believe,
    inertia,
    inverse_dynamics,
)
from jaxidl.gap.benchmark.cases import all_cases, truth, write_case
from jaxidl.gap.benchmark.catalogue import INJECTED, make
from jaxidl.gap.benchmark.draw import PLACES
from jaxidl.gap.benchmark.engine import run, simulate
from jaxidl.gap.benchmark.hidden import EXCLUDED, LATER, MERGING, ONCE, WHOLE
from jaxidl.gap.benchmark.imitable import IMITABLE
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.gap.benchmark.outside import OUTSIDE
from jaxidl.gap.benchmark.severity import BAND, SEVERITIES, SIZES, residual, severity
from jaxidl.gap.benchmark.transmission import Backlash, JointElasticity

SHORT = 8.0  # s


PENDULUM_ROTOR = 0.02  # [kg m^2], as its file says


def motion(log):
    """Positions, speeds and commands at the instants of the residual, (T - 2, J)."""
    step = log.time[1]
    return (
        log.clean[1:-1],
        (log.clean[2:] - log.clean[:-2]) / (2 * step),
        (log.tau[1:-1] + log.tau[:-2]) / 2,
    )


def rotor(log, inertia):
    """The torque (T - 2, J) that accelerates rotors of an ``inertia``."""
    return inertia * np.diff(log.clean, 2, axis=0) / log.time[1] ** 2


def low(x):
    return signal.sosfiltfilt(signal.butter(4, BAND, fs=500, output="sos"), x, axis=0)


@pytest.mark.parametrize("name", MECHANISMS)
def test_nothing_hidden_leaves_nothing(name):
    log = run(MECHANISMS[name], [], 1, SHORT)
    assert severity(MECHANISMS[name], log, None) < 0.003
    kind = "slide" if name == "slider" else "hinge"
    error = log.q - log.clean
    assert np.std(error) == pytest.approx(
        math.hypot(NOISE[kind], QUANTUM[kind] / math.sqrt(12)), rel=0.05
    )
    assert np.allclose(log.q / QUANTUM[kind], np.round(log.q / QUANTUM[kind]), atol=1e-6)


@pytest.mark.parametrize("name", MECHANISMS)
def test_motion_rests_reverses_and_spans_its_range(name):
    log = run(MECHANISMS[name], [], 1)
    speed = np.gradient(log.wanted, log.time, axis=0)
    still = (np.abs(speed) < 1e-9).all(axis=1)
    assert 0.04 < still.mean() < 0.5
    assert np.abs(speed[:3]).max() < 1e-9
    for j in range(log.q.shape[1]):
        assert np.sum(np.diff(np.sign(speed[np.abs(speed[:, j]) > 1e-6, j])) != 0) > 15
        assert np.ptp(log.q[:, j]) > 1.0 * PLACES[name, j].span
        assert np.abs(log.q - log.wanted).max() < 0.1 * PLACES[name, j].span
    if name != "slider":
        assert np.abs(log.tau[still]).max() > 0.5


FORMULAS = {
    "viscous_friction": ({"coefficient": 0.3}, lambda q, qd, tau: -0.3 * qd),
    "quadratic_drag": ({"coefficient": 0.2}, lambda q, qd, tau: -0.2 * qd * np.abs(qd)),
    "coulomb_friction": ({"level": 0.3}, lambda q, qd, tau: -0.3 * np.sign(qd)),
    "asymmetric_friction": (
        {"positive": 0.5, "negative": 0.1},
        lambda q, qd, tau: np.where(qd > 0, -0.5, 0.1),
    ),
    "stribeck_friction": (
        {"sliding": 0.2, "excess": 0.3, "speed": 0.3},
        lambda q, qd, tau: -(0.2 + 0.3 * np.exp(-((qd / 0.3) ** 2))) * np.sign(qd),
    ),
    "stiction": ({"breakaway": 1.0, "sliding": 0.3}, lambda q, qd, tau: -0.3 * np.sign(qd)),
    "position_dependent_friction": (
        {"level": 0.3, "variation": 0.8, "period": 1.3, "phase": 0.4},
        lambda q, qd, tau: -0.3 * (1 + 0.8 * np.sin(2 * np.pi * q / 1.3 + 0.4)) * np.sign(qd),
    ),
    "load_dependent_friction": (
        {"coefficient": 0.2},
        lambda q, qd, tau: -0.2 * np.abs(tau) * np.sign(qd),
    ),
    "constant_offset": ({"offset": -0.4}, lambda q, qd, tau: -0.4 + 0 * q),
    "spring": ({"stiffness": 0.8, "rest": 0.2}, lambda q, qd, tau: -0.8 * (q - 0.2)),
    "torque_ripple": (
        {"amplitude": 0.4, "period": 0.4, "phase": 1.0},
        lambda q, qd, tau: 0.4 * np.sin(2 * np.pi * q / 0.4 + 1.0),
    ),
    "torque_scale": ({"scale": 0.8}, lambda q, qd, tau: -0.2 * tau),
    "torque_saturation": ({"limit": 1.5}, lambda q, qd, tau: np.clip(tau, -1.5, 1.5) - tau),
    "torque_curve": ({"loss": 0.03}, lambda q, qd, tau: -0.03 * tau * np.abs(tau)),
    "sublinear_friction": (
        {"coefficient": 0.4, "power": 0.5},
        lambda q, qd, tau: -0.4 * np.sqrt(np.abs(qd)) * np.sign(qd),
    ),
    "directional_load_friction": (
        {"driving": 0.25, "driven": 0.05},
        lambda q, qd, tau: -np.where(tau * qd > 0, 0.25, 0.05) * np.abs(tau) * np.sign(qd),
    ),
    "torque_ripple/harmonics": (
        {"amplitude": [0.4, 0.2, 0.1], "period": 1.2, "phase": [0.5, 1.0, 2.0]},
        lambda q, qd, tau: sum(
            a * np.sin(2 * np.pi * (n + 1) * q / 1.2 + p)
            for n, (a, p) in enumerate([(0.4, 0.5), (0.2, 1.0), (0.1, 2.0)])
        ),
    ),
    "outside/torque_deadband": ({"width": 0.3}, lambda q, qd, tau: -np.clip(tau, -0.3, 0.3)),
    "outside/root_load_friction": (
        {"coefficient": 0.3},
        lambda q, qd, tau: -0.3 * np.sqrt(np.abs(tau)) * np.sign(qd),
    ),
    "outside/fading_motor": ({"loss": 0.1}, lambda q, qd, tau: -0.1 * np.abs(qd) * tau),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_effect_is_the_torque_of_its_formula(name):
    parameters, formula = FORMULAS[name]
    name, _, kind = name.partition("/")
    hidden = make(name, 0, parameters | ({"kind": kind} if name == "outside" else {}))
    log = run(MECHANISMS["pendulum"], [hidden], 4, SHORT / 2)
    error, _ = residual(MECHANISMS["pendulum"], log)
    q, qd, tau = motion(log)
    if hidden.loaded:  # what passes the gear
        tau = tau - rotor(log, PENDULUM_ROTOR)
    moving = np.abs(qd) > 0.05
    wanted, found = low(formula(q, qd, tau))[moving], -error[moving]
    assert np.dot(wanted, found) / np.dot(wanted, wanted) == pytest.approx(1, abs=0.03)
    # what is left is where the joint turns round
    assert np.linalg.norm(wanted - found) < 0.16 * np.linalg.norm(wanted)


def test_friction_under_load_reads_what_other_friction_leaves():
    """In both engines, the same on one joint."""
    xml = MECHANISMS["pendulum"]
    hidden = [
        make("viscous_friction", 0, {"coefficient": 0.4}),
        make("coulomb_friction", 0, {"level": 0.6}),
        make("load_dependent_friction", 0, {"coefficient": 0.3}),
    ]

    def formula(qd, tau, left):
        other = -0.4 * qd - 0.6 * np.sign(qd)
        passed = tau + left * (other - turned)
        return other - 0.3 * np.abs(passed) * np.sign(qd)

    log = run(xml, hidden, 4, SHORT)
    speed = np.gradient(log.wanted, 0.002, axis=0)
    wanted = log.wanted, speed, np.gradient(speed, 0.002, axis=0)
    arm = run_arm(xml, hidden, wanted, 500.0, Sensors(np.full(1, 1e-6), np.zeros(1), 0))
    for each in (log, arm):
        error, _ = residual(xml, each)
        _, qd, tau = motion(each)
        turned = rotor(each, PENDULUM_ROTOR)
        moving = np.abs(qd) > 0.05
        far = [np.linalg.norm((low(formula(qd, tau, left)) + error)[moving]) for left in (1.0, 0.0)]
        assert far[0] < 0.12 * np.linalg.norm(error[moving])
        assert far[0] < 0.7 * far[1]  # the motor's own torque as the load


def test_inertia_that_varies_with_position_keeps_the_energy():
    """Its torque is minus that of the Lagrangian J(q)·qd²/2: J·qdd + J'·qd²/2."""
    varying = {"kind": "position_inertia", "inertia": 0.04, "period": 2.0, "phase": 0.3}
    log = run(MECHANISMS["pendulum"], [make("outside", 0, varying)], 4, SHORT)
    error, _ = residual(MECHANISMS["pendulum"], log)
    q, qd, _ = motion(log)
    qdd, turn = np.diff(log.clean, 2, axis=0) * 500**2, np.pi * q + 0.3
    wanted = low(0.04 * np.sin(turn) * qdd + 0.02 * np.pi * np.cos(turn) * qd**2)
    assert np.linalg.norm(wanted - error) < 0.15 * np.linalg.norm(wanted)


def test_grease_that_gets_warm_rubs_less():
    time_constant = run(
        MECHANISMS["pendulum"],
        [make("thermal_friction", 0, {"excess": 0.6, "time_constant": 2.0})],
        4,
        SHORT,
    )
    error, _ = residual(MECHANISMS["pendulum"], time_constant)
    _, qd, _ = motion(time_constant)
    wanted = low(0.6 * np.exp(-time_constant.time[1:-1, None] / 2.0) * qd)
    assert np.linalg.norm(wanted - error) < 0.03 * np.linalg.norm(wanted)
    by_work = make("thermal_friction", 0, {"excess": 0.5, "warm": 0.1, "work": 1.0})
    by_work.start(0.01, 0.0, 0.0)
    torques = [by_work.torque(0.0, [0.0], [1.0], 0.0) for _ in range(10000)]
    assert torques[0] == pytest.approx(-0.6)
    assert torques[-1] == pytest.approx(-0.1, abs=0.005)


def test_friction_between_two_joints_depends_on_the_difference_of_their_speeds():
    coupling = make(
        "coupled_joint_friction",
        0,
        {"other": 1, "coefficient": 0.2, "level": 0.1, "difference": True},
    )
    log = run(MECHANISMS["two_link"], [coupling], 4, SHORT)
    error, _ = residual(MECHANISMS["two_link"], log)
    _, qd, _ = motion(log)
    between = qd[:, 0] - qd[:, 1]
    wanted = 0.2 * between + 0.1 * np.sign(between)
    moving = np.abs(between) > 0.1
    for column, sign in ((0, 1.0), (1, -1.0)):
        assert np.linalg.norm(
            error[moving, column] - sign * wanted[moving]
        ) < 0.05 * np.linalg.norm(wanted[moving])


def test_a_coupled_motor_turns_both_joints():
    log = run(
        MECHANISMS["two_link"], [make("motor_coupling", 0, {"other": 1, "share": 0.1})], 4, SHORT
    )
    error, tau = residual(MECHANISMS["two_link"], log)
    assert np.linalg.norm(error[:, 1] + 0.1 * tau[:, 0]) < 0.03 * np.linalg.norm(0.1 * tau[:, 0])
    assert np.std(error[:, 0]) < 0.03 * np.std(error[:, 1])


def test_wrong_links_and_a_tilted_base():
    """A centre of mass, an inertia and a tilt, each against the same model written by hand."""
    believed = MECHANISMS["two_link"]
    fore = '<inertial pos="0 0 -0.175" mass="1" diaginertia="0.0102 0.0102 0.001"/>'
    assert fore in believed
    tilt = 'gravity="0.9779 0 -9.7613"'  # 0.1 rad about y, seen from the base
    for effect, parameters, other in (
        (
            "com_error",
            {"moment": [0.02, 0.0, -0.03]},
            believed.replace('pos="0 0 -0.175"', 'pos="0.02 0 -0.205"'),
        ),
        (
            "inertia_tensor_error",
            {"tensor": [0.002, 0.003, 0.001, 0.0, 0.0004, 0.0]},
            believed.replace(
                fore,
                fore.replace(
                    'diaginertia="0.0102 0.0102 0.001"',
                    'fullinertia="0.0122 0.0132 0.002 0 0.0004 0"',
                ),
            ),
        ),
        ("base_tilt", {"angles": [0.0, 0.1]}, believed.replace('gravity="0 0 -9.81"', tilt)),
    ):
        log = run(believed, [make(effect, 1, parameters)], 4, 4.0)
        assert severity(other, log, None) < 0.004 < severity(believed, log, None)


def test_eccentric_encoder_reads_wrong_once_a_turn():
    wrong = make(
        "outside", 0, {"kind": "encoder_eccentricity", "error": 0.05, "period": 2.0, "phase": 0.0}
    )
    log, straight = (run(MECHANISMS["pendulum"], hidden, 4, 4.0) for hidden in ([wrong], []))
    assert np.abs(log.q - straight.q).max() < 0.02  # the controller follows its reading
    error, _ = residual(MECHANISMS["pendulum"], log)
    assert np.std(error) > 0.03


@pytest.mark.parametrize("kind", ["coulomb", "viscous"])
def test_position_dependent_friction_is_dry_or_viscous(kind):
    effect = make(
        "position_dependent_friction",
        0,
        {"level": 0.5, "variation": 0.8, "period": 1.0, "phase": 0.0, "kind": kind},
    )
    assert (effect.torque(0.0, [0.25], [2.0], 0.0) == pytest.approx(-1.8)) == (kind == "viscous")
    assert (effect.dry(0.25, 2.0, 0.0)[0] == pytest.approx(0.9)) == (kind == "coulomb")


def test_friction_varies_with_the_other_joints_position():
    parameters = {"other": 1, "level": 0.5, "variation": 0.9, "period": 1.5, "phase": 0.3}
    log = run(MECHANISMS["two_link"], [make("coupled_friction", 0, parameters)], 4, SHORT)
    error, _ = residual(MECHANISMS["two_link"], log)
    q, qd, _ = motion(log)
    wanted = low(-0.5 * (1 + 0.9 * np.sin(2 * np.pi * q[:, 1] / 1.5 + 0.3)) * qd[:, 0])
    assert np.linalg.norm(wanted + error[:, 0]) < 0.03 * np.linalg.norm(wanted)
    assert np.std(error[:, 1]) < 0.02 * np.std(error[:, 0])


def test_another_body_is_the_believed_one_plus_what_was_added():
    two = believe(MECHANISMS["two_link"])
    log = run(
        MECHANISMS["two_link"],
        [make("payload", None, {"mass": 0.3, "com": [0.02, 0.0, -0.3]})],
        4,
        SHORT,
    )
    error, _ = residual(MECHANISMS["two_link"], log)
    heavier = MECHANISMS["two_link"].replace(
        "</body>\n    </body>",
        '<body pos="0.02 0 -0.3"><inertial pos="0 0 0" mass="0.3" diaginertia="3e-8 3e-8'
        ' 3e-8"/></body></body></body>',
    )
    assert severity(heavier, log, None) < 0.003 < np.std(error)
    for parameters, more in (
        ({"extra": 0.04}, 0.04),
        ({"extra": -0.5, "kind": "mass"}, -0.5 * (0.0102 + 0.175**2)),
    ):
        log = run(MECHANISMS["two_link"], [make("inertia_error", 1, parameters)], 4, SHORT)
        error, _ = residual(MECHANISMS["two_link"], log)
        step, q = log.time[1], log.clean
        qdd = (q[2:] - 2 * q[1:-1] + q[:-2]) / step**2
        if "kind" not in parameters:
            assert np.linalg.norm(error[:, 1] - low(more * qdd[:, 1])) < 0.03 * np.linalg.norm(
                error[:, 1]
            )
        else:  # gravity and the upper joint's motion are in it as well
            assert severity(MECHANISMS["two_link"], log, 1) > 0.1
    assert inertia(two, np.zeros(2))[1, 1] == pytest.approx(0.03 + 0.0102 + 0.175**2)


@pytest.mark.parametrize("name", ["actuator_delay", "sensor_delay"])
def test_dead_time_shifts_the_torque(name):
    log = run(MECHANISMS["pendulum"], [make(name, 0, {"delay": 0.01})], 4, SHORT)
    error, tau = residual(MECHANISMS["pendulum"], log)
    needed = (tau - error)[:, 0]
    off = [np.linalg.norm(needed[20:-20] - np.roll(tau[:, 0], k)[20:-20]) for k in range(11)]
    assert np.argmin(off) == 5  # samples of 2 ms
    assert off[5] < 0.01 * np.linalg.norm(tau)


def test_lag_is_a_first_order_low_pass():
    log = run(MECHANISMS["pendulum"], [make("actuator_lag", 0, {"time_constant": 0.02})], 4, SHORT)
    error, tau = residual(MECHANISMS["pendulum"], log)
    held = np.repeat(log.tau[:, 0], 10)
    share = -math.expm1(-2e-4 / 0.02)
    start = signal.lfilter_zi([share], [1, share - 1]) * held[0]
    late = signal.lfilter([share], [1, share - 1], held, zi=start)[0].reshape(-1, 10).mean(axis=1)
    wanted = low((late[1:-1] + late[:-2]) / 2)
    assert np.linalg.norm(wanted - (tau - error)[:, 0]) < 0.01 * np.linalg.norm(tau)


def test_bias_moves_the_reading():
    log = run(MECHANISMS["pendulum"], [make("position_bias", 0, {"bias": 0.2})], 4, SHORT)
    error, _ = residual(MECHANISMS["pendulum"], log)
    q = motion(log)[0]
    wanted = low(0.4 * 9.81 * (np.sin(q - 0.2) - np.sin(q)))
    assert np.linalg.norm(wanted - error) < 0.03 * np.linalg.norm(wanted)


def test_joint_at_rest_stays_at_rest():
    """Dry friction holds up to its level and not beyond; sliding friction of a breakaway joint is
    none.
    """
    for effect, level in (("coulomb_friction", {"level": 0.5}), ("stiction", {"breakaway": 0.5})):
        log = run(MECHANISMS["pendulum"], [make(effect, 0, level)], 4, SHORT)
        at_rest = np.diff(log.clean[:, 0]) == 0
        assert at_rest.mean() > 0.02
        model = believe(MECHANISMS["pendulum"])
        weight = inverse_dynamics(model, log.clean, 0 * log.clean, 0 * log.clean)
        inside = at_rest[1:] & at_rest[:-1]
        assert np.abs(log.tau - weight)[1:-1][inside].max() < 0.5 + 1e-6


def test_two_rough_joints_rest_together():
    hidden = [
        make("coulomb_friction", 0, {"level": 1.0}),
        make("coulomb_friction", 1, {"level": 0.4}),
    ]
    log = run(MECHANISMS["two_link"], hidden, 4, SHORT)
    both = (np.abs(np.diff(log.clean, axis=0)) < 1e-12).all(axis=1)
    assert both[:100].all()
    error, _ = residual(MECHANISMS["two_link"], log)
    assert np.median(np.abs(error), axis=0) == pytest.approx([1.0, 0.4], rel=0.05)


def test_rotor_on_a_fixed_link_swings_at_its_resonance():
    spring = JointElasticity(0, stiffness=200.0, damping=0.0, motor_inertia=0.02)
    spring.start(2e-4, 0.0, 0.0)
    torque = np.array([spring.transmit(0.0, 0.0, 1.0) for _ in range(20000)])
    crossings = np.sum(np.diff(np.sign(torque - 1.0)) != 0)
    assert crossings / 2 / 4.0 == pytest.approx(math.sqrt(200 / 0.02) / (2 * math.pi), rel=0.02)
    assert torque.mean() == pytest.approx(1.0, abs=0.01)


def test_backlash_bears_nothing_inside_its_gap_and_never_pulls():
    gear = Backlash(0, stiffness=100.0, damping=1.0, motor_inertia=0.02, gap=0.1)
    assert gear.bear(0.04, 5.0) == gear.bear(-0.04, -5.0) == 0.0
    assert gear.bear(0.06, 0.0) == pytest.approx(1.0)
    assert gear.bear(-0.06, -1.0) == pytest.approx(-2.0)
    assert gear.bear(0.06, -50.0) == 0.0


def test_stiff_transmission_is_the_believed_model():
    stiff = {"stiffness": 3e3, "damping": 3.0, "motor_inertia": 0.02}
    for hidden in (make("joint_elasticity", 0, stiff), make("backlash", 0, stiff | {"gap": 0.0})):
        log = run(MECHANISMS["pendulum"], [hidden], 4, SHORT)
        assert severity(MECHANISMS["pendulum"], log, 0) < 0.03


def test_run_follows_from_its_seed():
    effects = [
        make("actuator_delay", 0, {"delay": 0.006}),
        make("backlash", 1, {"stiffness": 1e3, "damping": 2.0, "motor_inertia": 0.03, "gap": 0.01}),
    ]
    one, again = (simulate(MECHANISMS["two_link"], effects, 5, 4.0) for _ in range(2))
    other = simulate(MECHANISMS["two_link"], [], 6, 4.0)
    assert list(one) == ["time", "q0", "q1", "tau0", "tau1"]
    assert all(np.array_equal(one[name], again[name]) for name in one)
    assert not np.allclose(one["q0"], other["q0"])
    assert np.array_equal(
        run(MECHANISMS["slider"], [], 5, 4.0).wanted,
        run(MECHANISMS["slider"], effects[:1], 5, 4.0).wanted,
    )


def test_lost_mechanism_is_no_measurement():
    with pytest.raises(Diverged, match="joint 0 reads"):
        run(MECHANISMS["slider"], [make("actuator_delay", 0, {"delay": 0.1})], 1, SHORT)


CASES = all_cases()


def test_cases_cover_the_catalogue():
    count = {
        family: sum(case.family == family for case in CASES)
        for family in ("single", "none", "outside", "pair")
    }
    assert count["none"] >= 100
    assert count["pair"] >= 60
    assert count["outside"] >= 36
    assert len({case.id for case in CASES}) == len({case.seed for case in CASES}) == len(CASES)
    assert {case.log for case in CASES} == {"log.csv", "log.npz"}
    assert all_cases() == CASES
    for name in INJECTED:
        for n, (mechanism, joint) in enumerate(PLACES):
            there = [
                c
                for c in CASES
                if c.family == "single"
                and c.mechanism == mechanism
                and c.hidden[0][:2] == (name, joint)
            ]
            missing = (
                (name, mechanism) in EXCLUDED
                or name in WHOLE
                or f"{mechanism} {joint}" not in ONCE.get(name, [f"{mechanism} {joint}"])
            )
            kinds = sum(row.startswith(f"{name}/") and SIZES[row][n] is not None for row in LATER)
            each = [] if missing else [2 + kinds] * 3
            assert [sum(c.severity == severity for c in there) for severity in SEVERITIES] == (
                each or [0] * 3
            )
    assert len(IMITABLE) >= 7
    assert {c.hidden[0].parameters["kind"] for c in CASES if c.family == "outside"} == {*OUTSIDE}
    assert {row.partition("/")[0] for row in SIZES} == {*INJECTED, "outside"}
    for case in CASES:
        if case.family == "pair":
            (one, a, _), (other, b, _) = case.hidden
            assert one != other
            assert a != b or not any({one, other} <= group for group in MERGING)


def test_case_on_disk_holds_nothing_of_the_truth(tmp_path):
    for case in (
        next(c for c in CASES if c.log == name and c.family == "pair")
        for name in ("log.csv", "log.npz")
    ):
        folder = tmp_path / case.id
        write_case(case, folder, 1.0)
        assert sorted(file.name for file in folder.iterdir()) == [case.log, "model.xml"]
        assert (folder / "model.xml").read_text() == MECHANISMS[case.mechanism]
        columns = case.measure(1.0).log()
        if case.log == "log.csv":
            table = np.genfromtxt(folder / "log.csv", delimiter=",", names=True)
            stored = {name: table[name] for name in table.dtype.names}
        else:
            stored = dict(np.load(folder / "log.npz"))
        assert list(stored) == list(columns)
        assert all(
            np.allclose(stored[name], columns[name], rtol=1e-6, atol=1e-6) for name in columns
        )
    assert json.loads(json.dumps(truth(CASES))) == truth(CASES)


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [c for c in CASES if c.family == "pair"][3::22], ids=lambda case: case.id
)
def test_shipped_pairs_do_not_diverge(case):
    assert np.isfinite(case.measure().tau).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [c for c in CASES if c.family == "single"][7::70], ids=lambda case: case.id
)
def test_severity_is_about_what_it_says(case):
    hidden = case.hidden[0]
    joint = hidden.parameters["other"] if hidden.effect == "motor_coupling" else hidden.joint
    aimed, found = (
        SEVERITIES[case.severity],
        severity(MECHANISMS[case.mechanism], case.measure(), joint),
    )
    assert (0.25 if case.hidden[0].effect == "joint_elasticity" else 0.45) < found / aimed < 2.0
