"""Sets of effects on made-up rows: the score against refits, the search, what may be named, and
confidence.
"""

from dataclasses import replace
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from jaxidl.effects import (
    AsymmetricFriction,
    ConstantOffset,
    CoulombFriction,
    CoupledJointFriction,
    DirectionalLoadFriction,
    Spring,
    StribeckFriction,
    TorqueCurve,
    TorqueRipple,
)
from jaxidl.gap.choice import estimates, rivals
from jaxidl.gap.choice.confidence import DRAWS, support
from jaxidl.gap.choice.find import outgrown
from jaxidl.gap.choice.objections import apart, nameable, objection, objections
from jaxidl.gap.choice.rivals import Contests, contested, tied
from jaxidl.gap.choice.search import REPLACED, replaced, search
from jaxidl.gap.evidence.gram import Anchor, Item
from jaxidl.gap.evidence.items import absorbed
from jaxidl.gap.evidence.noise import in_units_of_noise
from jaxidl.gap.evidence.projection import ALIGNMENT
from jaxidl.gap.evidence.rows import Rows
from jaxidl.gap.evidence.samples import correlation_time
from jaxidl.gap.evidence.shape import Shape
from jaxidl.gap.fit.bounded import bounded
from jaxidl.gap.fit.held_out import aside, gain, worse_by
from jaxidl.gap.fit.library import residual
from jaxidl.gap.fit.score import Score, unconnected
from jaxidl.gap.fit.torque_constants import SHARE, swayed
from jaxidl.gap.fit.values import Value, resampled, somewhere
from jaxidl.gap.result.findings import best_instead, cancelling, company_of, there

N, JOINTS, BLOCKS, DT = 1200, 2, 8, 1e-3
FAR = np.inf
SIGNALS = SimpleNamespace(
    dt=DT,
    interval=DT,
    band=100.0,
    noise_floor=np.zeros(JOINTS),
    body=None,
    qd=np.zeros((N, JOINTS)),
    rows=np.arange(N),
    rest_speed=np.ones(JOINTS),
)
SHAPES = {  # by number of amplitudes; what they are called does not matter here
    1: Shape(ConstantOffset, 0, JOINTS, ("offset",), {"offset": 0.0}, {}, {}),
    2: Shape(
        AsymmetricFriction,
        0,
        JOINTS,
        ("positive", "negative"),
        dict.fromkeys(AsymmetricFriction.parameters, 0.0),
        {},
        {},
    ),
}


def rows_with(gap, seed=0):
    """Rows of two joints, of which some of the second one do not count.

    The last quarter is held out, in three blocks.
    """
    rng = np.random.default_rng(seed)
    train = 3 * N // 4
    block = np.concatenate(
        [np.arange(train) * BLOCKS // train, -1 - np.arange(N - train) * 3 // (N - train)]
    )
    used = np.ones((N, JOINTS), bool)
    used[100:140:2, 1] = False
    command = rng.normal(0.0, 2.0, (N, JOINTS))
    floor, spread = np.full(JOINTS, 1e-3), np.ones(JOINTS)
    return Rows(gap, command, used, block, floor, spread, command, 0.0 * gap, 0.0 * gap, SIGNALS)  # type: ignore[arg-type]


def item(name, columns, joints=(0,), low=-FAR, high=FAR, **more):
    """An item of P columns (P, N, K), with prior odds one to one."""
    columns = np.asarray(columns, float).reshape(-1, N, len(joints))
    p = len(columns)
    options = {"precision": np.zeros(p), "odds": 0.0} | more
    bounds = np.broadcast_to(low, p).astype(float), np.broadcast_to(high, p).astype(float)
    shape = options.pop("shape", None) or SHAPES[p]
    return Item(
        (name, joints[0] if len(joints) == 1 else None, ""),
        shape,
        tuple(joints),
        columns,
        *bounds,
        **options,
    )


def score_of(rows, items, **more):
    return Score(rows, items, np.full(JOINTS, 0.5), np.full(JOINTS, 50.0), **more)


@pytest.fixture(scope="module")
def planted():
    """Items of one joint and of both. Three of them make the gap."""
    rng = np.random.default_rng(1)
    pool = [item(f"one{k}", rng.normal(size=(1, N, 1)), (k % 2,)) for k in range(8)]
    pool += [
        item("two", rng.normal(size=(2, N, 2)), (0, 1)),
        item("pair", rng.normal(size=(2, N, 1)), (1,)),
    ]
    # so alike that each looks right as long as the truth is not there
    pool.append(
        item(
            "alike",
            0.6 * pool[0].columns + 0.8 * pool[2].columns + 0.2 * rng.normal(size=(1, N, 1)),
        )
    )
    pool = [replace(i, odds=-2.0) for i in pool]
    truth = [pool[0], pool[2], pool[8]]
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    for m, x in zip(truth, ([1.0], [0.7], [0.5, -0.8]), strict=True):
        gap[:, list(m.joints)] += np.tensordot(x, m.columns, 1)
    rows = rows_with(gap)
    return rows, pool, truth, score_of(rows, pool)


def stacked(rows, members, fitted):
    """Design (M, P) and gap (M,) of the rows that count, joint after joint, where ``fitted``
    (N,).
    """
    width = sum(len(m.lower) for m in members)
    xs, ys = [], []
    for j in range(JOINTS):
        use, at = rows.used[:, j] & fitted, 0
        x = np.zeros((use.sum(), width))
        for m in members:
            if j in m.joints:
                x[:, at : at + len(m.lower)] = m.columns[:, use, m.joints.index(j)].T
            at += len(m.lower)
        xs.append(x)
        ys.append(rows.gap[use, j])
    return np.concatenate(xs), np.concatenate(ys)


# the score


def test_a_fitted_shape_replaces_those_that_would_be_scaled_too_far():
    rng = np.random.default_rng(7)
    spring = {"stiffness": 1.0, "rest": 0.0}
    column = rng.normal(size=(1, N, 1))
    at = lambda size: item(
        "spring",
        size * column,
        low=-2.0,
        high=2.0,
        shape=Shape(Spring, 0, JOINTS, (), spring, {}, {}),
    )
    fitted, near, far, turned = at(1.0), at(0.7), at(0.3), at(-0.3)
    other = item("other", rng.normal(size=(1, N, 1)))
    rows = rows_with(column[0] @ [[1.0, 0.0]] + 0.1 * rng.normal(size=(N, JOINTS)))
    score = score_of(rows, [near, far, turned, other, fitted])
    assert outgrown(score, [fitted, other]).items == [near, other, fitted]
    assert outgrown(score, [other]) is score


def test_when_a_torque_acts_is_known_no_worse_than_its_bounds_say():
    """In slow logs a shift of the torque looks like viscous friction of a joint with weight."""
    rng = np.random.default_rng(5)
    friction, other = rng.normal(size=(2, 1, N, 1))
    drag = item("friction", friction)
    shift = replace(
        item("shift", friction + 1e-3 * other, low=-1.5, high=0.5, always=True),
        group=(ALIGNMENT, 0, ""),
    )
    rows = rows_with(2.0 * friction[0] @ [[1.0, 0.0]] + 0.3 * rng.normal(size=(N, JOINTS)))
    errors = []
    for one in (shift, somewhere(shift, score_of(rows, [drag, shift]))):
        score = score_of(rows, [drag, one])
        found = score.solve([drag, one])
        errors.append(np.sqrt(np.diagonal(score.covariance(found))))
    assert np.all(errors[0] > 5.0)
    np.testing.assert_allclose(errors[1], 2.0 / np.sqrt(12.0), rtol=0.05)


def test_error_on_blocks_left_out_is_that_of_refits_by_brute_force(planted):
    rows, pool, _, score = planted
    found = score.solve([pool[0], pool[8], pool[9]])
    for b in range(BLOCKS):
        x, *_ = np.linalg.lstsq(
            *stacked(rows, found.members, rows.training & (rows.block != b)), rcond=None
        )
        np.testing.assert_allclose(found.folds[b], x, atol=1e-6)
        for j in range(JOINTS):
            only = rows._replace(used=rows.used & (np.arange(JOINTS) == j))
            left = stacked(only, found.members, rows.block == b)
            np.testing.assert_allclose(
                found.error[b, j], np.sum((left[1] - left[0] @ x) ** 2) / 0.5**2, rtol=1e-5
            )
    x, *_ = np.linalg.lstsq(*stacked(rows, found.members, rows.training), rcond=None)
    np.testing.assert_allclose(found.x, x, atol=1e-6)
    left = stacked(rows, found.members, ~rows.training)
    np.testing.assert_allclose(
        score.aside(found).sum(), np.sum((left[1] - left[0] @ x) ** 2) / 0.5**2, rtol=1e-5
    )
    mean = found.error.sum(0) / score.count[score.training].sum(0)
    assert found.value == pytest.approx(-25.0 * np.log(mean).sum() - 3 * 2.0)


def test_a_score_made_from_another_one_is_the_same(planted):
    """Some items stay, one goes, one is new and one has other columns.

    Matrices and solution are the same.
    """
    rows, pool, _, score = planted
    changed = replace(pool[2], columns=1.3 * pool[2].columns)
    items = [
        pool[9],
        changed,
        *pool[3:9],
        item("new", np.random.default_rng(3).normal(size=(2, N, 2)), (0, 1)),
    ]
    again, alone = (
        Score(rows, items, score.noise, score.effective, None, score),
        score_of(rows, items),
    )
    for one, other in zip((*again.gram, *again.right), (*alone.gram, *alone.right), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
    a, b = (s.solve([items[0], changed, items[-1]]) for s in (again, alone))
    np.testing.assert_allclose(a.x, b.x, rtol=1e-10)
    assert a.value == pytest.approx(b.value, rel=1e-12)


def test_parts_of_a_set_without_a_joint_in_common_are_solved_one_by_one(planted):
    rows, pool, truth, score = planted
    on_each = [m for m in pool if len(m.joints) == 1]
    assert [len(part) for part in unconnected(on_each)] == [5, 5]
    assert len(unconnected([*on_each, *truth])) == 1
    at_once, apiece = score_of(rows, pool)._solve(tuple(on_each)), score.solve(on_each)
    order = np.concatenate([np.arange(11)[at_once.of(m)] for m in apiece.members])
    np.testing.assert_allclose(apiece.x, at_once.x[order], rtol=1e-6)
    np.testing.assert_allclose(apiece.folds, at_once.folds[:, order], rtol=1e-5)
    np.testing.assert_allclose(apiece.error, at_once.error, rtol=1e-6)
    assert apiece.value == pytest.approx(at_once.value, rel=1e-6)
    everywhere, here = estimates.promise(score, on_each), estimates.promise(score, on_each, (0,))
    assert here == {id(i): everywhere[id(i)] for i in pool if 0 in i.joints and id(i) in everywhere}


def test_bounds_hold_as_in_a_bounded_fit(planted):
    rows, pool, _, _ = planted
    zero = np.zeros(2)
    tight = [
        replace(pool[0], upper=zero[:1] + 0.6),
        replace(pool[2], lower=zero[:1]),
        replace(pool[9], lower=zero),
    ]
    found = score_of(rows, tight).solve(tight)
    low, high = (
        np.concatenate([getattr(m, side) for m in found.members]) for side in ("lower", "upper")
    )
    best = lsq_linear(*stacked(rows, found.members, rows.training), bounds=(low, high))
    np.testing.assert_allclose(found.x, best.x, atol=1e-6)
    assert found.x[found.of(tight[0])][0] == 0.6
    assert np.all((found.folds >= low) & (found.folds <= high))


def test_a_bound_lets_go_what_it_need_not_hold():
    """Without bounds both are below zero; where one is held there, the other need not be."""
    rng = np.random.default_rng(4)
    first, other = rng.normal(size=(2, N))
    second = -0.9 * first + np.sqrt(1.0 - 0.9**2) * other
    rows = rows_with(np.stack([-first - 0.05 * second, np.zeros(N)], 1))
    low = np.zeros(1)
    pair = [item("first", first, low=low), item("second", second, low=low)]
    found = score_of(rows, pair).solve(pair)
    x, y = stacked(rows, found.members, rows.training)
    assert np.all(np.linalg.lstsq(x, y, rcond=None)[0] < 0.0)
    best = lsq_linear(x, y, bounds=(0.0, np.inf))
    assert best.x.max() > 0.5
    np.testing.assert_allclose(found.x, best.x, atol=1e-6)


@pytest.mark.parametrize("begin", [np.nan, -1.0, 0.0, 2.0], ids=["anywhere", "low", "in", "high"])
def test_bounds_are_the_best_ones_wherever_the_fit_begins(begin):
    rng, size = np.random.default_rng(4), 40
    for _ in range(20):
        x = rng.normal(size=(60, size)) + rng.normal(size=(60, 1))  # columns that are alike
        y = rng.normal(size=60)
        low, high = -0.05 * rng.integers(0, 2, size), 0.2 * rng.uniform(0.1, 1.0, size)
        dead, start = np.zeros(size, bool), np.clip(np.full(size, begin), low, high)
        found = bounded((x.T @ x)[None], (x.T @ y)[None], low, high, dead, start)[0]
        best = lsq_linear(x, y, bounds=(low, high), tol=1e-14)
        np.testing.assert_allclose(found, best.x, atol=1e-6)


def test_bounds_of_amplitudes_are_those_of_their_combinations():
    """Beside a part of it, only the difference of two amplitudes is left; it has their bounds."""
    apart = np.array([[1.0], [-1.0]]) / np.sqrt(2.0)
    within = dict.fromkeys(("driving", "driven"), (0.0, 0.6))
    values = dict.fromkeys(within, 0.0)
    shape = Shape(DirectionalLoadFriction, 0, 1, tuple(within), values, {}, within, basis=apart)
    np.testing.assert_allclose(shape.limits(), [[-0.6 / np.sqrt(2.0)], [0.6 / np.sqrt(2.0)]])
    free = shape._replace(within=dict.fromkeys(within, (0.0, np.inf)))
    np.testing.assert_array_equal(free.limits(), [[-np.inf], [np.inf]])
    alone = free._replace(basis=np.eye(2)[:, :1])
    np.testing.assert_array_equal(alone.limits(), [[0.0], [np.inf]])


def test_a_prior_on_coefficients_is_a_ridge(planted):
    rows, pool, _, _ = planted
    stiff = replace(pool[0], precision=np.array([900.0]))
    found = score_of(rows, [stiff]).solve([stiff])
    x, y = stacked(rows, [stiff], rows.training)
    np.testing.assert_allclose(found.x, x.T @ y / (x.T @ x + 900.0 * 0.5**2).ravel(), rtol=1e-6)


def test_standard_errors_are_the_scatter_where_neighbours_say_the_same():
    """Every 18 of the 900 samples are the same.

    Over logs that are drawn again, results scatter as the covariance says for 50 samples.
    """
    rng, alike = np.random.default_rng(5), 18
    drawn = lambda: np.repeat(rng.normal(size=N // alike + 1), alike)[:N]
    found, said = [], []
    for _ in range(200):
        x, y = drawn(), drawn()
        both = item("both", np.stack([x, x + 0.5 * y]), (0,))
        rows = rows_with(np.stack([0.7 * x + 0.3 * drawn(), np.zeros(N)], 1))
        score = score_of(rows, [both])
        solution = score.solve([both])
        found.append(solution.x)
        said.append(np.sqrt(np.diag(score.covariance(solution))))
    np.testing.assert_allclose(np.mean(said, 0), np.std(found, 0), rtol=0.2)


def test_an_unseen_parameter_is_as_uncertain_as_its_prior(planted):
    rows, pool, _, _ = planted
    unseen = replace(pool[1], columns=1e-9 * pool[1].columns, precision=np.array([2.0]))
    score = score_of(rows, [pool[0], unseen])
    solution = score.solve([pool[0], unseen])
    at = solution.of(unseen).start
    per = np.median(score.count[score.training].sum(0) / 50.0)  # samples that say as much as one
    assert np.sqrt(score.covariance(solution)[at, at]) == pytest.approx(
        np.sqrt(per / 2.0), rel=1e-3
    )


def test_an_effect_that_lets_little_of_the_command_through_explains_little():
    rng = np.random.default_rng(2)
    rows = rows_with(rng.normal(size=(N, JOINTS)))
    # a command that hardly arrives
    rows = rows._replace(gap=0.9 * rows.command + 0.1 * rng.normal(size=(N, JOINTS)))
    scale = item("scale", rows.command[None, :, :1])
    acting = replace(scale, actuates=True)
    plain, honest_score = (score_of(rows, [i]) for i in (scale, acting))
    plain, honest = plain.solve([scale]), honest_score.solve([acting])
    # of the command's amplitude, 2, an eighth arrives: (4 (u - 0.1)^2 + 0.01) / u^2 is least there,
    # the error relative to what arrives
    np.testing.assert_allclose(honest.passed, [1.0 / 8.0**2, 1.0], rtol=0.05)
    assert plain.error[:, 0].sum() < honest.error[:, 0].sum()
    mean = honest.error.sum(0) / honest_score.count[honest_score.training].sum(0) / honest.passed
    assert honest.value == pytest.approx(-25.0 * np.log(mean).sum(), rel=1e-3)  # but for the floor


def test_where_a_motor_lets_no_more_through_it_explains_nothing(planted):
    """In a quarter of the rows a little more command would deliver no more, as at a limit."""
    rows, pool, _, _ = planted
    acting = replace(pool[0], actuates=True)
    (x,) = score_of(rows, [acting]).solve([acting]).x
    held = np.zeros((1, 1, N, 1))
    held[0, 0, np.flatnonzero(rows.training)[::4], 0] = 1.0 / x
    push = np.ones((1, N, 1)), held
    deaf = np.array([[0.25 / abs(x)]])
    score = score_of(rows, [limited := replace(acting, push=push, deaf=deaf)])
    found = score.solve([limited])
    part = found.x[0] / x
    passed = 1.0 - 0.25 * part * (2.0 - part)  # all but that quarter
    np.testing.assert_allclose(found.passed, [passed, 1.0], rtol=1e-6)
    mean = found.error.sum(0) / score.count[score.training].sum(0)
    variance = np.var(rows.command[rows.training & rows.used[:, 0], 0]) / 0.5**2
    # any command explains the motion there
    heard = 1.0 - 0.25 * part
    joint = heard * np.log(mean[0] / passed) + (1.0 - heard) * np.log(variance)
    assert found.value == pytest.approx(-25.0 * (joint + np.log(mean[1])) - 2.0)


def test_a_quick_score_is_that_of_the_fit_to_all_blocks(planted):
    rows, pool, _, _ = planted
    # a motor's effect, an item within bounds, and parts without a joint in common
    motor = item("motor", 0.1 * rows.command[None, :, :1], (0,), actuates=True)
    bounded = item("bounded", pool[3].columns, (1,), low=0.0, high=0.1)
    for members in ([*pool[:4], pool[8]], [pool[0], pool[1]], [pool[0], pool[8], motor, bounded]):
        score = score_of(rows, [*pool, motor, bounded])
        found = score.solve(members)
        whole = score.likelihood(found.members, found.x)
        assert score.quick(members) == pytest.approx(whole, abs=1e-3)  # one step of dilution
        assert score.quick(members) > found.value  # no block was left out
        again = score.resampled(2.0 * np.ones(len(score.weights)))
        assert again.quick(members) == pytest.approx(score.quick(members))


def test_the_members_of_a_set_may_be_in_any_order(planted):
    """Those of another score are."""
    rows, pool, _, _ = planted
    motor = item("motor", 0.1 * rows.command[None, :, :1], (0,), actuates=True)
    score = score_of(rows, [*pool, motor])
    found = score.solve([pool[0], pool[8], motor])
    back = found.members[::-1]
    x = np.concatenate([found.x[found.of(m)] for m in back])
    expected = score.likelihood(found.members, found.x)
    assert score.likelihood(back, x) == pytest.approx(expected)


def test_an_anchor_makes_the_fit_that_of_both_logs_together(planted):
    rows, pool, _, _ = planted
    other = rows_with(rows.gap + np.random.default_rng(3).normal(size=(N, JOINTS)), seed=4)
    common = [replace(i, always=True) for i in (pool[0], pool[8])]
    there = score_of(other, common)
    first = there.solve(common)
    information = there.normal(first.members)[0].sum(0)
    new = rows._replace(gap=rows.gap - _made(common, first))
    anchor = Anchor(first.members, information, np.zeros(len(information)))
    here = score_of(new, [*common, pool[9]], anchor=anchor)
    found = here.solve([*common, pool[9]])
    x, y = (
        np.concatenate(parts)
        for parts in zip(
            stacked(rows, found.members, rows.training),
            _nothing(stacked(other, found.members, other.training), 1),
            strict=True,
        )
    )
    joint, *_ = np.linalg.lstsq(x, y, rcond=None)
    both = np.concatenate(
        [
            found.x[found.of(m)] + (first.x[first.of(m)] if m in common else 0.0)
            for m in found.members
        ]
    )
    np.testing.assert_allclose(both, joint, atol=1e-5)
    assert (
        np.abs(
            both - np.linalg.lstsq(*stacked(rows, found.members, rows.training), rcond=None)[0]
        ).max()
        > 1e-3
    )


def _made(members, found):
    out = np.zeros((N, JOINTS))
    for m in members:
        out[:, list(m.joints)] += np.tensordot(found.x[found.of(m)], m.columns, 1)
    return out


def _nothing(design, last):
    """The design of another log, which does not have the effects of the last item's two columns."""
    x, y = design
    return np.concatenate([x[:, :-2], 0.0 * x[:, -2:]], 1), y


def test_blocks_drawn_again_count_as_often_as_they_are_drawn(planted):
    rows, _, truth, score = planted
    weights = np.array([2.0, 0.0, 1.0, 1.0, 3.0, 0.0, 1.0, 0.0])
    found = score.resampled(weights).solve(truth)
    xs = [
        stacked(rows, found.members, rows.block == b)
        for b in np.repeat(np.arange(BLOCKS), weights.astype(int))
    ]
    x, *_ = np.linalg.lstsq(
        np.concatenate([x for x, _ in xs]), np.concatenate([y for _, y in xs]), rcond=None
    )
    np.testing.assert_allclose(found.x, x, atol=1e-6)
    assert score.solve(truth).value != found.value  # and nothing of it is remembered in the first


def test_samples_that_are_alike_count_for_less():
    rng = np.random.default_rng(0)
    white = rng.normal(size=20_000)
    slow = np.empty_like(white)
    slow[0] = 0.0
    for t in range(1, len(white)):
        slow[t] = 0.9 * slow[t - 1] + white[t]
    assert correlation_time(white) == pytest.approx(1.0, abs=0.2)
    # of a first-order process
    assert correlation_time(slow) == pytest.approx((1 + 0.9) / (1 - 0.9), rel=0.2)


# the search


def test_the_search_finds_what_was_planted_from_any_start(planted):
    _, pool, truth, score = planted
    for start in ([], pool, [pool[10]], [pool[10], pool[9]], truth[::-1]):
        assert set(search(score, start).members) == set(truth)


def test_one_takes_the_place_of_all_that_it_can_imitate():
    """Three columns cost less as one item. No exchange of one or two items shows it."""
    rng = np.random.default_rng(8)
    columns = rng.normal(size=(3, N, 1))
    parts = [item(f"part{k}", columns[k : k + 1], odds=-3.0) for k in range(3)]
    whole = item("whole", rng.normal(size=(3, 3)) @ columns[..., 0], odds=-8.0, shape=SHAPES[2])
    rows = rows_with(
        np.stack([columns[..., 0].sum(0), np.zeros(N)], 1) + 0.05 * rng.normal(size=(N, JOINTS))
    )
    score = score_of(rows, [*parts, whole])
    assert estimates.imitated(score, parts, whole) == parts
    assert estimates.imitated(score, [*parts[:2], whole], parts[2]) == []
    assert search(score, parts).members == (whole,)
    dear = replace(whole, odds=-10.0)
    assert set(search(score_of(rows, [*parts, dear]), [dear]).members) in ({dear}, set(parts))


def test_a_part_takes_the_place_of_the_whole_whatever_else_is_missing():
    """Others explain more and stand before it, so that only its being a part brings it up."""
    rng = np.random.default_rng(9)
    columns = rng.normal(size=(REPLACED + 3, N, 1))
    part = item("part", columns[:1], odds=-3.0)
    whole = item("whole", columns[:2], odds=-3.0, shape=SHAPES[2])
    others = [item(f"other{k}", c[None], odds=-3.0) for k, c in enumerate(columns[2:])]
    there = columns[0] + 5.0 * columns[2:].sum(0)
    rows = rows_with(np.concatenate([there, np.zeros((N, 1))], 1))
    score = score_of(rows, [part, whole, *others])
    moves = replaced(score, score.solve([whole]))
    assert (frozenset([whole]), frozenset([part])) in moves
    assert (frozenset([part]), frozenset([whole])) not in replaced(score, score.solve([part]))
    assert set(search(score, [whole]).members) == {part, *others}


def test_nothing_is_found_in_noise():
    rng = np.random.default_rng(5)
    pool = [item(f"one{k}", rng.normal(size=(1, N, 1)), (k % 2,), odds=-3.0) for k in range(20)]
    assert search(score_of(rows_with(rng.normal(size=(N, JOINTS))), pool), []).members == ()


def test_what_is_always_there_stays_and_is_no_finding(planted):
    rows, pool, truth, _ = planted
    clock = replace(pool[1], always=True)
    pool = [clock if i is pool[1] else i for i in pool]
    score = score_of(rows, pool)
    assert set(search(score, [clock]).members) == {*truth, clock}


# what may be named


def test_each_objection_is_raised_where_it_holds(planted):
    rows, pool, truth, score = planted
    now = score.solve(truth)
    assert [objection(score, now, m, 0.05, rows) for m in now.members] == [""] * 3
    assert objection(score, now, pool[2], 0.9, rows) == "it removes less than 90% of the error"
    # what is there in every second block, and the opposite in the others
    sign = np.where(rows.block % 2 == 0, 1.0, -0.9)
    other = rows._replace(gap=rows.gap + (sign * pool[3].columns[0, :, 0])[:, None] * [0.0, 1.0])
    swinging = score_of(other, pool)
    assert "exclude zero" in objection(
        swinging, swinging.solve([*truth, pool[3]]), pool[3], 0.05, other
    )
    bound = replace(pool[0], upper=np.array([0.4]))
    tight = score_of(rows, [bound, *truth[1:]])
    assert (
        objection(tight, tight.solve(tight.items), bound, 0.05, rows) == "its value is on a bound"
    )
    gap = rows.gap.copy()
    # the opposite, in the part kept aside
    gap[~rows.training, 0] -= 2.0 * pool[0].columns[0, ~rows.training, 0]
    other = rows._replace(gap=gap)
    turned = score_of(other, pool)
    then = turned.solve(truth)
    assert (
        objection(turned, then, pool[0], 0.05, other)
        == "held-out data are predicted better without it"
    )
    share, stderr = worse_by(other, turned.solve(truth[1:]), then, 0)
    assert share < -3.0 * stderr < 0.0
    once = rows.gap.copy()
    # in one block only, which is no scatter
    once[rows.block == -2, 0] -= 2.0 * pool[0].columns[0, rows.block == -2, 0]
    other = rows._replace(gap=once)
    odd = score_of(other, pool)
    assert objection(odd, odd.solve(truth), pool[0], 0.05, other) == ""


@pytest.mark.parametrize(("own", "refused"), [(0.0, True), (1.0, False)])
def test_rare_friction_of_two_joints_has_to_improve_on_common_friction_of_each(own, refused):
    """Two joints that always move together, with equal friction: one coefficient or two."""
    rng = np.random.default_rng(8)
    rest = dict.fromkeys(CoupledJointFriction.parameters, np.nan)  # which are not fitted
    level = lambda cls, j: Shape(cls, j, JOINTS, ("level",), rest | {"level": 0.0}, {}, {})
    dry = lambda j: item(f"dry{j}", rng.normal(size=(N, 1)), (j,), shape=level(CoulombFriction, j))
    common = [replace(dry(j), common=True, odds=-2.3) for j in range(JOINTS)]
    both = np.stack([i.columns[0, :, 0] for i in common], 1) + own * rng.normal(size=(N, JOINTS))
    coupled = item("coupled", both, (0, 1), shape=level(CoupledJointFriction, 0), odds=-3.0)
    rows = rows_with(coupled.columns[0] + 0.3 * rng.normal(size=(N, JOINTS)))
    score = score_of(rows, [*common, coupled])
    now = score.solve([coupled])
    assert now.value > score.solve(common).value
    assert bool(objection(score, now, coupled, 0.05, rows)) == refused


@pytest.mark.parametrize(("own", "named"), [(0.0, False), (1.0, True)], ids=["sum", "more"])
def test_common_effects_together_are_tried_for_a_rare_one(own, named):
    """One motor constant looks like the errors of several links at once."""
    rng = np.random.default_rng(4)
    links, other = rng.normal(size=(3, N, 1)), rng.normal(size=(N, 1))
    common = [item(f"link{k}", x, common=True, odds=-0.5) for k, x in enumerate(links)]
    rare = item("constant", links.sum(0) + own * other, odds=-6.0)
    gap = 0.1 * rng.normal(size=(N, JOINTS))
    gap[:, :1] += rare.columns[0]
    score = score_of(rows_with(gap), [*common, rare])
    assert search(score, [rare]).members == ((rare,) if named else tuple(common))


def test_a_joint_without_noise_and_command_has_a_residual_in_units_of_nothing():
    rows = rows_with(np.zeros((N, JOINTS)))._replace(spread=np.zeros(JOINTS))
    left = np.zeros((N, JOINTS))
    left[:, 0] = np.random.default_rng(0).normal(size=N)
    some, none = in_units_of_noise(rows, left, (0, 1))
    assert np.isfinite(some)
    assert some > 1e9
    assert none == 0.0


def test_an_offset_is_more_than_noise():
    rows, offset = rows_with(np.zeros((N, JOINTS))), np.ones((N, JOINTS))
    wave = np.sin(np.arange(N) * DT)[:, None] + 0.0 * offset
    slow, constant = (in_units_of_noise(rows, x, (0,))[0] for x in (wave[:, :1], offset[:, :1]))
    assert constant > 0.5 * slow > 0.0


@pytest.mark.parametrize(
    ("noise", "why"), [(0.0, ""), (0.1, "it only makes the encoder's noise smaller")]
)
def test_an_effect_that_only_makes_noise_smaller_is_not_named(noise, why):
    """It takes off what is at high frequencies and adds a little at low ones."""
    rng, t = np.random.default_rng(1), np.arange(N) * DT
    fast = np.sin(2.0 * np.pi * 90.0 * t + rng.normal(0.0, 0.1, N))
    gap = rng.normal(0.0, 1e-3, (N, JOINTS))
    gap[:, 0] += 0.1 * fast
    rows = rows_with(gap)
    rows = rows._replace(
        signals=SimpleNamespace(**(vars(SIGNALS) | {"noise_floor": np.full(JOINTS, noise)}))
    )
    smoothing = item("smoothing", fast + 0.2 * np.sin(2.0 * np.pi * 3.0 * t))
    score = score_of(rows, [smoothing])
    assert objection(score, score.solve([smoothing]), smoothing, 0.05, rows) == why


def test_what_may_not_be_named_goes_and_the_rest_is_fitted_anew(planted):
    rows, pool, truth, _ = planted
    bound = replace(pool[0], upper=np.array([0.4]))
    score = score_of(rows, [bound, *truth[1:]])
    now, narrowed, strong, weak = nameable(score, score.solve(score.items), rows, 0.05, {})
    assert strong == {bound.group: "its value is on a bound"}
    assert weak == {}
    assert set(now.members) == set(truth[1:])
    assert bound not in narrowed.items
    assert aside(rows, now, 0) > aside(rows, score.solve(score.items), 0)
    assert gain(score, score.solve(truth[1:]), score.solve(score.items))[0] > 0.05


def test_one_member_on_each_joint_goes_at_a_time():
    on = lambda *joints: item("", np.ones((1, N, len(joints))), joints)
    first, second, third, both = on(0), on(0), on(1), on(1, 2)
    found = [(1.0, first, ""), (2.0, second, ""), (3.0, third, ""), (4.0, both, "")]
    assert [worth for worth, _, _ in apart(found)] == [1.0, 3.0]
    assert [worth for worth, _, _ in apart(found[::-1])] == [4.0, 2.0]


def test_what_makes_too_little_goes_last_and_nothing_takes_its_place(planted):
    rows, pool, truth, _ = planted
    score = score_of(rows, pool)
    now, _, strong, weak = nameable(score, score.solve(truth), rows, 0.8, {})
    assert strong == {}
    assert set(weak.values()) == {"it removes less than 80% of the error"}
    assert set(now.members) < set(truth)


# quick estimates


def test_what_is_common_takes_the_place_of_rare_effects_that_make_too_little():
    rng = np.random.default_rng(3)
    columns, noise = rng.normal(size=(1, N, 1)), 0.3 * rng.normal(size=(3, 1, N, 1))
    friction = item("friction", columns, common=True, odds=2.0)
    rare = [item(f"rare{k}", columns + noise[k], odds=-2.0) for k in (0, 1)]
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, 0] = (columns + noise[2])[0, :, 0]
    rows = rows_with(gap)
    score = score_of(rows, [friction, *rare])
    now, _, _, weak = nameable(score, score.solve(rare), rows, 0.3, {})
    assert now.members == (friction,)
    assert all("less than" in why for why in weak.values())


def test_a_promise_is_what_an_item_is_worth_on_the_blocks_themselves(planted):
    rows, pool, truth, score = planted
    now = score.solve(truth[:2])
    promise = estimates.promise(score, now.members)
    assert not {id(m) for m in now.members} & promise.keys()
    held_out = now.error.sum(0)
    for i in (truth[2], pool[3], pool[9]):
        with_it, without = (
            np.array([_left(rows, members, j) for j in range(JOINTS)])
            for members in ([*truth[:2], i], truth[:2])
        )
        on = list(i.joints)
        gain = (without - with_it)[on].sum() / 0.5**2
        worth = (
            -25.0 * len(on) * np.log(1.0 - gain / held_out[on].sum()) - 0.5 * len(i.lower) + i.odds
        )
        assert promise[id(i)] == pytest.approx(worth, abs=0.05)
    assert max(promise, key=lambda k: promise[k]) == id(truth[2])


def _left(rows, members, joint):
    """Sum of squares on a joint of what a fit to all blocks of training leaves."""
    x, *_ = np.linalg.lstsq(*stacked(rows, members, rows.training), rcond=None)
    only = rows._replace(used=rows.used & (np.arange(JOINTS) == joint))
    design, gap = stacked(only, members, rows.training)
    return float(np.sum((gap - design @ x) ** 2))


def test_what_a_member_is_worth_is_estimated_without_a_fit(planted):
    _, pool, truth, score = planted
    now = score.solve([*truth, pool[3]])
    lost = estimates.lost(score, now)
    for m in now.members:
        exact = now.value - score.solve([o for o in now.members if o is not m]).value
        assert lost[id(m)] == pytest.approx(exact, abs=max(0.1 * abs(exact), 1.5))


def test_a_rare_event_is_spread_over_several_blocks(planted):
    rows, *_ = planted
    left = np.full((N, JOINTS), 0.1)
    left[200:230, 0] = 5.0
    evened = rows.evened(left)
    assert len(set(rows.block[200:230])) <= 2 < len(set(evened.block[200:230]))
    assert np.array_equal(evened.training, rows.training)
    assert np.array_equal(evened.block[~rows.training], rows.block[~rows.training])
    assert np.all(np.diff(evened.block[rows.training]) >= 0)
    flat = rows.evened(np.full((N, JOINTS), 0.1))
    assert np.all(np.abs(np.bincount(flat.block[flat.training]) - flat.training.sum() / 16) < 2)
    assert (rows.whole().block >= 0).all()


def test_what_was_removed_beside_others_comes_back_once_those_are_gone():
    """A common one is on its bound beside a rare one, which does too much and is on its own."""
    rng = np.random.default_rng(12)
    cause, more = rng.normal(size=(2, N, 1))
    common = item("common", cause, low=-0.1, high=2.0, odds=2.0, common=True)
    rare = item("rare", 4.0 * cause + 3.0 * more, low=0.3, high=0.3, odds=-2.0)
    gap = 0.1 * rng.normal(size=(N, JOINTS))
    gap[:, :1] += cause + 0.9 * more
    rows = rows_with(gap)
    score = score_of(rows, [common, rare])
    both = score.solve([common, rare])
    assert both.x[both.of(common)] == pytest.approx(-0.1)
    now, _, strong, _ = nameable(score, both, rows, 0.05, {})
    assert now.members == (common,)
    assert common.group not in strong


# how sure it is


def test_a_strong_effect_is_there_on_every_draw_and_a_twin_beside_it(planted):
    rows, pool, truth, score = planted
    said = support(score, score.solve(truth))
    assert all(share == 1.0 for share in said.share.values())
    rng = np.random.default_rng(6)
    twin = item("twin", pool[0].columns + 0.02 * rng.normal(size=(1, N, 1)), odds=-2.0)
    twins = score_of(rows, [*truth, twin])
    found = search(twins, [])
    (own,) = [m for m in found.members if m in (pool[0], twin)]
    said = support(twins, found)
    assert said.share == support(twins, found).share  # the same draws each time
    assert all(said.share[m.group] == 1.0 for m in found.members if m is not own)


def test_draws_say_by_how_much_coefficients_are_off_but_not_beside_an_effect_on_its_bound(planted):
    rows, pool, truth, score = planted
    said = support(score, score.solve(truth))
    off = np.array([d[pool[0].group] for d in said.moves])
    assert off.shape == (DRAWS, 1)
    assert 0.005 < off.std() < 0.05  # 0.3/√900, that of least squares, is 0.01
    limit = item("limit", np.sign(pool[1].columns), (1,), high=0.1)
    gap = rows.gap + np.where([False, True], 2.0 * limit.columns[0], 0.0)
    bounded = score_of(rows._replace(gap=gap), [*truth, limit])
    said = support(bounded, bounded.solve(truth))
    assert all(said.share[m.group] == 1.0 for m in truth)
    assert all(set(d) == {m.group for m in truth if 1 not in m.joints} for d in said.moves)


def constants(elsewhere=0.0, wrong=0.0):
    """Rows whose first torque is logged ``wrong`` times ``SHARE`` too small, and their items.

    The command is three times all columns, and ``elsewhere`` times what no column forms.
    """
    rng = np.random.default_rng(7)
    pool = [item(f"column{k}", rng.normal(size=(1, N, 1)), (k % 2,)) for k in range(3)]
    pool.append(item("both", rng.normal(size=(2, N, 2)), (0, 1)))
    command = elsewhere * rng.normal(size=(N, JOINTS))
    for m in pool:
        command[:, list(m.joints)] += 3.0 * m.columns.sum(0)
    gap = 0.3 * rng.normal(size=(N, JOINTS)) + [wrong * SHARE, 0.0] * command
    return rows_with(gap)._replace(command=command), pool


@pytest.mark.parametrize(("elsewhere", "wrong"), [(0.0, 0.0), (40.0, 0.0), (40.0, 2.0)])
def test_coefficients_move_with_a_torque_constant_as_far_as_their_covariance_says(elsewhere, wrong):
    rows, pool = constants(elsewhere, wrong)
    score = score_of(rows, pool)
    found = score.solve(pool)
    x, y = stacked(rows, pool, rows.training)
    left = y - x @ found.x
    predicted = stacked(rows._replace(gap=rows.command), pool, rows.training)[1] - left
    at = np.repeat(range(JOINTS), [(rows.used[:, j] & rows.training).sum() for j in range(JOINTS)])
    torque = SHARE * predicted[:, None] * (at[:, None] == range(JOINTS)) / score.noise[0]
    off = np.linalg.lstsq(x / score.noise[0], torque)[0]
    rest = torque - x / score.noise[0] @ off
    each = found.error.sum(0) / score.effective + score.floor * np.bincount(at) / BLOCKS
    spread = np.linalg.inv(rest.T @ rest / np.sqrt(np.outer(each, each)) + np.eye(JOINTS))
    mean = spread @ (torque.T @ left / score.noise[0] / each)
    expected = off @ (spread + np.outer(mean, mean)) @ off.T
    got = swayed(score, found, rows, residual(rows, found))
    np.testing.assert_allclose(got, expected, atol=1e-6 * expected.max())


def test_what_a_bound_holds_does_not_move_with_a_torque_constant():
    """Otherwise what the bound leaves in the residual would seem to be a wrong constant."""
    rows, pool = constants(elsewhere=0.5)
    least = replace(pool[0], lower=np.full(1, 0.5))  # what the gap has of it is noise
    score = score_of(rows, [least, *pool[1:]])
    found = score.solve([least, *pool[1:]])
    left = residual(rows, found)
    gap = rows.gap - least.lower[0] * np.pad(least.columns[0], ((0, 0), (0, 1)))
    without = score_of(rows._replace(gap=gap), pool[1:])
    rest = without.solve(pool[1:])
    got, expected = (
        swayed(one, set_, rows, left)[-4:, -4:] for one, set_ in ((score, found), (without, rest))
    )
    np.testing.assert_allclose(got, expected, rtol=1e-3)
    np.testing.assert_array_equal(swayed(score, found, rows, left)[0], 0.0)


def test_a_log_says_how_wrong_a_torque_constant_may_be():
    def errors(**more):
        rows, pool = constants(**more)
        score = score_of(rows, pool)
        found = score.solve(pool)
        return np.sqrt(np.diagonal(swayed(score, found, rows, residual(rows, found))))

    # nothing, if the columns form all of the command: then it is as wrong as one may be
    np.testing.assert_allclose(errors()[:3], 3.0 * SHARE, rtol=0.2)
    known, wrong = errors(elsewhere=40.0), errors(elsewhere=40.0, wrong=5.0)
    assert known[0] < SHARE  # right, as the log says
    assert wrong[0] > 3.0 * SHARE  # off by five times as much as one is, as it says, too


def test_beside_a_reference_log_or_a_motor_constant_less_moves_with_a_torque_constant():
    rows, pool = constants()
    score = score_of(rows, pool)
    found = score.solve(pool)
    none, left = np.zeros((len(found.x), len(found.x))), residual(rows, found)
    other = score_of(rows, pool, anchor=Anchor(tuple(pool), none, none[0]))
    new = swayed(score, found, rows._replace(command=rows.gap), left)  # only what is new counts
    np.testing.assert_allclose(swayed(other, other.solve(pool), rows, left), new, rtol=1e-9)
    # a motor constant that is fitted says what the command's factor is: else hardly anything moves
    command = rows.command + np.random.default_rng(1).normal(size=(N, JOINTS))
    rows = rows._replace(command=command)
    motors = [item(f"motor{j}", command[None, :, j, None], (j,), actuates=True) for j in (0, 1)]
    score = score_of(rows, [*pool, *motors])
    found = score.solve([*pool, *motors])
    got = swayed(score, found, rows, residual(rows, found))
    np.testing.assert_allclose(got, 0.0, atol=(0.3 * SHARE) ** 2)


def test_a_standard_error_covers_what_draws_say_that_choose_their_own_sets():
    (m,) = [item("one", np.ones((1, N, 1)))]
    value = Value(
        m.key, (m,), ConstantOffset(jnp.ones(1)), {"offset": (np.ones(1), np.full(1, 0.2))}, False,
        scatter={"offset": np.full(1, 0.1)}, moved=lambda by: {"offset": 1.0 + by},
    )  # fmt: skip
    draws = lambda *off: [{m.group: np.array([x])} for x in off]
    error = lambda *off: resampled(value, [{}, *draws(*off)]).parameters["offset"][1]
    np.testing.assert_allclose(error(0.3, -0.3), np.sqrt(0.2**2 + 0.3**2 - 0.1**2))
    np.testing.assert_allclose(error(0.3, 0.3), error(0.3, -0.3))  # off on one side, too
    np.testing.assert_allclose(error(0.05, -0.05), 0.2)
    np.testing.assert_allclose(error(0.3), 0.2)  # a single draw says nothing
    # 0.4 more in another set, which explains the log as well with a probability of a quarter
    (_, either) = resampled(value, draws(0.0, 0.0), [(0.25, *draws(0.4))]).parameters["offset"]
    np.testing.assert_allclose(either, np.sqrt(0.2**2 + 0.25 * 0.4**2))
    vague = resampled(value, draws(1.0, -1.0))  # 1 ± 1
    assert there(value) > 0.999
    assert 0.6 < there(vague) < 0.7
    assert there(vague._replace(together=3.0)) > 0.99
    assert there(vague._replace(share=0.1)) == 1.0


def test_another_part_of_the_same_effect_may_explain_as_much():
    """A mass in place of a wrong centre: then the rotor, part of the mass's effect, is lighter."""
    rng = np.random.default_rng(7)
    gravity, rotor, small = rng.normal(size=(3, N, 1))
    extra, mass = (
        replace(item("inertia", x), group=("inertia", 0, part))
        for part, x in (("extra", rotor), ("mass", gravity + 0.3 * rotor + 0.02 * small))
    )
    centre = item("centre", gravity)
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, :1] += gravity + 1.0 * rotor
    rows = rows_with(gap)
    score = score_of(rows, [extra, mass, centre])
    now = score.solve([extra, centre])
    (tie,) = tied(score, now, rows, rows.command)
    assert (tie.found, tie.instead) == ((centre.group,), (mass.group,))
    np.testing.assert_allclose(tie.moves[extra.group], -0.3, atol=0.02)
    assert centre.group not in tie.moves


def test_a_shape_far_from_its_best_is_a_rival_with_what_fitting_it_brings(monkeypatch):
    """A spring relaxed elsewhere adds a constant torque, too: fitted, it has the offset within."""
    rng = np.random.default_rng(13)
    q = rng.normal(size=(N, 1))
    centre = item("centre", np.sin(q))
    (offset,) = [replace(item("x", np.ones((1, N, 1))), group=("constant_offset", 0, "offset"))]
    relaxed = lambda at: replace(
        item("spring", np.sin(q) + 0.02 * rng.normal(size=(N, 1)) - at),
        shape=Shape(Spring, 0, JOINTS, ("stiffness",), {"stiffness": 0.0, "rest": at}, {}, {}),
    )
    far, best = relaxed(3.0), relaxed(0.0)
    asked = []

    def fitted(shape, at, *rest):
        asked.append((shape, at.members))
        return best

    monkeypatch.setattr(rivals, "fitted", fitted)
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, :1] += np.sin(q)
    rows = rows_with(gap)
    score = score_of(rows, [centre, offset, far])
    now = score.solve([centre])
    (tie,) = tied(score, now, rows, rows.command)
    assert asked == [(far, (far,))]
    assert (tie.found, tie.instead) == ((centre.group,), (best.group,))
    also = score_of(rows, [best])
    assert tie.falls == pytest.approx(now.value - also.solve([best]).value, abs=1e-6)


def test_one_of_two_rare_effects_is_tried_without_the_other(monkeypatch):
    """Beside the other, its best shape is another one."""
    rng = np.random.default_rng(17)
    cause, more = rng.normal(size=(2, N, 1))
    curve = lambda columns: replace(
        item("curve", columns),
        shape=Shape(TorqueCurve, 0, JOINTS, (), {"loss": 0.1}, {}, {}),
    )
    best, beside, other = curve(cause), curve(cause + 0.5 * more), item("other", more)
    monkeypatch.setattr(
        rivals, "fitted", lambda m, at, *rest: beside if other in at.members else best
    )
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, :1] += cause
    rows = rows_with(gap)
    score = score_of(rows, [beside, other])
    now = score.solve([beside, other])
    assert contested(score, now, rows, rows.command, Contests()) == [best]


def test_a_rival_is_tried_as_it_was_fitted_last_and_two_that_became_one_once(monkeypatch):
    rng = np.random.default_rng(19)
    first, second, noise = rng.normal(size=(3, N, 1))
    curve = lambda loss: replace(
        item("curve", first + second + 0.05 * noise),
        shape=Shape(TorqueCurve, 0, JOINTS, (), {"loss": loss}, {}, {}),
    )
    low, high, asked = curve(0.1), curve(0.3), []

    def fitted(rival, *rest):
        asked.append(float(rival.shape.values["loss"]))
        return curve(0.2 + 0.0001 * len(asked))

    monkeypatch.setattr(rivals, "fitted", fitted)
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, :1] += first + second
    rows, members = rows_with(gap), [item("first", first), item("second", second)]
    score = score_of(rows, [*members, low, high])
    assert contested(score, score.solve(members), rows, rows.command, Contests()) is None
    assert sorted(asked[:2]) == [0.1, 0.3]
    assert asked[2:] == [pytest.approx(0.2001)]


def test_shapes_are_alike_only_if_their_parameters_mean_the_same():
    """An effect may have fewer amplitudes, and beside a part of it others."""
    rng = np.random.default_rng(20)
    columns = rng.normal(size=(2, N, 1))
    whole = item("curve", columns)
    beside = lambda part, basis: item(
        "curve",
        columns[: len(basis)],
        shape=whole.shape._replace(basis=np.array(basis).T, parts=((part, np.ones(2)),)),
    )
    one, other = beside("dry", [[1.0, -1.0]]), beside("offset", [[1.0, -1.0]])
    assert rivals.alike(one, [whole, other]) is one
    assert rivals.alike(one, [whole, other, replace(one)]) is not one

    def ripple(harmonics):
        values = dict.fromkeys(("sine", "cosine"), np.zeros((1, harmonics))) | {"period": 0.4}
        amplitudes = rng.normal(size=(2 * harmonics, N, 1))
        shape = Shape(TorqueRipple, 0, JOINTS, ("sine", "cosine"), values, {}, {})
        return item("ripple", amplitudes, shape=shape)

    single, double = ripple(1), ripple(2)
    assert rivals.alike(double, [single]) is double
    assert rivals.alike(ripple(2), [single, double]) is double


def test_a_member_is_contested_once_beside_the_same_others():
    rng = np.random.default_rng(11)
    cause, beside = rng.normal(size=(2, N, 1))
    true = item("true", cause, odds=-2.0)
    alike = item("alike", cause + 0.5 * rng.normal(size=(N, 1)), odds=-2.0)
    another, elsewhere = item("another", beside), item("elsewhere", beside, (1,))
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, 0] += (cause + beside)[:, 0]
    rows = rows_with(gap)
    score, contests = score_of(rows, [true, alike, another, elsewhere]), Contests()

    def better(*members):
        now = score.solve(members)
        return contested(score, now, rows, rows.command, contests)

    assert better(alike)
    assert better(alike) is None
    assert better(alike, elsewhere) is None
    assert set(better(alike, another)) == {true, another}


def test_ties_are_looked_for_beside_a_member_that_explains_nothing():
    rng = np.random.default_rng(9)
    cause, idle, other = (
        item(name, x) for name, x in zip("abc", rng.normal(size=(3, N, 1)), strict=True)
    )
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, 0] += cause.columns[0, :, 0]
    rows = rows_with(gap)
    score = score_of(rows, [cause, idle, other])
    now = score.solve([cause, idle])
    assert not [
        t for t in tied(score, now, rows, rows.command)
        if cause.group in t.found
    ]  # fmt: skip


def test_likelihood_of_coefficients_is_that_of_their_residual(planted):
    rows, _, truth, _ = planted
    motor = item("motor", 0.4 * rows.command[None, :, 0, None], (0,), actuates=True)
    members, mask = [*truth, motor], rows.used & rows.training[:, None]
    score = score_of(rows, members)
    found = score.solve(members)
    assert found.passed[0] != 1.0
    for x in (found.x, np.add(found.x, [0.1, -0.2, 0.3, 0.1, 0.0])):
        left = rows.gap.copy()
        for m in found.members:
            left[:, list(m.joints)] -= np.tensordot(x[found.of(m)], m.columns, 1)
        mean = np.sum((left / score.noise) ** 2 * mask, axis=0) / mask.sum(0) / found.passed
        expected = -0.5 * score.effective @ np.log(mean) + sum(m.odds for m in members)
        assert score.likelihood(found.members, x) == pytest.approx(expected, rel=1e-9)


def test_the_models_own_residual_is_that_of_aligned_torques():
    rng = np.random.default_rng(8)
    shift = replace(
        item("shift", rng.normal(size=(1, N, 1)), always=True), group=(ALIGNMENT, 0, "")
    )
    both = item("both", rng.normal(size=(1, N, 1)), always=True)  # shared with a reference log
    rows = rows_with(0.3 * rng.normal(size=(N, JOINTS)))
    rows.gap[:, 0] += 0.5 * shift.columns[0, :, 0] + 0.7 * both.columns[0, :, 0]
    found = score_of(rows, [shift, both]).solve([shift, both])
    left = residual(rows, found, [m for m in found.members if m.key[0] == ALIGNMENT])
    np.testing.assert_array_equal(left[:, 1], rows.gap[:, 1])
    np.testing.assert_allclose(
        left[:, 0], rows.gap[:, 0] - found.x[found.of(shift)] * shift.columns[0, :, 0]
    )
    assert np.std(left[:, 0]) < 0.95 * np.std(rows.gap[:, 0])


def test_a_part_is_judged_with_its_whole():
    """By itself the part could be zero; but it is a share of the whole, and reported as that."""
    rng = np.random.default_rng(3)
    part = item("level", rng.normal(size=(1, N, 1)))
    values = dict.fromkeys(StribeckFriction.parameters, np.ones(1))
    parts = (("level", np.ones(2)),)
    free = ("level", "excess")
    shape = Shape(StribeckFriction, 0, JOINTS, free, values, {}, {}, parts=parts)
    whole = item("bend", rng.normal(size=(2, N, 1)), shape=shape)
    rows = rows_with(0.3 * rng.normal(size=(N, JOINTS)))
    rows.gap[:, 0] += whole.columns.sum(0)[:, 0]
    score = score_of(rows, [part, whole])
    assert [m for _, m, _ in objections(score, score.solve([part]), 0.05, rows)] == [part]
    assert "exclude zero" in objection(score, score.solve([part, whole]), part, 0.05, rows)
    assert objections(score, score.solve([part, whole]), 0.05, rows) == []


def test_what_two_logs_have_in_common_is_no_part_of_a_finding():
    rng = np.random.default_rng(0)
    part = item("level", rng.normal(size=(1, N, 1)))
    shape = SHAPES[2]._replace(cls=StribeckFriction, parts=(("level", np.ones(2)),))
    whole = item("bend", rng.normal(size=(2, N, 1)), shape=shape)
    assert absorbed([part, whole]) == {part.key: whole.key}
    assert absorbed([replace(part, always=True), whole]) == {}
    assert absorbed([part, replace(whole, always=True)]) == {}


def test_the_nearest_other_effect_is_solved_for_and_one_that_contains_it_is_no_rival():
    rng = np.random.default_rng(5)
    own, other = rng.normal(size=(2, N))
    on = lambda column: np.stack([column])[:, :, None]
    truth = item("constant_offset", on(own))
    near = item("near", on(0.8 * own + 0.6 * other))
    both, other_shape = np.stack([own, other])[:, :, None], SHAPES[2]._replace(cls=StribeckFriction)
    # promises most, but not within its bounds
    bounded = item("bounded", both, low=-0.01, high=0.01, shape=other_shape)
    whole = item("asymmetric_friction", both)  # its shape contains an offset
    gap = 0.3 * rng.normal(size=(N, JOINTS))
    gap[:, 0] += own
    score = score_of(rows_with(gap), [truth, near, bounded, whole])
    bare = score.solve([])
    promise = estimates.promise(score, [])
    assert promise[id(bounded)] > promise[id(near)]
    best, nearest = best_instead(score, [truth], [], bare, 0)
    assert nearest == near.key
    assert best == score.solve([near]).value
    assert best_instead(score, [truth], [], bare, 1) == (bare.value, None)  # nothing else is there


def test_of_two_effects_that_cancel_each_is_the_others_counterpart():
    rng = np.random.default_rng(6)
    offset, used = np.ones((N, JOINTS)), np.ones(N, bool)
    weight = -0.9 * offset + 0.1 * rng.normal(size=(N, JOINTS))
    friction = rng.normal(size=(N, JOINTS))
    friction -= friction.mean(0)
    added = [friction, offset, weight]
    assert [cancelling(one, added, used, 0) for one in added] == [None, 2, 1]
    used[:] = False  # nothing of it counts
    assert cancelling(offset, added, used, 0) is None


def test_one_joint_may_change_alone_but_lacks_friction_seldom_alone():
    found = [("spring", 1), ("drag", 0), ("drag", 2), ("load", None)]
    of = lambda key, changed: company_of(key, found, 5, changed)
    assert [of(key, False) for key in found] == [0.0, 0.25, 0.25, 0.0]
    assert [of(key, True) for key in found] == [1.0, 1.0, 1.0, 0.0]
