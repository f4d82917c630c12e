"""The live view: a page with the arm, what it has learned and what it does, and with controls that
teach, learn, throw and practise.

It hears sensors, markers and status, never the ground truth. The page's server has threads of its
own: what they ask for comes through a queue, and the scene changes in the executor's thread,
`rate` times a second whatever the rates of the topics.
"""

import os
import queue
import tempfile
from functools import partial
from pathlib import Path

import numpy as np
from dart_skill_msgs.action import Practice, Teach
from dart_skill_msgs.msg import Demonstration
from diagnostic_msgs.msg import DiagnosticArray
from visualization_msgs.msg import Marker, MarkerArray

from dart_skill.common.regions import Region
from dart_skill.recording import HAND, demonstration_from_message
from dart_skill.simulation import Basket
from dart_skill.skills.protocol import Skill
from dart_skill.view import Panel, Request, Scene, new_token, open_server, url_of, with_token
from dart_skill_nodes.client.live_scene import LiveScene
from dart_skill_nodes.client.node_inspector import NodeStatuses
from dart_skill_nodes.client.pulled_lesson import PulledLesson
from dart_skill_nodes.client.viewer_jobs import ViewerJobs, in_words
from dart_skill_nodes.comms.coroutines import start
from dart_skill_nodes.comms.for_viewers import ellipsoids
from dart_skill_nodes.comms.names import (
    ADDRESS_FILE,
    DEMONSTRATIONS,
    DIAGNOSTICS,
    in_graph,
)
from dart_skill_nodes.comms.qos import LATCHED, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.graph_processes import TOKEN, GraphFailure
from dart_skill_nodes.process.node_base import OK, Diagnostics, run
from dart_skill_nodes.process.parameters import declare, declare_bodies, skill_of

CAMERAS = "mock_optitrack"
"""The node whose parameters say where the cameras stand."""


def _kept(address: str) -> Path:
    """A new file with the whole address of the page, which only this user can read: everybody
    hears what a node says of itself.
    """
    with tempfile.NamedTemporaryFile(
        "w", prefix="dart_skill_viewer_", suffix=".txt", delete=False
    ) as file:
        file.write(f"{address}\n")
    return Path(file.name)


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
        self.p = declare(self, "viewer")
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
        self._demonstrations, self._new_demonstration, self._fault = {}, False, ""
        self._status, self._phase = NodeStatuses(lambda name: in_graph(self, name) is not None), ""
        frame_id = self.p["frame_id"]
        name_of = declare_bodies(self, (HAND, *skill.bodies))
        self._live = LiveScene(self, self._scene, name_of, frame_id)
        self._controls = ViewerJobs(
            self,
            region,
            self.p["seed"],
            frame_id,
            panel=self._panel,
            seen=lambda: self._live.basket,
            heard=lambda: len(self._demonstrations),
            skill=skill,
        )
        self._lesson = None
        if self._scene.held_hand is not None and self._panel.holding is not None:
            held = self._scene.held_hand
            self._lesson = PulledLesson(
                self, self._controls, held, self._panel, skill, frame_id, self._hurry
            )
            held.on_drag(lambda place: self._requests.put(Request("pull", {"place": place})))
        self._subscribe()
        self._whole_address = _kept(with_token(url_of(self._server), token))
        self._diagnostics = Diagnostics(self, self._describe)
        self._pictures_timer = None
        self._hurry(False)
        self.create_timer(1.0, lambda: self._panel.show_nodes(self._status.now()), clock=WALL)
        # the giver of the token knows the rest of the address, and a log need not
        url = url_of(self._server)
        self.get_logger().info(f"the live view is at {url if given else with_token(url, token)}")

    def _subscribe(self) -> None:
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
            newest = self._live.show()
            if self._lesson is not None and newest:
                self._lesson.see(newest)
            self._fault = ""
        except ValueError as error:
            if str(error) != self._fault:
                self.get_logger().error(f"not shown: {error}")
            self._fault = str(error)
        if self._new_demonstration:
            self._new_demonstration = False
            ways, places = zip(*self._demonstrations.values(), strict=True)
            self._scene.show_ways(ways, np.concatenate(places))

    # what is learned

    def _on_demonstration(self, message: Demonstration) -> None:
        try:
            shown = self._demonstrated(message)
        except ValueError as error:
            self.get_logger().error(f"a demonstration is not shown: {error}")
            return
        if message.header.frame_id == self.p["frame_id"]:
            self._demonstrations[message.id], self._new_demonstration = shown, True
            self._panel.count_shown(len(self._demonstrations))
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
        self._panel.add_knobs(f"/{name}", await self._controls.inspector.knobs(f"/{name}"))
        if in_graph(self, name) == CAMERAS:
            self._scene.show_cameras(await self._controls.inspector.cameras(f"/{name}"))

    def _inspected(self, _, error: Exception | None) -> None:
        if isinstance(error, GraphFailure | KeyError):
            self.get_logger().warning(f"not shown: {error}")
        elif error is not None:
            self.refusals.add(DIAGNOSTICS, error)

    def _describe(self):
        address = url_of(self._server)
        return (
            OK,
            f"{address}, with the token that is in {self._whole_address}",
            {
                "address": address,
                ADDRESS_FILE: self._whole_address,
                "browsers": len(self._server.get_clients()),
                "demonstrations": len(self._demonstrations),
            },
        )

    def destroy_node(self) -> None:
        self._live.close()
        self._server.stop()
        self._whole_address.unlink(missing_ok=True)
        super().destroy_node()


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill viewer`."""
    run(lambda: [Viewer()], args)


if __name__ == "__main__":
    main()
