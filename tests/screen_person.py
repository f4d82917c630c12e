"""A person in front of a screen, who sees the tracked bodies and pulls the hand: as a plain ROS
client, or on the page.
"""

import time

import numpy as np
from dart_skill_msgs.action import Teach
from geometry_msgs.msg import PoseStamped
from rclpy.qos import qos_profile_sensor_data
from scipy.spatial.transform import Rotation
from std_srvs.srv import SetBool, Trigger

from dart_skill.common.situation import Pose
from dart_skill.common.world import pose_topic
from dart_skill.view import TURN_BY
from dart_skill_nodes.comms import conversions
from tests.integration.browser import project
from tests.integration.conftest import wait_for

STAYS = 10
"""The hand is where it is pulled to if it is near in so many poses, one after the other; a ball
rests after so many equal looks.
"""
LIMIT = 30.0
"""For a ball that shall come to rest [s]."""


def begin_by_pointer(client, teacher, situation):
    """A lesson that is given with a pointer, from when on the hand may be pulled: the future of
    its result.
    """
    phases, wanted = (
        [],
        Teach.Goal(situation=conversions.situation_msg(situation), by_pointer=True),
    )
    handle = client.wait(
        teacher.send_goal_async(
            wanted, feedback_callback=lambda one: phases.append(one.feedback.phase)
        ),
        "/teach",
    )
    assert handle.accepted
    result = handle.get_result_async()
    wait_for(client, lambda: "held" in phases or result.done(), what="a hand that may be pulled")
    return result


class RosHands:
    """Pulls by /teacher/pointer and tells the fingers by /teacher/grip, as any ROS client may.
    client: a GraphClient.
    """

    there, turned = 0.002, 0.012
    """How near to where it is pulled to the hand comes [m], [rad]: friction in the wrist holds it
    5 mrad off, seen with noise of 1 mrad.
    """

    def __init__(self, client):
        self._client, node = client, client.node
        self._pointer = node.create_publisher(PoseStamped, "/teacher/pointer", 10)
        self._grip, self._done = (
            node.create_client(SetBool, "/teacher/grip"),
            node.create_client(Trigger, "/teacher/done"),
        )

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
    """The same with the mouse on the page, which turns the hand about the vertical only. page: a
    PageClient that is open.
    """

    there, turned = RosHands.there, RosHands.turned

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


class MouseHands:
    """The same with a real mouse and real keys in a browser, as the page looks at first.

    page: a Page that is open; watch: a PageClient of it, which tells where the ball is; sight:
    where the page looks from and to (3,).
    """

    there, turned = 0.008, 0.045
    """A pixel is three millimetres, and a key turns by 5 degrees."""

    def __init__(self, page, watch, sight):
        self._page, self._watch, (self._eye, self._look_at) = page, watch, sight
        forward = self._look_at - self._eye
        up = np.cross(np.cross(forward, [0.0, 0.0, 1.0]), forward)
        # of the ball that is dragged up on the screen, for a metre in height
        self._rise = up / up[2]
        self._let_go()

    def _let_go(self):
        self._base, self._keys = None, 0

    @property
    def _ball(self):
        return self._watch.places["/pointer"]

    def possible(self, quaternion):
        self._base = Rotation.from_quat(quaternion) if self._base is None else self._base
        self._wanted_keys = round(
            np.rad2deg((Rotation.from_quat(quaternion) * self._base.inv()).as_rotvec()[2])
            / TURN_BY
        )
        return (
            Rotation.from_euler("z", TURN_BY * self._wanted_keys, degrees=True) * self._base
        ).as_quat()

    def pull(self, position, quaternion):
        while self._keys != self._wanted_keys:
            left = self._wanted_keys > self._keys
            self._page.key("q" if left else "e")
            self._keys += 1 if left else -1
        rise = position[2] - self._ball[2]
        if abs(rise) > self.there / 2:
            self._drag(self._ball + rise * self._rise, shift=False)
        if np.hypot(*(position - self._ball)[:2]) > self.there / 2:
            self._drag(position * [1.0, 1.0, 0.0] + self._ball * [0.0, 0.0, 1.0], shift=True)

    def _drag(self, position, shift):
        """As the screen does, or with Shift over the ground."""
        ball = self._ball
        start, wanted = project(
            np.array([ball, position]), self._eye, self._look_at, self._page.size
        )

        def correct(end):
            """The mouse has hold of the near side of the ball, where a pixel is a shorter way: it
            goes on until the ball is there.
            """
            seen = self._ball_at_rest()
            off = wanted - project(seen, self._eye, self._look_at, self._page.size)[0]
            return None if np.linalg.norm(off) < 0.5 else end + off

        self._page.drag(start, wanted, shift=shift, correct=correct)

    def _ball_at_rest(self):
        """Where the ball is, when all that the page was told of it has come."""
        places = []
        until = time.monotonic() + LIMIT
        while len(places) < STAYS or not np.array_equal(places[-STAYS], places[-1]):
            assert time.monotonic() < until, "the ball moves by itself"
            self._watch.listen(0.02)
            places.append(self._ball)
        return places[-1]

    def grip(self, closes):
        self._page.key("c")

    def done(self):
        self._page.key("Enter")
        self._let_go()


class ScreenPerson:
    """client: a GraphClient, which is spun while the person waits; names: roles of the bodies that
    are seen, the hand among them.
    """

    def __init__(self, client, names, hands=None, meanwhile=lambda: None):
        self._client, self._names, self._meanwhile, self.seen = client, names, meanwhile, {}
        self._poses, self._near_since = 0, None  # of the hand, so far, and when it came near
        self.hands = hands or RosHands(client)
        for name in names:
            see = lambda message, name=name: self._see(name, message)  # noqa: E731
            client.node.create_subscription(
                PoseStamped, pose_topic(name), see, qos_profile_sensor_data
            )

    def _see(self, name, message):
        self._poses += name == "hand"
        p, q = message.pose.position, message.pose.orientation
        self.seen[name] = Pose(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))

    def look(self, until):
        """At all bodies, wherever they were before."""
        self.seen.clear()
        until(
            lambda: len(self.seen) == len(self._names),
            lambda: f"{', '.join(set(self._names) - set(self.seen))}",
        )

    def pull(self, position, quaternion, limit=60.0):
        """Until the hand is there and stays there."""
        self._near_since, quaternion = None, self.hands.possible(quaternion)

        def there():
            self.hands.pull(position, quaternion)
            self._meanwhile()
            hand = self.seen["hand"]
            turn = (
                Rotation.from_quat(hand.quaternion).inv() * Rotation.from_quat(quaternion)
            ).magnitude()
            near = (
                np.linalg.norm(hand.position - position) < self.hands.there
                and turn < self.hands.turned
            )
            return self._stays(near, STAYS)

        wait_for(
            self._client,
            there,
            limit,
            lambda: (
                f"the hand at {np.round(position, 3)}, not at"
                f" {np.round(self.seen['hand'].position, 3)},"
            ),
        )

    def _stays(self, near, poses):
        """Whether the hand has been near in so many poses, one after the other."""
        if not near:
            self._near_since = None
        elif self._near_since is None:
            self._near_since = self._poses
        return near and self._poses - self._near_since >= poses

    def follow(self, role, beside, poses=STAYS, limit=120.0):
        """Keep the hand beside a body (3,) [m], wherever that goes, until it is there and stays
        there for so many poses.
        """
        self._near_since, turned = None, self.seen["hand"].quaternion

        def there():
            wanted = self.seen[role].position + beside
            self.hands.pull(wanted, turned)
            near = np.linalg.norm(self.seen["hand"].position - wanted) < 2.0 * self.hands.there
            return self._stays(near, poses)

        wait_for(self._client, there, limit, f"the hand beside the {role}")

    def carry(self, goal):
        """Take the part around which the hand is, and bring it over a goal (a Pose); returns the
        pose of the hand down there.
        """
        hand = self.seen["hand"]
        self.hands.grip(True)
        self.pull(hand.position + [0.0, 0.0, 0.1], hand.quaternion)
        end = goal.place(self.seen["part"].sees(self.seen["hand"]))
        self.pull(end.position + [0.0, 0.0, 0.07], end.quaternion)
        return end

    def place(self, goal):
        """The same, and put it down there."""
        end = self.carry(goal)
        for height in (0.02, 0.0):
            self.pull(end.position + [0.0, 0.0, height], end.quaternion)
        self.hands.grip(False)
