"""Designed motions: better than random ones, within their limits, written and read again."""

import json
from dataclasses import fields, replace

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from jaxidl.backend import jit_quickly
from jaxidl.errors import ConfigurationError
from jaxidl.excite.design import Effort, design, finished, random_motion
from jaxidl.excite.plan import Plan, random_start
from jaxidl.excite.run import Request, excite
from jaxidl.excite.table import evidence
from jaxidl.gap.benchmark.mechanisms import PENDULUM
from jaxidl.logs.log import read
from jaxidl.systems.bounds import Shapes
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics

EFFORT = Effort(starts=2, steps=30)


@pytest.fixture(scope="module")
def found(made):
    return design(made.plan, None, EFFORT)


def test_a_designed_motion_tells_more_than_random_ones_and_keeps_its_limits(made, found):
    plan: Plan = made.plan
    chance = [random_motion(plan, None, seed, 100.0).value for seed in range(4)]
    assert found.value < min(chance) - 0.1
    assert found.q.min() >= plan.limits.lower[0]
    assert found.q.max() <= plan.limits.upper[0]
    assert np.abs(found.qd).max() <= plan.limits.speed[0] * (1 + 1e-9)
    assert np.abs(found.qdd).max() <= plan.limits.acceleration[0] * (1 + 1e-9)
    assert np.abs(found.tau).max() <= plan.limits.torque[0]
    for x in (found.qd, found.qdd, found.q - plan.limits.start):
        assert_allclose(x[[0, -1]], 0.0, atol=1e-9)
    body = plan.know.body
    assert_allclose(found.tau, inverse_dynamics(body, found.q, found.qd, found.qdd), atol=1e-9)
    before, after = (np.asarray(made.plan.gram(e)) for e in evidence(made, found))
    assert np.linalg.slogdet(after)[1] > np.linalg.slogdet(before)[1]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_motion(made, found):
    again = design(made.plan, None, EFFORT)
    assert_allclose(again.q, found.q, rtol=0, atol=0)


@pytest.mark.parametrize("most", [pytest.param(1.5, marks=pytest.mark.slow), 0.2])
def test_a_tight_torque_limit_is_kept_and_no_random_motion_tells_more(made, most):
    limits = replace(made.plan.limits, torque=np.array([most]))
    plan = replace(made.plan, limits=limits)
    tight = design(plan, None, EFFORT)
    assert most / 3.0 < np.abs(tight.tau).max() <= most
    rng = np.random.default_rng(EFFORT.seed)
    starts = [random_start(plan, rng) for _ in range(EFFORT.starts)]
    judge = jit_quickly(plan.judged)
    kept = [finished(plan, z, None, 100.0, judge) for z in starts]
    assert tight.value <= min(f.value for f in kept if f is not None)
    assert tight.value <= tight.random


def test_a_motion_is_returned_where_the_descent_finds_none(made):
    """A descent that breaks, here by a criterion without a derivative, leaves the random starts."""

    class Broken(Plan):
        def judged(self, z):
            value, torque, q = super().judged(z)
            return value + 0.0 * jnp.sqrt(jnp.sum(z * 0.0)), torque, q

    plan = Broken(**{f.name: getattr(made.plan, f.name) for f in fields(Plan)})
    found = design(plan, None, replace(EFFORT, steps=10))
    assert not found.descended
    assert found.value <= found.random


def test_an_interrupted_design_keeps_the_best_so_far(made):
    shares = []

    def watch(share):
        shares.append(share)
        if len(shares) > 2:
            raise KeyboardInterrupt

    found = design(made.plan, None, EFFORT, watch=watch)
    assert len(found.course) == 2
    assert found.value < found.random


@pytest.mark.slow
def test_shapes_stay_apart(tmp_path, made, limits):
    path = tmp_path / "model.xml"
    wall = '<geom type="box" pos="0.45 0 -0.25" size="0.05 0.2 0.2" contype="1" conaffinity="1"/>'
    path.write_text(
        PENDULUM.replace("<worldbody>", f"<worldbody>{wall}")
        .replace('contype="0" conaffinity="0"', 'contype="1" conaffinity="1"')
        .replace('<geom fromto="0 0 0', '<geom fromto="0 0 -0.1')
    )
    shapes = Shapes(read_model(path), limits.clearance)
    assert shapes.any
    free = random_motion(made.plan, None, 1, 100.0)
    assert len(shapes.near(free.q).row)  # without a look at shapes it would touch
    found = design(made.plan, shapes, Effort(2, 20))
    assert not len(shapes.near(found.q).row)
    start = replace(made.plan.limits, start=np.array([-0.9]))
    with pytest.raises(ConfigurationError, match="apart at the start"):
        design(replace(made.plan, limits=start), shapes, Effort(2, 20))


@pytest.mark.slow
def test_a_file_is_read_again_as_a_log(pendulum, tmp_path):
    limits = tmp_path / "limits.yaml"
    limits.write_text("position: [-1, 1]\nspeed: 2\nacceleration: 8\n")
    request = Request(seconds=6.0, starts=1, steps=10)
    result = excite(pendulum, request, limits=limits)
    path = tmp_path / "motion.csv"
    path.write_text(result.csv())
    assert path.read_text().startswith("time,q0,qd0,qdd0,tau0\n")
    log = read(path, joints=1)
    assert_allclose(log.q, result.found.q, atol=1e-8)
    assert_allclose(log.tau, result.found.tau, atol=1e-7)
    assert log.qd is not None
    assert not [note for note in log.notes if "uneven" in note]
    assert "viscous friction" in result.table
    record = json.loads(json.dumps(result.record(), default=np.ndarray.tolist))
    assert record["criterion"]["designed"] < record["criterion"]["random"]
    assert max(record["reached"]["speed"]) <= 2.0
