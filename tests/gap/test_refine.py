"""Parameters fitted to trajectories: found from wrong starts, kept only where motion kept aside is
followed more closely.
"""

import json
import sys
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl import gap
from jaxidl.cli import main
from jaxidl.effects import (
    ActuatorDelay,
    AsymmetricFriction,
    CoulombFriction,
    OnJoint,
    PositionBias,
    Spring,
    ViscousFriction,
)
from jaxidl.errors import ConfigurationError
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.gap.evidence.rows import instants_of, kept_rows
from jaxidl.gap.fit.refine import _starts, _tied, refine
from jaxidl.logs.log import from_arrays
from jaxidl.logs.signals import prepare
from jaxidl.replay.rollout import windows_at
from jaxidl.replay.trajectory import WindowFit, window_errors, window_slopes
from jaxidl.report import table
from jaxidl.systems import Plant
from jaxidl.systems.free import Free
from jaxidl.types import State

DT, STEPS, NOISE = 2e-3, 6000, 1e-5
TRUE = {"viscous_friction": 0.25, "coulomb_friction": 0.3, "actuator_delay": 0.013}
SLIDING = ("viscous_friction", "coulomb_friction")  # without hidden states: fast
FREE = ({"coefficient": (0.0, 10.0)}, {"level": (0.0, 10.0)}, {"delay": (0.0, 0.1)})
LENGTH = 200  # steps of a window, as refine has it: one program
WRONG = (1.25, 0.75, 1.3)


def effects(*factors):
    """Viscous and dry friction and a dead time, each a factor off."""
    viscous, dry, delay = (
        jnp.array([f * x]) for f, x in zip(factors or (1.0, 1.0, 1.0), TRUE.values(), strict=True)
    )
    found = ViscousFriction(viscous), CoulombFriction(dry), ActuatorDelay(delay, steps=20)
    return tuple(OnJoint(effect, 0, 1) for effect in found)


def values(found):
    return [float(jax.tree.leaves(effect)[0][0]) for effect in found]


def moved(plant, start=0.3):
    """Log of a plant with one joint under a rich torque; from the plant's own steps, so its
    parameters are exact.
    """
    t = DT * np.arange(STEPS)
    tones = [(1.6, 0.31, 0.0), (1.3, 0.73, 1.0), (0.9, 1.7, 2.0), (0.5, 3.1, 0.5)]
    tau = sum(a * np.sin(2.0 * np.pi * f * t + phase) for a, f, phase in tones)[:, None]

    @jax.jit
    def simulate(tau):
        def step(carry, command):
            return plant.step(*carry, command, DT, implicit=True), carry[0].q

        q = jnp.array([start])
        return jax.lax.scan(step, (State(q, jnp.zeros(1)), plant.start(q)), tau)[1]

    q = np.asarray(simulate(jnp.asarray(tau)))
    return from_arrays(t, q + NOISE * np.random.default_rng(0).standard_normal(q.shape), tau)


@pytest.fixture(scope="module")
def signals(pendulum):
    log = moved(Plant(pendulum.plant.body, effects()))
    return prepare(log, pendulum.plant.body)


@pytest.fixture(scope="module")
def problem(pendulum, signals):
    """The windows of training, at parameters that are off."""
    return _problem(pendulum, signals, effects(*WRONG))


def _problem(pendulum, signals, found=None, free=FREE):
    starts = _starts(signals, instants_of(signals, kept_rows(signals, 0.3)), LENGTH)
    return WindowFit(
        Free(Plant(pendulum.plant.body, found or effects()), free), signals, starts, LENGTH
    )


@pytest.mark.slow
def test_parameters_a_quarter_off_are_found_again(pendulum, signals):
    found = refine(pendulum.plant, effects(*WRONG), signals, FREE)
    assert found.accepted
    np.testing.assert_allclose(values(found.effects), list(TRUE.values()), rtol=0.01)
    for truth, refined, stderr in zip(TRUE.values(), found.refined, found.stderr, strict=True):
        (name,) = refined
        assert abs(refined[name][0] - truth) < 4.0 * stderr[name][0] < 0.02 * truth
    assert found.after.score < 0.1 * found.before.score
    assert found.after.torque_rms[0] < 0.5 * found.before.torque_rms[0]
    assert found.after.rollout_rms["0.5"][0] < 0.1 * found.before.rollout_rms["0.5"][0]
    assert found.effects[2].effect.steps == 20


@pytest.mark.slow
def test_right_parameters_are_left_alone(pendulum, signals):
    right = effects()
    found = refine(pendulum.plant, right, signals, FREE)
    assert not found.accepted
    assert found.effects == right
    assert found.after.score > 0.8 * found.before.score  # less only by fitting noise
    np.testing.assert_allclose(
        [next(iter(v.values()))[0] for v in found.refined], list(TRUE.values()), rtol=0.01
    )


@pytest.mark.slow
def test_parameters_stay_within_their_bounds(pendulum, signals):
    bounds = ({"coefficient": (0.0, 10.0)}, {"level": (0.0, 0.27)}, {"delay": (0.0145, 0.1)})
    found = refine(pendulum.plant, effects(*WRONG), signals, bounds)
    assert found.accepted
    _, level, delay = values(found.effects)
    assert 0.2699 < level <= 0.27
    assert 0.0145 <= delay < 0.01451


def test_what_encoders_do_is_undone_and_not_fitted(pendulum, signals):
    shifted = signals._replace(q=signals.q + 0.2)
    bias = OnJoint(PositionBias(jnp.array([0.2])), 0, 1)
    seen = shifted.behind((bias, *effects()))
    np.testing.assert_allclose(seen.q, signals.q, atol=1e-12)
    np.testing.assert_allclose(seen.qd, signals.qd, atol=1e-9)
    found = refine(pendulum.plant, (bias,), shifted, ({"bias": (-1.0, 1.0)},))
    assert (found.accepted, found.reason, found.refined) == (
        False,
        "there is no parameter to refine",
        ({},),
    )


def test_what_two_effects_share_stays_with_the_simpler_one(pendulum, signals, problem):
    """Plain friction and friction by direction: no motion shows which of the two the common
    part belongs to.
    """
    uneven = OnJoint(AsymmetricFriction(*(jnp.array([x]) for x in (0.3, 0.3, 0.01, -0.01))), 0, 1)
    either = ("viscous_positive", "viscous_negative")
    free = (*FREE, dict.fromkeys(either, (-1.0, 1.0)))
    body = pendulum.plant.body
    (row,) = _tied(Free(Plant(body, (*effects(), uneven)), free), signals)
    np.testing.assert_allclose(row, np.array([0.0, 0.0, 0.0, 1.0, 1.0]) / np.sqrt(2.0), atol=1e-9)
    # nothing has the common part
    assert _tied(Free(Plant(body, (effects()[1], uneven)), (FREE[1], free[3])), signals) == []
    fixed = ({}, *free[1:])
    # what has it is not fitted
    assert _tied(Free(Plant(body, (*effects(), uneven)), fixed), signals) == []
    tied = WindowFit(
        Free(problem.plant, FREE), signals, problem.starts, LENGTH, [np.array([1.0, 1.0, 0.0])]
    )
    step = (
        tied.residual(tied.start + np.array([0.01, -0.01, 0.0]))[-1],
        tied.residual(tied.start + 0.01)[-1],
    )
    assert abs(step[0]) < 1e-9 < 1e-2 < step[1]
    np.testing.assert_allclose(tied.slopes(tied.start)[-1] * 0.01 @ np.ones(3), step[1])


@pytest.mark.slow
def test_forward_reverse_and_numeric_derivatives_agree(problem):
    theta, options = problem.start, problem.options
    of = lambda x: window_errors(x, problem.plant, problem.windows, problem.span, **options)[0]
    forward = window_slopes(theta, problem.plant, problem.windows, problem.span, **options)
    error, pull = jax.vjp(of, jnp.asarray(theta))
    (reverse,) = jax.jit(pull)(error)
    np.testing.assert_allclose(np.einsum("wkj,wkjp->p", error, forward), reverse, rtol=1e-9)
    for p, h in enumerate(1e-6 * theta):
        up, down = (of(theta + side * h * np.eye(len(theta))[p]) for side in (1.0, -1.0))
        size = float(jnp.abs(forward[..., p]).max())
        np.testing.assert_allclose((up - down) / (2.0 * h), forward[..., p], atol=1e-5 * size)


def test_a_window_that_runs_away_counts_as_an_error_and_spoils_no_derivative(problem):
    broken = jax.tree.map(np.copy, problem.windows)
    broken.tau[2] = 1e300  # not finite after a few steps
    broken.tau[4] = 300.0  # finite, but far away
    arguments = problem.start, problem.plant
    error, lost = window_errors(*arguments, broken, problem.span, **problem.options)
    slopes = window_slopes(*arguments, broken, problem.span, **problem.options)
    well = window_slopes(*arguments, problem.windows, problem.span, **problem.options)
    assert np.flatnonzero(lost).tolist() == [2, 4]
    np.testing.assert_array_equal(error[lost], np.broadcast_to(problem.span, error[lost].shape))
    np.testing.assert_array_equal(slopes[lost], 0.0)
    np.testing.assert_allclose(slopes[~lost], well[~lost], rtol=1e-9, atol=1e-12)


def test_a_start_from_which_everything_diverges_is_reported(pendulum, signals):
    # a stiffer spring than steps of this length can simulate
    spring = OnJoint(Spring(jnp.array([1e6]), jnp.zeros(1)), 0, 1)
    unstable, free = (spring, *effects()[1:]), ({"stiffness": (0.0, 1e6)}, *FREE[1:])
    found = refine(pendulum.plant, unstable, signals, free)
    assert not found.accepted
    assert "diverges" in found.reason
    assert found.effects == unstable
    at = _problem(pendulum, signals, unstable, free)
    assert at.hopeless
    assert np.isfinite(at.residual(at.start)).all()
    np.testing.assert_array_equal(at.slopes(at.start), 0.0)


def test_windows_lie_wholly_on_their_side(signals):
    rows = np.arange(STEPS) % 1000 < 700
    for side in (rows, ~rows):
        starts = _starts(signals, side, LENGTH)
        assert np.diff(starts).min() >= LENGTH
        for window in windows_at(signals._replace(q=side[:, None] * 1.0), starts, 0, LENGTH).q:
            assert window.all()


def test_nothing_to_fit_and_too_few_windows_are_reported(pendulum, signals):
    nothing = refine(pendulum.plant, effects(), signals, ({}, {}, {}))
    assert (nothing.accepted, nothing.reason) == (False, "there is no parameter to refine")
    short = refine(pendulum.plant, effects(), signals, FREE, window=2.0)
    assert (short.accepted, short.before) == (False, None)
    assert "fewer than 8 windows" in short.reason


@pytest.mark.parametrize(
    ("bounds", "window", "words"),
    [
        ({"stiffness": (0.0, 1.0)}, 0.4, "spring.stiffness in"),
        ({"stiffness": (0.0, 9.0)}, 0.01, "10 samples"),
    ],
)
def test_wrong_bounds_and_windows_are_explained(pendulum, signals, bounds, window, words):
    spring = OnJoint(Spring(jnp.array([2.0]), jnp.array([0.0])), 0, 1)
    with pytest.raises(ConfigurationError, match=words):
        refine(pendulum.plant, (spring,), signals, (bounds,), window=window)


@pytest.fixture(scope="module")
def commanded(tmp_path_factory):
    """``jaxidl gap --refine`` on the pendulum's log: its folder, and the diagnosis before it was
    refined.
    """
    folder = tmp_path_factory.mktemp("command")
    (folder / "model.xml").write_text(MECHANISMS["pendulum"])
    log = moved(Plant(gap.read_model(folder / "model.xml").plant.body, effects()[:2]))
    np.savez(folder / "log.npz", allow_pickle=False, time=log.time, q=log.q, tau=log.tau)
    made = []

    def kept(*arguments, **options):
        made.append(gap.diagnose(*arguments, **options))
        return made[-1]

    words = [
        "gap",
        str(folder / "log.npz"),
        "--model",
        str(folder / "model.xml"),
        "--out",
        str(folder / "out"),
        "--refine",
    ]
    # MuJoCo's code is not as strict as this suite
    with pytest.MonkeyPatch.context() as patch, jax.numpy_rank_promotion("allow"):
        patch.setattr(sys.modules["jaxidl.gap.workflow"], "diagnose", kept)
        main([*words, "--effects", *SLIDING])
    return folder / "out", made[0]


@pytest.mark.slow
def test_command_line_fits_to_motion_and_reports_it(commanded):
    folder, _ = commanded
    report = json.loads((folder / "report.json").read_text())
    record, patch = report["refined"], json.loads((folder / "effects.json").read_text())["effects"]
    assert {e["effect"] for e in record["effects"]} == set(SLIDING)
    assert record["windows"]["training"] > record["windows"]["held_out"] > 8
    assert (
        {"score", "lost", "torque_rms", "rollout_rms"}
        == set(record["before"])
        == set(record["after"])
    )
    for refined, found, written in zip(record["effects"], report["effects"], patch, strict=True):
        ((name, values),) = refined["parameters"].items()
        assert set(values) == {"unit", "before", "after", "stderr"}
        assert values["after"] == pytest.approx(TRUE[refined["effect"]], rel=0.01)
        kept = values["after" if record["accepted"] else "before"]
        assert found["parameters"][name]["value"] == written["parameters"][name]["value"] == kept
    assert record["reason"] in (folder / "report.html").read_text()


@pytest.mark.slow
def test_a_diagnosis_is_refined_on_demand_and_says_so(commanded):
    _, found = commanded
    assert "refined" not in found.to_dict()
    assert "fitted to motion" not in table(found)
    wrong = replace(
        found,
        findings=tuple(
            replace(f, effect=jax.tree.map(lambda x: 0.8 * x, f.effect)) for f in found.findings
        ),
    )
    with jax.numpy_rank_promotion("allow"):  # the programs of the command
        refined = wrong.refined()
    before, after = refined.refinement.before, refined.refinement.after
    assert refined.refinement.accepted
    assert after.score < 0.2 * before.score
    assert (refined.gap.after.torque_rms, refined.gap.after.rollout_rms) == (
        after.torque_rms,
        after.rollout_rms,
    )
    assert refined.plant.effects == refined.refinement.effects
    for f in refined.findings:
        (parameter,) = f.parameters.values()
        assert parameter.value == pytest.approx(TRUE[f.name], rel=0.01)
    assert wrong.refinement is None
    assert "accepted, the simulation follows" in table(refined)
    assert refined.to_dict()["refined"]["accepted"]


@pytest.mark.slow
def test_a_diagnosis_without_its_signals_cannot_be_refined(commanded):
    with pytest.raises(ConfigurationError, match="signals"):
        replace(commanded[1], signals=None).refined()
