"""Recordings without ROS: bags in and out, message types, demonstrations.

`bags` has modules that check, recover and play bags, `imports` reads what other laboratories
recorded, `mcap` is the container.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use

if TYPE_CHECKING:
    from dart_skill.recording.bags import (
        BagError,
        BagReader,
        BagWriter,
        GraphBag,
        TopicInfo,
        definition,
        deserialize,
        encoded,
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
        HAND,
        SKILL,
        UNSEEN,
        WORDS,
        Demonstration,
        Event,
        Track,
        arm_rows,
        demonstration_from_message,
        demonstration_message,
        duration_content,
        each_demonstration,
        fill_demonstration_message,
        filled,
        grip_of,
        named,
        pose_rows,
        read_demonstrations,
        situation_content,
        situation_from_message,
        skill_of,
        stamp_ns,
        times_after,
    )
    from dart_skill.recording.grip_signal import GripSignal, Opening, read_command
    from dart_skill.recording.joint_state import JointLayout, joint_layout
    from dart_skill.recording.log_time import LogTime
    from dart_skill.recording.marks import (
        AS_ASKED,
        DROPPED,
        MARK_TOPIC,
        MARK_TYPE,
        Marks,
        check_known,
        demonstration_id,
        read_dropped,
        unwanted,
    )
else:
    __getattr__, __dir__ = on_first_use(
        __name__,
        {
            "bags": (
                "BagError BagReader BagWriter GraphBag TopicInfo definition deserialize encoded"
                " is_stamped message qos_yaml serialize type_hash types_for typestore"
            ),
            "demonstration": (
                "DEMONSTRATION_TOPIC DEMONSTRATION_TYPE HAND SKILL UNSEEN WORDS Demonstration"
                " Event Track arm_rows"
                " demonstration_from_message demonstration_message duration_content"
                " each_demonstration fill_demonstration_message filled grip_of named pose_rows"
                " read_demonstrations situation_content situation_from_message skill_of stamp_ns"
                " times_after"
            ),
            "grip_signal": "GripSignal Opening read_command",
            "joint_state": "JointLayout joint_layout",
            "log_time": "LogTime",
            "marks": (
                "AS_ASKED DROPPED MARK_TOPIC MARK_TYPE Marks check_known demonstration_id"
                " read_dropped unwanted"
            ),
        },
    )

__all__ = [
    "AS_ASKED",
    "DEMONSTRATION_TOPIC",
    "DEMONSTRATION_TYPE",
    "DROPPED",
    "HAND",
    "SKILL",
    "UNSEEN",
    "WORDS",
    "BagError",
    "BagReader",
    "BagWriter",
    "Demonstration",
    "Event",
    "GripSignal",
    "GraphBag",
    "JointLayout",
    "LogTime",
    "MARK_TOPIC",
    "MARK_TYPE",
    "Marks",
    "Opening",
    "TopicInfo",
    "Track",
    "arm_rows",
    "check_known",
    "definition",
    "demonstration_from_message",
    "demonstration_id",
    "demonstration_message",
    "deserialize",
    "encoded",
    "duration_content",
    "each_demonstration",
    "fill_demonstration_message",
    "filled",
    "grip_of",
    "is_stamped",
    "joint_layout",
    "message",
    "named",
    "pose_rows",
    "qos_yaml",
    "read_command",
    "read_demonstrations",
    "read_dropped",
    "serialize",
    "situation_content",
    "situation_from_message",
    "skill_of",
    "stamp_ns",
    "times_after",
    "type_hash",
    "types_for",
    "typestore",
    "unwanted",
]
