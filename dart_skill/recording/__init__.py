"""Bags without ROS: MCAP in and out, message types, demonstrations."""

from dart_skill.recording.bag_reader import BagAttachment, BagError, BagMessage, BagReader, TopicInfo
from dart_skill.recording.bag_writer import BagWriter, qos_yaml
from dart_skill.recording.demonstration import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    Demonstration,
    demonstration_from_message,
    demonstration_message,
    fill_demonstration_message,
    read_demonstrations,
)
from dart_skill.recording.messages import (
    definition,
    deserialize,
    interface_folder,
    message,
    serialize,
    type_hash,
    typestore,
)

__all__ = [
    "DEMONSTRATION_TOPIC",
    "DEMONSTRATION_TYPE",
    "BagAttachment",
    "BagError",
    "BagMessage",
    "BagReader",
    "BagWriter",
    "Demonstration",
    "TopicInfo",
    "definition",
    "demonstration_from_message",
    "demonstration_message",
    "deserialize",
    "fill_demonstration_message",
    "interface_folder",
    "message",
    "qos_yaml",
    "read_demonstrations",
    "serialize",
    "type_hash",
    "typestore",
]
