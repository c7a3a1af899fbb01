"""A patched plant as MJCF and effects.json: it reads back the same, and MuJoCo in C moves it the
same.
"""

import json
import struct
import xml.etree.ElementTree as ET

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import jaxidl.effects as fx
from jaxidl.effects import CATALOGUE, Effect, OnJoint
from jaxidl.errors import EffectError, ModelError, StoreError
from jaxidl.gap.benchmark.mechanisms import MECHANISMS, PENDULUM
from jaxidl.systems import Plant
from jaxidl.systems.export import patched, write_patched
from jaxidl.systems.mjcf import read_model
from jaxidl.types import State
from tests.helpers.effects import EXAMPLES, one, pair
from tests.helpers.model_files import CHAIN, RICH, stored

ON = lambda effect, joint: OnJoint(effect, joint, 2)
LOAD = fx.Payload(jnp.array(0.4), jnp.array([0.1, 0.05, -0.3]))
# a rod allows of no shift
THICK = ON(fx.InertiaTensorError(jnp.array([[0.02, 0.02, 0.02, 0.0, 0.0, 0.0]])), 1)
FAR = LOAD.replace(com=jnp.array([-0.3, 0.0, 0.1]))

WRITTEN: dict[str, tuple[list[Effect], str]] = {
    "viscous": (
        [fx.ViscousFriction(pair(0.3, 1 / 3)), ON(fx.ViscousFriction(one(0.2)), 1)],
        "joint/damping",
    ),
    "coulomb": (
        [ON(fx.CoulombFriction(one(0.3)), 0), fx.CoulombFriction(pair(0.1, 0.7))],
        "joint/frictionloss",
    ),
    "spring": (
        [ON(fx.Spring(one(2.0), one(0.7)), j) for j in (0, 1)],
        "joint/stiffness, joint/springref",
    ),
    "rotor": (
        [ON(fx.InertiaError(one(0.1)), 0), fx.InertiaError(pair(0.1, -0.02))],
        "joint/armature",
    ),
    "body": (
        [
            ON(fx.InertiaError(one(0.0), jnp.array(-0.3)), 1),
            fx.InertiaError(pair(0.0, 0.0), pair(0.2, 0.1)),
        ],
        "body/inertial",
    ),
    "both": ([fx.InertiaError(pair(0.1, 0.2), pair(0.2, -0.1))], "joint/armature, body/inertial"),
    "centre": ([THICK, ON(fx.ComError(jnp.array([[0.02, -0.01, 0.03]])), 1)], "body/inertial"),
    "tensor": (
        [
            fx.InertiaTensorError(
                0.001 * jnp.array([[3.0, 2, 4, 0.5, -0.3, 0.2], [1, 1, 1, 0, 0.1, 0]])
            )
        ],
        "body/inertial",
    ),
    "link": (
        [
            ON(fx.ComError(jnp.array([[0.02, 0.01, 0.0]])), 1),  # alone not possible
            THICK,
            ON(fx.InertiaError(one(0.1), one(0.2)), 1),
            fx.BaseTilt(pair(0.03, -0.05)),
        ],
        "joint/armature, body/inertial, option/gravity",
    ),
    "payload": ([LOAD], "body/inertial"),
    "heavy payload": (
        [
            LOAD.replace(
                moment=jnp.array([0.01, 0.0, 0.02]),
                inertia=0.1 * jnp.array([1.0, 1, 1, 0.1, 0, 0.2]),
            )
        ],
        "body/inertial",
    ),
    "payload gone": ([fx.Payload(jnp.array(-0.2), jnp.array([0.0, 0.0, -0.175]))], "body/inertial"),
    "tilt": ([fx.BaseTilt(pair(0.05, -0.03))], "option/gravity"),
    "payloads": ([LOAD, FAR, ON(fx.InertiaError(one(0.0), one(0.5)), 1)], "body/inertial"),
}
equation = jax.jit(lambda body, q, qd: body.equation_of_motion(q, qd))


def ingredients(plant, q, qd, tau, in_c):
    """The parts of a plant's acceleration: inertia, bias, torques, dry friction and delivered
    torque.
    """
    memory, body, delivered = plant.start(q), plant.body, tau
    for effect, state in zip(plant.effects, memory, strict=True):
        delivered, body = effect.actuate(state, q, qd, delivered, 1e-3)[0], effect.alter(body)
    if in_c:
        model, data = body.source, mujoco.MjData(body.source)
        assert all(type(getattr(e, "effect", e)).alter is Effect.alter for e in plant.effects)
        data.qpos[:], data.qvel[:], inertia = q, qd, np.zeros((model.nv, model.nv))
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, inertia)
        moving = inertia, data.qfrc_bias
    else:
        moving = equation(body, q, qd)
    torque = sum((e.torque(q, qd, delivered) for e in plant.effects), jnp.zeros_like(q))
    dry = sum((e.dry(q, qd, delivered, qd) for e in plant.effects), jnp.zeros_like(q))
    return [np.asarray(x) for x in (*moving, torque, dry, delivered)]


def compare(plant, again, in_c=True, rtol=1e-9):
    for state in np.random.default_rng(0).normal(size=(3, 3, len(plant.body.names))):
        arrays = [
            ingredients(p, *map(jnp.asarray, state), c) for p, c in ((plant, False), (again, in_c))
        ]
        for ours, theirs in zip(*arrays, strict=True):
            np.testing.assert_allclose(theirs, ours, rtol=rtol, atol=1e-10)


def record_of(path):
    """The record, read as strict JSON."""
    return json.loads(path.read_text(), parse_constant=lambda name: pytest.fail(f"{name} in JSON"))


@pytest.mark.parametrize("case", WRITTEN)
def test_what_mujoco_has_is_restored_by_the_model_alone(case, two_link, tmp_path):
    added, place = WRITTEN[case]
    model, record = write_patched(two_link, added, tmp_path / "new")
    entries = record_of(record)["effects"]
    assert all(entry["in_mjcf"] and entry["mjcf"] in place for entry in entries)
    plant = Plant(two_link.plant.body, (*two_link.plant.effects, *added))
    compare(plant, read_model(model).plant)
    record.unlink()
    compare(plant, read_model(model).plant)


def test_a_reloaded_plant_accelerates_as_the_patched_one(two_link, tmp_path):
    added = [effects[0] for effects, _ in WRITTEN.values()] + [
        EXAMPLES["stribeck_friction"],
        EXAMPLES["torque_ripple"],
    ]
    again = read_model(write_patched(two_link, added, tmp_path)[0]).plant
    step = jax.jit(lambda plant, q, qd, tau: plant.acceleration(State(q, qd), tau, 1e-3))
    plant = Plant(two_link.plant.body, (*two_link.plant.effects, *added))
    for state in jnp.asarray(np.random.default_rng(1).normal(size=(5, 3, 2))):
        np.testing.assert_allclose(step(again, *state), step(plant, *state), rtol=1e-8, atol=1e-8)


def test_what_mujoco_has_not_is_in_the_record_alone(two_link, tmp_path):
    added = [
        effect
        for name, effect in EXAMPLES.items()
        if name in CATALOGUE and name not in ("inertia_error", "payload") and not effect.mjcf
    ]
    added += [ON(fx.Stiction(one(1.0), jnp.array(1e-3), jnp.array(jnp.inf)), 1)]
    model, record = write_patched(two_link, added, tmp_path)
    assert all(
        entry["in_mjcf"] is False and entry["mjcf"] is None
        for entry in record_of(record)["effects"]
    )
    assert [e.to_dict() for e in read_model(model).plant.effects] == [e.to_dict() for e in added]
    assert mujoco.MjModel.from_xml_path(str(model)).nu == 0


def test_what_does_not_go_into_mjcf_stays_in_the_record(two_link, tmp_path):
    spring = fx.Spring(pair(1.0, 2.0), pair(0.1, 0.2))
    light = ON(fx.InertiaError(one(-0.04)), 1)  # of 0.03 of armature
    # its inertia about that centre would be negative
    outside = ON(fx.ComError(jnp.array([[3.0, 0.0, 0.0]])), 1)
    void = ON(fx.InertiaError(one(0.0), one(-1.0)), 1)  # all that the body weighs
    added = [spring, ON(fx.Spring(one(3.0), one(0.4)), 1), light, void, outside]
    model, record = write_patched(two_link, added, tmp_path)
    written = [entry["in_mjcf"] for entry in record_of(record)["effects"]]
    assert written == [True, True, False, False, False]  # two springs of a joint are one
    compare(Plant(two_link.plant.body, tuple(added)), read_model(model).plant, in_c=False)


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_a_spring_that_is_weaker_or_gone_is_written(two_link, tmp_path, share):
    whole = ON(fx.Spring(one(3.0), one(0.4)), 1)
    model, _ = write_patched(two_link, [whole], tmp_path / "whole")
    less = ON(fx.Spring(one(-3.0 * share), one(0.4)), 1)
    after, _ = write_patched(read_model(model), [less], tmp_path / "less")
    compiled = mujoco.MjModel.from_xml_path(str(after))
    np.testing.assert_allclose(compiled.jnt_stiffness, [0.0, 3.0 * (1.0 - share)], atol=1e-9)
    if share < 1.0:
        np.testing.assert_allclose(compiled.qpos_spring[1], 0.4)


def test_a_patch_of_a_patch_carries_over_what_was_found_before(two_link, tmp_path):
    first = [
        ON(fx.ViscousFriction(one(0.2)), 0),
        EXAMPLES["stribeck_friction"],
        LOAD,
        ON(fx.TorqueScale(one(2.0)), 0),
    ]
    second = [
        fx.ViscousFriction(pair(0.1, 0.4)),
        LOAD.replace(com=jnp.ones(3)),
        ON(fx.TorqueSaturation(one(3.0)), 0),
    ]
    once = read_model(write_patched(two_link, first, tmp_path)[0])
    model, record = write_patched(once, second, tmp_path)  # over itself
    entries = record_of(record)["effects"]
    assert [entry["effect"] for entry in entries] == [
        (e.effect if isinstance(e, OnJoint) else e).name for e in first + second
    ]
    assert [entry["in_mjcf"] for entry in entries] == [True, False, True, False, True, True, False]
    compare(Plant(two_link.plant.body, (*first, *second)), read_model(model).plant)
    inside = mujoco.MjModel.from_xml_path(str(model))
    np.testing.assert_allclose(inside.actuator_gear[:, 0], [2.0, 1.0])
    np.testing.assert_allclose(inside.actuator_forcerange[0], [-1.5, 1.5])  # before the gear


def test_motors_are_written_if_they_can_do_it_in_this_order(two_link, tmp_path):
    scale, limit, lag = (
        EXAMPLES[f"{name}"] for name in ("torque_scale", "torque_saturation", "actuator_lag")
    )
    for order, motors in (
        ((lag, scale, limit), 2),
        ((limit, scale, limit), 2),
        ((limit, lag), 0),
        ((lag, lag), 0),
        ((EXAMPLES["actuator_delay"], scale), 2),
        ((EXAMPLES["backlash"], scale), 0),
        ((scale, EXAMPLES["backlash"]), 2),
    ):
        text, record = patched(two_link, order)
        assert text.count("<general") == motors
        assert not any(entry["in_mjcf"] for entry in record["effects"])
        assert [entry["mjcf"] is not None for entry in record["effects"]] == [
            bool(motors and e.mjcf) for e in order
        ]
    with_actuators = read_model(stored(tmp_path, RICH))
    assert (
        patched(with_actuators, [OnJoint(fx.TorqueScale(one(2.0)), 0, 4)])[0].count("<general") == 1
    )


def test_the_users_own_things_are_kept_in_the_same_order(tmp_path):
    model = read_model(
        stored(tmp_path, RICH.replace('pos="0 0 -0.5"', 'pos="0.1234567891 0 -0.5"'))
    )
    added = [
        OnJoint(fx.CoulombFriction(one(0.2)), 3, 4),
        OnJoint(fx.InertiaError(one(-0.1)), 1, 4),
        LOAD,
    ]
    path, _ = write_patched(model, added, tmp_path / "new")
    again = read_model(path)
    assert again.names == model.names
    compare(Plant(model.plant.body, (*model.plant.effects, *added)), again.plant)
    inside = mujoco.MjModel.from_xml_path(str(path))
    assert (inside.nu, inside.nsensor, inside.ngeom, inside.nlight) == (1, 1, 6, 1)
    assert inside.dof_armature[1] == 0.0  # although its class has some
    assert inside.body("table").mass[0] == 8000.0


def test_bodies_in_frames_keep_their_order(tmp_path):
    bodies = [
        f'<body><joint name="{name}" axis="0 1 0"/><geom size="0.1" pos="{place} 0 0"/></body>'
        for name, place in ("a1", "b2", "c3")
    ]
    frame = '<frame pos="1 0 0" euler="0 0 30">'
    plain = f"<mujoco><worldbody>{frame}{bodies[0]}</frame>{bodies[1]}{frame}{bodies[2]}</frame></worldbody></mujoco>"  # noqa: E501
    model = read_model(stored(tmp_path, plain))
    again = read_model(
        write_patched(model, [OnJoint(fx.ViscousFriction(one(0.1)), 2, 3)], tmp_path / "new")[0]
    )
    assert again.names == model.names == ("a", "b", "c")
    np.testing.assert_allclose(again.plant.body.source.body_mass, model.plant.body.source.body_mass)


def test_a_urdf_with_a_mesh_becomes_mjcf_elsewhere(tmp_path):
    points = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])[
        [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    ]
    (tmp_path / "meshes").mkdir()
    mesh = b"".join(struct.pack("<12fH", *[0.0] * 3, *face.ravel(), 0) for face in points)
    (tmp_path / "meshes" / "part.stl").write_bytes(bytes(80) + struct.pack("<I", 4) + mesh)
    shape = (
        '<collision><geometry><mesh filename="meshes/part.stl"/></geometry></collision></link><link'
        ' name="l2">'
    )
    model = read_model(
        stored(tmp_path, CHAIN.replace('</link><link name="l2">', shape), "arm.urdf")
    )
    added = [OnJoint(fx.ViscousFriction(one(0.1)), 3, 4), LOAD]
    path, _ = write_patched(model, added, tmp_path / "far" / "away")
    assert ET.parse(path).getroot().tag == "mujoco"
    compare(Plant(model.plant.body, tuple(added)), read_model(path).plant)
    assert mujoco.MjModel.from_xml_path(str(path)).nmesh == 1


def test_what_cannot_be_written_raises_and_leaves_nothing(two_link, tmp_path):
    for wrong in (
        fx.ViscousFriction(pair(-0.1, 0.1)),
        fx.ViscousFriction(jnp.ones(3)),
        OnJoint(LOAD, 0, 1),
    ):
        with pytest.raises(EffectError):
            write_patched(two_link, [wrong], tmp_path / "new")
    with pytest.raises(ModelError, match="gone"):
        write_patched(two_link._replace(path=tmp_path / "gone.xml"), [], tmp_path / "new")
    with pytest.raises(ModelError, match="read the model again"):
        write_patched(
            two_link._replace(path=stored(tmp_path, PENDULUM), names=("a",)), [], tmp_path / "new"
        )
    assert not (tmp_path / "new").exists()
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="to write"):
        write_patched(two_link, [], tmp_path / "file" / "new")


DT, STEPS = 1e-4, 10_000
NEUTRAL = {
    "lag": 1e-6,
    "scale": 1.0,
    "limit": 1e6,
    "viscous": 0.0,
    "coulomb": 0.0,
    "stiffness": 0.0,
    "rest": 0.0,
}
NEUTRAL |= {"extra": 0.0, "mass": 0.0, "load": 0.0}
MOVED = {
    "viscous": {"viscous": 0.5},
    "coulomb": {"coulomb": 1.0},
    "sticking": {"coulomb": 3.0},
    "spring": {"stiffness": 3.0, "rest": 0.3},
    "armature": {"extra": 0.1},
    "mass": {"mass": -0.3},
    "payload": {"load": 0.5},
    "scale": {"scale": 0.7},
    "saturation": {"limit": 1.5},
    "lag": {"lag": 0.05},
    "drive": {"lag": 0.05, "scale": 0.7, "limit": 1.2},
}


def effects_of(joints, **values):
    """One list of effects of one structure, so that one program runs all cases."""
    v = {key: jnp.full(joints, value) for key, value in (NEUTRAL | values).items()}
    drive = fx.ActuatorLag(v["lag"]), fx.TorqueScale(v["scale"]), fx.TorqueSaturation(v["limit"])
    friction = (
        fx.ViscousFriction(v["viscous"]),
        fx.CoulombFriction(v["coulomb"]),
        fx.Spring(v["stiffness"], v["rest"]),
    )
    load = fx.Payload(v["load"][0], jnp.array([0.1, 0.05, -0.3]))
    return (*drive, *friction, fx.InertiaError(v["extra"], v["mass"]), load)


def changed(effects, neutral):
    same = lambda a, b: all(map(np.array_equal, jax.tree.leaves(a), jax.tree.leaves(b)))
    return [a for a, b in zip(effects, neutral, strict=True) if not same(a, b)]


def push(joints):
    t = DT * np.arange(STEPS)[:, None]
    return np.array([4.0, 2.0])[:joints] * np.sin(2 * np.pi * np.array([1.5, 2.5])[:joints] * t)


@jax.jit
def rollout(plant, start, torque):
    def step(carry, tau):
        carry = plant.step(*carry, tau, DT)
        return carry, carry[0].q

    return jax.lax.scan(step, (State(start, jnp.zeros_like(start)), plant.start(start)), torque)[1]


def rollout_in_c(path, start, torque, hard):
    """The exported model in plain MuJoCo, driven by its motors if it has any."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep, model.opt.integrator = DT, mujoco.mjtIntegrator.mjINT_EULER
    if hard:
        model.dof_solref[:], model.dof_solimp[:, :2] = (4 * DT, 1.0), 0.99
    data = mujoco.MjData(model)
    data.qpos[:] = start
    drive, out = data.ctrl if model.nu else data.qfrc_applied, np.empty_like(torque)
    for t, tau in enumerate(torque):
        drive[:] = tau
        mujoco.mj_step(model, data)
        out[t] = data.qpos
    return out


@pytest.mark.parametrize(
    "mechanism", [pytest.param("pendulum", marks=pytest.mark.slow), "two_link"]
)
def test_plain_mujoco_moves_the_exported_model_as_our_plant_moves(mechanism, tmp_path):
    """One second at 0.1 ms. Both schemes are of first order, hence 3e-3 rad on 1 rad of motion.

    MuJoCo's dry friction gives way: with the hardness that is written, for steps of 2 ms, a little;
    harder still, less.
    """
    model = read_model(stored(tmp_path, MECHANISMS[mechanism]))
    joints = len(model.names)
    start, torque, neutral = np.full(joints, 0.4), push(joints), effects_of(joints)
    free = np.asarray(rollout(Plant(model.plant.body, neutral), start, torque))
    for name, values in MOVED.items():
        effects = effects_of(joints, **values)
        ours = np.asarray(rollout(Plant(model.plant.body, effects), start, torque))
        path, _ = write_patched(model, changed(effects, neutral), tmp_path / name)
        theirs = rollout_in_c(path, start, torque, hard=True)
        np.testing.assert_allclose(theirs, ours, atol=3e-3, err_msg=name)
        assert np.abs(ours - free).max() > 0.05, name  # it makes a difference
        if "coulomb" in values:
            np.testing.assert_allclose(
                rollout_in_c(path, start, torque, hard=False), ours, atol=0.012
            )
