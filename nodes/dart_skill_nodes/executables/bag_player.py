"""The bag player: publishes what a bag holds, with the quality of service that was recorded, at
any rate, with /clock.

~/pause (SetBool) and ~/step (a number of messages, while paused) steer it, and so does the
parameter `rate`. It ends with the bag. Commands of a recording are played only where that is asked
for, and no states or commands beside an arm that is there: before the player has looked for
one, it offers nothing on any topic.
"""

import math
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable

from dart_skill_msgs.srv import Step
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from std_srvs.srv import SetBool

from dart_skill.recording import BagReader, GraphBag
from dart_skill.recording.bags import CLOCK_TOPIC, Due, Playback, PlaybackPace
from dart_skill_nodes.client.playing import (
    DEPTH,
    Hearers,
    arm_beside,
    awaited_topics,
    concern_an_arm,
    offers,
    selection,
)
from dart_skill_nodes.client.service_calls import APPEARS
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.names import CLOCK, full_name
from dart_skill_nodes.comms.qos import WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.comms.this_machine import LOOK
from dart_skill_nodes.process.node_base import ERROR, OK, Diagnostics, run
from dart_skill_nodes.process.parameters import declare

PATIENCE = Duration(seconds=10)
"""Longest wait, at the end, for reliable subscribers to acknowledge everything; Fast DDS asks them
every 3 s.
"""


class BagPlayer(GuardedNode):
    """Publishes from a thread of its own, so that no callback delays a message.

    tell: called, in that thread, with "playing" when that begins, and before with what it waits
    for. finished: whether everything was published. refusal: why not: an arm is there.
    """

    def __init__(self, tell: Callable[[str], None] = lambda state: None):
        super().__init__("bag_player")
        self.p = declare(self, "bag_player")
        self.refusal, self._made, self._tell = "", time.monotonic(), tell
        self.finished, self._stopping = False, False
        self._steps, self._published, self._position_ns = 0, 0, 0
        self._bag = GraphBag(self.p["bag"]) if self.p["graph"] else BagReader(self.p["bag"])
        self._playback = Playback(self._bag, selection(self, self._bag, self.p))
        self._offers = offers(self._playback)
        self._publishers_of: dict[str, Publisher] = {}
        self._awaited = awaited_topics(self.p["awaited"], self._offers)
        self._sent: Counter[str] = Counter()  # since everything was last acknowledged
        self._changed = threading.Condition()
        self._pace = PlaybackPace(self.p["rate"], time.monotonic(), self.p["start_paused"])
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(Step, "~/step", self._on_step)
        self.add_on_set_parameters_callback(self._on_parameters)
        self._diagnostics = Diagnostics(self, self._describe)
        self._hearers = Hearers(self, self._offers)
        self._watch_arms()
        self.create_timer(LOOK, self._watch_arms, clock=WALL)
        self._thread = threading.Thread(target=self._play, name="playing")
        self._thread.start()

    def destroy_node(self) -> None:
        with self._changed:
            self._stopping = True
            self._changed.notify()
        self._thread.join()
        self._bag.close()
        super().destroy_node()

    @property
    def _waiting(self) -> str:
        return f"waiting for a subscriber of {', '.join(self._awaited)}"

    # playing, in the thread

    def _play(self) -> None:
        if self._is_alone() and self._are_awaited():
            self._tell("playing")
            with self._changed:
                self._pace.begin(time.monotonic())
            self._publish_all(self._playback)
        self.finished = not self._stopping

    def _are_awaited(self) -> bool:
        """Wait until the topics of `awaited` have subscribers; False if playing was stopped."""
        if self._awaited:
            self._tell(f"{self._waiting} before playing")
        with self._changed:
            while not self._stopping and self._awaited:
                self._awaited = [
                    topic
                    for topic in self._awaited
                    if not self._publishers_of[topic].get_subscription_count()
                ]
                self._changed.wait(0.05)
            return not self._stopping

    def _is_alone(self) -> bool:
        """Wait until the topics are offered; False if playing was stopped, as beside an arm."""
        with self._changed:
            while not self._stopping and not self._publishers_of:
                self._changed.wait()
            return not self._stopping

    def _watch_arms(self) -> None:
        """Stop when an arm is there that would take what is played for its own, or for a command;
        else offer the topics.
        """
        if self.finished or self.refusal:
            return
        reason = (
            arm_beside(self, {topic: info.name for topic, info in self._playback.topics.items()})
            or self._hearers.look()
        )
        has_looked = not concern_an_arm(self._offers) or time.monotonic() > self._made + APPEARS
        with self._changed:
            self.refusal, self._stopping = reason, self._stopping or bool(reason)
            if has_looked and not self._stopping and not self._publishers_of:
                # the time of a graph goes with it into its namespace
                moved = {CLOCK_TOPIC: full_name(self, CLOCK)} if self.p["graph"] else {}
                self._publishers_of = {
                    topic: self.create_publisher(kind, moved.get(topic, topic), qos)
                    for topic, (kind, qos) in self._offers.items()
                }
            self._changed.notify()

    def _publish_all(self, dues: Iterable[Due]) -> None:
        for due in dues:
            if not self._wait_for(due):
                return
            self._publishers_of[due.topic].publish(due.data)
            self._hold_back(due)
            self._published, self._position_ns = self._published + 1, due.stamp_ns
        self._wait_for_acknowledgements()

    def _hold_back(self, due: Due) -> None:
        """In a hurry, wait for the subscribers before a history is full: what is overwritten
        cannot be repeated.
        """
        self._sent[due.topic] += 1
        if self._sent[due.topic] >= DEPTH // 2 and self._pace.hurries(
            due.position_ns, time.monotonic()
        ):
            self._wait_for_acknowledgements()
            self._sent.clear()

    def _wait_for(self, due: Due) -> bool:
        """Wait until a message is due; False if playing was stopped."""
        with self._changed:
            while (
                not self._stopping
                and not self._steps
                and (wait := self._pace.wait(due.position_ns, time.monotonic())) > 0.0
            ):
                self._changed.wait(None if math.isinf(wait) else wait)
            self._steps -= self._steps > 0 and due.topic != CLOCK_TOPIC
            self._pace.reach(due.position_ns, time.monotonic())
            while not self._stopping and not self._hearers.are_known(
                due.topic, self._publishers_of[due.topic].get_subscription_count()
            ):
                self._changed.wait(0.05)  # a subscriber that has just joined is looked at first
            return not self._stopping

    def _wait_for_acknowledgements(self) -> None:
        for publisher in self._publishers_of.values():
            if not self._stopping and publisher.get_subscription_count():
                publisher.wait_for_all_acked(PATIENCE)

    # steering

    def _on_pause(self, request, response):
        with self._changed:
            self._pace.pause(request.data, time.monotonic())
            self._changed.notify()

    def _on_step(self, request, response):
        response.stamp = conversions.time_msg(self._position_ns)
        with self._changed:
            if not self._pace.paused or not request.steps:
                raise ValueError(
                    "messages are stepped while paused (~/pause), at least 1 at a time"
                )
            self._steps += request.steps
            self._changed.notify()

    def _on_parameters(self, parameters) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "rate":
                with self._changed:
                    self._pace.set_rate(parameter.value, time.monotonic())
                    self._changed.notify()
        return SetParametersResult(successful=True)

    def _describe(self):
        if self.refusal:
            return ERROR, f"not played: {self.refusal}", {"published": self._published}
        if not self._publishers_of:
            return OK, "looking for an arm", {"published": 0}
        state = "finished" if self.finished else "paused" if self._pace.paused else "playing"
        values = {"published": self._published, "stamp_ns": self._position_ns}
        return OK, self._waiting if self._awaited else state, values | {"rate": self._pace.rate}


def play(
    args: list[str] | None, program: str, tell: Callable[[str], None] = lambda state: None
) -> BagPlayer:
    """Play until the end, Ctrl-C or a refusal, which is said. tell: as for the player."""
    players: list[BagPlayer] = []

    def make() -> list[BagPlayer]:
        players.append(BagPlayer(tell))
        return players

    run(
        make, args, over=lambda nodes: nodes[0].finished or bool(nodes[0].refusal), program=program
    )
    if players[0].refusal:
        print(f"{program}: not played: {players[0].refusal}", file=sys.stderr, flush=True)
    return players[0]


def main(args: list[str] | None = None) -> None:
    """Entry point of `ros2 run dart_skill bag_player`."""
    if play(args, "bag_player").refusal:
        sys.exit(1)


if __name__ == "__main__":
    main()
