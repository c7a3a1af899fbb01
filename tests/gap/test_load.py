"""A load whose inertia hardly shows, and errors of links that it looks like."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxidl import gap
from jaxidl.effects import ComError, OnJoint, Payload
from jaxidl.gap import read_model

ARM = """<mujoco><worldbody><body><joint name="base" axis="0 0 1"/>
  <inertial pos="0 0.01 0.04" mass="2" diaginertia="0.006 0.006 0.005"/>
  <body pos="0 0 0.08"><joint name="shoulder" axis="0 1 0"/>
    <inertial pos="0.15 0.01 0" mass="2.4" diaginertia="0.004 0.03 0.03"/>
    <body pos="0.35 0 0"><joint name="elbow" axis="0 1 0"/>
      <inertial pos="0.13 0 0.01" mass="1.2" diaginertia="0.002 0.012 0.012"/></body></body>
</body></worldbody></mujoco>"""
HEAD = """<mujoco><worldbody><body><joint name="pan" axis="0 0 1"/>
  <inertial pos="0 0 0.05" mass="1.2" diaginertia="0.004 0.004 0.004"/>
  <body pos="0 0 0.1"><joint name="tilt" axis="0 1 0"/>
    <inertial pos="0.01 0 0" mass="1.5" diaginertia="0.003 0.005 0.005"/></body></body>
</worldbody></mujoco>"""
TIME = 8e-3 * np.arange(5000)
NAMES = ("viscous_friction", "coulomb_friction", "inertia_error", "com_error", "payload")


def model_of(xml, folder):
    path = folder / "robot.xml"
    path.write_text(xml)
    return read_model(path)


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return model_of(ARM, tmp_path_factory.mktemp("load"))


def diagnosed(model, hidden, names=NAMES, noise=0.05):
    """Find what is hidden in slow motion with friction."""
    count = len(model.names)
    at = np.array([[0.31, 0.53], [0.37, 0.61], [0.43, 0.71]])
    size = np.array([[0.4, 0.2], [0.3, 0.3], [0.4, 0.3]])
    at, size = at[:count], size[:count]
    q, qd, qdd = (
        np.real(np.sum(size * (1j * at) ** k * np.exp(1j * (at * TIME[:, None, None] + size)), 2))
        for k in range(3)
    )
    with jax.enable_x64(True):
        body = hidden.alter(model.plant.body)

        @jax.jit
        @jax.vmap
        def torque(q, qd, qdd):
            inertia, bias = body.equation_of_motion(q, qd)
            return inertia @ qdd + bias

        tau = np.asarray(torque(*(jnp.asarray(x) for x in (q, qd, qdd))))
    tau = tau + noise * (10.0 * qd + np.array([20.0, 20.0, 10.0])[:count] * np.tanh(qd / 0.01))
    draw = np.random.default_rng(5).standard_normal((2, *q.shape))
    log = gap.from_arrays(TIME, q + 2e-5 * draw[0], tau + noise * draw[1])
    found = gap.diagnose(log, model, effects=names, rollouts=False)
    return {(f.name, f.joint): f for f in found.findings if f.sure}


@pytest.mark.slow
def test_a_load_is_no_error_of_two_links(model):
    """Its mass is felt by the shoulder, as an error of the upper arm's mass would be."""
    found = diagnosed(model, Payload(jnp.array(0.4), jnp.array([0.28, 0.0, 0.0])))
    assert not {name for name, _ in found} & {"inertia_error", "com_error"}
    load = found["payload", None].parameters
    for name, true, most in (("mass", 0.4, 0.04), ("com", 0.28, 0.03)):
        value, stderr = (np.ravel(getattr(load[name], x))[0] for x in ("value", "stderr"))
        assert stderr < most
        assert abs(value - true) < 2.0 * stderr


@pytest.mark.slow
def test_a_centre_of_mass_is_no_load_without_mass(model):
    found = diagnosed(model, OnJoint(ComError(jnp.array([[0.06, 0.0, 0.0]])), 2, 3))
    assert ("payload", None) not in found
    moment = found["com_error", 2].parameters["moment"]
    assert abs(moment.value[0] - 0.06) < 2.0 * moment.stderr[0]


def test_a_load_whose_mass_cannot_be_known_is_given_by_its_moment(tmp_path):
    """On two axes at right angles a mass that is added where they meet changes nothing."""
    head = model_of(HEAD, tmp_path)
    load = Payload(jnp.array(0.15), jnp.array([0.1, 0.0, 0.02]))
    found = diagnosed(head, load, ("viscous_friction", "coulomb_friction", "payload"), 2e-3)
    values = found["payload", None].parameters
    assert "com" not in values
    assert values["mass"].value < values["mass"].stderr
    for axis, true in ((0, 0.015), (2, 0.003)):
        assert values["moment"].stderr[axis] < 1e-3
        assert abs(values["moment"].value[axis] - true) < 2.0 * values["moment"].stderr[axis]
