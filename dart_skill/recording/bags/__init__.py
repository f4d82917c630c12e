"""Bags of rosbag2 and their message types: read, written, checked, recovered and played.

What is done with whole bags is imported only then, so that each command of `dart-skill bag` starts
as fast as it can.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.recording.bags.check import Finding, check_bag, check_file, glance
    from dart_skill.recording.bags.columns import Columns, columns_by_layout
    from dart_skill.recording.bags.description import describe
    from dart_skill.recording.bags.messages import (
        definition,
        deserialize,
        encoded,
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
    from dart_skill.recording.bags.playback import (
        CLOCK_TOPIC,
        CLOCK_TYPE,
        Due,
        Pace,
        Playback,
        Selection,
        clock_message,
    )
    from dart_skill.recording.bags.reader import (
        BagError,
        BagMessage,
        BagReader,
        GraphBag,
        TopicInfo,
    )
    from dart_skill.recording.bags.recovery import Recovery, recover
    from dart_skill.recording.bags.writer import BagWriteError, BagWriter, qos_yaml
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "check": "Finding check_bag check_file glance",
            "columns": "Columns columns_by_layout",
            "description": "describe",
            "messages": (
                "definition deserialize encoded header_content interface_folder is_stamped message"
                " pose_content serialize stamp_content type_hash types_for typestore"
                " vector_content"
            ),
            "playback": "CLOCK_TOPIC CLOCK_TYPE Due Pace Playback Selection clock_message",
            "reader": "BagError BagMessage BagReader GraphBag TopicInfo",
            "recovery": "Recovery recover",
            "writer": "BagWriteError BagWriter qos_yaml",
        },
    )

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
    "Columns",
    "columns_by_layout",
    "definition",
    "describe",
    "glance",
    "deserialize",
    "encoded",
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
