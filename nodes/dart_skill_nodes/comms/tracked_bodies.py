"""What the commander, the teacher and the recorder have in common: they watch hand, ball and basket through the motion capture."""

from collections import deque
from functools import partial

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from dart_skill.skill.observe.cutting import ThrowLog
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.matching_qos import MatchingSubscriptions

FRAME_NS = 10_000_000
"""Between two frames of the cameras."""
BEFORE_NS = 200_000_000
"""The release is looked for from so long before the hand was told to open."""
ROLES = ("hand", "ball", "basket")
SILENCE = 5.0
"""A sensor that is silent for longer sees nothing: what is lost on the way is repeated within 3 s [s, wall clock]."""


class Arrivals:
    """Up to which stamp everything has come: as far as the sensor that is farthest behind, or as far as all were long enough ago."""

    def __init__(self):
        self._past: deque[tuple[float, int]] = deque()
        self._sure_ns = 0

    def until(self, newest_ns: list[int], now: float) -> int:
        """That stamp [ns], of the newest one of each sensor, at an instant of the wall clock [s]."""
        self._past.append((now, max(newest_ns) - FRAME_NS))
        while self._past[0][0] <= now - SILENCE:
            self._sure_ns = self._past.popleft()[1]
        return max(self._sure_ns, min(newest_ns))


class TrackedBodies:
    """Keeps a ThrowLog up to date from the pose topics, and knows up to which stamp every message has arrived.

    Between `clear` and `rest` messages are looked at; at other times they are not even decoded. on_pose is called after each pose,
    for whoever waits for one. `subscribe` is false for a node that gets the messages anyway and hands them to `take`.
    """

    def __init__(self, node: Node, frame_id: str, on_pose=lambda: None, subscribe: bool = True):
        self._awake = False
        self.log, self._node, self._frame_id, self._on_pose = ThrowLog(), node, frame_id, on_pose
        self.newest_ns, self.wrong_frame = 0, ""
        self._cameras = MatchingSubscriptions(node)
        for role in ROLES if subscribe else ():
            self._cameras.subscribe(f"/vrpn_mocap/{role}/pose", partial(self.take, role), PoseStamped, raw=True)

    async def listen(self) -> None:
        """Wait until the cameras are heard: in a graph that has just been started they may not be yet. Without any, go on after a while."""
        await self._cameras.found()

    def clear(self) -> None:
        """Forget what was seen; a new throw begins."""
        self.log.clear()
        self._awake = True

    def rest(self) -> None:
        """The throw is over; what was seen of it is kept."""
        self._awake = False

    def has_all_until(self, ns: int) -> bool:
        """Whether every pose up to a stamp has come: one that is a frame newer has, and the bodies' poses travel on topics of their own."""
        return self.newest_ns >= ns + FRAME_NS

    def take(self, role: str, data: bytes) -> None:
        """A pose of hand, ball or basket, serialised."""
        if not self._awake:
            return
        message = deserialize_message(data, PoseStamped)
        if message.header.frame_id != self._frame_id:
            if not self.wrong_frame:
                self._node.get_logger().error(f"{role} poses are in '{message.header.frame_id}', not '{self._frame_id}': ignored")
            self.wrong_frame = message.header.frame_id
            return
        ns, position = conversions.stamp_ns(message.header.stamp), conversions.vector(message.pose.position)
        if role == "hand":
            self.log.add_hand(ns, position, conversions.quaternion(message.pose.orientation))
        elif role == "ball":
            self.log.add_ball(ns, position)
        else:
            self.log.add_basket(ns, position)
        self.newest_ns = max(self.newest_ns, ns)
        self._on_pose()
