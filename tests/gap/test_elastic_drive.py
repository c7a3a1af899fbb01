"""A drive with a spring behind a noisy encoder: its parameters, and its simulation along a log."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import JointElasticity, OnJoint
from jaxidl.gap import diagnose
from jaxidl.gap.benchmark.cases import all_cases
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.gap.choice.objections import unconfirmed
from jaxidl.gap.evidence.noise import read_again
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.gap.fit.values import Value
from jaxidl.logs.log import Log
from jaxidl.logs.signals import prepare
from jaxidl.replay.rollout import rollout_errors
from jaxidl.systems import Plant
from jaxidl.systems.mjcf import read_model


def drive(identity, folder):
    """Log, model and true parameters of a pendulum's drive of the benchmark."""
    (case,) = (c for c in all_cases() if c.id == identity)
    columns = case.measure().log()
    q, tau = (np.asarray(columns[name])[:, None] for name in ("q0", "tau0"))
    path = folder / "model.xml"
    path.write_text(MECHANISMS[case.mechanism])
    time = np.asarray(columns["time"])
    log = Log(time, q, tau, None, None, np.zeros(len(time), int), float(time[1] - time[0]), ())
    return log, read_model(path), case.hidden[0].parameters


@pytest.fixture(scope="module")
def elastic(tmp_path_factory):
    """A pendulum's elastic drive, with true parameters and an encoder whose noise matters."""
    return drive("pendulum-d608974e", tmp_path_factory.mktemp("elastic"))


def test_a_log_read_again_has_as_much_more_noise_as_it_had(elastic):
    log, model, _ = elastic
    rows = rows_of(prepare(log, model.plant.body))
    once, twice = read_again(rows), read_again(rows)
    np.testing.assert_array_equal(once.gap, twice.gap)
    added = np.std(once.gap - rows.gap, axis=0)
    np.testing.assert_allclose(added, rows.signals.noise_floor, rtol=0.25)


def test_noise_of_a_logged_velocity_is_its_own(elastic):
    log, model, _ = elastic
    speed = np.gradient(log.q, log.dt, axis=0)
    smooth = prepare(log, model.plant.body).qd  # hardly any noise
    noises = [
        np.std(read_again(rows).gap - rows.gap)
        for qd in (None, smooth, speed)
        for rows in [rows_of(prepare(replace(log, qd=qd), model.plant.body))]
    ]
    assert noises[1] < 0.1 * noises[0]
    assert noises[2] > 0.5 * noises[0]


def test_an_elastic_drive_is_found_as_it_is_despite_noise(elastic):
    """Fitted to the noise as well, its motor is five times too heavy: less of the noisy
    acceleration is then on the link's side.
    """
    log, model, true = elastic
    found = diagnose(log, model, effects=["joint_elasticity"], rollouts=False)
    (finding,) = found.findings
    assert finding.name == JointElasticity.name
    for name, estimate in finding.parameters.items():
        assert abs(estimate.value - true[name]) < 2.0 * estimate.stderr
    motor = finding.parameters["motor_inertia"]
    assert motor.value < 3.0 * true["motor_inertia"]


@pytest.mark.slow
def test_play_is_fitted_though_each_contact_is_rough(tmp_path):
    """Its error jumps up and down with each parameter: of least squares that follow its slopes, a
    third of the gap would be left.
    """
    log, model, true = drive("pendulum-d74f9ed3", tmp_path)
    found = diagnose(log, model, effects=["backlash"], rollouts=False)
    (finding,) = found.findings
    assert found.gap.after.torque_rms[0] < 0.2 * found.gap.before.torque_rms[0]
    for name, near in (("gap", 0.05), ("motor_inertia", 0.05), ("stiffness", 0.3)):
        assert finding.parameters[name].value == pytest.approx(true[name], rel=near)


def test_the_true_drive_follows_the_log_from_any_moment_on(elastic):
    """Its motor, which no encoder sees, has to swing as the real one at the beginning."""
    log, model, true = elastic
    signals = prepare(log, model.plant.body)
    drive = JointElasticity(*(jnp.array([true[name]]) for name in JointElasticity.parameters))
    rigid, elastic_one = (
        rollout_errors(Plant(model.plant.body, effects), signals, np.ones(log.samples, bool))
        for effects in (model.plant.effects, (*model.plant.effects, OnJoint(drive, 0, 1)))
    )
    for horizon in rigid:
        assert elastic_one[horizon] < 0.2 * rigid[horizon]


def test_what_no_single_parameter_shows_is_confirmed_by_its_share():
    unsure = {"stiffness": (np.array([10.0]), np.array([6.0]))}
    effect = JointElasticity(*(jnp.ones(1) for _ in range(3)))
    value = Value((effect.name, 0), (), OnJoint(effect, 0, 1), unsure, on_bound=False)
    assert "does not confirm" in unconfirmed(value, ())
    assert unconfirmed(value._replace(share=0.5), ()) == ""
    assert unconfirmed(value._replace(together=3.0), ()) == ""
