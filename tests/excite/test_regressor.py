"""The regressor in JAX and what effects add along a motion, against those of MuJoCo and of logs."""

import jax
import numpy as np
import pytest
from numpy.testing import assert_allclose

from jaxidl.backend import jit_quickly
from jaxidl.excite.parameters import independent
from jaxidl.gap.benchmark.mechanisms import MECHANISMS
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.regressor import table
from jaxidl.systems.tables import tables

TREE = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="a" pos="0.1 0 0.2"><joint type="slide" axis="0 1 0.2"/>
    <joint axis="0 0 1" pos="0 0.1 0"/>
    <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.02 0.02" quat="0.8 0.6 0 0"/>
    <body name="b" pos="0 0 0.3" quat="0.7 0.1 0.7 0"><joint axis="1 0 0" armature="0.1"/>
      <inertial pos="0 0.1 0" mass="2" diaginertia="0.02 0.03 0.04"/></body>
    <body name="c" pos="0.3 0 0"><joint type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0.1" mass="0.5" diaginertia="0.01 0.01 0.01"/></body></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("text", [TREE, MECHANISMS["two_link"]], ids=["tree", "two_link"])
def test_regressor_is_that_of_mujoco(text, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(text)
    body = read_model(path).plant.body
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 8, len(body.names)))
    ours = jit_quickly(jax.vmap(lambda *x: table(body, *x)))(q, qd, qdd)
    theirs = tables(body, q, qd, qdd)
    for name in ("torque", "by_mass", "by_link", "by_payload", "by_gravity", "by_tilt"):
        assert_allclose(getattr(ours, name), getattr(theirs, name), atol=1e-9)


def test_columns_that_others_imitate_are_found():
    a, b, c = np.random.default_rng(0).normal(size=(3, 40, 2))
    kept = independent(np.stack([a, 3.0 * a, 0.0 * a, b, a - 2.0 * b, c]))
    assert kept.tolist() == [True, False, False, True, False, True]
    assert independent(np.stack([a, c]), np.stack([a, b])).tolist() == [False, True]
