"""The bag player: publishes what a bag holds, with the quality of service that was recorded, at
any rate, with /clock.

~/pause (SetBool) and ~/step (a number of messages, while paused) steer it, and so does the
parameter `rate`. It ends with the bag. Commands of a recording are played only where that is asked
for, and no states or commands beside an arm that is there: before the player has looked for
one, it offers nothing on any topic.
"""

import math
import re
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable

from dart_skill_msgs.srv import Step
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool

from dart_skill.recording import BagReader, GraphBag, TopicInfo, type_hash, types_for
from dart_skill.recording.bags import (
    CLOCK_TOPIC,
    CLOCK_TYPE,
    Due,
    Playback,
    PlaybackPace,
    PlaybackSelection,
)
from dart_skill_nodes.client.live_arm import Hearers, arm_beside, commands_an_arm, concern_an_arm
from dart_skill_nodes.client.server_probe import APPEARS
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.matching_qos import message_class
from dart_skill_nodes.comms.names import CLOCK, GLOBAL, full_name
from dart_skill_nodes.comms.presence import LOOK
from dart_skill_nodes.comms.qos import CLOCK_QOS, WALL
from dart_skill_nodes.comms.refusals import GuardedNode
from dart_skill_nodes.process.node_base import ERROR, OK, Diagnostics, Parameter, declare, run

TABLE = [
    Parameter("bag", "folder or .mcap file"),
    Parameter(
        "rate", "seconds of the bag per second; 0: as fast as can be", 0.0, 1e6, read_only=False
    ),
    Parameter(
        "topics", "regular expressions; a topic is played that one of them matches as a whole"
    ),
    Parameter(
        "exclude", "regular expressions; a topic that one of them matches as a whole is not played"
    ),
    Parameter(
        "commands",
        "play topics on which an arm takes commands, too; never beside an arm that is there",
    ),
    Parameter(
        "graph",
        "of one graph: play it in the namespace of this node, whichever it was recorded in",
    ),
    Parameter("remap", "recorded=published name; '=': none"),
    Parameter("start", "begin so long after the bag's first message [s]", 0.0, 1e9),
    Parameter("duration", "end so long after that [s]; 0: with the bag", 0.0, 1e9),
    Parameter("loop", "begin again at the end"),
    Parameter("start_paused", "wait for ~/pause or ~/step"),
    Parameter(
        "clock_rate",
        "of /clock, unless the bag has one [1/s of the bag's time]; 0: none",
        0.0,
        10_000.0,
    ),
    Parameter(
        "awaited",
        "regular expressions: topics, as published, that must have a subscriber before playing"
        " begins; '': none",
    ),
]
DEPTH = 10_000
"""Least depth of publishers, whatever was recorded, so that what is lost on the way can be
repeated; no subscriber sees it.
"""
PATIENCE = Duration(seconds=10)
"""At the end, for reliable subscribers to acknowledge everything; Fast DDS asks them every 3 s."""


class BagPlayer(GuardedNode):
    """Publishes from a thread of its own, so that no callback delays a message.

    * tell: called, in that thread, with "playing" when that begins, and before with what it waits
      for.

    Attributes:

    * finished: whether everything was published.
    * refusal: why not everything was: an arm is there. Empty without one.
    """

    def __init__(self, tell: Callable[[str], None] = lambda state: None):
        super().__init__("bag_player")
        self.p = declare(self, "bag_player.yaml", TABLE)
        self.refusal, self._made, self._tell = "", time.monotonic(), tell
        self.finished, self._stopping = False, False
        self._steps, self._published, self._position_ns = 0, 0, 0
        self._bag = GraphBag(self.p["bag"]) if self.p["graph"] else BagReader(self.p["bag"])
        self._playback = Playback(self._bag, self._selection())
        self._offers = {
            topic: (message_class(info.type_name), _quality(info))
            for topic, info in self._playback.topics.items()
        }
        self._publishers_of: dict[str, Publisher] = {}
        if self._playback.makes_clock:
            self._offers[CLOCK_TOPIC] = (message_class(CLOCK_TYPE), CLOCK_QOS)
        self._awaited = self._awaited_topics()
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

    # what is played

    def _selection(self) -> PlaybackSelection:
        played = PlaybackSelection(self.p["topics"], self.p["exclude"])
        own = [
            name
            for name in self._bag.topics
            if self.p["graph"] and name not in (CLOCK_TOPIC, *GLOBAL)
        ]
        remap = {name: full_name(self, name.removeprefix("/")) for name in own}
        remap |= dict(text.split("=", 1) for text in self.p["remap"] if text.strip("="))
        chosen = {name: info for name, info in self._bag.topics.items() if played.matches(name)}
        unknown = [
            name
            for name, info in chosen.items()
            if self._would_command(remap.get(name, name)) or not self._is_known(info)
        ]
        return PlaybackSelection(
            topics=self.p["topics"],
            exclude=[*self.p["exclude"], *map(re.escape, unknown)],
            remap=remap,
            start=self.p["start"],
            duration=self.p["duration"] or math.inf,
            loop=self.p["loop"],
            clock_rate=self.p["clock_rate"],
        )

    def _would_command(self, topic: str) -> bool:
        """Whether a topic is left out because it moves arms, and that was not asked for; says so."""
        if self.p["commands"] or not commands_an_arm(topic):
            return False
        self.get_logger().info(
            f"{topic} is not played: it would command an arm (parameter commands)"
        )
        return True

    def _is_known(self, info: TopicInfo) -> bool:
        """Whether a topic's type is installed here, in the version that the bag has; says why not."""
        try:
            message_class(info.type_name)
            here = type_hash(types_for(info.type_name), info.type_name)
        except (ImportError, AttributeError, ValueError) as error:
            self.get_logger().warning(f"{info.name} is not played: {error}")
            return False
        if info.type_hash not in ("", here):
            self.get_logger().warning(
                f"{info.name} is not played: its {info.type_name} differs from the one that is"
                " installed here"
            )
            return False
        return True

    def _in_full(self, topic: str) -> str:
        """The time of a graph goes with it into its namespace."""
        return full_name(self, CLOCK) if self.p["graph"] and topic == CLOCK_TOPIC else topic

    def _awaited_topics(self) -> list[str]:
        """Those of `awaited`; ValueError if one of its expressions matches nothing that is played."""
        patterns = list(filter(None, self.p["awaited"]))
        if unknown := [
            pattern
            for pattern in patterns
            if not any(re.fullmatch(pattern, topic) for topic in self._offers)
        ]:
            raise ValueError(f"awaited: {unknown} are not played, only {sorted(self._offers)}")
        return [
            topic
            for topic in self._offers
            if any(re.fullmatch(pattern, topic) for pattern in patterns)
        ]

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
                self._publishers_of = {
                    topic: self.create_publisher(kind, self._in_full(topic), quality)
                    for topic, (kind, quality) in self._offers.items()
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
        response.success = True
        return response

    def _on_step(self, request, response):
        with self._changed:
            response.success = self._pace.paused and request.steps > 0
            if response.success:
                self._steps += request.steps
                self._changed.notify()
            else:
                response.message = (
                    "messages are stepped while paused (~/pause), at least 1 at a time"
                )
        response.stamp = conversions.time_msg(self._position_ns)
        return response

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
        state = "finished" if self.finished else ("paused" if self._pace.paused else "playing")
        if self._awaited:
            state = self._waiting
        return (
            OK,
            state,
            {"published": self._published, "stamp_ns": self._position_ns, "rate": self._pace.rate},
        )


def _quality(info: TopicInfo) -> QoSProfile:
    """The first recorded quality of service of a topic; late joiners get as many messages of a
    latched one as they did then.
    """
    if not info.qos:
        return QoSProfile(depth=DEPTH)
    recorded = info.qos[0]
    latched = recorded.durability.name == "TRANSIENT_LOCAL"
    return QoSProfile(
        depth=recorded.depth if latched and recorded.depth else max(recorded.depth, DEPTH),
        reliability=ReliabilityPolicy[recorded.reliability.name],
        durability=DurabilityPolicy[recorded.durability.name],
    )


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
