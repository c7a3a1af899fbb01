"""Every effect of the catalogue against its definition, written down a second time."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.test_util import check_grads

from jaxidl.effects import (
    CATALOGUE,
    ActuatorLag,
    ConstantOffset,
    InertiaError,
    PaperFriction,
    SensingNoise,
    Stiction,
    ViscousFriction,
    from_dict,
    paper_stiction,
    regressor,
)
from jaxidl.errors import EffectError

EXAMPLES = [
    ViscousFriction(jnp.array([2.0, 3.0])),
    PaperFriction(jnp.array(5.0)),
    paper_stiction(8.0),
    Stiction(jnp.array([1.0, 2.0]), jnp.array(1e-3), jnp.array(jnp.inf)),
    InertiaError(jnp.array([1.0, -0.5])),
    ConstantOffset(jnp.array([1.0, -2.0])),
    ActuatorLag(jnp.array([0.01, 0.02])),
    SensingNoise(jnp.array(1e-3)),
]


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
    places = [-0.5, 0.0, 0.1, 0.2, 0.3, 0.4, 0.7, 1.2, 2.0]  # 0.2, 0.4 and 1.2 are borders, which are strict
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


def test_unsigned_stiction_lets_a_strong_negative_torque_through():
    effect = Stiction(jnp.array([10.0]), jnp.array(1e-3), jnp.array(jnp.inf))
    rest = jnp.zeros(1), jnp.zeros(1)
    assert effect.holds(*rest, jnp.array([-9.0]))[0]
    assert not effect.holds(*rest, jnp.array([-11.0]))[0]


def test_sensing_noise_is_bounded_and_scaled():
    draws = jnp.array([0.5, -3.0])
    np.testing.assert_allclose(SensingNoise(jnp.array(0.1)).sense(jnp.ones(2), draws), [1.05, 0.9])


@pytest.mark.parametrize("effect", EXAMPLES, ids=lambda e: e.name)
def test_round_trip_through_a_dictionary(effect):
    import json

    again = from_dict(json.loads(json.dumps(effect.to_dict(), allow_nan=False)))
    assert type(again) is type(effect)
    assert again.to_dict() == effect.to_dict()
    assert jax.tree.structure(again) == jax.tree.structure(effect)


def test_every_effect_of_the_catalogue_is_described_and_exemplified():
    assert {e.name for e in EXAMPLES} == set(CATALOGUE)
    for name, cls in CATALOGUE.items():
        assert cls.sentence
        assert cls.parameters
        assert set(cls.parameters) <= set(cls.__dataclass_fields__), name
        for spec in cls.parameters.values():
            assert spec.unit
            assert spec.lower < spec.upper


@pytest.mark.parametrize("bad", [jnp.array(-1.0), jnp.array(jnp.nan), jnp.array(13.0)])
def test_parameters_out_of_bounds_are_named(bad):
    with pytest.raises(EffectError, match=r"paper_friction\.level in \[0, 12\]"):
        PaperFriction(bad).check()


def test_unknown_or_incomplete_records_are_refused():
    with pytest.raises(EffectError, match="viscous_friction"):
        from_dict({"effect": "magic"})
    with pytest.raises(EffectError, match="to_dict"):
        from_dict({"effect": "viscous_friction", "parameters": {"coefficient": {}}})
    with pytest.raises(EffectError, match="sign"):
        from_dict({**paper_stiction(5.0).to_dict(), "options": {"sign": True}})
    with pytest.raises(EffectError, match="no coefficient"):
        from_dict({"effect": "viscous_friction", "parameters": {}})


@pytest.mark.parametrize("effect", [e for e in EXAMPLES if type(e).linear], ids=lambda e: e.name)
def test_the_regressor_of_a_linear_effect_is_its_torque_and_recovers_its_parameters(effect):
    rng = np.random.default_rng(0)
    q, qd, tau = (jnp.asarray(rng.normal(size=(50, 2))) for _ in range(3))
    rows = np.concatenate(jax.vmap(lambda *m: regressor(effect, *m))(q, qd, tau))
    torque = np.concatenate(jax.vmap(effect.torque)(q, qd, tau))
    flat = jax.flatten_util.ravel_pytree(effect)[0]
    np.testing.assert_allclose(rows @ flat, torque, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.lstsq(rows, torque, rcond=None)[0], flat, rtol=1e-10)


@pytest.mark.parametrize("q", [(0.1, 0.1), (0.1, 0.3), (0.3, 0.8), (0.5, 1.5)])
@pytest.mark.parametrize("effect", EXAMPLES, ids=lambda e: e.name)
def test_derivatives_forward_reverse_and_numeric_agree_inside_a_region(effect, q):
    floats, rebuild = jax.flatten_util.ravel_pytree(effect)

    def torque(*arguments):
        parameters, q, qd, tau = map(jnp.asarray, arguments)  # the numeric side hands over NumPy arrays
        return rebuild(parameters).torque(q, qd, tau)

    motion = jnp.array(q), jnp.array([0.7, -0.4]), jnp.array([3.0, 4.0])
    check_grads(torque, (floats, *motion), order=1, modes=("fwd", "rev"), atol=1e-5, rtol=1e-5)
