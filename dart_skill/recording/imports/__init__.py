"""Recordings of other laboratories: what their topics, files, axes and units mean, what is wrong
with their poses; ours as CSV files.
"""

from dart_skill.recording.imports._csv_folder import MAPPING, bodies_to_csv, throws_to_csv
from dart_skill.recording.imports.bag_topics import (
    BODY_TYPES,
    POSE_TYPES,
    bag_faults,
    filled_topics,
)
from dart_skill.recording.imports.clocks import MOST_STEPS, steps_at, without_running_back
from dart_skill.recording.imports.faults import BACKWARDS, BAG, Fault, fault_lines, in_words
from dart_skill.recording.imports.joint_streams import JointStream
from dart_skill.recording.imports.mapping import (
    ANGLE_UNITS,
    LENGTH_UNITS,
    OWN,
    QUATERNION_ORDERS,
    CaptureFile,
    Clock,
    MappingError,
    PoseSource,
    RecordingMapping,
    SignalSource,
    Table,
    clocks_of,
    flow_text,
    load_mapping,
    mapping_text,
    mended_joints,
    mended_pose,
    parse_mapping,
    with_remedies,
)
from dart_skill.recording.imports.pose_faults import repair
from dart_skill.recording.imports.pose_stream import (
    AS_OURS,
    UP_AXES,
    Axes,
    PoseStream,
    RigidTransform,
    axes_matrix,
    find_leaps,
    nearest_axes,
)
from dart_skill.recording.imports.throw_recording import (
    ThrowRecording,
    convert,
    read_in_parts,
    read_recording,
)

__all__ = [
    "CaptureFile",
    "ANGLE_UNITS",
    "AS_OURS",
    "BACKWARDS",
    "BAG",
    "BODY_TYPES",
    "Axes",
    "Clock",
    "LENGTH_UNITS",
    "OWN",
    "POSE_TYPES",
    "QUATERNION_ORDERS",
    "UP_AXES",
    "axes_matrix",
    "nearest_axes",
    "Fault",
    "MAPPING",
    "MOST_STEPS",
    "JointStream",
    "MappingError",
    "PoseSource",
    "PoseStream",
    "RecordingMapping",
    "RigidTransform",
    "SignalSource",
    "Table",
    "ThrowRecording",
    "bag_faults",
    "bodies_to_csv",
    "clocks_of",
    "convert",
    "fault_lines",
    "filled_topics",
    "in_words",
    "find_leaps",
    "flow_text",
    "load_mapping",
    "mapping_text",
    "mended_joints",
    "mended_pose",
    "parse_mapping",
    "read_in_parts",
    "read_recording",
    "repair",
    "steps_at",
    "throws_to_csv",
    "with_remedies",
    "without_running_back",
]
