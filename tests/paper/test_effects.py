"""The friction and the stiction of the paper's plant against its rules."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jaxidl.errors import EffectError
from jaxidl.paper.effects import PaperFriction, paper_stiction


def friction_by_the_rules(q, f):
    """The page's four rules in plain Python."""
    c = [0.0, 0.0]
    if q[0] < 0.2:
        c[0] = 10 * np.exp(f) * np.sin(q[0]) ** 2
    if q[1] < 0.2:
        c[1] = 10 * f * np.cos(q[1]) ** 2
    if 0.2 < q[1] < 0.4:
        c[1] = -(f**2) * np.sin(q[1]) ** 2
    if 0.4 < q[1] < 1.2:
        c[0] = max(0, f) * np.sin(q[1]) ** 2
    return c


@pytest.mark.parametrize("level", [5.0, 8.0])
def test_paper_friction_follows_the_rules_everywhere(level):
    # 0.2, 0.4 and 1.2 are borders, which are strict
    places = [-0.5, 0.0, 0.1, 0.2, 0.3, 0.4, 0.7, 1.2, 2.0]
    effect = PaperFriction(jnp.array(level))
    for q0 in places:
        for q1 in places:
            got = effect.torque(jnp.array([q0, q1]), jnp.array([1.5, -2.0]), jnp.zeros(2))
            c = friction_by_the_rules((q0, q1), level)
            np.testing.assert_allclose(got, [-1.5 * c[0], 2.0 * c[1]], rtol=1e-13)


def test_paper_friction_pulls_in_its_negative_region_and_couples_the_joints():
    effect = PaperFriction(jnp.array(5.0))
    assert effect.coefficient(jnp.array([0.5, 0.3]))[1] < 0
    free, coupled = (effect.coefficient(jnp.array([0.5, q1]))[0] for q1 in (0.3, 0.8))
    assert free == 0
    assert coupled > 0


def test_joints_beyond_the_second_are_free_of_paper_friction():
    c = PaperFriction(jnp.array(5.0)).coefficient(jnp.array([0.1, 0.1, 0.1]))
    assert c[0] > 0
    assert c[1] > 0
    assert c[2] == 0


@pytest.mark.parametrize(
    ("q", "qd", "tau", "held"),
    [
        (0.0, 0.0, 499.0, True),
        (0.0, 0.0, 500.0, False),  # at the breakaway torque it moves
        (0.0, 0.0, -9999.0, True),  # signed, as in the program
        (0.2, 0.0, 0.0, False),  # the border is strict
        (0.0, 1e-4, 0.0, False),
        (0.0, -0.99e-4, 0.0, True),
    ],
)
def test_paper_stiction_holds_by_the_rule(q, qd, tau, held):
    far = jnp.array([q, 1.0]), jnp.array([qd, 1.0]), jnp.array([tau, 0.0])
    np.testing.assert_array_equal(paper_stiction(5.0).holds(*far), [held, False])


@pytest.mark.parametrize("bad", [jnp.array(-1.0), jnp.array(jnp.nan), jnp.array(13.0)])
def test_parameters_out_of_bounds_are_named(bad):
    with pytest.raises(EffectError, match=r"paper_friction\.level in \[0, 12\]"):
        PaperFriction(bad).check()


@pytest.mark.parametrize("q", [(0.1, 0.1), (0.1, 0.3), (0.3, 0.8), (0.5, 1.5)])
def test_derivatives_forward_reverse_and_numeric_agree_in_every_region_of_the_paper_friction(q):
    torque = lambda level, *motion: PaperFriction(jnp.asarray(level)).torque(
        *map(jnp.asarray, motion)
    )
    motion = jnp.array(q), jnp.array([0.7, -0.4]), jnp.array([3.0, 4.0])
    check_grads(
        torque, (jnp.array(5.0), *motion), order=1, modes=("fwd", "rev"), atol=1e-5, rtol=1e-5
    )
