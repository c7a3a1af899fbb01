"""What effects do to the encoders is undone once: the model's own in the signals, those that are
being found in their terms.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import (
    ActuatorDelay,
    InertiaError,
    JointElasticity,
    LoadDependentFriction,
    OnJoint,
    Payload,
    PositionBias,
    SensorDelay,
    ViscousFriction,
)
from jaxidl.gap.evidence import additions as along
from jaxidl.gap.evidence.additions import additions
from jaxidl.gap.evidence.behind import Behind
from jaxidl.gap.evidence.friction import mean_sign
from jaxidl.gap.fit.balance import balance
from jaxidl.gap.fit.refine import _starts
from jaxidl.logs.log import from_arrays
from jaxidl.logs.low_pass import derivative
from jaxidl.logs.signals import prepare
from jaxidl.replay.rollout import window_starts

DT, STEPS, DELAY, BIAS, NOISE = 2e-3, 4000, 0.017, 0.2, 1e-4


def on_joint(effect, joint=1):
    return OnJoint(effect, joint, 2)


ENCODERS = (on_joint(PositionBias(jnp.array([BIAS]))), on_joint(SensorDelay(jnp.array([DELAY]))))
LATE = on_joint(ActuatorDelay(jnp.array([0.01])))
SOFT = on_joint(JointElasticity(jnp.array([20.0]), jnp.array([0.3]), jnp.array([0.05])))
BESIDE = {
    "friction": on_joint(ViscousFriction(jnp.array([0.3])), 1),
    "friction elsewhere": on_joint(ViscousFriction(jnp.array([0.3])), 0),
    "rotor": on_joint(InertiaError(jnp.array([0.2])), 1),
    "link": on_joint(InertiaError(jnp.array([0.0]), jnp.array([0.4])), 1),
    "load": Payload(jnp.array(0.5), jnp.array([0.1, 0.0, -0.2])),
}


@pytest.fixture(scope="module")
def body(two_link):
    return two_link.plant.body


def motion(t):
    return np.column_stack(
        [0.8 * np.sin(3.0 * t) + 0.2 * np.sin(11.0 * t), 0.6 * np.sin(5.0 * t + 1.0)]
    )


@pytest.fixture(scope="module")
def log():
    """Readings of an arm of two links, of which the second's encoder is late and off; torques that
    belong to nothing.
    """
    t = DT * np.arange(STEPS)
    q = motion(t)
    q[:, 1] = motion(t - DELAY)[:, 1] + BIAS
    return from_arrays(
        t,
        q + NOISE * np.random.default_rng(0).standard_normal(q.shape),
        np.column_stack([np.sin(t), np.cos(7.0 * t)]),
    )


@pytest.mark.parametrize("beside", BESIDE.values(), ids=BESIDE)
@pytest.mark.parametrize("encoder", ENCODERS, ids=["bias", "delay"])
def test_an_effect_counts_once_be_it_the_models_own_or_found(log, body, encoder, beside):
    """Friction and links are where the joint truly is, whichever of both was known."""
    own, _ = balance(prepare(log, body, (encoder,)), (encoder, beside))
    found, mixed, neither = (
        balance(prepare(log, body), own, others)[0]
        for own, others in (
            ((), (encoder, beside)),
            ((beside,), (encoder,)),
            ((), (beside,)),
        )
    )
    np.testing.assert_array_equal(own.signals.rows, found.signals.rows)
    change = np.abs(found.gap - neither.gap).max()
    np.testing.assert_allclose(own.gap, found.gap, atol=0.01 * change)
    np.testing.assert_allclose(own.gap, mixed.gap, atol=0.01 * change)


def test_friction_under_load_turns_with_the_joint_and_keeps_its_load(log, body):
    signals, t = prepare(log, body), DT * np.arange(STEPS)
    load = 2.0 + np.sin(0.7 * t)[:, None] * [1.0, 1.0]
    friction = on_joint(LoadDependentFriction(jnp.array([0.3])))
    late = lambda *behind: additions(
        [ENCODERS[1]], signals, log.tau, load, behind=Behind(behind, body)
    )[0][0]
    true = derivative(motion(t), DT)
    turned = 0.3 * load * (np.sign(true) - np.sign(signals.qd))
    wanted = signals.smooth(turned * [0.0, 1.0])[signals.rows]
    off = late(friction) - late() - wanted
    assert np.mean(np.abs(off)) < 0.1 * np.mean(np.abs(wanted))


@pytest.mark.parametrize("logged", [STEPS, 3001])
@pytest.mark.parametrize("effect", [*ENCODERS, LATE, SOFT], ids=["bias", "delay", "late", "soft"])
def test_what_an_effect_adds_does_not_depend_on_the_length_of_its_program(
    log, body, monkeypatch, effect, logged
):
    cut = from_arrays(log.time[:logged], log.q[:logged], log.tau[:logged])
    signals = prepare(cut, body)
    longer = additions([effect], signals, cut.tau, cut.tau)[0]
    monkeypatch.setattr(along, "_longer", lambda x: x)
    np.testing.assert_allclose(longer, additions([effect], signals, cut.tau, cut.tau)[0])
    assert longer.any()


@pytest.mark.parametrize("logged", [False, True], ids=["positions", "speeds-too"])
def test_motion_is_that_behind_the_encoders(log, body, logged):
    if logged:
        speed = derivative(log.q, DT)
        log = replace(log, qd=speed, qdd=derivative(speed, DT))
    seen, after = prepare(log, body, ENCODERS), prepare(log, body).behind(ENCODERS)
    t = DT * np.arange(STEPS)
    true, well = motion(t), slice(500, -500)
    speed = derivative(true, DT)
    for name, wanted in {"q": true, "qd": speed, "qdd": derivative(speed, DT)}.items():
        one, other = (getattr(signals, name)[well] for signals in (seen, after))
        size = np.abs(wanted).max()
        np.testing.assert_allclose(one, other, atol=1e-4 * size)  # the bands differ a little
        np.testing.assert_allclose(one, wanted[well], atol=0.02 * size)


def test_an_encoder_that_is_late_is_not_taken_for_a_quieter_one(log, body):
    half = on_joint(SensorDelay(jnp.array([0.5 * DT])))
    np.testing.assert_array_equal(prepare(log, body, (half,)).sigma, prepare(log, body).sigma)


def test_no_window_reaches_beyond_what_late_encoders_have_seen(log, body):
    signals, every = prepare(log, body), np.ones(STEPS, bool)
    # a cubic reads one sample further
    seen, late = signals.behind(ENCODERS), int(np.ceil(DELAY / DT)) + 1
    assert signals.late == signals.behind(ENCODERS[:1]).late == 0
    assert seen.late == prepare(log, body, ENCODERS).late == late
    assert seen.behind(ENCODERS).late == 2 * late
    for length in range(200, 231):
        assert window_starts(seen, every, 50, length).max() + length < STEPS - late
        assert _starts(seen, every, length).max() + length < STEPS - late


def test_friction_is_averaged_around_each_instant_where_a_joint_reverses():
    fine, late = 400, 0.3
    t = np.arange(0.0, 60.0, 1.0 / fine)[:, None]
    speed = np.sin(0.7 * t + late) * np.exp(-0.01 * t)
    exact = [
        np.mean(np.sign(speed[k - fine // 2 : k + fine // 2])) for k in range(fine, 58 * fine, fine)
    ]
    found = mean_sign(speed[::fine])
    np.testing.assert_allclose(found[1:58, 0], exact, atol=0.02)
    assert len(np.unique(np.round(exact, 2))) > 10  # it reverses between instants
    moved = mean_sign(np.interp(t[::fine, 0] + 1e-3, t[:, 0], speed[:, 0]))
    assert np.abs(moved - found[:, 0])[1:-1].max() < 0.01  # the sign itself jumps


def test_a_late_encoder_is_no_actuator():
    """What it remembers is the motion, and the motor's torque passes as it is."""
    assert not SensorDelay.actuates()
    assert ActuatorDelay.actuates()
