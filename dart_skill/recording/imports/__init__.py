"""Recordings of other laboratories: what their topics, files, axes and units mean, what is wrong with their poses; ours as CSV files."""

from dart_skill.recording.imports._csv_folder import MAPPING, bodies_to_csv, throws_to_csv
from dart_skill.recording.imports.mapping import (
    CaptureFile,
    MappingError,
    PoseSource,
    RecordingMapping,
    SignalSource,
    Table,
    flow_text,
    load_mapping,
    mapping_text,
    mended_joints,
    mended_pose,
    parse_mapping,
)
from dart_skill.recording.imports.pose_faults import Fault, fault_lines, repair
from dart_skill.recording.imports.pose_stream import PoseStream, RigidTransform
from dart_skill.recording.imports.throw_recording import JointStream, ThrowRecording, convert, read_in_parts, read_recording

__all__ = [
    "CaptureFile",
    "Fault",
    "MAPPING",
    "JointStream",
    "MappingError",
    "PoseSource",
    "PoseStream",
    "RecordingMapping",
    "RigidTransform",
    "SignalSource",
    "Table",
    "ThrowRecording",
    "bodies_to_csv",
    "convert",
    "fault_lines",
    "flow_text",
    "load_mapping",
    "mapping_text",
    "mended_joints",
    "mended_pose",
    "parse_mapping",
    "read_in_parts",
    "read_recording",
    "repair",
    "throws_to_csv",
]
