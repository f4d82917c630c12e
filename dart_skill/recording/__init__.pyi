from dart_skill.recording.bags import BagError as BagError
from dart_skill.recording.bags import BagReader as BagReader
from dart_skill.recording.bags import BagWriter as BagWriter
from dart_skill.recording.bags import GraphBag as GraphBag
from dart_skill.recording.bags import TopicInfo as TopicInfo
from dart_skill.recording.bags import definition as definition
from dart_skill.recording.bags import deserialize as deserialize
from dart_skill.recording.bags import encoded as encoded
from dart_skill.recording.bags import example_bag as example_bag
from dart_skill.recording.bags import is_stamped as is_stamped
from dart_skill.recording.bags import message as message
from dart_skill.recording.bags import qos_yaml as qos_yaml
from dart_skill.recording.bags import serialize as serialize
from dart_skill.recording.bags import type_hash as type_hash
from dart_skill.recording.bags import types_for as types_for
from dart_skill.recording.bags import typestore as typestore
from dart_skill.recording.demonstration import DEMONSTRATION_TOPIC as DEMONSTRATION_TOPIC
from dart_skill.recording.demonstration import DEMONSTRATION_TYPE as DEMONSTRATION_TYPE
from dart_skill.recording.demonstration import HAND as HAND
from dart_skill.recording.demonstration import SKILL as SKILL
from dart_skill.recording.demonstration import UNSEEN as UNSEEN
from dart_skill.recording.demonstration import WORDS as WORDS
from dart_skill.recording.demonstration import Demonstration as Demonstration
from dart_skill.recording.demonstration import Event as Event
from dart_skill.recording.demonstration import Track as Track
from dart_skill.recording.demonstration import arm_rows as arm_rows
from dart_skill.recording.demonstration import (
    demonstration_from_message as demonstration_from_message,
)
from dart_skill.recording.demonstration import demonstration_message as demonstration_message
from dart_skill.recording.demonstration import duration_content as duration_content
from dart_skill.recording.demonstration import each_demonstration as each_demonstration
from dart_skill.recording.demonstration import (
    fill_demonstration_message as fill_demonstration_message,
)
from dart_skill.recording.demonstration import filled as filled
from dart_skill.recording.demonstration import grip_of as grip_of
from dart_skill.recording.demonstration import named as named
from dart_skill.recording.demonstration import pose_rows as pose_rows
from dart_skill.recording.demonstration import read_demonstrations as read_demonstrations
from dart_skill.recording.demonstration import situation_content as situation_content
from dart_skill.recording.demonstration import situation_from_message as situation_from_message
from dart_skill.recording.demonstration import skill_of as skill_of
from dart_skill.recording.demonstration import stamp_ns as stamp_ns
from dart_skill.recording.demonstration import times_after as times_after
from dart_skill.recording.marks import AS_ASKED as AS_ASKED
from dart_skill.recording.marks import DROPPED as DROPPED
from dart_skill.recording.marks import MARK_TOPIC as MARK_TOPIC
from dart_skill.recording.marks import MARK_TYPE as MARK_TYPE
from dart_skill.recording.marks import Marks as Marks
from dart_skill.recording.marks import demonstration_id as demonstration_id
from dart_skill.recording.marks import ids_named as ids_named
from dart_skill.recording.marks import read_dropped as read_dropped
from dart_skill.recording.marks import unwanted as unwanted
from dart_skill.recording.signals import GripSignal as GripSignal
from dart_skill.recording.signals import JointLayout as JointLayout
from dart_skill.recording.signals import LogTime as LogTime
from dart_skill.recording.signals import Opening as Opening
from dart_skill.recording.signals import joint_layout as joint_layout
from dart_skill.recording.signals import read_command as read_command
