"""What effects give to a search: starting shapes, amplitudes, plausible bounds, odds, and whether
they read the torque.
"""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import jaxidl.effects as fx
from jaxidl.effects import CATALOGUE, Effect, OnJoint, Parameter, Scale, placed, register, searched
from jaxidl.effects.spec import Variant
from jaxidl.errors import EffectError
from jaxidl.paper.effects import paper_stiction
from jaxidl.systems import PointMass
from jaxidl.systems.record import check_fits
from tests.helpers.effects import TURNING, Worm

JOINTS = 3
SCALE = Scale(
    30.0, 2.0, -0.5, 0.4, 2.0, 1.5, 40.0, 2e-3, 0, JOINTS, (-0.5, -0.3, 0.0), (0.4, 0.9, 0.0), 0.01
)
SEARCHED = {name: CATALOGUE[name] for name in searched()}
of = pytest.mark.parametrize("cls", SEARCHED.values(), ids=SEARCHED)

Q, QD, TAU = jnp.array([0.1, 0.23, -0.4]), jnp.array([0.7, -0.9, 1.1]), jnp.array([3.0, -2.0, 4.0])
QDD = jnp.array([2.0, -3.0, 1.5])


def added(effect):
    """What an effect changes (7 J,): torque, dry friction in motion and at rest, the body's torque,
    and the command over three steps.
    """
    body, zero = PointMass(jnp.array([2.0, 2.5, 1.0])), jnp.zeros(JOINTS)
    altered = effect.alter(body).inverse_dynamics(Q, QD, QDD) - body.inverse_dynamics(Q, QD, QDD)
    levels = effect.dry(Q, QD, TAU, QD), effect.dry(Q, zero, TAU, jnp.ones(JOINTS))
    memory, passed = effect.start(Q), []
    for _ in range(3):
        # below any bend of a motor's curve
        tau, memory = effect.actuate(memory, Q, QD, TAU / 100.0, 1.0)
        passed.append(tau - TAU / 100.0)
    return np.concatenate([effect.torque(Q, QD, TAU), *levels, altered, *passed])


@of
def test_variants_are_complete_within_bounds_and_fit_a_mechanism(cls):
    variants = cls.variants(SCALE)
    assert variants
    for variant in variants:
        assert set(variant.free) <= set(cls.parameters)
        assert set(variant.values) <= set(cls.parameters)
        effect = placed(cls, variant, SCALE.joint, JOINTS)
        check_fits(effect, JOINTS)
        inner = effect.effect if isinstance(effect, OnJoint) else effect
        for name, (low, high) in variant.within.items():
            spec = cls.parameters[name]
            assert low < high
            assert high > spec.lower
            assert low < spec.upper
            if name not in variant.free:
                assert np.all(
                    (np.asarray(getattr(inner, name)) >= low)
                    & (np.asarray(getattr(inner, name)) <= high)
                ), name


@of
def test_what_a_variant_adds_is_linear_in_its_amplitudes_and_zero_at_zero(cls):
    for variant in cls.variants(SCALE)[::7]:
        if not variant.free:
            assert not cls.linear
            continue
        effect = placed(cls, variant, SCALE.joint, JOINTS)
        inner = effect.effect if isinstance(effect, OnJoint) else effect
        flat, rebuild = ravel_pytree({name: getattr(inner, name) for name in variant.free})

        def at(values, effect=effect, inner=inner, rebuild=rebuild):
            now = inner.replace(**rebuild(values))
            return added(effect.replace(effect=now) if isinstance(effect, OnJoint) else now)

        np.testing.assert_array_equal(at(0.0 * flat), 0.0)
        one, two = (jax.random.normal(jax.random.key(k), flat.shape) for k in (1, 2))
        assert np.abs(at(one)).max() > 0.0 or cls.name in TURNING
        np.testing.assert_allclose(
            at(one) + 2.0 * at(two), at(one + 2.0 * two), rtol=1e-6, atol=1e-7
        )


@of
def test_odds_and_advice_are_given(cls):
    assert 0.0 < cls.prior <= 0.5
    assert all(v.prior is None or 0.0 < v.prior <= 0.5 for v in cls.variants(SCALE))
    assert len(cls.advice.split()) > 5
    for variant in cls.variants(SCALE):
        for part in cls.contains(variant.free):
            name, _, parameter = part.partition(".")
            assert name in CATALOGUE
            assert name != cls.name
            assert not parameter or parameter in CATALOGUE[name].parameters


def test_friction_and_the_common_effects_are_marked():
    assert {name for name, cls in SEARCHED.items() if cls.friction} == {
        # presliding friction gives back a part of what it takes
        n
        for n in SEARCHED
        if "friction" in n and n != "presliding_friction"
    } | {
        "stiction",
        "quadratic_drag",
    }
    assert {"viscous_friction", "coulomb_friction", "inertia_error", "constant_offset"} <= {
        name for name, cls in SEARCHED.items() if cls.common
    }


def test_contained_effects_depend_on_the_free_parameters():
    cls = fx.AsymmetricFriction
    assert cls.contains(("positive", "negative")) == ("coulomb_friction", "constant_offset")
    assert cls.contains(("viscous_positive", "viscous_negative")) == ("viscous_friction",)
    assert fx.PositionDependentFriction.contains(("coefficient",)) == ("viscous_friction",)


def test_tables_over_another_joint_leave_out_those_that_do_not_move():
    options = [variant.options for variant in fx.CoupledFriction.variants(SCALE)]
    assert {(o["joint"], o["other"]) for o in options} == {(0, 1)}  # joint 2 rests
    assert fx.CoupledFriction.variants(SCALE._replace(lows=(), highs=())) == []


def test_a_saturated_sample_is_one_whose_motion_needs_the_limit():
    limit = fx.TorqueSaturation(jnp.array([2.0]))
    logged = jnp.array([3.0, 3.0, -3.0, 1.95, 3.0])[:, None]
    needed = jnp.array([1.96, 1.0, 1.96, 1.96, -2.5])[:, None]
    seen = np.array([3.0, 1.0, 1.96, 1.96, -2.5])[:, None]  # the second is a gap of another kind
    np.testing.assert_allclose(limit.seen(logged, needed), seen)
    both = jnp.concatenate([needed, needed], 1)
    np.testing.assert_allclose(
        OnJoint(limit, 1, 2).seen(jnp.concatenate([logged] * 2, 1), both), np.hstack([needed, seen])
    )
    np.testing.assert_array_equal(fx.ViscousFriction(jnp.ones(1)).seen(logged, needed), logged)


def test_effects_that_read_the_torque_are_recognised():
    reads = {
        n
        for n, c in SEARCHED.items()
        if c.alone() and placed(c, c.variants(SCALE)[0], 1, JOINTS).reads_torque(JOINTS)
    }
    assert "load_dependent_friction" in reads
    assert not reads & {
        "viscous_friction",
        "coulomb_friction",
        "spring",
        "inertia_error",
        "torque_scale",
        "stribeck_friction",
    }
    assert paper_stiction(jnp.array(1.0)).reads_torque(2)  # holds


def test_a_linear_effect_of_a_user_that_reads_the_torque_is_recognised(clean_catalogue):
    """At zero nothing shows that it does."""
    register(Worm)
    (variant,) = Worm.variants(SCALE)
    assert variant == Variant({"share": 0.0}, ("share",))
    assert placed(Worm, variant, 1, JOINTS).reads_torque(JOINTS)
    assert not fx.ViscousFriction(jnp.zeros(1)).reads_torque()


def test_effects_of_the_whole_mechanism_can_be_searched_for(clean_catalogue):
    class Wind(Effect):
        """Pushes all joints."""

        force: jax.Array

        name: ClassVar[str] = "wind"
        sentence: ClassVar[str] = "the wind pushes all joints alike"
        parameters: ClassVar = {"force": Parameter("N", -10.0, 10.0, "the force")}
        linear: ClassVar[bool] = True
        whole: ClassVar[bool] = True

        def torque(self, q, qd, tau):
            return self.force + 0.0 * q

    register(Wind)
    assert "wind" in searched()
    effect = placed(Wind, Wind.variants(SCALE)[0], 0, JOINTS)
    assert isinstance(effect, Wind)
    check_fits(effect, JOINTS)
    assert effect.torque(Q, QD, TAU).shape == (JOINTS,)


def test_variants_with_names_that_are_not_there_are_refused(clean_catalogue):
    class Odd(Effect):
        pull: jax.Array

        name: ClassVar[str] = "odd"
        sentence: ClassVar[str] = "an odd pull"
        parameters: ClassVar = {"pull": Parameter("N", 0.0, 1.0, "the pull")}

        @classmethod
        def variants(cls, scale):
            return [Variant({"pull": 0.1}, ("push",))]

    with pytest.raises(EffectError, match="variants of odd with free among pull; got push"):
        register(Odd)


def test_a_field_that_hides_a_method_of_every_effect_is_refused(clean_catalogue):
    class Late(Effect):
        start: jax.Array

        name: ClassVar[str] = "late"
        sentence: ClassVar[str] = "a late pull"
        parameters: ClassVar = {"start": Parameter("s", 0.0, 1.0, "when it begins")}

    with pytest.raises(EffectError, match=r"start, which every effect has as a method; rename"):
        register(Late)


@pytest.mark.parametrize("typical", [0.0, 20.0, 250.0])
def test_a_limit_is_looked_for_as_far_down_as_the_usual_command(typical):
    """A controller that winds up asks for many times what the motor can give."""
    scale = SCALE._replace(torque=700.0, typical=typical)
    variants = fx.TorqueSaturation.variants(scale)
    limits = sorted(variant.values["limit"] for variant in variants)
    assert max(limits) == pytest.approx(0.93 * 700.0)
    assert min(limits) == pytest.approx(0.2 * 700.0) if typical != 20.0 else min(limits) < 30.0
    low, high = variants[0].within["limit"]
    assert low < min(limits)
    assert high == 700.0
    assert (np.diff(np.log(limits)) < 0.4).all()
