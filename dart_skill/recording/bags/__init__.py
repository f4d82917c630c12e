"""Bags of rosbag2 and their message types, read and written.

What is done with whole bags stands in modules that are imported only for it: `check`, `description`, `recovery`, `playback`.
"""

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
from dart_skill.recording.bags.reader import BagError, BagMessage, BagReader, TopicInfo
from dart_skill.recording.bags.writer import BagWriteError, BagWriter, qos_yaml

__all__ = [
    "BagError",
    "BagMessage",
    "BagReader",
    "BagWriteError",
    "BagWriter",
    "TopicInfo",
    "definition",
    "deserialize",
    "header_content",
    "interface_folder",
    "is_stamped",
    "message",
    "pose_content",
    "qos_yaml",
    "serialize",
    "stamp_content",
    "type_hash",
    "types_for",
    "typestore",
    "vector_content",
]
