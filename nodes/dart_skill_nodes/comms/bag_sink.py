"""A bag for topics: announced as their publishers offer them, flushed every second, and closed
with what was lost written into it.
"""

from itertools import count
from pathlib import Path

from dart_skill_msgs.msg import DemonstrationMark
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dart_skill.recording import (
    DEMONSTRATION_TYPE,
    MARK_TYPE,
    BagWriter,
    Demonstration,
    definition,
    demonstration_message,
    encoded,
    is_stamped,
    qos_yaml,
    type_hash,
    types_for,
)
from dart_skill.skills.observation import attach_arm
from dart_skill_nodes.comms import conversions
from dart_skill_nodes.comms.names import DEMONSTRATIONS, MARKS
from dart_skill_nodes.comms.qos import LATCHED, WALL
from dart_skill_nodes.comms.refusals import NOT_RECORDED, GuardedLifecycleNode

FLUSH = 1.0
"""What came more than so long ago is safe from a crash [s, wall clock]."""


def free_folder(path: Path) -> Path:
    """The path, or where something is there already the same with the next free number."""
    free = path
    for number in count(2):
        if not free.exists():
            break
        free = path.with_name(f"{path.name}_{number}")
    return free


class BagSink:
    """A bag that is being filled. failure: why nothing is written any more, as when the disk is
    full; empty if all is well.

    limits: of a file, as `BagWriter` has them.
    """

    def __init__(self, node: Node, path: Path, custom_data: dict[str, str], **limits):
        self._node, self._stamped, self._open, self.failure = node, {}, True, ""
        self._names: dict[str, str] = {}  # in full, by how the node calls them
        self.writer = BagWriter(path, custom_data=custom_data, **limits)
        attach_arm(self.writer)
        self._timer = node.create_timer(FLUSH, self.flush, clock=WALL)

    def add_offered(self, topic: str, offers: list[TopicEndpointInfo]) -> None:
        """Announce a topic with the type and quality of service of its publishers; ValueError if
        its type cannot be found.
        """
        self._add(topic, offers[0].topic_type, [offer.qos_profile for offer in offers])

    def add_own(self, topic: str, type_name: str, qos: QoSProfile) -> None:
        """Announce a topic that the node itself writes."""
        self._add(topic, type_name, [qos])

    def stamp_ns(self, topic: str, data: bytes) -> int | None:
        """The stamp that a serialised message begins with; None where messages of the topic have
        none, or this one has none that can be.
        """
        try:
            return conversions.leading_stamp_ns(data) if self._stamped.get(topic, True) else None
        except ValueError:
            return None  # the message is recorded all the same

    def write(self, topic: str, log_ns: int, stamp_ns: int, data: bytes) -> None:
        """Append a message, unless recording has stopped."""
        if not self.failure:
            self._try(self.writer.write, self._names[topic], log_ns, stamp_ns, data)

    def flush(self) -> None:
        """Hand over to the disk what has come."""
        if self._open and not self.failure:
            self._try(self.writer.flush, True)

    def close(self, notes: dict[str, str] | None = None) -> None:
        """Close the bag with notes for its metadata."""
        self._node.destroy_timer(self._timer)
        self._open = False  # one more tick of the timer may be under way
        for name, text in (notes or {}).items():
            self.writer.note(name, text)
        self._try(self.writer.close)

    def _add(self, topic, type_name, profiles):
        types = types_for(type_name)
        self._stamped[topic] = is_stamped(types, type_name)
        texts = {
            qos_yaml(
                p.reliability.name.lower(),
                p.durability.name.lower(),
                p.history.name.lower(),
                p.depth,
            )
            for p in profiles
        }
        self._names[topic] = self._node.resolve_topic_name(topic)
        self._try(
            self.writer.add_topic,
            self._names[topic],
            type_name,
            definition(types, type_name),
            "".join(sorted(texts)),
            type_hash(types, type_name),
        )

    def _try(self, write, *arguments) -> None:
        try:
            write(*arguments)
        except OSError as error:
            if not self.failure:
                self._node.get_logger().error(f"{NOT_RECORDED}: {error}")
            self.failure = str(error)


class DemonstrationBag(BagSink):
    """A bag of demonstrations, and of marks of those that were dropped or restored."""

    _has_marks = False

    def keep(self, one: Demonstration, log_ns: int, until_ns: int) -> None:
        """Append a demonstration that was watched up to a stamp."""
        # Not by serialize_message: Fast DDS's size estimate leaves stray bytes behind empty
        # sequences.
        types = types_for(DEMONSTRATION_TYPE)
        content = encoded(types, DEMONSTRATION_TYPE, demonstration_message(types, one))
        self.write(DEMONSTRATIONS, log_ns, until_ns, content)

    def mark(self, marks: list[DemonstrationMark], log_ns: int) -> None:
        """Append marks."""
        if not self._has_marks:
            self.add_own(MARKS, MARK_TYPE, LATCHED)
        self._has_marks = True
        for mark in marks:
            self.write(MARKS, log_ns, log_ns, serialize_message(mark))
        self.flush()


class BagKeeper(GuardedLifecycleNode):
    """A managed node with a bag, which is closed whichever way the node ends; `_close` is called
    once or more.
    """

    def _close(self) -> None:
        raise NotImplementedError

    def on_cleanup(self, state) -> TransitionCallbackReturn:
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state) -> TransitionCallbackReturn:
        self._close()
        return TransitionCallbackReturn.SUCCESS

    def destroy_node(self) -> None:
        self._close()
        super().destroy_node()
