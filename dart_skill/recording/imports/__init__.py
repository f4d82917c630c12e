"""Recordings of other laboratories: what their topics, files, axes and units mean, and what is wrong with their poses."""

from dart_skill.recording.imports.mapping import (
    MappingError,
    PoseSource,
    RecordingMapping,
    SignalSource,
    Table,
    load_mapping,
    parse_mapping,
)
from dart_skill.recording.imports.pose_faults import Fault, fault_lines, repair
from dart_skill.recording.imports.pose_stream import PoseStream, RigidTransform
from dart_skill.recording.imports.throw_recording import JointStream, ThrowRecording, convert, read_recording

__all__ = [
    "Fault",
    "JointStream",
    "MappingError",
    "PoseSource",
    "PoseStream",
    "RecordingMapping",
    "RigidTransform",
    "SignalSource",
    "Table",
    "ThrowRecording",
    "convert",
    "fault_lines",
    "load_mapping",
    "parse_mapping",
    "read_recording",
    "repair",
]
