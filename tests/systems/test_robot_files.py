"""Model files of real robots: missing meshes, links without mass, joints that mimic, and parts of a
robot.
"""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from jaxidl.effects import InertiaError, OnJoint, Payload, ViscousFriction
from jaxidl.errors import ModelError
from jaxidl.systems.export import patched
from jaxidl.systems.mjcf import names_of, read_model
from jaxidl.systems.regressor import table
from jaxidl.systems.tables import inverse_dynamics, tables
from tests.helpers.model_files import (
    FLAT,
    MIMIC,
    SHAPES,
    complaint,
    scene,
    stored,
    torque_in_c,
    urdf,
)


def states(seed, joints):
    return np.random.default_rng(seed).normal(size=(3, joints))


def test_meshes_that_are_not_there_are_left_out(tmp_path):
    bare = read_model(stored(tmp_path, urdf(), "bare.urdf"))
    dressed = read_model(stored(tmp_path, urdf(shapes=SHAPES), "dressed.urdf"))
    assert any("1 mesh file not found" in note for note in dressed.notes), dressed.notes
    at = states(0, 4)
    np.testing.assert_array_equal(
        torque_in_c(dressed.plant.body.source, *at), torque_in_c(bare.plant.body.source, *at)
    )


def test_missing_assets_of_mjcf_are_left_out(tmp_path):
    assets = """<asset><mesh name="m" file="gone.stl"/><texture name="t" type="2d" file="gone.png"/>
    <material name="k" texture="t"/><hfield name="h" file="gone.png" size="1 1 1 1"/></asset>"""
    shape = '<geom type="mesh" mesh="m" material="k"{}/>'
    inertial = '<inertial pos="0 0 -0.1" mass="1" diaginertia="1 1 1"/>'
    ground = '<geom type="hfield" hfield="h"/>'
    text = scene(
        inside=inertial + shape.format(""),
        after=assets + f"<worldbody>{ground}{shape.format('')}</worldbody>",
    )
    model = read_model(stored(tmp_path, text))
    assert [note for note in model.notes if "texture" in note or "mesh" in note] == [
        "2 mesh files not found or not readable: left out, the dynamics need no geometry",
        "1 texture file not found: left out",
    ]
    assert model.plant.body.source.body_mass[1] == 1.0
    primitive = scene(
        ' name="a"', inside=shape.format(' mass="0"') + '<geom size="0.1" mass="3"/>', after=assets
    )
    assert read_model(stored(tmp_path, primitive)).plant.body.source.body_mass[1] == pytest.approx(
        3 + 4 / 3 * np.pi, rel=1e-9
    )
    for inside, words in (
        ("", "body of joint a"),
        ('<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', None),
    ):
        path = stored(tmp_path, scene(' name="a"', inside=inside + shape.format(""), after=assets))
        if words:
            assert words in complaint(path)
            assert "gone.stl" in complaint(path)
        else:
            read_model(path)


def test_a_patched_model_without_its_meshes_reads_back(tmp_path):
    model = read_model(stored(tmp_path, urdf(shapes=SHAPES, inside={2: ""}), "robot.urdf"))
    text, _ = patched(model, [])
    again = read_model(stored(tmp_path, text))
    np.testing.assert_allclose(
        again.plant.body.source.body_mass, model.plant.body.source.body_mass, rtol=1e-12
    )
    assert "gone" not in text
    assert "package" not in text


def test_a_link_without_mass_between_two_joints(tmp_path):
    """Models of wrists have such links. The links beyond them have all the inertia."""
    for nothing in (
        "",
        (
            '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0"'
            ' iyz="0"/></inertial>'
        ),
    ):
        model = read_model(stored(tmp_path, urdf(inside={2: nothing}), "robot.urdf"))
        assert any("no mass or inertia of its own: l2" in note for note in model.notes)
        light = mujoco.MjModel.from_xml_string(urdf())
        light.body("l2").mass[:], light.body("l2").inertia[:] = 1e-15, 1e-15
        at = states(1, 4)
        np.testing.assert_allclose(
            torque_in_c(model.plant.body.source, *at), torque_in_c(light, *at), atol=1e-6
        )


def test_a_joint_without_any_inertia_is_named(tmp_path):
    assert "none at j4" in complaint(stored(tmp_path, urdf(inside={4: ""}), "robot.urdf"))
    box = "<collision><geometry><box size='1 1 1'/></geometry></collision>"
    # no mass but what the file gives
    assert "none at j4" in complaint(stored(tmp_path, urdf(inside={4: box}), "robot.urdf"))
    on_axis = (
        '<inertial><origin xyz="0.3 0 0"/><mass value="1"/><inertia ixx="0" iyy="0" izz="0" ixy="0"'
        ' ixz="0" iyz="0"/></inertial>'
    )
    assert "none at j4" in complaint(stored(tmp_path, urdf(inside={4: on_axis}), "robot.urdf"))


def test_unbalanced_inertia_is_balanced_and_named(tmp_path):
    """The largest moment stays and the others are raised to the least that is possible.

    What is slightly wrong changes slightly.
    """
    for least, most in ((0.01, 0.04), (0.01, 0.0201)):
        model = read_model(
            stored(tmp_path, urdf(inside={3: FLAT.format(least, least, most, 0)}), "robot.urdf")
        )
        (note,) = [note for note in model.notes if "A + B < C" in note]
        assert " l3 " in note
        np.testing.assert_allclose(
            sorted(model.plant.body.source.body_inertia[4]), [most / 2, most / 2, most]
        )  # the base is body 1
    turned = read_model(
        stored(tmp_path, urdf(inside={3: FLAT.format(0.025, 0.025, 0.01, 0.015)}), "robot.urdf")
    )
    data = mujoco.MjData(turned.plant.body.source)  # moments 0.01, 0.01 and 0.04 about (1, 1, 0)
    mujoco.mj_kinematics(turned.plant.body.source, data)
    principal = np.zeros(9)
    mujoco.mju_quat2Mat(principal, turned.plant.body.source.body_iquat[4])
    tensor = (
        principal.reshape(3, 3)
        * turned.plant.body.source.body_inertia[4]
        @ principal.reshape(3, 3).T
    )
    np.testing.assert_allclose(tensor, [[0.03, 0.01, 0], [0.01, 0.03, 0], [0, 0, 0.02]], atol=1e-9)


def test_an_inertia_matrix_that_no_body_has_is_raised_and_noted(tmp_path):
    for tensor in (FLAT.format(0.01, 0.01, -0.04, 0), FLAT.format(0.01, 0.01, 0.02, 0.03)):
        model = read_model(stored(tmp_path, urdf(inside={3: tensor}), "robot.urdf"))
        (note,) = [note for note in model.notes if "inertia matrix" in note]
        assert " l3 " in note
        moments = np.sort(model.plant.body.source.body_inertia[4])
        assert moments[0] >= 0.0
        assert moments[2] <= moments[0] + moments[1] + 1e-9


def test_inertia_that_rounding_made_negative_is_none(tmp_path):
    path = stored(tmp_path, urdf(inside={3: FLAT.format(-5e-20, 0, 4e-18, 0)}), "robot.urdf")
    model = read_model(path)
    assert "no inertia of its own: l3" in model.notes
    assert model.plant.body.source.body_inertia[4].max() < 1e-11


def test_a_file_without_masses_says_so(tmp_path):
    assert "no mass at all" in complaint(
        stored(tmp_path, urdf(inside=dict.fromkeys((1, 2, 3, 4), "")), "robot.urdf")
    )


def fused(text, name, at):
    """A chain in C whose joint ``name`` stands still at ``at``: torques of the others."""
    model = mujoco.MjModel.from_xml_string(text)
    j = model.joint(name).id
    keep = [i for i in range(model.njnt) if i != j]

    def of(q, qd, qdd):
        whole = np.zeros((3, model.njnt))
        whole[:, keep] = q, qd, qdd
        whole[0, j] = at
        return torque_in_c(model, *whole)[keep]

    return of


@pytest.mark.parametrize("name", ["j1", "j2", "j3", "j4"])
def test_joints_that_are_not_asked_for_are_locked(tmp_path, name):
    path = stored(tmp_path, urdf(), "robot.urdf")
    rest = [joint for joint in ("j4", "j3", "j2", "j1") if joint != name]
    for at in (None, 0.7):
        model = read_model(path, joints=rest, locked={} if at is None else {name: at})
        assert model.names == tuple(reversed(rest))  # in the file's order
        assert (
            f"locked, because they were not chosen or not logged: {name} at {at or 0:.4g}"
            in model.notes
        )
        motion = states(2, 3)
        expected = fused(urdf(), name, at or 0.0)(*motion)
        np.testing.assert_allclose(
            torque_in_c(model.plant.body.source, *motion), expected, rtol=1e-9, atol=1e-9
        )
        text, _ = patched(model, [])
        again = read_model(stored(tmp_path, text))
        np.testing.assert_allclose(
            torque_in_c(again.plant.body.source, *motion), expected, rtol=1e-9, atol=1e-9
        )


def test_a_slide_can_be_locked(tmp_path):
    joint = '<joint name="{}" type="{}" axis="{}" pos="0.1 0 0"/>'
    body = (
        f'<body pos="0.1 0.2 0" quat="0.6 0.8 0 0">{joint}<geom size="0.1" pos="0.2 0'
        ' 0.1"/>{}</body>'
    )
    inner = body.format("b", "hinge", "0 1 0", "")
    path = stored(
        tmp_path,
        f"<mujoco><worldbody>{body.format('a', 'slide', '0 0.6 0.8', inner)}</worldbody></mujoco>",
    )
    model = read_model(path, joints=["b"], locked={"a": -0.3})
    motion = states(3, 1)
    expected = fused(path.read_text(), "a", -0.3)(*motion)
    np.testing.assert_allclose(torque_in_c(model.plant.body.source, *motion), expected, rtol=1e-9)


def test_unknown_joints_are_refused(tmp_path):
    path = stored(tmp_path, urdf(), "robot.urdf")
    for joints, words in (
        (["j5"], "choose among j1, j2, j3, j4"),
        (["j1", "j1"], "j1 twice"),
        ([], "none"),
    ):
        with pytest.raises(ModelError, match=words):
            read_model(path, joints=joints)


def test_a_joint_that_mimics_another_is_locked(tmp_path):
    path = stored(tmp_path, urdf(mimic=MIMIC), "robot.urdf")
    assert names_of(path) == ("j1", "j2", "j3")
    model = read_model(path)
    assert "joint j4 mimics j2: it follows" in model.notes
    motion = states(4, 3)
    expected = fused(urdf(), "j4", 0.2)(*motion)
    np.testing.assert_allclose(
        torque_in_c(model.plant.body.source, *motion), expected, rtol=1e-9, atol=1e-9
    )
    part = read_model(path, joints=["j3"], locked={"j2": 0.4})
    ignored = "joint j4 mimics j2: its own motion is ignored, it is locked at 0"
    assert ignored in part.notes
    assert part.plant.body.following is None
    with pytest.raises(ModelError, match="j4, which mimics j2"):
        read_model(path, joints=["j1", "j4"])


def test_the_torque_of_a_mechanism_has_the_motion_of_joints_that_mimic(tmp_path):
    """Its power is the rate at which energy changes, that of the joints that follow included."""
    model = read_model(stored(tmp_path, urdf(mimic=MIMIC), "robot.urdf"))
    whole = model.plant.body.following.source
    assert whole.njnt == 4
    t = np.linspace(0.0, 1.0, 2001)[:, None]
    turn, at = np.array([1.3, 2.1, 1.7]), np.array([0.3, 0.9, 1.4])
    q, qd, qdd = (np.real((1j * turn) ** k * np.exp(1j * (turn * t + at))) for k in range(3))
    data = mujoco.MjData(whole)
    whole.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    energy = []
    for x, v in zip(q, qd, strict=True):
        data.qpos[:], data.qvel[:] = [*x, 0.2 - 0.5 * x[1]], [*v, -0.5 * v[1]]
        mujoco.mj_forward(whole, data)
        energy.append(data.energy.sum())
    whole.opt.enableflags = 0  # MJX does not know it
    tau = inverse_dynamics(model.plant.body, q, qd, qdd)
    power, rate = np.sum(tau * qd, axis=1), np.gradient(energy, t[:, 0], edge_order=2)
    np.testing.assert_allclose(power, rate, atol=1e-4 * np.abs(rate).max())
    few = slice(None, None, 200)
    body, motion = model.plant.body, (q[few], qd[few], qdd[few])
    along = tables(body, *motion)
    load = jnp.array([0.3, 0.02, 0.05, -0.01, 0.02, 0.03, 0.01, 0.0, 0.001, 0.0])
    loaded = jax.vmap(body.add_payload(load).inverse_dynamics)
    heavier = loaded(*map(jnp.asarray, motion))
    np.testing.assert_allclose(along.torque, tau[few], atol=1e-9)
    np.testing.assert_allclose(along.torque + along.by_payload @ load, heavier, atol=1e-9)
    for n, x in enumerate(zip(*motion, strict=True)):
        here = table(body, *map(jnp.asarray, x))
        np.testing.assert_allclose(here.torque, along.torque[n], atol=1e-9)
        np.testing.assert_allclose(here.by_link, along.by_link[n], atol=1e-9)
        np.testing.assert_allclose(here.by_tilt, along.by_tilt[n], atol=1e-9)
    still = inverse_dynamics(model.plant.body.replace(following=None), q, qd, qdd)
    assert np.abs(tau - still).max() > 0.01 * np.abs(still).max()


def test_a_corrected_model_keeps_joints_that_mimic(tmp_path):
    model = read_model(stored(tmp_path, urdf(mimic=MIMIC), "robot.urdf"))
    found = (
        OnJoint(InertiaError(jnp.array([0.02]), jnp.array([0.3])), 2, 3),
        OnJoint(ViscousFriction(jnp.array([0.7])), 1, 3),
        Payload(jnp.array(0.4), jnp.array([0.1, 0.0, 0.02])),
    )
    body = model.plant.body
    for effect in found:
        body = effect.alter(body)
    text, record = patched(model, found)
    assert all(entry["in_mjcf"] for entry in record["effects"])
    again = read_model(stored(tmp_path, text))
    assert again.names == model.names
    assert [type(e.effect) for e in again.plant.effects] == [ViscousFriction]
    motion = [jnp.asarray(x) for x in states(6, 3)]
    wanted = body.inverse_dynamics(*motion)
    np.testing.assert_allclose(again.plant.body.inverse_dynamics(*motion), wanted, rtol=1e-9)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_that_float_are_refused_unless_a_part_is_asked_for(tmp_path, kind):
    path = stored(tmp_path, urdf(kind=kind), "robot.urdf")
    assert f"j4, {kind}" in complaint(path)
    assert "--joints" in complaint(path)
    model = read_model(path, joints=["j1", "j2", "j3"])
    assert model.names == ("j1", "j2", "j3")
    motion = states(5, 3)
    np.testing.assert_allclose(
        torque_in_c(model.plant.body.source, *motion),
        fused(urdf(), "j4", 0.0)(*motion),
        rtol=1e-9,
        atol=1e-9,
    )


GRIPPER = """<mujoco><worldbody><body><joint name="arm" axis="0 1 0"/><geom size="0.1" pos="0.3 0 0"/>
<body name="left" pos="0.5 0 0"><joint name="f1" type="slide"/><geom size="0.02"/></body>
<body name="right" pos="0.5 0 0"><joint name="f2" type="slide"/><geom size="0.02"/></body></body></worldbody>
<tendon><fixed name="split"><joint joint="f1" coef="0.5"/><joint joint="f2" coef="0.5"/></fixed></tendon>
<equality><joint joint1="f1" joint2="f2"/><connect body1="left" body2="right" anchor="0 0 0"/></equality>
<actuator><motor joint="arm"/><position tendon="split" name="grip"/></actuator>
<sensor><jointpos joint="f1"/><actuatorfrc actuator="grip"/><jointpos joint="arm"/></sensor>
<keyframe><key qpos="1 0 0"/></keyframe></mujoco>"""  # noqa: E501


def test_an_arm_can_be_read_without_its_gripper(tmp_path):
    path = stored(tmp_path, GRIPPER)
    assert "name the joints to keep" in complaint(path)
    model = read_model(path, joints=["arm"])
    assert model.names == ("arm",)
    whole = mujoco.MjModel.from_xml_path(str(path))
    assert model.plant.body.source.body_mass.sum() == pytest.approx(
        whole.body_mass.sum(), rel=1e-12
    )
    text, _ = patched(model, [])
    assert read_model(stored(tmp_path, text)).names == ("arm",)
    # the fingers are still connected
    with pytest.raises(ModelError, match="no equality constraints"):
        read_model(stored(tmp_path, GRIPPER), joints=["arm", "f2"])


FINGERS = """<mujoco><worldbody><body><joint name="arm" axis="0 1 0"/><geom size="0.1"/>
<body pos="0.5 0 0"><joint name="f1" type="slide" ref="0.01"/><geom size="0.02"/></body>
<body pos="0.5 0 0"><joint name="f2" type="slide" ref="0.03"/><geom size="0.02"/></body></body>
</worldbody>
<equality><joint joint1="f1" joint2="f2" polycoef="0.002 -1 5 0 0"/></equality></mujoco>"""


def test_in_mjcf_joints_mimic_others_by_an_equality(tmp_path):
    """As MuJoCo has it: relative to the reference positions, by a polynomial."""
    path = stored(tmp_path, FINGERS)
    model = read_model(path, joints=["arm"], locked={"f2": 0.07})
    where = 0.01 + 0.002 - 0.04 + 5 * 0.04**2
    assert any(
        f"joint f1 mimics f2: its own motion is ignored, it is locked at {where:.4g}" in note
        for note in model.notes
    )
    assert read_model(path).names == ("arm", "f2")
    with pytest.raises(ModelError, match="f1, which mimics f2; leave it out"):
        read_model(path, joints=["arm", "f1"])


def test_xacro_and_sdf_are_refused_with_the_remedy(tmp_path):
    xacro = '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="a"/></robot>'
    assert "expand it: xacro robot.urdf.xacro > robot.urdf" in complaint(
        stored(tmp_path, xacro, "robot.urdf.xacro")
    )
    expanded = urdf().replace("</robot>", "<!-- <xacro:wheel/>\n --></robot>")
    assert len(read_model(stored(tmp_path, expanded, "robot.urdf")).names) == len(
        read_model(stored(tmp_path, urdf(), "robot.urdf")).names
    )
    assert "SDF is not supported" in complaint(
        stored(tmp_path, '<sdf version="1.9"></sdf>', "robot.sdf")
    )


DEGREES = """<mujoco><compiler angle="degree"/>
<default><default class="k"><joint damping="0.3" armature="0.1"/></default></default>
<worldbody><body name="a" pos="0 0 0.1"><joint name="j" class="k" axis="0 1 0" ref="20" range="-30 40"/>
<geom type="cylinder" size="0.02 0.1"/><frame pos="0.1 0.2 0.3" euler="10 20 30" childclass="k"><joint axis="1 0 0" pos="1 2 3"/>
<body name="c" pos="0 0 -0.5"><joint axis="0 1 0" stiffness="2" springref="90"/><geom type="ellipsoid" size="0.1 0.2 0.3"/></body>
</frame></body></worldbody></mujoco>"""  # noqa: E501


def test_a_part_of_a_file_in_degrees_with_frames_and_unnamed_joints_is_read(tmp_path):
    model = read_model(stored(tmp_path, DEGREES), joints=["joint1", "joint2"])
    assert len(model.names) == 2
    motion, bare = states(6, 2), mujoco.MjSpec.from_string(DEGREES)
    for joint in bare.joints:
        joint.damping, joint.stiffness = np.zeros(3), np.zeros(3)
    whole, everything = bare.compile(), np.zeros((3, 3))
    everything[0, 0] = np.deg2rad(20)
    everything[:, 1:] = motion
    np.testing.assert_allclose(
        torque_in_c(model.plant.body.source, *motion),
        torque_in_c(whole, *everything)[1:],
        rtol=1e-9,
        atol=1e-9,
    )
    assert [effect.to_dict()["effect"] for effect in model.plant.effects] == [
        "viscous_friction",
        "viscous_friction",
        "spring",
    ]
    with pytest.raises(ModelError, match=r"lock it at 0\.349"):
        read_model(tmp_path / "model.xml", joints=["joint1", "joint2"], locked={"j": 0.0})
