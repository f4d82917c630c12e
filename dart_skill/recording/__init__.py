"""Recordings without ROS: bags in and out, message types, demonstrations.

`bags` has modules that check, recover and play bags, `imports` reads what other laboratories recorded, `mcap` is the container.
"""

from dart_skill.recording.bags import (
    BagError,
    BagReader,
    BagWriter,
    TopicInfo,
    definition,
    deserialize,
    is_stamped,
    message,
    qos_yaml,
    serialize,
    type_hash,
    types_for,
    typestore,
)
from dart_skill.recording.demonstration import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    Demonstration,
    demonstration_from_message,
    demonstration_message,
    fill_demonstration_message,
    read_demonstrations,
    stamp_ns,
)
from dart_skill.recording.grip_signal import OLDER_COMMAND, GripSignal, Opening, completed_command, read_command
from dart_skill.recording.log_time import LogTime
from dart_skill.recording.marks import MARK_TOPIC, MARK_TYPE, Marks, check_known, demonstration_id, read_dropped

__all__ = [
    "DEMONSTRATION_TOPIC",
    "DEMONSTRATION_TYPE",
    "BagError",
    "BagReader",
    "BagWriter",
    "Demonstration",
    "GripSignal",
    "LogTime",
    "MARK_TOPIC",
    "MARK_TYPE",
    "Marks",
    "OLDER_COMMAND",
    "Opening",
    "TopicInfo",
    "check_known",
    "definition",
    "demonstration_from_message",
    "demonstration_id",
    "demonstration_message",
    "deserialize",
    "fill_demonstration_message",
    "is_stamped",
    "message",
    "qos_yaml",
    "completed_command",
    "read_command",
    "read_demonstrations",
    "read_dropped",
    "serialize",
    "stamp_ns",
    "type_hash",
    "types_for",
    "typestore",
]
