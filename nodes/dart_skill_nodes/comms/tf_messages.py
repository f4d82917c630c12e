"""What a viewer needs to show the arm and the tracked bodies, made of what the graph publishes anyway: /robot_description, /tf, /tf_static.

tf2_msgs is no part of the common interfaces, so a machine may lack it: the messages are serialised without it, for a bag.
"""

from collections.abc import Collection, Iterator

from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from dart_skill.recording import serialize, types_for
from dart_skill.robot import Transform, fixed_transforms, joint_transforms, wam_description, write_urdf
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.names import JOINT_STATES
from dart_skill_nodes.comms.qos import LATCHED

TF, TEXT = "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"
POSE = "/vrpn_mocap/"
ARM = f"/{JOINT_STATES}"


class TfMessages:
    """The messages that go with others. Those on topics of `published` are left to whoever publishes them.

    topics: name -> type and quality of service of what is made here.
    """

    def __init__(self, frame_id: str, rate: float, published: Collection[str] = ()):
        self._frame_id, self._period_ns = frame_id, round(1e9 / rate)
        made = {"robot_description": (TEXT, LATCHED), "/tf_static": (TF, LATCHED), "/tf": (TF, QoSProfile(depth=100))}
        self.topics = {topic: made[topic] for topic in made if topic not in published}
        self._begun, self._shown_ns = False, {}

    def messages(self, topic: str, ns: int, data: bytes) -> Iterator[tuple[str, bytes]]:
        """Topics and serialised messages to follow a message of `topic`, received at `ns`; ValueError for one that cannot be shown."""
        if not self._begun:
            self._begun = True
            yield from self._first(ns)
        if "/tf" not in self.topics or not (topic == "joint_states" or topic.startswith(POSE)) or self._is_early(topic, ns):
            return
        if topic == "joint_states":
            state = conversions.arm_state(conversions.decoded(data, JointState))
            yield "/tf", _tf(joint_transforms(wam_description(), state.position), state.stamp_ns)
        elif (message := conversions.decoded(data, PoseStamped)).header.frame_id == self._frame_id:
            body = topic.removeprefix(POSE).split("/")[0]
            position = conversions.place(message.pose.position, body)
            seen = Transform(self._frame_id, body, position, conversions.unit_quaternion(message.pose.orientation, body))
            yield "/tf", _tf([seen], conversions.checked_stamp_ns(message.header.stamp, body))

    def _first(self, ns: int) -> Iterator[tuple[str, bytes]]:
        if "robot_description" in self.topics:
            yield "robot_description", serialize(types_for(TEXT), TEXT, {"data": write_urdf(wam_description())})
        if "/tf_static" in self.topics:
            yield "/tf_static", _tf(fixed_transforms(wam_description(), self._frame_id), ns)

    def _is_early(self, topic: str, ns: int) -> bool:
        """Whether too little time has gone since the last one; time that jumped back begins anew."""
        if 0 <= ns - self._shown_ns.get(topic, -self._period_ns) < self._period_ns:
            return True
        self._shown_ns[topic] = ns
        return False


def _tf(transforms: list[Transform], ns: int) -> bytes:
    sec, nanosec = divmod(ns, conversions.GIGA)
    content = [
        {
            "header": {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": one.parent},
            "child_frame_id": one.child,
            "transform": {
                "translation": dict(zip("xyz", one.translation.tolist(), strict=True)),
                "rotation": dict(zip("xyzw", one.quaternion.tolist(), strict=True)),
            },
        }
        for one in transforms
    ]
    return serialize(types_for(TF), TF, {"transforms": content})
