"""Wrong links, loads and a tilted base: linear in inertial parameters, in MJX, along a log and in a
file.
"""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.effects import OnJoint, placed
from jaxidl.effects.ten import about, elements, matrix, moved, ten
from jaxidl.systems.inertial import level, links, per_moment
from jaxidl.systems.mjcf import read_model
from jaxidl.systems.point import PointMass
from jaxidl.systems.tabled_body import TabledBody
from jaxidl.systems.tables import heavier, leaning, tables
from tests.helpers.model_files import stored, torque_in_c
from tests.helpers.numeric import compare

SLANTED = """<mujoco><option gravity="0.3 -1 -9.7"/><worldbody><body pos="0.1 0 0.3" euler="20 -30 40" name="lower">
  <joint name="lift" type="slide" axis="0 0.6 0.8"/><joint name="turn" axis="0.6 0 0.8" pos="0.05 0.02 0"/>
  <inertial pos="0.1 -0.05 0.2" quat="0.7 0.1 -0.5 0.5" mass="2" diaginertia="0.03 0.04 0.05"/>
  <body pos="0.2 0.1 0.4" euler="-70 10 5" name="upper"><joint name="elbow" axis="0 1 0" armature="0.1"/>
    <inertial pos="0.02 0.1 0.1" mass="1" diaginertia="0.01 0.02 0.015"/>
    <body pos="0 0.1 0.2" euler="10 80 30" name="flange"/></body></body></worldbody></mujoco>"""  # noqa: E501
JOINTS = 3
RNG = np.random.default_rng(0)
ERROR = np.array([0.3, 0.02, -0.05, 0.04, 0.02, 0.03, 0.025, 0.004, -0.003, 0.002])


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    return read_model(stored(tmp_path_factory.mktemp("links"), SLANTED)).plant.body


def heavier_in_c(b, numbers):
    """The model in which body ``b`` has these inertial parameters in addition, computed by hand."""
    model = mujoco.MjModel.from_xml_string(SLANTED)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[b])
    turn, m, c = turn.reshape(3, 3), model.body_mass[b], model.body_ipos[b]
    outer = lambda m, c: m * (c @ c * np.eye(3) - np.outer(c, c))
    mass, moment = m + numbers[0], m * c + numbers[1:4]
    tensor = turn @ np.diag(model.body_inertia[b]) @ turn.T + outer(m, c)
    tensor += [
        [numbers[4], numbers[7], numbers[8]],
        [numbers[7], numbers[5], numbers[9]],
        [numbers[8], numbers[9], numbers[6]],
    ]
    values, axes = np.linalg.eigh(tensor - outer(mass, moment / mass))
    axes[:, 2] *= np.linalg.det(axes)
    model.body_mass[b], model.body_ipos[b], model.body_inertia[b] = mass, moment / mass, values
    mujoco.mju_mat2Quat(model.body_iquat[b], axes.ravel())
    model.body_sameframe[b] = 0  # or MuJoCo would not look where its centre is
    return model


@pytest.mark.parametrize("b", [1, 2, 3], ids=["lower", "upper", "flange"])
def test_what_is_added_to_a_body_moves_as_in_c(body, b):
    """At random states the torque is that of MuJoCo in C with the same numbers in its model, in MJX
    and from the tables.
    """
    states = RNG.normal(size=(3, 6, JOINTS))
    true = heavier_in_c(b, ERROR)
    if b == 3:
        alter = lambda body: body.add_payload(jnp.asarray(ERROR))
    else:
        alter = lambda body: body.add_link(jnp.zeros((JOINTS, 10)).at[2 * b - 2].set(ERROR))
    table, inverse = (
        tables(body, *states),
        jax.jit(lambda *state: alter(body).inverse_dynamics(*state)),
    )
    for k, state in enumerate(zip(*states, strict=True)):
        expected = torque_in_c(true, *state)
        np.testing.assert_allclose(inverse(*state), expected, rtol=1e-9, atol=1e-10)
        row = jax.tree.map(lambda x, k=k: x[k], table)
        extra = alter(TabledBody(row, jnp.asarray(state[2]), jnp.zeros(JOINTS))).extra
        np.testing.assert_allclose(table.torque[k] + extra, expected, rtol=1e-9, atol=1e-10)


def test_a_tilted_base_is_another_gravity(body):
    states, angles = RNG.normal(size=(3, 4, JOINTS)), np.array([0.04, -0.02])
    gravity = np.array([0.3, -1.0, -9.7])
    turns = level(body.source)
    # horizontal axes: no more and no less gravity
    np.testing.assert_allclose(gravity @ turns, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(turns, axis=0), np.linalg.norm(gravity))
    model = mujoco.MjModel.from_xml_string(SLANTED)
    model.opt.gravity[:] = gravity + turns @ angles
    table, inverse = tables(body, *states), jax.jit(body.tilt(jnp.asarray(angles)).inverse_dynamics)
    for k, state in enumerate(zip(*states, strict=True)):
        expected = torque_in_c(model, *state)
        np.testing.assert_allclose(
            inverse(*map(jnp.asarray, state)), expected, rtol=1e-9, atol=1e-10
        )
        np.testing.assert_allclose(
            table.torque[k] + table.by_tilt[k] @ angles, expected, rtol=1e-9, atol=1e-10
        )
        np.testing.assert_allclose(table.by_gravity[k] @ turns, table.by_tilt[k], atol=1e-12)


def test_a_base_turned_about_x_sees_gravity_turned_back(tmp_path):
    """The sign of the angles, and which axes they are where gravity points along -z."""
    path = stored(tmp_path, SLANTED.replace("0.3 -1 -9.7", "0 0 -10"))
    turns = level(read_model(path).plant.body.source)
    for k, axis in enumerate(np.eye(3)[:2]):
        quaternion, seen = np.zeros(4), np.zeros(3)
        mujoco.mju_axisAngle2Quat(quaternion, axis, 1e-6)
        mujoco.mju_negQuat(quaternion, quaternion)
        mujoco.mju_rotVecQuat(seen, np.array([0.0, 0.0, -10.0]), quaternion)
        np.testing.assert_allclose(turns[:, k], (seen - [0.0, 0.0, -10.0]) / 1e-6, atol=1e-4)


def test_a_payload_hangs_on_the_last_body_that_moves(body):
    assert body.carrier == "flange"
    assert body.body_names == ("world", "lower", "upper", "flange")


def test_a_cover_of_an_earlier_link_carries_no_payload(tmp_path):
    """It comes last in the file, as an arm's covers do, and moves with its link."""
    covered = SLANTED.replace(
        "</body></body></worldbody>", '</body><body name="cover"/></body></worldbody>'
    )
    body = read_model(stored(tmp_path, covered)).plant.body
    assert body.body_names[-1] == "cover"
    assert body.carrier == "flange"


def test_mass_goes_with_the_inertia_that_a_body_has(body):
    doubled = body.add_mass(jnp.array([0.0, 0.0, 1.0])).added[2]
    np.testing.assert_allclose(doubled, links(body.source)[2], rtol=1e-12)  # of a body of 1 kg


def test_numbers_of_a_point_and_of_another_frame():
    mass, com = 0.7, jnp.array([0.1, -0.2, 0.3])
    point = ten(jnp.array(mass), mass * com, about(mass, com))
    turn = jnp.asarray(np.linalg.qr(RNG.normal(size=(3, 3)))[0])
    there = turn @ com + jnp.array([0.4, 0.5, -0.6])
    np.testing.assert_allclose(
        moved(point, turn, there - turn @ com),
        ten(jnp.array(mass), mass * there, about(mass, there)),
    )
    six = jnp.arange(1.0, 7.0)
    np.testing.assert_array_equal(elements(matrix(six)), six)
    assert matrix(six)[1, 2] == 6.0  # yz is the last


def test_a_payload_settles_to_mass_centre_and_inertia():
    load = fx.Payload(
        jnp.array(2.8),
        jnp.array([0.01, 0.02, 0.1]),
        jnp.zeros(3),
        0.01 * jnp.array([3.0, 4.0, 5.0, 0.1, 0.0, 0.2]),
    )
    (variant,) = fx.Payload.variants(fx.Scale(1.0, 1.0, -1.0, 1.0, 1.0, 0.1, 10.0, 1e-3))
    zero = placed(fx.Payload, variant, 0, 6)
    assert isinstance(zero, fx.Payload)
    numbers = load.numbers()
    fitted = zero.replace(mass=numbers[0], moment=numbers[1:4], inertia=numbers[4:])
    for name in load.parameters:
        np.testing.assert_allclose(
            getattr(fitted.settled(), name), getattr(load, name), atol=1e-12, err_msg=name
        )
    np.testing.assert_allclose(fitted.settled().numbers(), numbers, atol=1e-12)
    # a load that is not there any more
    gone = fitted.replace(mass=-numbers[0], moment=-numbers[1:4], inertia=-numbers[4:])
    np.testing.assert_allclose(gone.settled().com, load.com)
    assert gone.settled().mass == -2.8
    # no centre, or one far away
    for other in (zero, zero.replace(mass=jnp.array(1e-4), moment=jnp.ones(3))):
        np.testing.assert_array_equal(other.settled().numbers(), other.numbers())
    by_moment = jax.jacfwd(lambda moment: fitted.replace(moment=moment).settled().com)(
        fitted.moment
    )
    np.testing.assert_allclose(by_moment, np.eye(3) / 2.8, atol=1e-12)
    assert np.all(
        np.isfinite(jax.jacfwd(lambda mass: zero.replace(mass=mass).settled().com)(zero.mass))
    )


ERRORS = {
    "com_error": fx.ComError(jnp.array([[0.02, -0.03, 0.05]])),
    "inertia_tensor_error": fx.InertiaTensorError(
        jnp.array([[0.01, 0.02, 0.03, 0.004, -0.005, 0.006]])
    ),
}


@pytest.mark.parametrize("effect", ERRORS.values(), ids=ERRORS)
def test_an_error_of_one_link_concerns_its_body(effect, body):
    (name,) = effect.parameters
    values = np.asarray(getattr(effect, name)[0])
    altered = OnJoint(effect, 2, JOINTS).alter(body).added
    expected = np.zeros((body.source.nbody, 10))
    expected[2] = values @ per_moment(body.source)[2] if name == "moment" else [0, 0, 0, 0, *values]
    np.testing.assert_allclose(altered, expected, rtol=1e-12)
    many = effect.replace(**{name: jnp.stack([jnp.zeros(len(values))] * 2 + [jnp.asarray(values)])})
    np.testing.assert_allclose(many.alter(body).added, expected, rtol=1e-12)


def test_a_centre_of_mass_moves_with_the_inertia_about_it(body):
    """A body whose centre is elsewhere in the model, by so little that the first order is all."""
    shift = 1e-6 * np.array([2.0, -3.0, 1.0])
    before, after = (mujoco.MjModel.from_xml_string(SLANTED) for _ in range(2))
    after.body_ipos[2] += shift
    moment = np.zeros((JOINTS, 3))
    moment[2] = shift * before.body_mass[2]
    states = RNG.normal(size=(3, 5, JOINTS))
    table = tables(body, *states)
    change = jax.jit(body.add_moment(jnp.asarray(moment)).inverse_dynamics)
    for k, state in enumerate(zip(*states, strict=True)):
        expected = torque_in_c(after, *state) - torque_in_c(before, *state)
        np.testing.assert_allclose(change(*state) - table.torque[k], expected, atol=1e-9)
        np.testing.assert_allclose(
            np.einsum("ija,ja->i", table.by_moment[k], moment), expected, atol=1e-9
        )


def test_a_tilt_turns_the_weight_of_what_was_added(body):
    q, angles = RNG.normal(size=(4, JOINTS)), jnp.array([0.04, -0.02])
    change = np.zeros((JOINTS + 1, 10))
    change[1], change[2], change[3] = 0.5 * ERROR, -ERROR, 2.0 * ERROR
    changed = body.add_link(jnp.asarray(change[:-1])).add_payload(jnp.asarray(change[-1]))
    torque = lambda of: np.stack([of.inverse_dynamics(x, 0.0 * x, 0.0 * x) for x in jnp.asarray(q)])
    own, all_ = (torque(b.tilt(angles)) - torque(b) for b in (body, changed))
    assert np.abs(all_ - own).max() > 1e-3
    np.testing.assert_allclose(leaning(body, q, change) @ angles, all_ - own, atol=1e-10)


@pytest.mark.parametrize("mass", [0.3, 0.0, -2.0], ids=["heavier", "off centre", "impossible"])
def test_changed_links_need_what_the_tables_say(body, mass):
    """Torque is linear in inertial parameters, of links that cannot be built, too."""
    states, angles = RNG.normal(size=(3, 6, JOINTS)), np.array([0.04, -0.02])
    change = np.array([ERROR, -ERROR, 2.0 * ERROR, ERROR])
    change[:, 0] = mass
    table = tables(body, *states)
    wanted = table.torque + np.einsum("tijp,jp->ti", table.by_link, change[:-1])
    wanted = wanted + table.by_payload @ change[-1] + table.by_tilt @ angles
    found = heavier(body, *states, change, angles)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-10)


def test_derivatives_by_every_inertial_parameter(body):
    """Of accelerations, forward, reverse and numeric."""
    state = jnp.asarray(RNG.normal(size=(3, JOINTS)))

    def acceleration(x, state):
        links, load, angles = x[:30].reshape(3, 10), x[30:40], x[40:]
        return body.add_link(links).add_payload(load).tilt(angles).forward_dynamics(*state)

    forward = compare(acceleration, (jnp.asarray(0.01 * RNG.normal(size=42)),), state)
    assert np.all(np.any(np.abs(forward) > 0.0, axis=0)[30:])


def test_least_squares_finds_inertial_parameters_from_a_log(body):
    """The fit predicts the links' torque. Not each parameter is determined by the log."""
    states = RNG.normal(size=(3, 400, JOINTS))
    table = tables(body, *states)
    true = np.zeros((JOINTS, 10))
    true[1, 1:4], true[2, :4] = [0.02, 0.0, 0.03], [0.2, 0.01, 0.0, -0.04]
    rows = [jnp.asarray(s[:20]) for s in states]
    torque = jax.jit(jax.vmap(body.add_link(jnp.asarray(true)).inverse_dynamics))(*rows)
    columns = table.by_link.reshape(400, JOINTS, 30)
    found = np.linalg.lstsq(
        columns[:20].reshape(60, 30), (torque - table.torque[:20]).ravel(), rcond=1e-9
    )[0]
    # at states that were not seen
    np.testing.assert_allclose(columns @ found, columns @ true.ravel(), atol=1e-7)


def test_a_point_mass_knows_mass_only():
    mass = PointMass(jnp.array([2.0, 3.0]))
    np.testing.assert_array_equal(mass.add_link(jnp.ones((2, 10))).mass, [3.0, 4.0])
    assert mass.add_moment(jnp.ones((2, 3))) is mass
    np.testing.assert_array_equal(mass.add_payload(jnp.ones(10)).mass, [3.0, 4.0])
    table = tables(mass, *np.ones((3, 5, 2)))
    assert table.by_link.shape == (5, 2, 2, 10)
    np.testing.assert_array_equal(table.by_link[0, :, :, 0], np.eye(2))
    assert table.part([1]).by_link.shape == (5, 1, 1, 10)
    assert table.part(slice(0, 1)).by_tilt.shape == (5, 1, 2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_load_settles_to_one_that_can_be_simulated(sign):
    """A fit to a noisy log may find a principal moment a little below zero.

    It becomes zero, and the others stay.
    """
    load = fx.Payload(
        jnp.array(2.0),
        jnp.array([0.0, 0.0, 0.1]),
        jnp.zeros(3),
        jnp.array([0.02, -0.004, 0.01, 0.0, 0.0, 0.0]),
    )
    numbers = sign * load.numbers()
    settled = load.replace(
        mass=numbers[0], com=jnp.zeros(3), moment=numbers[1:4], inertia=numbers[4:]
    ).settled()
    np.testing.assert_allclose(
        settled.inertia, sign * np.array([0.02, 0.0, 0.01, 0.0, 0.0, 0.0]), atol=1e-12
    )
    np.testing.assert_allclose(settled.com, load.com, atol=1e-12)


FINGERS = """<mujoco><worldbody>
<body name="arm"><joint name="hinge" axis="0 1 0"/><inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/>
<body name="hand" pos="0 0 0.3"><inertial pos="0 0 0" mass="0.2" diaginertia="0.01 0.01 0.01"/>
<body name="left" pos="0 0.1 0"><inertial pos="0 0 0" mass="0.1" diaginertia="0.01 0.01 0.01"/></body>
<body name="right" pos="0 -0.1 0"><inertial pos="0 0 0" mass="0.1" diaginertia="0.01 0.01 0.01"/></body>
</body></body><body name="table" pos="1 0 0"><inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/></body>
</worldbody></mujoco>"""  # noqa: E501


def test_a_load_is_carried_by_the_hand_not_by_a_finger(tmp_path):
    assert read_model(stored(tmp_path, FINGERS)).plant.body.carrier == "hand"
    one = FINGERS.replace('<body name="left"', '<body name="left" quat="0 1 0 0"').replace(
        FINGERS[FINGERS.index('<body name="right"') : FINGERS.index("\n</body></body>")], ""
    )
    assert read_model(stored(tmp_path, one)).plant.body.carrier == "left"
