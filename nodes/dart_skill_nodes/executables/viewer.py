"""The live view: a page with the arm, what it has learned and what it does, and with controls that
teach, learn, throw and practise.

It hears sensors, markers and status, never the ground truth. The page's server has threads of its
own: what they ask for comes through a queue, and the scene changes in the executor's thread,
`rate` times a second whatever the rates of the topics.
"""

import os
import queue
from functools import partial

import numpy as np
from dart_skill_msgs.action import Practice, Teach
from dart_skill_msgs.msg import Demonstration
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

from dart_skill.common.regions import Region
from dart_skill.recording import HAND, demonstration_from_message
from dart_skill.simulation import Basket
from dart_skill.skills.protocol import Skill
from dart_skill.view import Panel, Request, Scene, new_token, open_server, url_of, with_token
from dart_skill_nodes.client.failures import CallFailed
from dart_skill_nodes.client.node_inspector import NodeInspector, NodeStatuses
from dart_skill_nodes.client.pulled_lesson import PulledLesson
from dart_skill_nodes.client.viewer_jobs import ViewerJobs, in_words
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.coroutines import start
from dart_skill_nodes.comms.joint_states import OfTheArm
from dart_skill_nodes.comms.markers import ellipsoids
from dart_skill_nodes.comms.names import (
    DEMONSTRATIONS,
    DIAGNOSTICS,
    JOINT_STATES,
    in_graph,
    pose_topic,
)
from dart_skill_nodes.comms.qos import LATCHED, WALL
from dart_skill_nodes.comms.raw_batches import LatestMessages, poses_of
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.graph_processes import TOKEN
from dart_skill_nodes.process.node_base import (
    OK,
    Diagnostics,
    Parameter,
    declare,
    declare_bodies,
    run,
    skill_of,
)

TABLE = [
    Parameter(
        "host",
        "address to listen on; whoever has the address of the page, with its token, moves the arm",
    ),
    Parameter("port", "of the page; 0: any free one, which is printed", 0, 65535),
    Parameter("rate", "of the pictures [1/s, wall clock]", 1.0, 100.0),
    Parameter(
        "rate_held",
        "the same while somebody holds the hand with the mouse [1/s, wall clock]",
        1.0,
        100.0,
    ),
    Parameter("frame_id", "frame of all positions; others are not shown"),
    Parameter("skill", "whose bodies it shows, and what its controls let be done"),
    Parameter("basket_radius", "free opening of the basket [m]", 0.05, 1.0),
    Parameter("basket_depth", "rim to floor of the basket [m]", 0.05, 1.0),
    Parameter("seed", "of the baskets at which it lets demonstrate", 0, 2**31 - 1),
    Parameter("near", "nearest place of the basket, from the base axis [m]", 0.5, 5.0),
    Parameter("far", "farthest place [m]", 0.5, 5.0),
    Parameter("side", "largest azimuth to either side [rad]", 0.0, 1.57),
    Parameter("rim", "height of the rim [m]", 0.0, 2.0),
]
ATTRACTOR = "commander/attractor"
CAMERAS = "mock_optitrack"
"""The node whose parameters say where the cameras stand."""
PICTURES_PER_PATH = 3


def _shown(skill: Skill, message: Demonstration) -> tuple[np.ndarray, np.ndarray]:
    """Way of the hand (n, 3) in a demonstration, and the places (m, 3) of bodies at its begin."""
    one = skill.described(demonstration_from_message(message, skill.name))
    start, stop = skill.cut(one)
    where = one.situation
    places = [where.pose(role).position for role in skill.bodies if role in where.poses]
    moves = (one.hand_time >= start) & (one.hand_time <= stop)
    return one.hand_position[moves], np.array(places).reshape(-1, 3)


class Viewer(GuardedNode):
    """Topics into the scene, requests of the panel into actions and services."""

    def __init__(self):
        super().__init__("viewer")
        self.p = declare(self, "viewer.yaml", TABLE)
        region = Region(**{name: self.p[name] for name in ("near", "far", "side", "rim")})
        given = os.environ.get(TOKEN, "")
        token = given or new_token()
        self._server = open_server(self.p["host"], self.p["port"], token=token)
        self._requests: queue.SimpleQueue[Request] = queue.SimpleQueue()
        basket = Basket(radius=self.p["basket_radius"], depth=self.p["basket_depth"])
        self._skill = skill = skill_of(self)
        other = None if skill.in_the_open else skill
        self._scene = Scene(self._server, region=region, basket=basket, skill=other)
        self._demonstrated = partial(_shown, skill)
        self._panel = Panel(self._server, self._scene, self._requests.put, skill)
        self._demonstrations, self._new_demonstration, self._basket, self._fault = (
            {},
            False,
            None,
            "",
        )
        self._status, self._phase = NodeStatuses(lambda name: in_graph(self, name) is not None), ""
        self._inspector = NodeInspector(self)
        self._path_ends, self._pictures = (
            {name: [] for name in (*self._scene.bodies[:1], "hand", "attractor")},
            0,
        )
        self._controls = ViewerJobs(
            self, region, self.p["seed"], self.p["frame_id"], say=self._panel.say, busy=self._panel.set_busy, threw=self._panel.add_throw,
            seen=lambda: self._basket, heard=lambda: len(self._demonstrations), skill=skill,
        )  # fmt: skip
        self._lesson = None
        if self._scene.held_hand is not None and self._panel.holding is not None:
            held = self._scene.held_hand
            self._lesson = PulledLesson(
                self, self._controls, held, self._panel, skill, self.p["frame_id"], self._hurry
            )
            held.on_drag(lambda place: self._requests.put(Request("pull", {"place": place})))
        self._subscribe(declare_bodies(self, (HAND, *skill.bodies)))
        self._diagnostics = Diagnostics(self, self._describe)
        self._pictures_timer = None
        self._hurry(False)
        self.create_timer(1.0, lambda: self._panel.show_nodes(self._status.now()), clock=WALL)
        # the giver of the token knows the rest of the address, and a log need not
        url = url_of(self._server)
        self.get_logger().info(f"the live view is at {url if given else with_token(url, token)}")

    def _subscribe(self, name_of: dict[str, str]) -> None:
        self._latest = LatestMessages(self)
        self._of_the_arm = OfTheArm()
        self._latest.watch(JOINT_STATES, JointState)
        self._pose_topics = {role: pose_topic(name) for role, name in name_of.items()} | {
            "attractor": ATTRACTOR
        }
        for topic in self._pose_topics.values():
            self._latest.watch(topic, PoseStamped, depth=200)
        self.create_subscription(Demonstration, DEMONSTRATIONS, self._on_demonstration, LATCHED)
        self.create_subscription(MarkerArray, "skill_learner/model", self._on_markers, LATCHED)
        self.create_subscription(DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, 50)
        for name, kind, callback in (
            ("teach", Teach, self._on_lesson),
            ("practice", Practice, self._on_practice),
        ):
            self.create_subscription(
                kind.Impl.FeedbackMessage, f"{name}/_action/feedback", callback, 50
            )

    # pictures

    def _hurry(self, held: bool) -> None:
        """Show more pictures a second while the hand is held with the mouse."""
        if self._pictures_timer is not None:
            self.destroy_timer(self._pictures_timer)
        self._pictures_timer = self.create_timer(
            1.0 / self.p["rate_held" if held else "rate"], self._tick, clock=WALL
        )

    def _tick(self) -> None:
        while not self._requests.empty():
            request = self._requests.get()
            if self._lesson is None or not self._lesson.obeys(request):
                self._controls.obey(request)
        try:
            self._show(
                self._latest.take(JOINT_STATES),
                {name: self._poses(topic) for name, topic in self._pose_topics.items()},
            )
            self._fault = ""
        except ValueError as error:
            if str(error) != self._fault:
                self.get_logger().error(f"not shown: {error}")
            self._fault = str(error)
        if self._new_demonstration:
            self._new_demonstration = False
            ways, places = zip(*self._demonstrations.values(), strict=True)
            self._scene.show_ways(ways, np.concatenate(places))

    def _show(self, states: list[bytes], poses: dict[str, np.ndarray]) -> None:
        """New joint states, serialised, and new poses (n, 7) of each body."""
        if not states and not any(map(len, poses.values())):
            self._send_paths()
            return
        states = [data for data in states if self._of_the_arm(data)]
        if states:
            self._scene.move_arm(
                conversions.arm_state(conversions.decoded(states[-1], JointState)).position
            )
        if len(poses["hand"]):
            self._scene.move_hand(poses["hand"][-1, :3], poses["hand"][-1, 3:])
        if len(poses["attractor"]):
            self._scene.move_attractor(poses["attractor"][-1, :3])
        for role in self._scene.bodies:
            if len(poses[role]):
                self._move_body(role, poses[role][-1])
        if self._lesson is not None:
            self._lesson.see(
                {role: poses[role][-1] for role in (HAND, *self._scene.bodies) if len(poses[role])}
            )
        self._extend_paths(poses)

    def _move_body(self, role: str, pose: np.ndarray) -> None:
        """A body as it was seen last (7,). How ball and basket are turned is of no use."""
        if role == conversions.BASKET:
            self._basket = pose[:3]
            self._scene.move_basket(self._basket)
        elif role == "ball":
            self._scene.move_ball(pose[:3])
        else:
            self._scene.move_body(role, pose[:3], pose[3:])

    def _extend_paths(self, poses: dict[str, np.ndarray]) -> None:
        """Paths are sent as a whole, so not with every picture."""
        for name, points in self._path_ends.items():
            points.extend(poses[name][:, :3])
        self._pictures += 1
        if self._pictures % PICTURES_PER_PATH == 0:
            self._send_paths()

    def _send_paths(self) -> None:
        for name, points in self._path_ends.items():
            if points:
                self._scene.extend_path(name, np.array(points))
                points.clear()

    def _poses(self, topic: str) -> np.ndarray:
        try:
            return poses_of(self._latest.take(topic), self.p["frame_id"])
        except ValueError as error:
            raise ValueError(f"{topic}: {error}") from error

    # what is learned

    def _on_demonstration(self, message: Demonstration) -> None:
        try:
            shown = self._demonstrated(message)
        except ValueError as error:
            self.get_logger().error(f"a demonstration is not shown: {error}")
            return
        if message.header.frame_id == self.p["frame_id"]:
            self._demonstrations[message.id], self._new_demonstration = shown, True
            if self._lesson is not None:
                self._lesson.heard()

    def _on_markers(self, message: MarkerArray) -> None:
        shown = ellipsoids(message, self.p["frame_id"])
        if any(marker.action == Marker.DELETEALL for marker in message.markers):
            self._scene.hide_gaussians(set(self._scene.gaussian_colours) - set(shown))
        for group, shapes in shown.items():
            self._scene.show_gaussians(group, *shapes)
        self._panel.show_legend()
        if shown:
            self._panel.welcome_a_model()

    # what goes on

    def _on_lesson(self, message) -> None:
        if self._lesson is not None:
            self._lesson.hear(message.feedback.phase)
        attempt = f", attempt {message.feedback.attempt}" if message.feedback.attempt > 1 else ""
        self._say_phase(
            f"{self._controls.progress or 'lesson'}{attempt}: {message.feedback.phase}"
        )

    def _on_practice(self, message) -> None:
        feedback = message.feedback
        what = self._controls.trial_in_words(self._panel.trial, feedback.number)
        if feedback.phase != "done":
            self._say_phase(f"{what}: {feedback.message or feedback.phase}")
            return
        error = float(feedback.outcome.error) if feedback.outcome.seen else float("nan")
        self._panel.add_throw(error, bool(feedback.outcome.success))
        self._say_phase(
            "; ".join(
                filter(
                    None,
                    (f"{what}: {in_words(feedback.outcome, self._skill.words)}", feedback.message),
                )
            )
        )

    def _say_phase(self, text: str) -> None:
        if text != self._phase:
            self._phase = text
            self._panel.say(text)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for name in self._status.take(message):
            start(self, self._inspect(name), self._inspected)

    async def _inspect(self, name: str) -> None:
        self._panel.add_knobs(f"/{name}", await self._inspector.knobs(f"/{name}"))
        if in_graph(self, name) == CAMERAS:
            self._scene.show_cameras(await self._inspector.cameras(f"/{name}"))

    def _inspected(self, _, error: Exception | None) -> None:
        if isinstance(error, CallFailed | KeyError):
            self.get_logger().warning(f"not shown: {error}")
        elif error is not None:
            self.refusals.add(DIAGNOSTICS, error)

    def _describe(self):
        return (
            OK,
            url_of(self._server),
            {
                "browsers": len(self._server.get_clients()),
                "demonstrations": len(self._demonstrations),
            },
        )

    def destroy_node(self) -> None:
        self._latest.close()
        self._server.stop()
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill viewer`."""
    run(lambda: [Viewer()], args)


if __name__ == "__main__":
    main()
