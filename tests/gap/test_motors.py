"""Effects of a motor in a row: each acts on the command that those before it deliver."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import ActuatorDelay, Backlash, JointElasticity, OnJoint, TorqueCurve
from jaxidl.gap.evidence.items import columns_of, item
from jaxidl.gap.evidence.rows import rows_of
from jaxidl.gap.evidence.shape import Shape
from jaxidl.gap.fit.balance import balance
from jaxidl.gap.fit.shapes import arriving
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare

DT, STEPS, DELAY, LOSS = 2e-3, 3000, 0.02, 0.05
HERE, ELSEWHERE = 0, 1


@pytest.fixture(scope="module")
def signals(two_link):
    t = DT * np.arange(STEPS)
    q = np.column_stack([0.8 * np.sin(3.0 * t), 0.6 * np.sin(5.0 * t + 1.0)])
    tau = np.column_stack([4.0 * np.sin(9.0 * t), 3.0 * np.cos(7.0 * t)])
    return prepare(from_arrays(t, q, tau), two_link.plant.body)


def motor(cls, joint, rows, **values):
    """An item of an effect with these values."""
    options = {"steps": 40} if cls is ActuatorDelay else {}
    shape = Shape(cls, joint, 2, (), values, options, {})
    return item(shape, *columns_of([shape], rows, rows.tau))


def test_effects_in_a_row_add_what_they_deliver_together(signals):
    rows, one = rows_of(signals), [np.ones(1)]
    delay = motor(ActuatorDelay, HERE, rows, delay=DELAY)
    curve = motor(TorqueCurve, HERE, rows, loss=LOSS)
    behind = arriving(curve, [delay], one, rows, rows.tau)
    in_a_row = delay.columns[0] + motor(TorqueCurve, HERE, behind, loss=LOSS).columns[0]
    effects = (
        OnJoint(ActuatorDelay(jnp.array([DELAY]), steps=40), HERE, 2),
        OnJoint(TorqueCurve(jnp.array([LOSS])), HERE, 2),
    )
    together = (rows.gap - balance(signals, (), effects)[0].gap)[:, [HERE]]
    np.testing.assert_allclose(in_a_row, together, atol=1e-9)
    assert np.abs(together - curve.columns[0] - delay.columns[0]).max() > 0.1


def test_only_what_comes_before_on_the_joint_counts(signals):
    rows, one = rows_of(signals), [np.ones(1)]
    delay = motor(ActuatorDelay, HERE, rows, delay=DELAY)
    curve = motor(TorqueCurve, HERE, rows, loss=LOSS)
    other = motor(TorqueCurve, ELSEWHERE, rows, loss=LOSS)
    assert arriving(delay, [curve], one, rows, rows.tau) is rows
    assert arriving(other, [delay], one, rows, rows.tau) is rows
    assert arriving(curve, [delay], one, rows, rows.tau) is not rows


def test_a_part_does_not_come_before_its_whole(signals):
    """Play contains the elasticity of a gear: one of them passes the command, not both."""
    rows, one = rows_of(signals), [np.ones(1)]
    drive = {"stiffness": 50.0, "damping": 0.5, "motor_inertia": 0.01}
    elastic = motor(JointElasticity, HERE, rows, **drive)
    play = motor(Backlash, HERE, rows, gap=0.01, **drive)
    assert arriving(play, [elastic], one, rows, rows.tau) is rows
