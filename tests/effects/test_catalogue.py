"""Every effect of the catalogue is described, bounded, stored and differentiable."""

import json
from dataclasses import fields

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import jaxidl.effects as fx
from jaxidl.effects import CATALOGUE, Scale, from_dict
from jaxidl.errors import EffectError
from jaxidl.paper.effects import PaperFriction, paper_stiction
from jaxidl.systems import Plant, PointMass
from jaxidl.types import State
from tests.helpers.effects import DT, EXAMPLES, MASS, SINGLE, TURNING, WRAPPED, pair
from tests.helpers.numeric import compare

SLIDING = State(pair(0.113, 0.312), pair(1.1, -0.9))  # away from every kink
PUSH = pair(3.1, -4.2)


def of(table):
    return pytest.mark.parametrize("effect", table.values(), ids=table.keys())


def test_every_effect_of_the_catalogue_is_described_and_exemplified():
    assert EXAMPLES.keys() - {PaperFriction.name} == CATALOGUE.keys()
    assert set(fx.searched()) == CATALOGUE.keys() - {
        "sensing_noise",
        "encoder_quantisation",
    }
    jargon = (
        "nonlinear",
        "stribeck",
        "coulomb",
        "backlash",
        "hysteresis",
        "stiction",
        "parameter",
        "qd",
        "_",
    )
    for name, cls in CATALOGUE.items():
        assert cls.name == name
        assert len(cls.sentence.split()) > 4
        assert not any(word in cls.sentence.lower() for word in jargon)
        assert list(cls.parameters) == [
            f.name for f in fields(cls) if f.metadata.get("pytree_node", True)
        ], name
        assert set(cls.mjcf) <= set(cls.parameters)
        for spec in cls.parameters.values():
            assert spec.unit
            assert spec.meaning
            assert spec.lower < spec.upper


@of(EXAMPLES)
def test_parameters_out_of_bounds_are_named(effect):
    assert effect.check() is effect
    for key, spec in effect.parameters.items():
        just = np.nextafter([spec.lower, spec.upper], [-np.inf, np.inf])
        for bad in (np.nan, *just[np.isfinite(just)]):
            value = np.array(getattr(effect, key), float)
            value.flat[-1] = bad
            with pytest.raises(
                EffectError, match=rf"^expected {effect.name}\.{key} in \[.*got .*; set [^\n]*$"
            ):
                effect.replace(**{key: jnp.asarray(value)}).check()


@of({name: e for name, e in (EXAMPLES | WRAPPED).items() if name != PaperFriction.name})
def test_round_trip_through_a_dictionary(effect):
    record = json.loads(json.dumps(effect.to_dict(), allow_nan=False))
    again = from_dict(record)
    assert again.check() is again
    assert again.to_dict() == effect.to_dict()
    assert jax.tree.structure(again) == jax.tree.structure(effect)  # classes and static fields
    pairs = zip(jax.tree.leaves(again), jax.tree.leaves(effect), strict=True)
    assert all(a.shape == b.shape and (a == b).all() for a, b in pairs)


def test_effects_of_different_classes_or_joints_have_different_structures():
    structures = [jax.tree.structure(effect) for effect in (*EXAMPLES.values(), *WRAPPED.values())]
    assert all(
        (a == b) == (i == j) for i, a in enumerate(structures) for j, b in enumerate(structures)
    )


def test_infinity_survives_json():
    effect = fx.Stiction(pair(1.0, 2.0), pair(1e-3, 1e-3), pair(jnp.inf, 0.5))
    assert from_dict(json.loads(json.dumps(effect.to_dict(), allow_nan=False))).below.tolist() == [
        np.inf,
        0.5,
    ]


@pytest.mark.parametrize(
    ("record", "match"),
    [
        ({"effect": "magic"}, "viscous_friction"),
        ({"effect": "viscous_friction", "parameters": {"coefficient": {}}}, "to_dict"),
        ({"effect": "viscous_friction", "parameters": {}}, "no coefficient"),
        (paper_stiction(5.0).to_dict() | {"options": {"sign": True}}, "sign"),
        (WRAPPED["spring on joint 1"].to_dict() | {"joint": 2}, "joint"),
        (WRAPPED["spring on joint 1"].to_dict() | {"joint": -1}, "joint"),
    ],
)
def test_unknown_or_incomplete_records_are_refused(record, match):
    with pytest.raises(EffectError, match=match):
        from_dict(record)


@of(CATALOGUE)
def test_fits_begin_within_the_bounds(effect):
    scale = Scale(
        torque=30.0, speed=2.0, lower=-0.3, upper=0.9, inertia=2.0, residual=1.5, band=40.0, dt=2e-3
    )
    guesses = effect.guesses(scale)
    assert guesses
    for guess in guesses:
        assert guess.keys() == effect.parameters.keys()
        for key, value in guess.items():
            effect.parameters[key].check(key, value)


# --- derivatives: forward = reverse = numeric
# --------------------------------------------------------------------------------


def everything(effect, q, qd, tau, noise):
    """All that an effect does at an instant, and over 20 steps with its hidden state."""
    body = effect.alter(PointMass(MASS))
    along = jnp.linspace(0.0, 1.0, 20)[:, None]
    drive = (
        q[None] + 0.03 * along * qd[None],
        qd[None] * (1.0 + along),
        tau[None] * jnp.cos(3.0 * along),
    )

    def step(memory, now):
        delivered, memory = effect.actuate(memory, *now, DT)
        return memory, (delivered, effect.sense(memory, now[0] + DT * now[1], noise))

    memory, outputs = jax.lax.scan(step, effect.start(q), drive)
    instant = effect.torque(q, qd, tau), effect.dry(q, qd, tau, qd), effect.dry(q, qd, tau, tau)
    dynamics = (
        body.forward_dynamics(q, qd, tau),
        body.inverse_dynamics(q, qd, tau),
        body.mobility(q),
    )
    return ravel_pytree((instant, dynamics, memory, outputs, effect.true_position(drive[0], DT)))[0]


@of(
    EXAMPLES
    | {name: WRAPPED[name] for name in ("stribeck_friction on joint 1", "backlash on joint 1")}
)
def test_derivatives_of_every_method_forward_reverse_and_numeric_agree(effect):
    noise, zero = pair(0.6, -0.4), jnp.zeros(2)
    compare(everything, (effect, *SLIDING, PUSH), noise)
    # at rest, without torque, without anything
    for place in ((SLIDING.q, zero, PUSH), (*SLIDING, zero), (zero, zero, zero)):
        compare(everything, (effect, *place), noise, smooth=False)


def end_of_50_steps(effect, push):
    """Positions and readings after 50 steps under a swinging torque, of a plant that has the
    effect.
    """
    joints = push.shape[0]
    plant = Plant(PointMass(MASS[:joints]), (effect,))
    start = State(SLIDING.q[:joints], push / 4.0)

    def step(carry, swing):
        return plant.step(*carry, push * swing, DT), None

    (state, hidden), _ = jax.lax.scan(
        step, (start, plant.start(start.q)), jnp.cos(jnp.linspace(0.0, 2.0, 50))
    )
    return jnp.concatenate([state.q, plant.sense(hidden, state.q, jnp.full(joints, 0.3))])


@pytest.mark.slow
@of(
    {f"{name}, 1 axis": e for name, e in SINGLE.items()}
    | {f"{name}, 2 axes": e for name, e in EXAMPLES.items()}
)
def test_derivatives_through_50_steps_of_a_plant(effect, request):
    push = PUSH[: 1 if "1 axis" in request.node.name else 2]
    slopes = compare(end_of_50_steps, (effect,), push)
    # which only a joint at rest feels
    assert np.abs(slopes).max() > 0.0 or effect.name in ("stiction", *TURNING)
    # at rest; moving off; with kinks on the way
    for other in (0.0 * push, 1e-4 * push, -100.0 * push):
        compare(end_of_50_steps, (effect,), other, smooth=False)
