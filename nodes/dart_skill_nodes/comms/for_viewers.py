"""What a viewer needs: markers and their colours; and to show the arm and the tracked bodies,
robot_description, /tf and /tf_static, live where they are heard, and in a bag made of what the graph
publishes anyway.

All graphs share /tf: the frames of one that lives in a namespace begin with it, as in
arm1/wam_base, but for the world, in which all stand.
"""

import re
from collections.abc import Collection, Iterator
from dataclasses import replace

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from dart_skill.arm import (
    Transform,
    fixed_transforms,
    joint_transforms,
    the_arm,
    write_urdf,
)
from dart_skill.common.constants import NS_PER_S
from dart_skill.common.palette import Colour, unit
from dart_skill.recording import serialize, types_for
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import OfTheArm
from dart_skill_nodes.comms.names import DESCRIPTION, JOINT_STATES, namespace_of
from dart_skill_nodes.comms.qos import LATCHED

TF, TEXT = "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"
RATE = 50.0
"""Rate of live transforms [1/s of their stamps]."""
QUALITY = QoSProfile(depth=100)
_BODY = re.compile(r"(?P<space>.*)/vrpn_mocap/(?P<body>[^/]+)/pose")
_ARM = re.compile(rf"(?P<space>.*)/{JOINT_STATES}")


class LiveTransforms:
    """Transforms of a graph on /tf, at most RATE a second of each child, and only while they
    are heard.

    frame_id: of the world. The ones that never change are given at once, on /tf_static.
    """

    def __init__(self, node: Node, frame_id: str, fixed: list[Transform] | None = None):
        from tf2_msgs.msg import TFMessage

        self._frame_id, self._space = frame_id, namespace_of(node)
        self._out = node.create_publisher(TFMessage, "/tf", QUALITY)
        self._due = _Due(RATE)
        if fixed:
            self._static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
            self._static.publish(_tf(_prefixed(fixed, self._space, frame_id), 0))

    def is_due(self, name: str, ns: int) -> bool:
        """Whether the transforms of a name are wanted at a stamp; if so they are to be published."""
        return not self._due.is_early(name, ns) and self._out.get_subscription_count() > 0

    def publish(self, transforms: list[Transform], ns: int) -> None:
        """Transforms with their stamp."""
        self._out.publish(_tf(_prefixed(transforms, self._space, self._frame_id), ns))


class TfMessages:
    """The messages that go with others, of each graph that is heard. Those on topics of
    `published` are left to their publishers.

    topics: name -> type and quality of service of what is made here. space: of the graph whose
    description of the arm is made.
    """

    def __init__(
        self, frame_id: str, rate: float, published: Collection[str] = (), space: str = ""
    ):
        self._frame_id, self._due, self._space = frame_id, _Due(rate), space
        self._description = f"{space}/{DESCRIPTION}"
        made = {
            self._description: (TEXT, LATCHED),
            "/tf_static": (TF, LATCHED),
            "/tf": (TF, QUALITY),
        }
        self.topics = {topic: made[topic] for topic in made if topic not in published}
        self._begun, self._of_the_arm = False, OfTheArm()

    def messages(self, topic: str, ns: int, data: bytes) -> Iterator[tuple[str, bytes]]:
        """Topics and serialised messages to follow a message of `topic`, received at `ns`;
        ValueError for one that cannot be shown.
        """
        if not self._begun:
            self._begun = True
            yield from self._first(ns)
        if "/tf" not in self.topics:
            return
        if (
            (arm := _ARM.fullmatch(topic))
            and self._of_the_arm(data)
            and not self._due.is_early(topic, ns)
        ):
            state = conversions.arm_state(conversions.decoded(data, JointState))
            moved = joint_transforms(the_arm(), state.position)
            yield "/tf", _tf(_prefixed(moved, arm["space"], self._frame_id), state.stamp_ns)
        elif (seen := _BODY.fullmatch(topic)) and not self._due.is_early(topic, ns):
            message = conversions.decoded(data, PoseStamped)
            if message.header.frame_id == self._frame_id:
                yield "/tf", self._body(message, seen["body"], seen["space"])

    def _body(self, message: PoseStamped, body: str, space: str) -> bytes:
        position = conversions.place(message.pose.position, body)
        seen = Transform(
            self._frame_id,
            body,
            position,
            conversions.unit_quaternion(message.pose.orientation, body),
        )
        return _tf(
            _prefixed([seen], space, self._frame_id),
            conversions.checked_stamp_ns(message.header.stamp, body),
        )

    def _first(self, ns: int) -> Iterator[tuple[str, bytes]]:
        if self._description in self.topics:
            yield (
                self._description,
                serialize(types_for(TEXT), TEXT, {"data": write_urdf(the_arm())}),
            )
        if "/tf_static" in self.topics:
            fixed = fixed_transforms(the_arm(), self._frame_id)
            yield "/tf_static", _tf(_prefixed(fixed, self._space, self._frame_id), ns)


class _Due:
    """What was shown when, by name."""

    def __init__(self, rate: float):
        self._period_ns, self._shown_ns = round(1e9 / rate), {}

    def is_early(self, name: str, ns: int) -> bool:
        """Whether too little time has gone since the last one; time that jumped back begins anew."""
        if 0 <= ns - self._shown_ns.get(name, -self._period_ns) < self._period_ns:
            return True
        self._shown_ns[name] = ns
        return False


def _prefixed(transforms: list[Transform], space: str, world: str) -> list[Transform]:
    """With frames of the graph in a namespace; the world is that of all."""
    prefix = f"{space.strip('/')}/" if space else ""
    if not prefix:
        return transforms
    return [
        replace(
            one,
            parent=one.parent if one.parent == world else prefix + one.parent,
            child=prefix + one.child,
        )
        for one in transforms
    ]


def _tf(transforms: list[Transform], ns: int) -> bytes:
    sec, nanosec = divmod(ns, NS_PER_S)
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


def marker_colour(colour: Colour, opacity: float = 1.0) -> ColorRGBA:
    """A colour of the palette as markers have it; opacity: from 0 to 1."""
    red, green, blue = unit(colour)
    return ColorRGBA(r=red, g=green, b=blue, a=opacity)


def ellipsoids(
    message: MarkerArray, frame_id: str
) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Spheres in a frame by namespace: centres (K, 3), quaternions x, y, z, w (K, 4), diameters
    (K, 3). The rest is left out.

    ValueError for a sphere that is nowhere.
    """
    groups: dict[str, list[Marker]] = {}
    for marker in message.markers:
        if (
            marker.type == Marker.SPHERE
            and marker.action == Marker.ADD
            and marker.header.frame_id == frame_id
        ):
            groups.setdefault(marker.ns, []).append(marker)
    return {name: _arrays(markers) for name, markers in groups.items()}


def _arrays(markers: list[Marker]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    centres = [conversions.place(one.pose.position, f"marker {one.id}") for one in markers]
    quaternions = [
        conversions.unit_quaternion(one.pose.orientation, f"marker {one.id}") for one in markers
    ]
    scales = [conversions.place(one.scale, f"the end of marker {one.id}") for one in markers]
    return np.array(centres), np.array(quaternions), np.array(scales)
