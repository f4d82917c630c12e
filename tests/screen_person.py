"""A person in front of a screen, who sees the tracked bodies and pulls the hand: as a plain ROS client, or on the page."""

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.qos import qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from std_srvs.srv import SetBool, Trigger

from dart_skill.skill.protocol import Pose
from dart_skill.world import pose_topic
from tests.integration.conftest import wait_for

THERE, TURNED, STAYS = 0.001, 0.004, 10
"""The hand is where it is pulled to if it is so near [m], [rad], in so many poses one after the other."""


class RosHands:
    """Pulls by /teacher/pointer and tells the fingers by /teacher/grip, as any ROS client may. client: a GraphClient."""

    def __init__(self, client):
        self._client, node = client, client.node
        self._pointer = node.create_publisher(PoseStamped, "/teacher/pointer", 10)
        self._grip, self._done = node.create_client(SetBool, "/teacher/grip"), node.create_client(Trigger, "/teacher/done")

    def possible(self, quaternion):
        """The nearest orientation to which the hand can be turned."""
        return quaternion

    def pull(self, position, quaternion):
        message = PoseStamped()
        message.header.frame_id = "world"
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z = map(float, position)
        q.x, q.y, q.z, q.w = map(float, quaternion)
        self._pointer.publish(message)

    def grip(self, closes):
        self._client.call(self._grip, SetBool.Request(data=closes))

    def done(self):
        self._client.call(self._done, Trigger.Request())


class PageHands:
    """The same with the mouse on the page, which turns the hand about the vertical only. page: a PageClient that is open."""

    def __init__(self, page):
        self._page = page
        self._let_go()

    def _let_go(self):
        self._base, self._place, self._turn = None, np.full(3, np.nan), np.nan

    def _turn_to(self, quaternion):
        """About the vertical, from how the hand was when it was taken [rad]."""
        self._base = Rotation.from_quat(quaternion) if self._base is None else self._base
        return float((Rotation.from_quat(quaternion) * self._base.inv()).as_rotvec()[2])

    def possible(self, quaternion):
        return (Rotation.from_rotvec([0.0, 0.0, self._turn_to(quaternion)]) * self._base).as_quat()

    def pull(self, position, quaternion):
        turn = self._turn_to(quaternion)
        if not abs(turn - self._turn) < 1e-3:
            self._page.set("Turn [°]", np.rad2deg(turn))
            self._turn = turn
        if not np.allclose(position, self._place, atol=1e-4):
            self._page.drag("/pointer", self._page.places["/pointer"], position)
            self._place = np.array(position)

    def grip(self, closes):
        self._page.click("Close or open the hand (C)")

    def done(self):
        self._page.press("the demonstration is done")
        self._let_go()


class ScreenPerson:
    """client: a GraphClient, which is spun while the person waits; names: roles of the bodies that are seen, the hand among them."""

    def __init__(self, client, names, hands=None, meanwhile=lambda: None):
        self._client, self._names, self._near, self._meanwhile, self.seen = client, names, 0, meanwhile, {}
        self.hands = hands or RosHands(client)
        for name in names:
            see = lambda message, name=name: self._see(name, message)  # noqa: E731
            client.node.create_subscription(PoseStamped, pose_topic(name), see, qos_profile_sensor_data)

    def _see(self, name, message):
        p, q = message.pose.position, message.pose.orientation
        self.seen[name] = Pose(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))

    def look(self, until):
        """At all bodies, wherever they were before."""
        self.seen.clear()
        until(lambda: len(self.seen) == len(self._names), "the bodies")

    def pull(self, position, quaternion, limit=60.0):
        """Until the hand is there and stays there."""
        self._near, quaternion = 0, self.hands.possible(quaternion)

        def there():
            self.hands.pull(position, quaternion)
            self._meanwhile()
            hand = self.seen["hand"]
            turn = (Rotation.from_quat(hand.quaternion).inv() * Rotation.from_quat(quaternion)).magnitude()
            near = np.linalg.norm(hand.position - position) < THERE and turn < TURNED
            self._near = self._near + 1 if near else 0
            return self._near >= STAYS

        wait_for(
            self._client, there, limit, lambda: f"the hand at {np.round(position, 3)}, not at {np.round(self.seen['hand'].position, 3)},"
        )

    def place(self, goal):
        """Take the part around which the hand is, and put it to a goal (a Pose): up, over, turned, and down."""
        hand = self.seen["hand"]
        self.hands.grip(True)
        self.pull(hand.position + [0.0, 0.0, 0.1], hand.quaternion)
        end = goal.place(self.seen["part"].sees(self.seen["hand"]))
        for height in (0.07, 0.02, 0.0):
            self.pull(end.position + [0.0, 0.0, height], end.quaternion)
        self.hands.grip(False)
