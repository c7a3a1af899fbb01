"""ROS bags of a controller's values, as ros2_control publishes them."""

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

DYNAMIC = "control_msgs/msg/DynamicJointState"
STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(
    {
        **get_types_from_msg(
            "string[] interface_names\nfloat64[] values", "control_msgs/msg/InterfaceValue"
        ),
        **get_types_from_msg(
            "std_msgs/Header header\nstring[] joint_names\n"
            "control_msgs/InterfaceValue[] interface_values",
            DYNAMIC,
        ),
    }
)
START = 1_700_000_000_000_000_000


def dynamic_bag(folder, time, names, values, topics=("/dynamic_joint_states",)):
    """A bag in which each joint has its own interfaces.

    ``values`` are (T,) of each of a joint's interfaces, for each joint.
    """
    message, interfaces = STORE.types[DYNAMIC], STORE.types["control_msgs/msg/InterfaceValue"]
    header, stamp = (
        STORE.types[name] for name in ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        channels = [writer.add_connection(topic, DYNAMIC, typestore=STORE) for topic in topics]
        for k, t in enumerate(time):
            at = START + round(1e9 * t)
            own = [
                interfaces(list(joint), np.array([x[k] for x in joint.values()]))
                for joint in values
            ]
            one = message(header(stamp(*divmod(at, 10**9)), ""), list(names), own)
            for channel in channels:
                writer.write(channel, at, STORE.serialize_cdr(one, DYNAMIC))
    return folder
