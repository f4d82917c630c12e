"""Recordings without ROS: bags in and out, message types, demonstrations, recordings of other laboratories.

`bags` has all that concerns bags of rosbag2, `imports` reads what others recorded, `mcap` is the container that bags are kept in.
A name is imported when somebody asks for it: the command line and its help need none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for editors
    from dart_skill.recording.bags import (  # noqa: F401
        BagAttachment,
        BagError,
        BagMessage,
        BagReader,
        BagWriter,
        TopicInfo,
        definition,
        deserialize,
        interface_folder,
        is_stamped,
        message,
        qos_yaml,
        serialize,
        type_hash,
        types_for,
        typestore,
    )
    from dart_skill.recording.demonstration import (  # noqa: F401
        DEMONSTRATION_TOPIC,
        DEMONSTRATION_TYPE,
        Demonstration,
        demonstration_from_message,
        demonstration_message,
        fill_demonstration_message,
        read_demonstrations,
    )
    from dart_skill.recording.grip_signal import GripSignal, Opening, read_command  # noqa: F401

_MODULES = {
    "bags": "BagAttachment BagError BagMessage BagReader BagWriter TopicInfo definition deserialize interface_folder is_stamped message"
    " qos_yaml serialize type_hash types_for typestore",
    "demonstration": "DEMONSTRATION_TOPIC DEMONSTRATION_TYPE Demonstration demonstration_from_message demonstration_message"
    " fill_demonstration_message read_demonstrations",
    "grip_signal": "GripSignal Opening read_command",
}
_HOME = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = [*_HOME]


def __getattr__(name: str) -> Any:
    """A name of `__all__` from the module that has it (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    globals()[name] = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    return globals()[name]
