"""A motion is rehearsed with each explanation of a doubt before it is handed out."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import ActuatorDelay, TorqueSaturation, ViscousFriction
from jaxidl.excite.design import random_motion
from jaxidl.excite.doubt import Explanation
from jaxidl.excite.rehearsal import NATURAL, Reference, execute, explained, gains, rehearsed

DT = 0.004


def explanation(*effects):
    keys = tuple((type(e).name, 0) for e in effects)
    return Explanation(keys, effects, (), (), ())


@pytest.fixture(scope="module")
def motion(made):
    return random_motion(made.plan, None, 0, 1.0 / DT)


def test_a_controller_follows_the_motion_unless_its_torque_is_cut(pendulum, motion):
    plant = explained(pendulum.plant, explanation())
    control = gains(plant, jnp.asarray(motion.q[0]))
    assert control.position.shape == (len(NATURAL), 1)
    one = type(control)(control.position[1], control.speed[1])
    reference = Reference(motion.q, motion.qd, motion.tau)
    follow = lambda torque: execute(plant, reference, one, jnp.array([torque]), DT)
    off = np.abs(follow(np.inf) - motion.q).max()
    assert off < 0.02 * np.ptp(motion.q)
    assert np.abs(follow(0.5 * np.abs(motion.tau).max()) - motion.q).max() > 3.0 * off


@pytest.mark.slow
def test_a_motion_that_all_explanations_keep_within_limits_stays(made, limits, motion):
    several = [explanation(), explanation(ViscousFriction(jnp.array([0.05])))]
    assert rehearsed(motion, made, several, limits, DT) is motion


def test_a_motion_is_made_smaller_where_a_weak_drive_would_leave_the_limits(made, limits, motion):
    weak = TorqueSaturation(0.6 * jnp.abs(motion.tau).max(0))
    found = rehearsed(motion, made, [explanation(weak)], limits, DT)
    assert 0.1 < found.smaller / motion.smaller < 1.0
    share = found.smaller / motion.smaller
    start = motion.q[0]
    np.testing.assert_allclose(found.q - start, share * (motion.q - start), atol=1e-12)
    np.testing.assert_allclose(found.qdd, share * motion.qdd, atol=1e-12)
    assert np.abs(found.tau).max() < np.abs(motion.tau).max()


@pytest.mark.slow
def test_a_loop_that_no_robot_could_have_had_is_no_witness(made, limits, motion):
    late = ActuatorDelay(jnp.array([0.075]), steps=40)  # no controller of 5 Hz bears it
    assert rehearsed(motion, made, [explanation(late)], limits, DT).smaller > 0.1 * motion.smaller
