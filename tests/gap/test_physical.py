"""Fits stay physical: bounds hold, friction dissipates and links can exist.

And effects beside those they contain.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.effects import (
    CATALOGUE,
    AsymmetricFriction,
    CoulombFriction,
    InertiaError,
    Payload,
    Scale,
    register,
)
from jaxidl.effects.transmission import MOTOR
from jaxidl.gap import from_arrays
from jaxidl.gap.choice.find import find, reread, seen_anew
from jaxidl.gap.choice.objections import blamed, objection
from jaxidl.gap.evidence.items import beside, items_of
from jaxidl.gap.evidence.links import change_of, links_of, physical, pseudo_inertia
from jaxidl.gap.evidence.rows import kept_rows, rms, rows_of
from jaxidl.gap.evidence.shape import acts_on_predicted, reads_load, shapes_of
from jaxidl.gap.fit.consistent import PLACES, buildable, consistent, dissipating
from jaxidl.gap.fit.library import (
    heavier,
    library,
    load_of,
    pushed,
    residual,
    scales,
    upsampled,
)
from jaxidl.gap.fit.prior import plausible
from jaxidl.gap.fit.shapes import fitted
from jaxidl.gap.fit.values import values
from jaxidl.logs.signals import prepare
from jaxidl.systems.tables import inverse_dynamics
from tests.helpers.effects import Worm

DT, STEPS = 2e-3, 6000
SCALE = Scale(
    torque=30.0, speed=2.0, lower=-0.3, upper=0.9, inertia=2.0, residual=1.5, band=40.0, dt=2e-3
)


def best(gram, right, lower=-np.inf, upper=np.inf, unequal=(), cones=(), least=0.0):
    p = len(right)
    bounds = (np.broadcast_to(float(x), p) for x in (lower, upper))
    conditions = np.array(unequal, float).reshape(-1, p)
    return consistent(
        gram, right, *bounds, conditions, np.full(len(conditions), float(least)), cones
    )


def test_no_rotor_takes_more_inertia_than_moves():
    (rotor, *_) = InertiaError.variants(SCALE._replace(free=0.3))
    assert rotor.within["extra"] == (-0.3, np.inf)
    (rotor, *_) = InertiaError.variants(SCALE)  # nobody knows how much moves
    assert rotor.within["extra"][0] == InertiaError.parameters["extra"].lower


# the conic program


def test_without_conditions_it_is_least_squares_and_bounds_hold():
    x = np.random.default_rng(0).normal(size=(50, 3))
    gram, right = x.T @ x, x.T @ (x @ [1.0, -2.0, 3.0])
    np.testing.assert_allclose(best(gram, right), [1.0, -2.0, 3.0], atol=1e-6)
    bounded = best(gram, right, -1.0, 2.0)
    assert bounded.min() == pytest.approx(-1.0, abs=1e-6)
    assert bounded.max() == pytest.approx(2.0, abs=1e-6)


def test_friction_that_would_drive_is_cut_to_what_dissipates():
    """The fit wants two levels of +2 and -1, but their sum acts alone somewhere and may not be
    negative.
    """
    found = best(np.eye(2), np.array([1.0, -2.0]), unequal=[[1.0, 0.0], [1.0, 1.0]])
    np.testing.assert_allclose(found, [1.5, -1.5], atol=1e-6)
    # where the model has a friction of 0.5 already, the sum may be as much less
    less = best(np.eye(2), np.array([1.0, -2.0]), unequal=[[1.0, 0.0], [1.0, 1.0]], least=-0.5)
    np.testing.assert_allclose(less, [1.25, -1.75], atol=1e-6)


def test_an_impossible_inertia_becomes_a_possible_one():
    """The fit wants to take more mass from a link than it has."""
    nominal = np.array([2.0, 0.1, 0.0, 0.2, 0.05, 0.06, 0.04, 0.0, 0.0, 0.0])
    base, slopes = pseudo_inertia(nominal), pseudo_inertia(np.eye(10))
    wanted = np.zeros(10)
    wanted[0] = -2.5
    change = best(np.eye(10), wanted, cones=[(base, slopes)])
    least = np.linalg.eigvalsh(pseudo_inertia(nominal + change))[0]
    assert -1e-6 < least < 1e-3  # at the border
    assert -2.0 < change[0] < -1.5
    assert physical(nominal)
    assert not physical(nominal + wanted)
    small = 0.04 * wanted  # what a link can lose is left alone
    np.testing.assert_allclose(best(np.eye(10), small, cones=[(base, slopes)]), small, atol=1e-5)


def test_it_is_found_in_any_units_and_beside_bounds_that_are_far_away():
    nominal = np.array([2.6, 0.05, 0.0, 0.36, 0.08, 0.08, 0.01, 0.0, 0.0, 0.0])
    base, slopes = pseudo_inertia(nominal), pseudo_inertia(np.eye(10)[4:])
    wanted = np.array([0.5, -0.4, 0.5, 0.0, 0.0, 0.0])
    near = best(np.eye(6), wanted, cones=[(base, slopes)])
    for size in (1e-3, 1e3):
        gram = size**2 * np.eye(6)
        far = best(gram, gram @ wanted, -1e4, 1e6, cones=[(base, slopes)])
        np.testing.assert_allclose(far, near, atol=2e-3)


def test_conditions_that_nothing_fulfils_are_reported():
    assert best(np.eye(1), np.ones(1), 0.0, 1.0, unequal=[[-1.0]]) == pytest.approx(0.0, abs=1e-6)
    assert (
        consistent(
            np.eye(1), np.ones(1), np.ones(1), 2 * np.ones(1), -np.ones((1, 1)), np.zeros(1), ()
        )
        is None
    )


# links


def test_a_load_changes_the_last_link_and_nothing_else(two_link):
    links = links_of(two_link.plant.body)
    change = change_of(Payload(jnp.array(0.5), jnp.array([0.1, 0.0, -0.2])), links)
    np.testing.assert_array_equal(change[:-1], 0.0)
    np.testing.assert_allclose(change[-1, :4], [0.5, 0.05, 0.0, -0.1])
    np.testing.assert_allclose(change[-1, 4:], 0.5 * np.array([0.04, 0.05, 0.01, 0.0, 0.02, 0.0]))
    assert physical(links.nominal).all()
    np.testing.assert_allclose(links.nominal[:2, 0], [1.5, 1.0])
    assert physical(np.zeros((1, 10))).all()  # nothing is no contradiction


# an effect beside its parts


def test_beside_its_parts_an_effect_is_what_is_special_about_it():
    """Friction by direction beside plain friction and an offset: nothing of the dry part is left,
    and half of the viscous part.
    """
    rng = np.random.default_rng(0)
    qd = rng.normal(size=(400, 1))
    up, down = np.where(qd > 0.0, qd, 0.0), np.where(qd < 0.0, qd, 0.0)
    shapes = {s.free: s for s in shapes_of(AsymmetricFriction, SCALE)}
    shape, columns = beside(
        shapes["viscous_positive", "viscous_negative"],
        np.stack([up, down]),
        [("viscous_friction", qd)],
    )
    assert columns.shape == (1, 400, 1)
    np.testing.assert_allclose(
        shape.basis, [[np.sqrt(0.5)], [-np.sqrt(0.5)]] * np.sign(shape.basis[0]), atol=1e-12
    )
    np.testing.assert_allclose(columns[0], shape.basis[0, 0] * up + shape.basis[1, 0] * down)
    np.testing.assert_allclose(dict(shape.parts)["viscous_friction"], [1.0, 1.0])
    made = shape.at(np.array([2.0])).effect
    np.testing.assert_allclose(made.viscous_positive, -made.viscous_negative)
    plus, minus = 1.0 * (qd > 0.0), -1.0 * (qd < 0.0)
    dry = shapes["positive", "negative"]
    _, nothing = beside(
        dry,
        np.stack([plus, minus]),
        [("coulomb_friction", np.sign(qd)), ("constant_offset", 0.0 * qd + 1.0)],
    )
    assert nothing.shape == (0, 400, 1)
    other = rng.normal(size=(400, 1))  # what it cannot imitate is no part of it
    same, columns = beside(dry, np.stack([plus, minus]), [("another", other)])
    assert (same, len(columns)) == (dry, 2)


# on a log


def swung(tau_of, shift=0.0, noise=1e-6):
    """A log of the two links on a smooth path. Its torques are a function of the motion."""
    t = DT * np.arange(STEPS)
    f = np.array([[0.31, 0.83, 1.7], [0.47, 1.1, 2.3]])
    size, phase = np.array([0.5, 0.2, 0.06]), np.array([[0.0, 1.0, 2.0], [0.5, 2.5, 1.0]])
    angle = 2.0 * np.pi * f * t[:, None, None] + phase
    q = np.sum(size * np.sin(angle), 2)
    late = 2.0 * np.pi * f * (t[:, None, None] - shift) + phase  # of the torque
    w = 2.0 * np.pi * f
    state = (
        np.sum(size * w**k * s(late), 2)
        for k, s in enumerate((np.sin, np.cos, lambda x: -np.sin(x)))
    )
    noise = noise * np.random.default_rng(0).normal(size=q.shape)
    return t, q + noise, tau_of(*state)


def found_in(two_link, log, names):
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    return rows, find(library(rows, names, {}), 0.05)


def needed(two_link, q, qd, qdd):
    return inverse_dynamics(two_link.plant.body, q, qd, qdd)


def test_where_within_a_sample_a_torque_acts_is_no_finding(two_link):
    """The torques are logged half a sampling interval late.

    That is the logger's convention: it is fitted, and never named.
    """
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)), 0.5 * DT, 1e-8)
    rows, found = found_in(
        two_link, log, ("viscous_friction", "coulomb_friction", "actuator_delay", "sensor_delay")
    )
    assert found.named == ()
    left = residual(found.library.rows, found.solution)
    assert rms(left, rows.used)[1] < 0.05 * rms(rows.gap, rows.used)[1]


def test_columns_of_shapes_side_by_side_are_those_of_each_alone(two_link):
    """A rotor acts on its own joint, a heavier link on the joints below, too.

    One program for both must not cut the columns of one to the size of the other.
    """
    signals = prepare(
        from_arrays(*swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))),
        two_link.plant.body,
    )
    rows = rows_of(signals)
    for name in ("inertia_error", "com_error", "position_bias", "stribeck_friction"):
        shapes = shapes_of(CATALOGUE[name], scales(rows)[1])
        together = items_of(shapes, rows, rows.tau)
        for one in together:
            (alone,) = items_of([one.shape], rows, rows.tau)
            assert alone.joints == one.joints, one.group
            np.testing.assert_allclose(
                one.columns, alone.columns, rtol=1e-9, atol=1e-12 * np.abs(alone.columns).max()
            )
        if name == "inertia_error":
            assert {i.group[2]: i.joints for i in together} == {"extra": (1,), "mass": (0, 1)}


def test_a_place_that_the_filter_blurs_forbids_no_friction(two_link):
    """Filtered, friction under load seems to feed motion at one place; no coefficient could."""
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    wave = np.sign(rows.signals.qd[rows.signals.rows, 0])
    blurred = np.flatnonzero(rows.used[:, 0])
    blurred = blurred[np.abs(rows.signals.qd[rows.signals.rows, 0][blurred]).argmax()]
    wave[blurred] *= -1e-3
    (one,) = (
        replace(i, columns=wave[None, :, None])
        for i in items_of(shapes_of(CATALOGUE["coulomb_friction"], scales(rows)[0]), rows, rows.tau)
    )
    any_sign = replace(one, lower=np.full(1, -np.inf))
    for item, count in ((one, PLACES - 1), (any_sign, PLACES)):
        unequal, least = dissipating([item], rows)
        assert len(unequal) == len(least) == count
    assert np.all(dissipating([one], rows)[0] > 0.0)


def test_where_ties_are_sought_effects_read_the_predicted_command(
    two_link,
):
    """Elsewhere they do not: a command that is predicted well would explain itself."""
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    lib = library(rows, ("viscous_friction", "load_dependent_friction"), {})
    before = lib.score
    torque = 3.0 * lib.predicted
    rows = lib.rows._replace(unloaded=3.0 * lib.rows.unloaded)
    assert seen_anew(before, before.solve([]), rows, torque, acts_on_predicted) is before
    after = seen_anew(before, before.solve([]), rows, torque, reads_load)
    for old, new in zip(
        *(sorted(s.items, key=lambda i: str(i.group)) for s in (before, after)), strict=True
    ):
        factor = 3.0 if old.key[0] == "load_dependent_friction" else 1.0
        moving = rows.used[:, list(old.joints)]
        np.testing.assert_allclose(
            new.columns[0][moving], factor * old.columns[0][moving], rtol=1e-6
        )


def test_the_load_is_what_the_motor_delivers(two_link):
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)) / 0.8)
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    score = library(rows, ("torque_scale",), {}).score
    found = score.solve([i for i in score.items if i.actuates])
    command = (rows.command - residual(rows, found))[rows.used]
    load = load_of(rows, found)[rows.signals.rows][rows.used]
    np.testing.assert_allclose(load, 0.8 * command, atol=0.01 * np.abs(command).max())
    nothing = score.solve([])
    np.testing.assert_allclose(load_of(rows, nothing), upsampled(rows, rows.command - rows.gap))


def test_a_set_reads_the_load_that_it_predicts_itself(two_link):
    """Not that of the envelope, nor of a larger set."""
    share = 0.4

    def command(q, qd, qdd):
        rigid = np.asarray(needed(two_link, q, qd, qdd))
        rotor = np.asarray(two_link.plant.body.armature) * qdd
        behind = rigid - rotor  # tau - share |tau - rotor| sign = rigid
        return rotor + behind / (1.0 - share * np.tanh(behind * qd / 1e-3))

    rows = rows_of(prepare(from_arrays(*swung(command)), two_link.plant.body))
    score = library(rows, ("load_dependent_friction",), {}).score
    before = score.solve(score.items)
    after = reread(score, before, rows)[1]
    reading = lambda found: [m for m in found.members if m.key[0] == "load_dependent_friction"]
    assert len(reading(after)) == 2
    fresh = items_of([m.shape for m in reading(after)], rows, load_of(rows, after))
    for new, m in zip(fresh, reading(after), strict=True):
        moving = rows.used[:, list(m.joints)]
        size = np.abs(m.columns[0][moving]).max()
        np.testing.assert_allclose(new.columns[0][moving], m.columns[0][moving], atol=5e-3 * size)
    wrong = lambda found: max(abs(found.x[found.of(m)][0] - share) for m in reading(found))
    assert wrong(after) < 0.02 < wrong(before)
    nothing = score.solve([])
    assert reread(score, nothing, rows) == (score, nothing)


def test_between_rows_of_any_distance_a_command_is_smooth(two_link):
    """Joints at rest add single rows between the regular ones."""
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    kept = np.unique([*range(0, len(rows.command), 4), 33, 202])
    few = rows._replace(
        used=np.ones_like(rows.used[kept]),
        command=rows.command[kept],
        signals=rows.signals._replace(rows=rows.signals.rows[kept]),
    )
    between = rows.signals.rows[: kept[-1]]
    got, wanted = upsampled(few, few.command)[between], rows.command[: kept[-1]]
    straight = np.stack([np.interp(between, few.signals.rows, c) for c in few.command.T], 1)
    assert np.abs(got - wanted).max() < 0.1 * np.abs(straight - wanted).max()


def test_deaf_is_where_more_command_held_delivers_no_more(two_link):
    """So it is at a limit.

    It is not so where a share of the command arrives, where it is late, or through play.
    """
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))
    signals = prepare(from_arrays(*log), two_link.plant.body)
    rows = rows_of(signals)
    (limit,) = np.quantile(np.abs(rows.command[rows.used[:, 0], 0]), [0.7])
    for name, given, most, least in (
        ("torque_saturation", {"limit": limit}, 0.4, 0.2),
        ("torque_scale", {"scale": 0.6}, 0.0, 0.0),
        ("actuator_delay", {"delay": 0.03}, 0.05, 0.0),
        ("backlash", {"gap": 0.02}, 0.15, 0.0),
    ):
        shape = shapes_of(CATALOGUE[name], scales(rows)[0])[0]
        shape = shape._replace(
            values={**shape.values, **{k: np.asarray(v) for k, v in given.items()}}
        )
        (found,) = pushed(items_of([shape], rows, rows.tau), rows, rows.tau)
        assert least <= found.deaf[0, 0] <= most, name


def test_an_effect_of_a_users_that_reads_the_torque_is_found_with_its_size(
    two_link, clean_catalogue
):
    """It reads the torque that the model predicts with it.

    With the one predicted without it, its share would be wrong.
    """
    register(Worm)
    share = np.array([0.3, 0.0])

    def tau_of(q, qd, qdd):
        net = np.asarray(needed(two_link, q, qd, qdd))
        drive = np.tanh(qd / 1e-3)  # tau - share |tau| drive = net
        return net / (1.0 - share * drive * np.sign(net))

    rows, found = found_in(
        two_link, swung(tau_of), ("viscous_friction", "coulomb_friction", "worm")
    )
    (m,) = found.named
    assert m.key == ("worm", 0)
    (value,) = values(found.score, found.score.solve([m]), rows, found.predicted)
    assert value.parameters["share"][0][0] == pytest.approx(0.3, rel=0.03)
    assert isinstance(value.effect.effect, Worm)


def test_dry_friction_is_found_from_any_start_and_keeps_its_bounds(two_link):
    log = swung(
        lambda q, qd, qdd: (
            np.asarray(needed(two_link, q, qd, qdd)) + np.array([0.4, 0.2]) * np.tanh(qd / 1e-3)
        )
    )
    rows, found = found_in(two_link, log, ("viscous_friction", "coulomb_friction", "spring"))
    assert {m.key for m in found.named} == {("coulomb_friction", 0), ("coulomb_friction", 1)}
    fitted = {v.key: v for v in values(found.score, found.solution, rows, found.predicted)}
    for j, level in enumerate((0.4, 0.2)):
        value, stderr = fitted["coulomb_friction", j].parameters["level"]
        assert value[0] == pytest.approx(level, rel=0.02)
        assert 0.0 < stderr[0] < 0.05 * level
        assert isinstance(fitted["coulomb_friction", j].effect.effect, CoulombFriction)


def test_two_laws_that_bend_opposite_ways_are_no_finding_where_a_straight_one_does(two_link):
    rub = lambda qd: np.array([0.4, 0.2]) * np.tanh(qd / 1e-3) + np.array([0.5, 0.0]) * qd
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)) + rub(qd))
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    names = ("viscous_friction", "coulomb_friction", "quadratic_drag", "sublinear_friction")
    lib = library(rows, names, {})
    by = {i.key: i for i in lib.score.items if not i.always}
    aligned = [i for i in lib.score.items if i.always]
    bent = [by[name, 0] for name in ("quadratic_drag", "sublinear_friction", "coulomb_friction")]
    now = lib.score.solve([*aligned, *bent, by["coulomb_friction", 1]])
    straight = lib.score.solve(
        [*aligned, by["viscous_friction", 0], bent[-1], by["coulomb_friction", 1]]
    )
    assert now.error[:, 0].sum() < 1.1 * straight.error[:, 0].sum()  # they explain as much
    for m in bent[:2]:  # and neither can go
        without = lib.score.solve([o for o in now.members if o is not m])
        assert without.error[:, 0].sum() > 3.0 * now.error[:, 0].sum()
    assert objection(lib.score, now, bent[0], 0.05, lib.rows)
    assert not objection(lib.score, straight, by["viscous_friction", 0], 0.05, lib.rows)


def test_beside_friction_that_bends_one_way_none_that_bends_the_other_is_an_equal(two_link):
    """Viscous friction and a bend are the sum of drag and another bend."""
    speed = 3.0
    bend = lambda s: -0.6 * (6.0 * s * (s - 1.0) + 1.0)
    level = lambda qd: 1.0 + 0.8 * np.abs(qd) + bend(np.minimum(np.abs(qd) / speed, 1.0))
    rub = lambda qd: np.array([1.0, 0.0]) * level(qd) * np.tanh(qd / 1e-3)
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)) + rub(qd))
    names = ("viscous_friction", "coulomb_friction", "quadratic_drag", "sublinear_friction")
    _, found = found_in(two_link, log, names)
    named = {m.key for m in found.named}
    assert named == {(n, 0) for n in names if n != "quadratic_drag"}
    assert not any("quadratic_drag" in {g[0] for g in tie.instead} for tie in found.ties)


def test_the_rest_of_a_spring_takes_up_an_offset(two_link):
    """Beside an offset any rest fits as well, and both would be reported."""
    pull = lambda q: np.array([1.5, 0.0]) * (q - 0.7)
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)) + pull(q))
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    lib = library(rows, ("spring", "constant_offset"), {})
    item = lambda name: next(i for i in lib.score.items if i.key == (name, 0))
    both = lib.score.solve([item("spring"), item("constant_offset")])
    fresh = fitted(item("spring"), both, rows, lib.predicted, lib.score)
    assert float(fresh.shape.values["rest"]) == pytest.approx(0.7, abs=0.02)


def test_tables_over_position_end_where_the_fitted_rows_do(two_link):
    """Beyond, in held-out rows, nothing determines them; there they are constant."""
    clean = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))
    rows = rows_of(prepare(from_arrays(*clean), two_link.plant.body))
    q = rows.signals.q.copy()
    q[rows.signals.rows[~rows.training]] += 1.0
    further = rows._replace(signals=rows.signals._replace(q=q))
    ends = lambda rows: [(s.lower, s.upper) for s in scales(rows)]
    assert ends(further) == ends(rows)
    assert ends(rows)[0][1] < clean[1][:, 0].max() + 0.01


def test_the_end_of_a_log_is_fitted_if_it_reaches_further_than_the_rest(two_link):
    clean = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))
    signals = prepare(from_arrays(*clean), two_link.plant.body)
    count = len(signals.rows)
    fitted = kept_rows(signals, 0.3)
    assert not fitted[int(0.75 * count) :].any()
    q = signals.q.copy()
    q[signals.rows[int(0.7 * count)] :, 1] += 1.0
    further = kept_rows(signals._replace(q=q), 0.3)
    assert 0.6 < further[int(0.75 * count) :].mean() < 0.8
    assert further.mean() == pytest.approx(0.7, abs=0.03)


def test_a_drive_may_carry_the_rotor_that_the_model_lacks(two_link):
    """The inertia of a joint is that of the model and of what all common effects add to it."""
    rotor = np.array([0.0, 2.5])
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)) + rotor * qdd)
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    lib = library(rows, ("inertia_error", "coulomb_friction", "joint_elasticity"), {})
    before = scales(rows)
    after = heavier(before, lib.envelope, rows)
    added = [b.inertia - a.inertia for a, b in zip(before, after, strict=True)]
    np.testing.assert_allclose(added, rotor, atol=0.02 * rotor[1])
    (most,) = {
        i.shape.within["motor_inertia"][1]
        for i in lib.score.items
        if i.key == ("joint_elasticity", 1)
    }
    assert most == pytest.approx(MOTOR[1] * after[1].inertia, rel=1e-3)


def test_a_lag_holds_back_what_has_the_residuals_spectrum_not_what_has_the_commands(two_link):
    """Otherwise smoothing the noise on a logged torque would count as explaining the motion."""
    # dry friction reverses: the command stands out of its noise at all frequencies
    dry = lambda qd: np.array([3.0, 0.3]) * np.sign(qd)
    clean = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)) + dry(qd))
    noise = np.random.default_rng(0).normal(size=clean[2].shape) * clean[2].std(0)
    rows = rows_of(
        prepare(from_arrays(clean[0], clean[1], clean[2] + 0.02 * noise), two_link.plant.body)
    )
    shape = shapes_of(CATALOGUE["actuator_lag"], scales(rows)[0])[0]
    shape = shape._replace(values={"time_constant": np.asarray(0.03)})
    (lag,) = pushed(items_of([shape], rows, clean[2]), rows, clean[2])
    left = [
        np.sum(((way - held[0]) ** 2)[rows.used[:, 0]]) / np.sum((way**2)[rows.used[:, 0]])
        for way, held in zip(*lag.push, strict=True)
    ]
    assert left[0] > 0.8
    assert left[1] < 0.5


def test_a_load_may_be_as_heavy_as_the_robot_and_no_part_of_it_is_free(two_link):
    signals = prepare(
        from_arrays(*swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))),
        two_link.plant.body,
    )
    rows, links = rows_of(signals), links_of(two_link.plant.body)
    scale = scales(rows)[0]
    (load,) = items_of(shapes_of(CATALOGUE["payload"], scale), rows, rows.tau)
    assert (load.precision == 0.0).all()
    sure = plausible(load, links, 1.0).precision
    assert (sure > 0.0).all()
    assert 1.0 / np.sqrt(sure[0]) == pytest.approx(links.nominal[:-1, 0].sum(), rel=0.5)


def test_only_a_tensor_that_is_free_by_itself_has_to_be_that_of_a_body(two_link):
    """A tensor that follows a moment to first order may be that of no body; its mass may not."""
    rows = rows_of(
        prepare(
            from_arrays(*swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))),
            two_link.plant.body,
        )
    )
    links = links_of(two_link.plant.body)

    def cone(name):
        i = items_of(shapes_of(CATALOGUE[name], scales(rows)[1]), rows, rows.tau)[-1]
        ((base, slopes),) = buildable([i], links, ())
        return base, slopes

    base, slopes = cone("com_error")
    np.testing.assert_array_equal(base, links.nominal[1, 0] * np.eye(4))
    np.testing.assert_array_equal(slopes, 0.0)
    base, slopes = cone("inertia_tensor_error")
    np.testing.assert_array_equal(base, pseudo_inertia(links.nominal[1]))
    assert np.any(slopes)


def test_joints_that_hardly_move_together_are_apart(two_link):
    t, q, tau = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)))
    together = scales(rows_of(prepare(from_arrays(t, q, tau), two_link.plant.body)))
    assert [s.apart for s in together] == [(), ()]
    half = np.arange(len(t))[:, None] < len(t) // 2
    still = np.where(half == np.array([True, False]), q, q[len(t) // 2])
    in_turn = scales(rows_of(prepare(from_arrays(t, still, tau), two_link.plant.body)))
    assert [s.apart for s in in_turn] == [(1,), (0,)]
    assert [s.neighbours() for s in (*together, *in_turn)] == [[1], [0], [], []]


def test_the_rare_one_of_two_that_replace_each_other_is_blamed(two_link):
    """A rotor is not needed beside a link's inertia tensor: the tensor goes, not the rotor."""
    rotor = np.array([0.0, 2.5])
    log = swung(lambda q, qd, qdd: np.asarray(needed(two_link, q, qd, qdd)) + rotor * qdd)
    rows = rows_of(prepare(from_arrays(*log), two_link.plant.body))
    lib = library(rows, ("inertia_error", "inertia_tensor_error"), {})
    place = {i.group: i for i in lib.score.items}
    own, tensor = place["inertia_error", 1, "extra"], place["inertia_tensor_error", 1, "tensor"]
    always = [i for i in lib.score.items if i.always]
    now = lib.score.solve([*always, own, tensor])
    assert tensor.odds < own.odds
    assert blamed(lib.score, now, own) is tensor
    assert blamed(lib.score, now, tensor) is tensor
    # alone it has only itself to blame
    assert blamed(lib.score, lib.score.solve([*always, own]), own) is own
