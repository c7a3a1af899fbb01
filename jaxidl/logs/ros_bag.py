"""ROS bags with joint states: MCAP, SQLite, or bags of ROS 1.

They are read through the optional package ``rosbags``; ROS itself is not needed. Two messages are
understood: ``JointState``, and the ``DynamicJointState`` of ros2_control, which has any number of
named values for each joint: what a controller computes, too.
"""

from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.columns import choose
from jaxidl.logs.families import Wanted, shortened
from jaxidl.logs.table import Table, listed, name_of, reading

ENDINGS = (".mcap", ".db3", ".bag")
STATE, DYNAMIC = "sensor_msgs/msg/JointState", "control_msgs/msg/DynamicJointState"
FIELDS = ("position", "velocity", "effort")  # of a JointState
MOST = 10_000_000  # most messages read


def is_bag(path: Path) -> bool:
    """Return whether a path is that of a ROS bag.

    A bag is a file with such a suffix, or a folder with a ``metadata.yaml``.
    """
    try:
        return path.suffix.lower() in ENDINGS or (
            path.is_dir() and (path / "metadata.yaml").is_file()
        )
    except (OSError, ValueError):
        return False


def load_bag(path: Path, wanted: Wanted, topic: str | None = None) -> Table:
    """Return the joint states of a bag as a table.

    Columns are called ``NAME/position``, ``NAME/velocity`` and ``NAME/effort``, or, of a
    ``DynamicJointState``, ``NAME/INTERFACE``.

    Args:
        topic: the topic to read. Default: the only one with joint states; if there are two kinds,
            the dynamic ones for the log of an execution, the others for a log of motion.

    Raises:
        LogError: if ``rosbags`` is not installed, the bag cannot be read, or has no such topic.
    """
    name = name_of(path)
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise LogError(
            f"rosbags to read {name}",
            "none installed",
            "pip install 'jaxidl[ros]', or export it as CSV",
        ) from None
    if not path.exists():
        raise LogError(f"a bag at {name}", "no such file", "correct the path")
    remedy = "give the folder that ros2 bag wrote, with its metadata.yaml, or record it again"
    with reading(name, "ROS bag", remedy):
        store = get_typestore(
            Stores.ROS1_NOETIC if path.suffix.lower() == ".bag" else Stores.ROS2_HUMBLE
        )
        with AnyReader([_bag_of(path)], default_typestore=store) as reader:
            return _table(name, reader, wanted, topic)


def _bag_of(path: Path) -> Path:
    """Return the bag's path; a SQLite file is read through the folder that it is in."""
    return (
        path.parent
        if path.suffix.lower() == ".db3" and (path.parent / "metadata.yaml").is_file()
        else path
    )


class Message(NamedTuple):
    """Values of some joints at one instant."""

    stamp: int  # [ns]
    received: int  # [ns]
    names: tuple[str, ...]
    values: dict[str, np.ndarray]  # of each field; empty where a message has none


def _message(received: int, raw: Any) -> Message:
    """Return a message of either type."""
    stamp = int(raw.header.stamp.sec) * 10**9 + int(raw.header.stamp.nanosec)
    if not hasattr(raw, "joint_names"):
        values = {field: np.asarray(getattr(raw, field), float) for field in FIELDS}
        return Message(stamp, int(received), tuple(raw.name), values)
    values = {}
    for j, own in enumerate(raw.interface_values):
        for field, value in zip(own.interface_names, own.values, strict=True):
            values.setdefault(field, np.full(len(raw.joint_names), np.nan))[j] = value
    return Message(stamp, int(received), tuple(raw.joint_names), values)


def _topic(name: str, reader: Any, wanted: Wanted, topic: str | None) -> str:
    """Return the topic to read."""
    order = (DYNAMIC, STATE) if wanted.control else (STATE, DYNAMIC)
    there = sorted({(c.topic, c.msgtype) for c in reader.connections})
    kinds = {kind: [one for one, its in there if its == kind] for kind in order}
    every = [one for kind in order for one in kinds[kind]]
    if topic is not None:
        if topic not in every:
            expected = f"a topic {shortened(topic)} of {STATE} or {DYNAMIC} in {name}"
            raise LogError(expected, listed(every) or "none", "choose one that is there")
        return topic
    if not every:
        raise LogError(
            f"a topic of {STATE} or {DYNAMIC} in {name}",
            listed([f"{one} ({kind})" for one, kind in there]),
            "record joint states, or export the log as CSV",
        )
    kind = next(kind for kind in order if kinds[kind])
    if len(kinds[kind]) > 1:
        got, remedy = listed(kinds[kind]), f"choose with --topic {kinds[kind][0]}"
        raise LogError(f"one topic of {kind} in {name}", got, remedy)
    return kinds[kind][0]


def _table(name: str, reader: Any, wanted: Wanted, topic: str | None) -> Table:
    topic = _topic(name, reader, wanted, topic)
    connections = [c for c in reader.connections if c.topic == topic]
    rows: list[Message] = []
    for connection, received, raw in reader.messages(connections=connections):
        rows.append(_message(received, reader.deserialize(raw, connection.msgtype)))
        if len(rows) > MOST:
            raise LogError(f"at most {MOST} messages in {name}", "more", "shorten the bag")
    if not rows:
        raise LogError(f"messages in {name}", "none", "record again")
    return _columns(name, rows, wanted)


def _columns(name: str, rows: list[Message], wanted: Wanted) -> Table:
    """Return a table of the messages of the publisher whose joints are those of the robot."""
    notes: list[str] = []
    groups = Counter(message.names for message in rows)
    robot = {wanted.names[j] for j in wanted.taken}
    fitting = [names for names in groups if robot and robot <= set(names)] or list(groups)
    if len(fitting) > 1:
        got = " and ".join(f"({listed(names, 4)})" for names in fitting[:3])
        raise LogError(
            f"joint states of the same joints in {name}",
            got,
            "record one publisher's topic, or name the joints (--joints)",
        )
    names, left = fitting[0], sum(groups.values()) - groups[fitting[0]]
    if left:
        notes.append(f"{left} messages of {name} with other joints left out")
    mine = [m for m in rows if m.names == names]
    stamps = [m.stamp for m in mine]
    if not any(stamps):
        notes.append(f"no time stamps in {name}: the time of recording is used")
        stamps = [m.received for m in mine]
    count = len(names) or max(map(len, mine[0].values.values()))
    headers, columns = ["time"], [np.array([1e-9 * (stamp - stamps[0]) for stamp in stamps])]
    nothing = np.zeros(0)
    for field in dict.fromkeys(field for m in mine for field in m.values):
        lengths = {len(m.values.get(field, nothing)) for m in mine}
        if lengths == {0}:
            continue
        if lengths != {count}:
            got = f"{listed([str(n) for n in sorted(lengths)])} of {count}"
            raise LogError(
                f"{field} of every joint in {name}",
                got,
                "record again, or export the good part as CSV",
            )
        values = np.array([m.values[field] for m in mine])
        for j in range(count):
            if not np.isnan(values[:, j]).all():  # some drivers fill unknown fields with NaN
                headers.append(f"{names[j]}/{field}" if names else f"{field}_{j}")
                columns.append(values[:, j])
    if not wanted.names and names:  # no names given: joints in the order of the messages
        headers = [
            headers[0],
            *(f"{h.rpartition('/')[2]}_{names.index(h.rpartition('/')[0])}" for h in headers[1:]),
        ]
    chosen = choose(name, headers, wanted)
    picked: dict[str, np.ndarray | list[str]] = {
        key: columns[place] for key, place in chosen.places.items()
    }
    return Table(
        name, picked, chosen.ignored, None, chosen.factors, chosen.titles, (*notes, *chosen.notes)
    )
