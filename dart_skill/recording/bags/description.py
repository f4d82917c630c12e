"""What a bag says of itself, for programs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from dart_skill.recording.bags._metadata import METADATA_FILE, lost_in
from dart_skill.recording.bags.reader import BagFile, BagReader, TopicInfo

if TYPE_CHECKING:
    from rosbags.interfaces import Qos
    from rosbags.typesys.store import Typestore


def describe(
    path: str | os.PathLike, types: Typestore | None = None, with_definitions: bool = True
) -> dict:
    """What a bag holds, in numbers, texts, lists and dicts only (JSON). Raises BagError.

    Parameters
    ----------
    types
        Known message types.
    with_definitions
        Whether to parse those of the bag and tell of each topic if its type is defined
        (`is_defined`), which takes longer than all the rest.
    """
    with BagReader(path, types) as bag:
        duration_ns = bag.end_ns - bag.start_ns
        attachments = bag.attachments()
        return {
            "path": str(path),
            "start_ns": bag.start_ns,
            "end_ns": bag.end_ns,
            "duration_ns": duration_ns,
            "message_count": bag.message_count,
            "storage": bag.storage,
            "compression": ", ".join(sorted({file.compression for file in bag.files} - {""})),
            "size_bytes": sum(file.size for file in bag.files),
            "has_metadata_file": (Path(path) / METADATA_FILE).is_file(),
            "ros_distro": bag.metadata.get("ros_distro") or "",
            "files": [_file(file) for file in bag.files],
            "topics": [
                _topic(topic, duration_ns, bag.types if with_definitions else None)
                for topic in bag.topics.values()
            ],
            "attachments": [
                {"name": one.name, "media_type": one.media_type, "size_bytes": len(one.data)}
                for one in attachments
            ],
            "lost": lost_in(bag.custom_data),
            "custom_data": bag.custom_data,
        }


def _file(file: BagFile) -> dict:
    return {
        "path": file.path.name,
        "size_bytes": file.size,
        "message_count": file.count,
        "start_ns": file.start_ns,
        "duration_ns": None
        if file.start_ns is None or file.end_ns is None
        else file.end_ns - file.start_ns,
        "library": file.library,
    }


def _topic(topic: TopicInfo, duration_ns: int, types: Typestore | None) -> dict:
    return {
        "name": topic.name,
        "type": topic.type_name,
        "other_types": list(topic.other_types),
        "count": topic.count,
        "rate_hz": topic.count / duration_ns * 1e9 if duration_ns else 0.0,
        "encoding": topic.encoding,
        "type_hash": topic.type_hash,
        **({} if types is None else {"is_defined": topic.type_name in types.fielddefs}),
        "qos": [_qos(profile) for profile in topic.qos],
    }


def _qos(profile: Qos) -> dict:
    return {
        name: value.name.lower()
        if hasattr(value, "name")
        else {"sec": value.sec, "nsec": value.nsec}
        if hasattr(value, "sec")
        else value
        for name, value in profile._asdict().items()
    }
