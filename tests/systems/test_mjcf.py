"""MJCF and URDF files as plants: MJX against MuJoCo in C, derivatives, and a file's own effects."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from jaxidl.effects import Payload
from jaxidl.gap.benchmark.mechanisms import MECHANISMS, PENDULUM, TWO_LINK
from jaxidl.systems.kinematics import place
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.tables import inverse_dynamics, tables
from tests.helpers.model_files import CHAIN, RICH, stored
from tests.helpers.numeric import quick


def in_c(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep, model.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_EULER
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("name", [*MECHANISMS, "chain"])
def test_mjx_moves_and_weighs_as_mujoco_in_c_does(name, tmp_path):
    path = (
        stored(tmp_path, CHAIN, "chain.urdf")
        if name == "chain"
        else stored(tmp_path, MECHANISMS[name])
    )
    body = read_model(path).plant.body
    model, data = in_c(path)
    start = jnp.linspace(0.9, -0.4, model.nv)

    @jax.jit
    def swing(q):
        def step(state, _):
            q, qd = state
            inertia, bias = body.equation_of_motion(q, qd)
            after = qd - 1e-3 * jnp.linalg.solve(inertia, bias)
            return (q + 1e-3 * after, after), (q, qd, inertia, bias)

        return jax.lax.scan(step, (q, jnp.zeros_like(q)), None, length=1000)[1]

    data.qpos[:] = start
    inertia, bend = np.zeros((model.nv, model.nv)), np.linspace(-2.0, 1.0, model.nv)
    history = [np.asarray(x) for x in swing(start)]
    for t, (q, qd, mass, bias) in enumerate(zip(*history, strict=True)):
        if t % 100 == 0:
            probe = mujoco.MjData(model)
            probe.qpos[:], probe.qvel[:], probe.qacc[:] = q, qd, bend
            mujoco.mj_inverse(model, probe)
            mujoco.mj_fullM(model, probe, inertia)
            np.testing.assert_allclose(mass, inertia, rtol=1e-10, atol=1e-12)
            np.testing.assert_allclose(
                mass @ bend + bias, probe.qfrc_inverse, rtol=1e-10, atol=1e-10
            )
        # the same scheme: rounding, grown over a second
        np.testing.assert_allclose(q, data.qpos, atol=1e-9)
        mujoco.mj_step(model, data)
    assert np.ptp(history[0], axis=0).max() > 0.5 or name == "slider"


@pytest.mark.parametrize("text", [RICH, CHAIN, TWO_LINK], ids=["rich", "chain", "two_link"])
def test_frames_are_where_mujoco_in_c_has_them(text, tmp_path):
    body = read_model(
        stored(tmp_path, text, "model.urdf" if text is CHAIN else "model.xml")
    ).plant.body
    data = mujoco.MjData(body.source)
    for q in np.random.default_rng(5).normal(size=(3, body.source.nq)):
        data.qpos[:] = q
        mujoco.mj_kinematics(body.source, data)
        for name, value in jax.jit(lambda q: place(body.source, q))(q).items():
            expected = getattr(data, name).reshape(value.shape)
            np.testing.assert_allclose(value, expected, atol=1e-13, err_msg=name)


def test_a_batch_is_its_instants(tmp_path):
    body = read_model(stored(tmp_path, PENDULUM)).plant.body
    log = jnp.asarray(np.random.default_rng(0).normal(size=(3, 7, 1)))
    one = jax.jit(body.inverse_dynamics)
    many = jax.jit(jax.vmap(body.inverse_dynamics))(*log)
    np.testing.assert_allclose(
        many, [one(*instant) for instant in zip(*log, strict=True)], rtol=1e-12
    )
    np.testing.assert_allclose(many, inverse_dynamics(body, *map(np.asarray, log)), rtol=1e-10)


@pytest.mark.slow
def test_derivatives_forward_reverse_numeric_and_tabled(tmp_path):
    body, rng = read_model(stored(tmp_path, TWO_LINK)).plant.body, np.random.default_rng(1)
    sizes = {"q": 2, "qd": 2, "qdd": 2, "extra": 2, "mass": 2, "load": 1, "com": 3}
    cuts = np.cumsum([*sizes.values()])[:-1]

    def both(x):
        q, qd, qdd, extra, mass, load, com = jnp.split(x, cuts)
        altered = (
            body.add_mass(mass).add_inertia(extra).add_payload(Payload(load[0], com).numbers())
        )
        return jnp.concatenate(
            [altered.inverse_dynamics(q, qd, qdd), altered.forward_dynamics(q, qd, qdd)]
        )

    value, forward, way = quick(both), quick(jax.jacfwd(both)), jnp.array([1.0, -0.7, 0.4, 0.2])
    reverse = quick(jax.grad(lambda x: way @ both(x)))
    x = jnp.asarray(
        np.concatenate([rng.normal(size=6), [0.1, 0.2, 0.3, -0.2, 0.4, 0.1, 0.05, -0.3]])
    )
    numeric = np.stack([(value(x + h) - value(x - h)) / 2e-6 for h in 1e-6 * np.eye(len(x))], -1)
    np.testing.assert_allclose(way @ forward(x), reverse(x), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(forward(x), numeric, rtol=1e-6, atol=1e-7)

    states, com = rng.normal(size=(3, 20, 2)), np.array([0.1, -0.2, 0.3])
    table = tables(body, *states)
    for t in range(20):
        x = jnp.concatenate([*states[:, t], jnp.zeros(5), com])
        q, qd, qdd, extra, mass, load, _ = jnp.split(forward(x)[:2], cuts, axis=1)
        for got, true, by in (
            (table.torque[t], value(x)[:2], "torque"),
            (table.inertia[t], qdd, "acceleration"),
            (table.by_q[t], q, "position"),
            (table.by_qd[t], qd, "velocity"),
            (table.by_mass[t], mass, "mass"),
            (
                table.by_payload[t] @ Payload(jnp.array(1.0), jnp.array(com)).numbers(),
                load[:, 0],
                "load",
            ),
            (np.diag(states[2, t]), extra, "rotor inertia"),
        ):
            # positions: central differences
            np.testing.assert_allclose(got, true, rtol=1e-7, atol=1e-7, err_msg=by)


def test_tables_are_interpolated_between_their_instants(tmp_path):
    body, t = read_model(stored(tmp_path, TWO_LINK)).plant.body, np.arange(0.0, 1.0, 1e-3)[:, None]
    wave = 2 * np.pi * np.array([0.7, 1.1])
    log = np.sin(wave * t), wave * np.cos(wave * t), -(wave**2) * np.sin(wave * t)
    fine, coarse = (tables(body, *log, stride=stride) for stride in (1, 7))
    np.testing.assert_array_equal(fine.torque, coarse.torque)
    for name, a, b in zip(fine._fields, fine, coarse, strict=True):
        # chords of 7 ms
        np.testing.assert_allclose(b, a, atol=2e-3 * np.abs(a).max(), err_msg=name)


@pytest.mark.slow
def test_a_body_may_be_a_programs_argument(tmp_path):
    """Compiled once for all masses, and what does not change is a constant of the program."""
    body, traces = read_model(stored(tmp_path, CHAIN, "chain.urdf")).plant.body, []

    @jax.jit
    def fall(body, q, qd, tau):
        traces.append(1)
        return body.forward_dynamics(q, qd, tau)

    q, qd, tau = jnp.asarray(np.random.default_rng(4).normal(size=(3, 4)))
    for load in (0.0, 0.4):
        heavier = body.add_mass(jnp.full(4, load)).add_inertia(jnp.array([load, 0.0, 0.0, 0.1]))
        inertia, bias = heavier.equation_of_motion(q, qd)
        np.testing.assert_allclose(
            fall(heavier, q, qd, tau), np.linalg.solve(inertia, tau - bias), rtol=1e-9
        )
    assert len(traces) == 1
    assert len(jax.tree.leaves(body)) == 3


def test_payloads_add_up_each_at_its_place(tmp_path):
    body = read_model(stored(tmp_path, TWO_LINK)).plant.body
    loads = [
        Payload(jnp.array(m), jnp.array(c))
        for m, c in ((0.5, [0.1, 0.2, -0.3]), (0.2, [-0.2, 0.0, 0.1]))
    ]
    state = jnp.asarray(np.random.default_rng(2).normal(size=(3, 2)))
    heavy = jax.jit(lambda *state: loads[1].alter(loads[0].alter(body)).inverse_dynamics(*state))(
        *state
    )
    state = np.asarray(state)
    by_payload = tables(body, *state[:, None]).by_payload[0]
    shift = sum(by_payload @ np.asarray(load.numbers()) for load in loads)
    np.testing.assert_allclose(heavy, inverse_dynamics(body, *state[:, None])[0] + shift, rtol=1e-9)


def test_what_a_file_says_of_its_joints_becomes_effects(tmp_path):
    model = read_model(stored(tmp_path, RICH))
    assert model.names == ("j", "joint1", "joint2", "joint3")
    assert model.units == ("Nm", "Nm", "Nm", "N")
    assert any("actuators" in note for note in model.notes)
    assert any("limits" in note for note in model.notes)
    records = [effect.to_dict() for effect in model.plant.effects]
    found = [
        (r["effect"], r["joint"], *(p["value"] for p in r["parameters"].values())) for r in records
    ]
    assert [entry[:3] for entry in found] == [
        ("viscous_friction", 0, 0.3),
        ("viscous_friction", 1, 0.3),
        ("viscous_friction", 2, 0.3),
        ("coulomb_friction", 2, 0.1),
        ("spring", 2, 2.0),
    ]
    np.testing.assert_allclose(found[-1][3], np.pi / 2, rtol=1e-12)  # the file counts in degrees


def test_a_payload_goes_on_the_last_body_that_moves(tmp_path):
    body = read_model(stored(tmp_path, RICH)).plant.body
    heavier = body.add_payload(jnp.ones(10)).added - body.added
    assert np.flatnonzero(np.any(heavier, axis=1)).tolist() == [body.source.jnt_bodyid[3]]
