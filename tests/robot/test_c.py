"""A controller in C computes what JAX computes."""

from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl.arm.setup import ArmStudy
from jaxidl.robot.c import Controller
from jaxidl.systems import Plant
from jaxidl.systems.arm import arm
from tests.helpers.compiled import InC


def double(params):
    return jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), params)


def test_x(tmp_path):
    study = ArmStudy()
    em, m = study.error_model, arm()
    params = double(em.init(jax.random.key(0)))
    given = Plant(m.plant.body, study.effects(0.0)[:6])
    c = InC(Controller(study.task(), given, study.law(), m.names, em, params), tmp_path)
    rng = np.random.default_rng(0)
    f = jax.jit(given.inverse_dynamics)
    from jaxidl.types import State
    g = jax.jit(lambda q, qd, qdd: em.torque(params, State(q, qd), qdd))
    for _ in range(10):
        q, qd, qdd = rng.normal(size=(3, 7)) * [[2], [2], [20]]
        print(np.abs(c.torque("inverse_dynamics", q, qd, qdd) - f(q, qd, qdd)).max())
        print(np.abs(c.torque("learned", q, qd, qdd) - g(q, qd, qdd)).max())
    assert 0
