"""Bags of rosbag2: read, written, checked, recovered and played, with their message types."""

from dart_skill.recording.bags._file_check import Finding
from dart_skill.recording.bags.check import check_bag, check_file
from dart_skill.recording.bags.description import describe
from dart_skill.recording.bags.messages import (
    definition,
    deserialize,
    header_content,
    interface_folder,
    is_stamped,
    message,
    pose_content,
    serialize,
    stamp_content,
    type_hash,
    types_for,
    typestore,
    vector_content,
)
from dart_skill.recording.bags.playback import CLOCK_TOPIC, CLOCK_TYPE, Due, Pace, Playback, Selection, clock_message
from dart_skill.recording.bags.reader import BagError, BagMessage, BagReader, TopicInfo
from dart_skill.recording.bags.recovery import recover
from dart_skill.recording.bags.writer import BagWriteError, BagWriter, qos_yaml

__all__ = [
    "CLOCK_TOPIC",
    "CLOCK_TYPE",
    "BagError",
    "BagMessage",
    "BagReader",
    "BagWriteError",
    "BagWriter",
    "Due",
    "Finding",
    "Pace",
    "Playback",
    "Selection",
    "TopicInfo",
    "check_bag",
    "check_file",
    "clock_message",
    "definition",
    "describe",
    "deserialize",
    "header_content",
    "interface_folder",
    "is_stamped",
    "message",
    "pose_content",
    "qos_yaml",
    "recover",
    "serialize",
    "stamp_content",
    "type_hash",
    "types_for",
    "typestore",
    "vector_content",
]
