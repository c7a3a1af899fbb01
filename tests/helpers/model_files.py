"""Model files of robots, right and damaged, and what MuJoCo in C makes of them."""

import re

import mujoco
import pytest

from jaxidl.errors import ModelError
from jaxidl.systems.mjcf import read_model

LINK = (
    '<link name="l{0}"><inertial><origin xyz="0.02 0.01 -0.1" rpy="0.1 0.2 0.3"/><mass'
    ' value="{1}"/><inertia ixx="0.02" iyy="0.015" izz="0.01" ixy="0.001" ixz="-0.002"'
    ' iyz="0.0005"/></inertial></link>'
)
HINGE = (
    '<joint name="j{0}" type="continuous"><parent link="l{1}"/><child link="l{0}"/>'
    '<origin xyz="0.03 0.01 -0.25" rpy="0.2 0 0.1"/><axis xyz="{2}"/></joint>'
)
SHAPE = '<{0}><geometry><mesh filename="package://robot/meshes/{1}"/></geometry></{0}>'
SHAPES = SHAPE.format("visual", "a.dae") + SHAPE.format("collision", "a.stl")
AXES = ("0 1 0", "1 0 0", "0 0.6 0.8", "1 0 0")


def urdf(
    *, shapes="", masses=(1.6, 1.2, 0.8, 0.4), inside=None, mimic="", kind="continuous", last=""
):
    """A chain of four joints; ``inside`` replaces inertials of links by their number."""
    links = [
        LINK.format(j + 1, mass).replace("</link>", shapes + "</link>")
        for j, mass in enumerate(masses)
    ]
    for j, text in (inside or {}).items():
        links[j - 1] = f'<link name="l{j}">{text}{shapes}</link>'
    joints = [HINGE.format(j + 1, j, axis) for j, axis in enumerate(AXES)]
    joints[3] = joints[3].replace("continuous", kind).replace("</joint>", mimic + "</joint>")
    return (
        '<robot name="chain"><link'
        f' name="l0">{shapes}</link>{"".join(links)}{"".join(joints)}{last}</robot>'
    )


def torque_in_c(model, q, qd, qdd):
    """Inverse dynamics (J,) by MuJoCo in C."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, qd, qdd
    mujoco.mj_inverse(model, data)
    return data.qfrc_inverse.copy()


# the chain with a tool that does not move against its last link
CHAIN = urdf(
    last='<link name="tool"/><joint name="end" type="fixed"><parent link="l4"/><child link="tool"/>'
    '<origin xyz="0 0 -0.2"/></joint>'
)
# a bit of everything that a file may have
RICH = """<mujoco><compiler angle="degree" boundmass="0.001"/><option timestep="0.001" integrator="implicitfast"/>
<default><default class="k"><joint damping="0.3" armature="0.1"/></default></default>
<worldbody><light pos="0 0 1"/><geom type="plane" size="1 1 1"/>
<body name="a" pos="0 0 0.1"><joint name="j" class="k" axis="0 1 0" ref="20" range="-30 40"/>
<geom type="cylinder" size="0.02 0.1"/><body name="q"><geom size="0.1"/></body>
<frame pos="0.1 0.2 0.3" euler="10 20 30" childclass="k"><joint axis="1 0 0" pos="1 2 3"/><body pos="0 0 -0.5">
<joint axis="0 1 0" stiffness="2" springref="90" frictionloss="0.1"/><geom type="ellipsoid" size="0.1 0.2 0.3"/></body></frame>
<body><joint type="slide"/><geom size="0.1"/></body></body><body name="table"><geom type="box" size="1 1 1"/></body></worldbody>
<actuator><motor joint="j"/></actuator><sensor><jointpos joint="j"/></sensor></mujoco>"""  # noqa: E501


BODY = '<body><joint axis="0 1 0"{}/><geom size="0.1"/>{}</body>'


def scene(joint="", inside="", after="", option=""):
    """A model of two bodies.

    The arguments are XML: attributes of the first joint, elements inside the first body, elements
    after the bodies and options.
    """
    bodies = BODY.format(joint, inside) + BODY.format(' name="b"', "")
    return f"<mujoco>{option}<worldbody>{bodies}</worldbody>{after}</mujoco>"


def stored(folder, text, name="model.xml"):
    """The path of a file with this text, or these bytes."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


# an inertia that no mass has, by its moments
FLAT = (
    '<inertial><mass value="1"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="{}" ixz="0"'
    ' iyz="0"/></inertial>'
)
MIMIC = '<mimic joint="j2" multiplier="-0.5" offset="0.2"/>'


def complaint(path):
    """The one line with which a file is refused."""
    with pytest.raises(ModelError) as caught:
        read_model(path)
    (line,) = str(caught.value).splitlines()
    assert re.fullmatch("expected .+; got .+; .+", line)
    return line


ODD = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e300",
    "1e18",
    "0",
    "-1",
    "1e-320",
    "",
    "x",
    "1 2 3 4 5 6 7 8 9",
    "99999999999999999999",
]


def damaged(text, rng):
    """The text with one damage: flipped bytes, the end cut off, or an attribute or element that is
    deleted, doubled, swapped or given an odd value.
    """
    kind, attributes = rng.randrange(12), list(re.finditer(r'\s\w+="[^"]*"', text))
    numbers, elements = (
        list(re.finditer(pattern, text)) for pattern in (r"-?\d*\.?\d+", r"<[^>]*/>")
    )
    if kind == 0:
        raw = bytearray(text.encode())
        for _ in range(rng.randint(1, 6)):
            raw[rng.randrange(len(raw))] = rng.randrange(256)
        return bytes(raw)
    if kind == 1:
        return text[: rng.randrange(len(text))].encode()
    a, b = (rng.choice(attributes if kind < 6 else elements) for _ in range(2))
    if kind < 8:
        put = ("", a.group() * 2, b.group())[kind % 3]
    else:
        a, put = rng.choice(numbers), rng.choice(ODD)
    return (text[: a.start()] + put + text[a.end() :]).encode()
