"""Topics at a glance: what came since the last look, for whoever needs the newest of a fast topic
at a slower rate.

The middleware keeps the newest messages; no callback is called for each of a thousand a second,
and most are never decoded.
"""

import struct

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from dart_skill.common.checks import FARTHEST
from dart_skill_nodes.comms.raw_batches import never_called, taken, unspun_node

POSE_BYTES = 7 * 8
FRAME_AT = 12
"""Where a header's frame_id begins in a serialised message: after the encapsulation and the stamp.
"""


class LatestMessages:
    """Best-effort subscriptions, which match every publisher and never hold one up, on a hidden
    node that nobody spins.
    """

    def __init__(self, node: Node):
        self._node, self._unspun = node, unspun_node(node, "latest_messages")
        self._subscriptions = {}

    def watch(self, topic: str, message_type: type, depth: int = 1) -> None:
        """Keep the `depth` newest messages of a topic for `take`."""
        qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._subscriptions[topic] = self._unspun.create_subscription(
            message_type, self._node.resolve_topic_name(topic), never_called, qos, raw=True
        )

    def take(self, topic: str) -> list[bytes]:
        """Serialised messages that have come since the last time, the newest last."""
        return [data for data, _, _ in taken(self._subscriptions[topic])]

    def close(self) -> None:
        """Keep nothing any more."""
        self._unspun.destroy_node()


def poses_of(messages: list[bytes], frame_id: str) -> np.ndarray:
    """Positions and quaternions x, y, z, w (n, 7) of serialised PoseStamped; ValueError if one is
    in another frame, or is no pose.

    The seven numbers end the message, whatever the length of the frame's name before them (CDR,
    little-endian, as on every machine that ROS 2 supports). Decoding whole messages takes thirty
    times as long.
    """
    for data in messages:
        if len(data) < FRAME_AT + 4 + POSE_BYTES:
            raise ValueError(f"{len(data)} bytes are no pose")
        name = data[
            FRAME_AT + 4 : FRAME_AT + 3 + struct.unpack_from("<I", data, FRAME_AT)[0]
        ].decode(errors="replace")
        if name != frame_id:
            raise ValueError(f"poses are in frame '{name[:100]}', not '{frame_id}'")
    poses = np.frombuffer(b"".join(data[-POSE_BYTES:] for data in messages), dtype="<f8").reshape(
        -1, 7
    )
    if not (np.abs(poses) <= FARTHEST).all():
        raise ValueError("a pose is not finite, or beyond this world")
    return poses
