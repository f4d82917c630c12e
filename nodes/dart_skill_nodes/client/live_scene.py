"""What the cameras and the arm's driver say, in the scene of a page: taken when a picture is made, and
most of it never decoded.
"""

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState

from dart_skill.recording import HAND
from dart_skill.view import Scene
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.joint_states import OfTheArm
from dart_skill_nodes.comms.names import JOINT_STATES, pose_topic
from dart_skill_nodes.comms.raw_batches import LatestMessages, poses_of

ATTRACTOR = "attractor"
"""Name of what the hand is pulled to, beside the roles of bodies."""
PICTURES_PER_PATH = 3
"""Pictures after which paths are sent: they are sent as a whole."""


class LiveScene:
    """Moves arm and bodies of a scene.

    * name_of: names of the tracked bodies by role. frame_id: of the poses that are shown.

    Attribute: basket, where it was seen last (3,), None before that.
    """

    def __init__(self, node: Node, scene: Scene, name_of: dict[str, str], frame_id: str):
        self._scene, self._frame_id, self._latest = scene, frame_id, LatestMessages(node)
        self._of_the_arm, self.basket = OfTheArm(), None
        self._paths = {name: [] for name in (*scene.bodies[:1], HAND, ATTRACTOR)}
        self._pictures = 0
        self._latest.watch(JOINT_STATES, JointState)
        self._topics = {role: pose_topic(name) for role, name in name_of.items()}
        self._topics[ATTRACTOR] = f"commander/{ATTRACTOR}"
        for topic in self._topics.values():
            self._latest.watch(topic, PoseStamped, depth=200)

    def show(self) -> dict[str, np.ndarray]:
        """Show what has come; the newest pose (7,) of hand and bodies by role. ValueError says
        what cannot be shown.
        """
        states = [data for data in self._latest.take(JOINT_STATES) if self._of_the_arm(data)]
        poses = {name: self._poses(topic) for name, topic in self._topics.items()}
        newest = {name: rows[-1] for name, rows in poses.items() if len(rows)}
        if not states and not newest:
            self._send_paths()
            return {}
        if states:
            state = conversions.arm_state(conversions.decoded(states[-1], JointState))
            self._scene.move_arm(state.position)
        if HAND in newest:
            self._scene.move_hand(newest[HAND][:3], newest[HAND][3:])
        if (attractor := newest.pop(ATTRACTOR, None)) is not None:
            self._scene.move_attractor(attractor[:3])
        for role in newest.keys() & set(self._scene.bodies):
            self._move_body(role, newest[role])
        for name, points in self._paths.items():
            points.extend(poses[name][:, :3])
        self._pictures += 1
        if self._pictures % PICTURES_PER_PATH == 0:
            self._send_paths()
        return {role: newest[role] for role in (HAND, *self._scene.bodies) if role in newest}

    def _move_body(self, role: str, pose: np.ndarray) -> None:
        """A body as it was seen last (7,). How ball and basket are turned is of no use."""
        if role == conversions.BASKET:
            self.basket = pose[:3]
            self._scene.move_basket(self.basket)
        elif role == "ball":
            self._scene.move_ball(pose[:3])
        else:
            self._scene.move_body(role, pose[:3], pose[3:])

    def _send_paths(self) -> None:
        for name, points in self._paths.items():
            if points:
                self._scene.extend_path(name, np.array(points))
                points.clear()

    def _poses(self, topic: str) -> np.ndarray:
        try:
            return poses_of(self._latest.take(topic), self._frame_id)
        except ValueError as error:
            raise ValueError(f"{topic}: {error}") from error

    def close(self) -> None:
        """Hear nothing any more."""
        self._latest.close()
