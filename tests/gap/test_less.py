"""Friction that is less than the model's, or less than it was."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl import gap, report
from jaxidl.effects import (
    CoulombFriction,
    OnJoint,
    Payload,
    QuadraticDrag,
    SensorDelay,
    Spring,
    ViscousFriction,
    added_to,
)
from jaxidl.errors import EffectError
from jaxidl.gap.benchmark.catalogue import make
from jaxidl.gap.benchmark.engine import run
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.gap.choice import objections
from jaxidl.gap.choice.objections import BOUND, UNSURE, brief
from jaxidl.gap.evidence.gram import Item
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.evidence.shape import present, shapes_of
from jaxidl.gap.fit import values
from jaxidl.gap.fit.held_out import wald
from jaxidl.gap.fit.score import Solution
from jaxidl.systems.export import patched, write_patched
from jaxidl.systems.mjcf import read_model
from tests.gap.test_physical import SCALE

PENDULUM = MECHANISMS["pendulum"]
TOO_MUCH = PENDULUM.replace("<joint ", '<joint damping="0.5" frictionloss="0.6" ')


def measured(viscous, dry, seed):
    """A log of the pendulum with friction."""
    effects = [
        make("viscous_friction", 0, {"coefficient": viscous}),
        make("coulomb_friction", 0, {"level": dry}),
    ]
    columns = run(PENDULUM, effects, seed).log()
    return gap.from_arrays(*(columns[name] for name in ("time", "q0", "tau0")))


@pytest.mark.slow
def test_less_friction_than_the_model_has_is_named_and_handed_out(tmp_path):
    (tmp_path / "model.xml").write_text(TOO_MUCH)
    found = gap.diagnose(measured(0.2, 0.15, 5), tmp_path / "model.xml")
    values = {f.name: next(iter(f.parameters.values())).value for f in found.findings if f.sure}
    assert values == {
        "viscous_friction": pytest.approx(-0.3, abs=0.02),
        "coulomb_friction": pytest.approx(-0.45, abs=0.02),
    }
    assert found.gap.after.torque_relative[0] < 0.2 * found.gap.before.torque_relative[0]
    assert found.gap.after.rollout_rms["0.5"][0] < 0.2 * found.gap.before.rollout_rms["0.5"][0]
    assert found.summary.startswith("The simulation has too much of 2 effects.")
    assert "below zero: less than the model has" in " ".join(report.table(found).split())
    page = report.save(found, tmp_path / "out").read_text()
    assert "Below zero: less than the model has." in page
    viscous, dry = read_model(tmp_path / "out" / "model.xml").plant.effects
    assert float(viscous.effect.coefficient[0]) == pytest.approx(0.2, abs=0.02)
    assert float(dry.effect.level[0]) == pytest.approx(0.15, abs=0.02)


@pytest.mark.slow
def test_friction_that_fell_between_two_logs_is_named(tmp_path):
    (tmp_path / "model.xml").write_text(PENDULUM)
    found = gap.diagnose(
        measured(0.3, 0.2, 7),
        tmp_path / "model.xml",
        reference=measured(0.3, 0.5, 6),
        rollouts=False,
    )
    (change,) = (f for f in found.findings if f.sure)
    assert change.name == "coulomb_friction"
    assert change.parameters["level"].value == pytest.approx(-0.3, abs=0.02)


def on_joint(effect):
    return OnJoint(effect, 0, 1)


def test_what_a_model_has_and_a_change_of_it_are_one_effect():
    own = [on_joint(CoulombFriction(jnp.array([0.5]))), ViscousFriction(jnp.array([1.0]))]
    less = added_to(own, on_joint(CoulombFriction(jnp.array([-0.2]))))
    np.testing.assert_allclose(less.effect.level, [0.3])
    other = on_joint(ViscousFriction(jnp.array([-0.2])))
    assert added_to(own, other) is other  # the model's is one of the whole mechanism


def test_two_springs_are_one_and_none_is_left_where_one_takes_the_other_away():
    spring = lambda k, rest: Spring(jnp.array([k]), jnp.array([rest]))
    both = spring(3.0, 0.2).plus(spring(1.0, 1.0))
    q, still = jnp.array([0.7]), jnp.zeros(1)
    apart = sum(s.torque(q, still, still) for s in (spring(3.0, 0.2), spring(1.0, 1.0)))
    np.testing.assert_allclose(both.torque(q, still, still), apart)
    left = added_to([on_joint(spring(3.0, 0.2))], on_joint(spring(-3.0 * (1.0 - 1e-9), 0.21)))
    np.testing.assert_array_equal(left.effect.stiffness, [0.0])
    left.check()


def test_a_change_that_mjcf_cannot_hold_is_written_into_what_it_changes(tmp_path):
    (tmp_path / "model.xml").write_text(PENDULUM)
    drag = lambda size: on_joint(QuadraticDrag(jnp.array([size])))
    write_patched(read_model(tmp_path / "model.xml"), [drag(0.5)], tmp_path / "own")
    model = read_model(tmp_path / "own" / "model.xml")
    text, record = patched(model, [drag(-0.2)])
    (only,) = record["effects"]
    assert only["parameters"]["coefficient"]["value"] == pytest.approx(0.3)
    (tmp_path / "model.xml").write_text(text)
    (tmp_path / "effects.json").write_text(json.dumps(record))
    (left,) = read_model(tmp_path / "model.xml").plant.effects
    np.testing.assert_allclose(left.effect.coefficient, [0.3])
    with pytest.raises(EffectError, match="in \\[0"):
        patched(model, [drag(-0.6)])


def test_what_is_on_a_bound_goes_before_what_was_judged_beside_it(tmp_path, monkeypatch):
    """Even if that is weaker, as dry friction is here."""
    (tmp_path / "model.xml").write_text(TOO_MUCH)
    real = objections.objection

    def objection(score, now, m, *rest):
        there = {o.group[0] for o in now.members}
        if m.group[0] == "viscous_friction":
            return BOUND
        if m.group[0] == "coulomb_friction" and "viscous_friction" in there:
            return "it is wrong"
        return real(score, now, m, *rest)

    monkeypatch.setattr(objections, "objection", objection)
    only = ["viscous_friction", "coulomb_friction"]
    found = gap.diagnose(
        measured(0.2, 0.5, 5), tmp_path / "model.xml", effects=only, rollouts=False
    )
    assert [f.name for f in found.findings] == ["coulomb_friction"]


@pytest.mark.slow
def test_of_several_that_the_whole_log_does_not_confirm_the_weakest_goes_first(
    tmp_path, monkeypatch
):
    """One that is wrong widens the errors of the others, which are right without it."""
    (tmp_path / "model.xml").write_text(TOO_MUCH)
    real = objections.unconfirmed
    asked = []

    def unconfirmed(value, own):
        asked.append(value.key[0])
        return "it is wrong" if asked.count("viscous_friction") == 1 else real(value, own)

    monkeypatch.setattr(objections, "unconfirmed", unconfirmed)
    found = gap.diagnose(measured(0.2, 0.5, 5), tmp_path / "model.xml", rollouts=False)
    # dry friction explains less than viscous friction here, and others may take its place
    names = {f.name for f in found.findings}
    assert "viscous_friction" in names
    assert "coulomb_friction" not in names
    assert ("coulomb_friction", 0, "it is wrong") in [
        (r.name, r.joint, r.reason) for r in found.rivals
    ]


@pytest.mark.slow
def test_nothing_takes_the_place_of_what_the_whole_log_does_not_confirm(tmp_path, monkeypatch):
    """Other kinds of friction would imitate it."""
    (tmp_path / "model.xml").write_text(TOO_MUCH)
    real, why = objections.unconfirmed, UNSURE

    def unconfirmed(value, own):
        return why if value.key[0] == "coulomb_friction" else real(value, own)

    monkeypatch.setattr(objections, "unconfirmed", unconfirmed)
    named = lambda: {
        f.name
        for f in gap.diagnose(
            measured(0.2, 0.5, 5), tmp_path / "model.xml", rollouts=False
        ).findings
    }
    assert named() == {"viscous_friction"}
    why = "it is wrong"
    assert len(named()) > 1


@pytest.mark.slow
def test_what_only_seems_wrong_since_another_has_gone_is_judged_again(tmp_path, monkeypatch):
    """Without what went, the others explain it as well as they can, and look wrong."""
    (tmp_path / "model.xml").write_text(TOO_MUCH)
    real, asked = objections.unconfirmed, []

    def unconfirmed(value, own):
        asked.append(value.key[0])
        first = value.key[0] == "coulomb_friction" and asked.count("coulomb_friction") == 1
        then = value.key[0] == "viscous_friction" and asked.count("viscous_friction") == 2
        return "it is wrong" if first or then else real(value, own)

    monkeypatch.setattr(objections, "unconfirmed", unconfirmed)
    found = gap.diagnose(measured(0.2, 0.5, 5), tmp_path / "model.xml", rollouts=False)
    assert asked.count("viscous_friction") > 2
    assert "viscous_friction" in {f.name for f in found.findings}
    dropped = {r.name for r in found.rivals if r.reason == "it is wrong"}
    assert dropped == {"coulomb_friction"}


@pytest.mark.parametrize("coupled", [False, True])
def test_several_coefficients_are_judged_together(coupled):
    """Each of two that only their sum is known of may be zero, but not both."""
    known = np.array([[1.0, -0.99], [-0.99, 1.0]]) if coupled else np.eye(2)
    assert (wald(np.array([1.0, 1.0]), known) > 2.0) == coupled


def test_what_is_on_a_bound_in_the_whole_log_is_not_named(tmp_path, monkeypatch):
    (tmp_path / "model.xml").write_text(PENDULUM)
    effects = [
        make("viscous_friction", 0, {"coefficient": 0.6}),
        make("torque_ripple", 0, {"amplitude": 0.3, "period": 0.6, "phase": 0.4}),
    ]
    columns = run(PENDULUM, effects, 4).log()
    log = gap.from_arrays(*(columns[name] for name in ("time", "q0", "tau0")))
    options = {"effects": ["viscous_friction", "torque_ripple"], "rollouts": False}
    found = gap.diagnose(log, tmp_path / "model.xml", **options)
    assert {f.name for f in found.findings} == {"viscous_friction", "torque_ripple"}
    monkeypatch.setattr(values, "on_bound", lambda shape, theta: True)
    found = gap.diagnose(log, tmp_path / "model.xml", **options)
    assert [f.name for f in found.findings] == ["viscous_friction"]  # has no shape
    assert ("torque_ripple", 0, BOUND) in [(r.name, r.joint, r.reason) for r in found.rivals]


def test_friction_that_was_not_there_cannot_have_become_less():
    """A load can: the old log's may be called otherwise."""
    had = present((on_joint(CoulombFriction(jnp.array([0.5]))),))
    lower = lambda cls, own: shapes_of(cls, SCALE, own, changed=True)[0].limits()[0]
    assert (lower(CoulombFriction, present(())) == 0.0).all()
    np.testing.assert_allclose(lower(CoulombFriction, had), -0.5)
    assert np.isneginf(lower(Payload, present(()))).any()


@pytest.mark.parametrize(
    ("samples", "back", "short"), [(1.2, 0.0, True), (3, 1.5, True), (3, 0, False)]
)
def test_a_delay_counts_from_a_sampling_interval_on(samples, back, short):
    """Less the part that torques which seem to be logged early cancel."""
    (shape, *_) = shapes_of(SensorDelay, SCALE)
    shape = shape._replace(values={"delay": np.array(samples * SCALE.dt)})
    one, column = np.ones(1), np.ones((1, 8, 1))
    late = Item(("sensor_delay", 0, ""), shape, (0,), column, -one, 2.0 * one, 0.0, 0.0 * one)
    early = replace(late, group=(ALIGNMENT, 0, ""), shape=None, always=True)
    x = np.array([1.0, -back * SCALE.dt])
    found = Solution((late, early), x, np.stack([x, x]), np.ones((2, 1)), one, 0.0)
    assert brief(found, late, SCALE.dt) is short
