"""Bags of rosbag2 and their message types: read, written, checked, recovered and played.

What is done with whole bags is imported only then, so that each command of `dart-skill bag` starts as fast as it can.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

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
from dart_skill.recording.bags.reader import BagError, BagMessage, BagReader, GraphBag, TopicInfo
from dart_skill.recording.bags.writer import BagWriteError, BagWriter, qos_yaml

if TYPE_CHECKING:
    from dart_skill.recording.bags.check import Finding, check_bag, check_file
    from dart_skill.recording.bags.description import describe
    from dart_skill.recording.bags.playback import CLOCK_TOPIC, CLOCK_TYPE, Due, Pace, Playback, Selection, clock_message
    from dart_skill.recording.bags.recovery import Recovery, recover

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
    "GraphBag",
    "Pace",
    "Playback",
    "Recovery",
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

_HOME = {
    **dict.fromkeys(("Finding", "check_bag", "check_file"), "check"),
    "describe": "description",
    **dict.fromkeys(("CLOCK_TOPIC", "CLOCK_TYPE", "Due", "Pace", "Playback", "Selection", "clock_message"), "playback"),
    **dict.fromkeys(("Recovery", "recover"), "recovery"),
}


def __getattr__(name: str) -> Any:
    """A name of `__all__` from the module that has it (PEP 562)."""
    if name in _HOME:
        globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
        return globals()[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
