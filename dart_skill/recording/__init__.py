"""Bags without ROS: MCAP in and out, message types, demonstrations. What is used of it is imported only then."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
        is_stamped,
        message,
        serialize,
        type_hash,
        types_for,
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
    "is_stamped",
    "message",
    "qos_yaml",
    "read_demonstrations",
    "serialize",
    "type_hash",
    "types_for",
    "typestore",
]

_MODULES = ("bag_reader", "bag_writer", "demonstration", "messages")


def __getattr__(name: str) -> Any:
    """Every name of `__all__` from the module that has it (PEP 562): the command line and its help need none of them."""
    if name in __all__:
        for module in _MODULES:
            found = import_module(f"{__name__}.{module}")
            if hasattr(found, name):
                globals()[name] = getattr(found, name)
                return globals()[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
