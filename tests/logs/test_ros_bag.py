"""ROS bags with joint states, written by the library that reads them."""

import numpy as np
import pytest

from jaxidl.logs.log import read
from tests.helpers.logs import ARM, SAMPLES, THREE, each_joint, refuse, same

pytest.importorskip("rosbags")

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from tests.helpers.bags import dynamic_bag

STORE = get_typestore(Stores.ROS2_HUMBLE)
STATE, HEADER, TIME, TEXT = (
    STORE.types[name]
    for name in (
        "sensor_msgs/msg/JointState",
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Time",
        "std_msgs/msg/String",
    )
)
START = 1_700_000_000_000_000_000


def bag(
    folder,
    topics=("/joint_states",),
    names=ARM,
    plugin=StoragePlugin.MCAP,
    stamped=True,
    effort=True,
    other=0,
    count=SAMPLES,
):
    """A bag of the three joints, in the order of ``names``; every ``other``-th message is of a
    gripper.
    """
    order = [ARM.index(name) for name in names]
    q, tau = (each_joint(THREE, kind, order) for kind in ("q", "tau"))
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        channels = [
            writer.add_connection(topic, STATE.__msgtype__, typestore=STORE) for topic in topics
        ]
        chatter = writer.add_connection("/chatter", TEXT.__msgtype__, typestore=STORE)
        writer.write(chatter, START, STORE.serialize_cdr(TEXT("hello"), TEXT.__msgtype__))
        for i in range(count):
            at = START + round(1e9 * THREE["time"][i])
            stamp = TIME(*divmod(at, 10**9)) if stamped else TIME(0, 0)
            push = tau[i] if effort else np.zeros(0)
            messages = [
                STATE(HEADER(stamp, ""), list(names), q[i], np.full(len(names), np.nan), push)
            ]
            if other and i % other == 0:
                messages.append(
                    STATE(HEADER(stamp, ""), ["finger"], np.ones(1), np.ones(1), np.ones(1))
                )
            for channel in channels:
                for message in messages:
                    writer.write(channel, at, STORE.serialize_cdr(message, STATE.__msgtype__))
    return folder


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_joint_states_are_read_by_name(tmp_path, plugin):
    folder = bag(tmp_path / "bag", names=ARM[::-1], plugin=plugin)
    file = next(path for path in folder.iterdir() if path.suffix in (".mcap", ".db3"))
    for path in (folder, file):
        log = read(path, ARM)
        same(log)
        assert log.qd is None  # NaN throughout
        np.testing.assert_allclose(log.time, THREE["time"], atol=1e-9)
    same(read(folder), joints=(2, 1, 0))  # no model: in the messages' order
    part = read(folder, ARM[:1], robot=ARM)
    same(part, joints=(0,))
    assert sorted(name for name, _ in part.still) == sorted(ARM[1:])


def test_messages_of_other_joints_are_left_out(tmp_path):
    folder = bag(tmp_path / "bag", other=3)
    log = read(folder, ARM)
    same(log)
    assert f"100 messages of {folder} with other joints left out" in log.notes
    refuse(lambda: read(folder), "joint states of the same joints", "finger")


def test_topics_are_for_the_user_to_choose(tmp_path):
    folder = bag(tmp_path / "bag", topics=("/left", "/right"))
    refuse(
        lambda: read(folder, ARM),
        "one topic of sensor_msgs/msg/JointState",
        "/left, /right",
        "--topic /left",
    )
    refuse(lambda: read(folder, ARM, topic="/middle"), "a topic /middle", "/left, /right")
    same(read(folder, ARM, topic="/right"))
    refuse(
        lambda: read(bag(tmp_path / "none", topics=()), ARM), "a topic of sensor_msgs", "/chatter"
    )


def test_bags_without_torques_or_messages_are_refused(tmp_path):
    same(read(bag(tmp_path / "a", stamped=False), ARM))
    refuse(
        lambda: read(bag(tmp_path / "b", effort=False), ARM),
        "torques tau0..tau2",
        "columns",
        "record torque",
    )
    refuse(lambda: read(bag(tmp_path / "c"), ("left", "right", "up")), "q0..q2")
    refuse(lambda: read(bag(tmp_path / "d", count=0), ARM), "messages", "none")
    refuse(lambda: read(tmp_path / "gone.mcap", ARM), "no such file")


def test_damaged_bags_are_refused(tmp_path):
    file = next(bag(tmp_path / "bag").glob("*.mcap"))
    whole, rng = file.read_bytes(), np.random.default_rng(0)
    for content in (
        b"",
        b"no bag",
        whole[: len(whole) // 2],
        *(whole[: rng.integers(len(whole))] for _ in range(5)),
    ):
        file.write_bytes(content)
        refuse(lambda: read(file, ARM), "a")
        refuse(lambda: read(file.parent, ARM), "a")
    (file.parent / "metadata.yaml").write_text("[")
    refuse(lambda: read(file.parent, ARM), "readable ROS bag")


def test_missing_rosbags_is_refused_with_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rosbags.highlevel", None)
    (tmp_path / "a.mcap").write_bytes(b"x")
    refuse(
        lambda: read(tmp_path / "a.mcap"), "rosbags", "none installed", "pip install 'jaxidl[ros]'"
    )


def test_values_of_ros2_control_are_read_by_interface(tmp_path):
    q, tau = (each_joint(THREE, kind, (0, 1, 2)) for kind in ("q", "tau"))
    values = [
        {"position": q[:, j], "effort": tau[:, j], **({"temperature": q[:, j]} if j else {})}
        for j in range(3)
    ]
    folder = dynamic_bag(tmp_path / "bag", THREE["time"], ARM, values)
    same(read(folder, ARM))
    two = dynamic_bag(tmp_path / "two", THREE["time"], ARM, values, ("/left", "/right"))
    refuse(lambda: read(two, ARM), "one topic of control_msgs", "--topic /left")
    same(read(two, ARM, topic="/right"))
