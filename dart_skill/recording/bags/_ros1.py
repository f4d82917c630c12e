"""Bags of ROS 1, read by `rosbags`: their messages become the CDR of ROS 2, by the definitions in
the bag, so that all else is the same.

Types have the names of ROS 2 (`geometry_msgs/msg/PoseStamped`), and headers no `seq`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.recording.bags.reader import BagFile, TopicInfo
from dart_skill.recording.mcap import BagMessage

if TYPE_CHECKING:
    from mcap.records import Attachment

HEADER = "std_msgs/msg/Header"
RENAMED = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
"""Types of ROS 1 that are called differently in ROS 2, and the same there."""


class Ros1Source:
    """A bag of ROS 1.

    Parameters
    ----------
    path
        Of the file.

    Raises
    ------
    ValueError
        For what is none, as rosbags says it.
    """

    def __init__(self, path: Path):
        from rosbags.rosbag1 import Reader
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self._reader = reader = Reader(path)
        try:
            reader.open()
        except Exception as error:
            if "not indexed" in str(error):
                raise ValueError(
                    "its recorder was stopped before it wrote the index: 'rosbag reindex' of ROS 1"
                    " makes it whole"
                ) from error
            raise
        self._store = get_typestore(Stores.EMPTY)
        found: dict = dict(get_typestore(Stores.ROS1_NOETIC).fielddefs)
        for one in reader.connections:
            found |= get_types_from_msg(one.msgdef.data, _renamed(one.msgtype))
        self._store.register({**found, HEADER: get_typestore(Stores.ROS2_JAZZY).fielddefs[HEADER]})
        self.storage = "ros1"
        self.metadata: dict = {}
        self.start_ns = reader.start_time if reader.message_count else 0
        self.end_ns = reader.end_time - 1 if reader.message_count else 0
        self.files = [
            BagFile(path, path.stat().st_size, reader.message_count, self.start_ns, self.end_ns)
        ]
        self.topics: dict[str, TopicInfo] = {}
        for name, topic in reader.topics.items():
            type_name = topic.msgtype or topic.connections[0].msgtype
            self.topics[name] = TopicInfo(name, _renamed(type_name), topic.msgcount, "", ())

    @property
    def is_open(self) -> bool:
        """Whether messages can be read."""
        return self._reader.bio is not None

    @property
    def definitions(self) -> tuple[tuple[str, str, str], ...]:
        """Type name, schema encoding and definition text of each type."""
        names = sorted({topic.type_name for topic in self.topics.values()})
        return tuple(
            (name, "ros2msg", self._store.generate_msgdef(name, ros_version=2)[0])
            for name in names
        )

    def messages(
        self, topics: set[str], start_ns: int, stop_ns: int, with_definitions: bool
    ) -> Iterator[BagMessage]:
        """Messages in order of log time.

        Parameters
        ----------
        topics
            Names.
        start_ns, stop_ns
            Log times from the first to before the second [ns].
        with_definitions
            Nothing, as a bag of ROS 1 defines each type once.
        """
        chosen = [one for one in self._reader.connections if one.topic in topics]
        if not chosen:
            return
        for one, stamp_ns, data in self._reader.messages(
            chosen, start_ns, min(stop_ns, 2**63 - 1)
        ):
            type_name = _renamed(one.msgtype)
            yield BagMessage(
                one.topic, type_name, stamp_ns, bytes(self._store.ros1_to_cdr(data, type_name))
            )

    def attachments(self) -> list[Attachment]:
        """A bag of ROS 1 has none."""
        return []

    def close(self) -> None:
        """Close the file; twice is no error."""
        if self.is_open:
            self._reader.close()


def _renamed(type_name: str) -> str:
    return RENAMED.get(type_name, type_name)
