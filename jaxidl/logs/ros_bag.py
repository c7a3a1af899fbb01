"""ROS bags with joint states: MCAP, SQLite, or bags of ROS 1.

They are read through the optional package ``rosbags``; ROS itself is not needed.
"""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from jaxidl.errors import LogError
from jaxidl.logs.columns import choose
from jaxidl.logs.families import Wanted, shortened
from jaxidl.logs.table import Table, listed, name_of, reading

ENDINGS = (".mcap", ".db3", ".bag")
TYPE = "sensor_msgs/msg/JointState"
FIELDS = ("position", "velocity", "effort")
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

    Columns are called ``NAME/position``, ``NAME/velocity`` and ``NAME/effort``.

    Args:
        topic: the topic to read. Default: the only one with joint states.

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


def _table(name: str, reader: Any, wanted: Wanted, topic: str | None) -> Table:
    topics = sorted({c.topic for c in reader.connections if c.msgtype == TYPE})
    if topic is None and len(topics) != 1:
        other = sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})
        if not topics:
            raise LogError(
                f"a topic of {TYPE} in {name}",
                listed(other),
                "record joint states, or export the log as CSV",
            )
        raise LogError(
            f"one topic of {TYPE} in {name}", listed(topics), f"choose with --topic {topics[0]}"
        )
    if topic is not None and topic not in topics:
        raise LogError(
            f"a topic {shortened(topic)} of {TYPE} in {name}", listed(topics), "choose one of these"
        )
    connections = [c for c in reader.connections if c.topic == (topic or topics[0])]
    rows: list[tuple[int, int, Any]] = []
    for connection, received, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        stamp = int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)
        rows.append((stamp, int(received), message))
        if len(rows) > MOST:
            raise LogError(f"at most {MOST} messages in {name}", "more", "shorten the bag")
    if not rows:
        raise LogError(f"messages in {name}", "none", "record again")
    return _columns(name, rows, wanted)


def _columns(name: str, rows: list[tuple[int, int, Any]], wanted: Wanted) -> Table:
    """Return a table of the messages of the publisher whose joints are those of the robot."""
    notes: list[str] = []
    groups = Counter(tuple(message.name) for _, _, message in rows)
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
    mine = [(stamp, received, m) for stamp, received, m in rows if tuple(m.name) == names]
    stamps = [stamp for stamp, _, _ in mine]
    if not any(stamps):
        notes.append(f"no time stamps in {name}: the time of recording is used")
        stamps = [received for _, received, _ in mine]
    count = len(names) or max(len(getattr(mine[0][2], field)) for field in FIELDS)
    headers, columns = ["time"], [np.array([1e-9 * (stamp - stamps[0]) for stamp in stamps])]
    for field in FIELDS:
        lengths = {len(getattr(m, field)) for _, _, m in mine}
        if lengths == {0}:
            continue
        if lengths != {count}:
            got = f"{listed([str(n) for n in sorted(lengths)])} of {count}"
            raise LogError(
                f"{field} of every joint in {name}",
                got,
                "record again, or export the good part as CSV",
            )
        values = np.array([getattr(m, field) for _, _, m in mine], float)
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
