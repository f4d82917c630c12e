"""What rosbag2 tells about a bag (metadata version 9, ROS 2 Jazzy): the content of metadata.yaml and of the records in its files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from dart_skill.files import open_file
from dart_skill.recording.bags._disk_sync import sync_folder
from dart_skill.recording.bags._yaml_text import LARGEST_TEXT, load

if TYPE_CHECKING:
    from dart_skill.recording.mcap import McapFile

METADATA_VERSION = 9
METADATA_FILE = "metadata.yaml"
RECORD_NAME, RECORD_KEY = "rosbag2", "serialized_metadata"
_ROOT = "rosbag2_bagfile_information"


@dataclass(frozen=True)
class TopicMetadata:
    """A topic of a bag.

    * name: of the topic.
    * type_name: as package/msg/Name.
    * qos: list of profiles as rosbag2 writes them.
    * type_hash: of the message type, by REP 2011 (RIHS01).
    * count: messages.
    * encoding: of the messages.
    """

    name: str
    type_name: str
    qos: list
    type_hash: str
    count: int
    encoding: str = "cdr"


@dataclass(frozen=True)
class FileMetadata:
    """A file of a bag.

    * name: in the folder of the bag.
    * count: messages.
    * start_ns, end_ns: log times of its first and last message [ns]; None without messages.
    """

    name: str
    count: int
    start_ns: int | None
    end_ns: int | None

    @classmethod
    def of(cls, file: McapFile) -> FileMetadata:
        """Of a file that is being written, as far as it is."""
        return cls(file.path.name, file.message_count, file.start_ns, file.end_ns)


def bag_metadata(files: list[FileMetadata], topics: Iterable[TopicMetadata], custom_data: Mapping[str, str], ros_distro: str) -> dict:
    """Metadata of a bag as rosbag2 nests them."""
    starts = [file.start_ns for file in files if file.start_ns is not None]
    ends = [file.end_ns for file in files if file.end_ns is not None]
    whole = FileMetadata("", sum(file.count for file in files), min(starts, default=None), max(ends, default=None))
    return {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        **_times(whole),
        "topics_with_message_count": [_topic(topic) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [{"path": file.name, **_times(file)} for file in files],
        "custom_data": dict(custom_data) or None,
        "ros_distro": ros_distro,
    }


def record_values(metadata: dict) -> dict[str, str]:
    """Values of the Metadata record (named `RECORD_NAME`) with which a lone file tells its metadata."""
    return {RECORD_KEY: dump(metadata)}


def write_metadata_file(folder: Path, metadata: dict) -> None:
    """Write metadata.yaml whole, and onto the disk, or not at all (OSError)."""
    temporary = folder / (METADATA_FILE + ".tmp")
    try:
        with open(temporary, "w", encoding="utf-8") as stream:
            stream.write(dump({_ROOT: metadata}))
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(folder / METADATA_FILE)
    except OSError:
        with suppress(OSError):
            temporary.unlink()
        raise
    sync_folder(folder)


def read_metadata_file(folder: Path) -> dict:
    """Metadata of a bag folder; ValueError if its metadata.yaml is damaged, FileNotFoundError without one."""
    with open_file(folder / METADATA_FILE) as stream:
        text = stream.read(4 * LARGEST_TEXT + 1).decode("utf-8")
    content = load(text, METADATA_FILE)
    found = content.get(_ROOT) if isinstance(content, dict) else None
    if not isinstance(found, dict):
        raise ValueError(f"{METADATA_FILE} has no mapping '{_ROOT}'")
    _check_kinds(found)
    return found


_KINDS: dict[str, tuple[type, type]] = {
    "relative_file_paths": (list, str),
    "files": (list, dict),
    "topics_with_message_count": (list, dict),
    "custom_data": (dict, str),
}


def _check_kinds(metadata: dict) -> None:
    """ValueError for an entry of metadata that is of another kind than rosbag2 writes."""
    for name, (outer, inner) in _KINDS.items():
        value: Any = metadata.get(name)
        items = value.values() if isinstance(value, dict) else value
        if value is not None and not (isinstance(value, outer) and all(isinstance(item, inner) for item in items)):
            raise ValueError(f"its {METADATA_FILE} misuses {name}: it must be a {outer.__name__} of {inner.__name__}")
    for name in ("storage_identifier", "compression_format", "compression_mode", "ros_distro"):
        if not isinstance(metadata.get(name) or "", str):
            raise ValueError(f"its {METADATA_FILE} misuses {name}: it must be a text")
    for topic in metadata.get("topics_with_message_count") or []:
        if not isinstance(topic.get("topic_metadata"), dict) or not isinstance(topic["topic_metadata"].get("name"), str):
            raise ValueError(f"its {METADATA_FILE} misuses topics_with_message_count: a topic has no name")
        if not isinstance(topic.get("message_count", 0), int):
            raise ValueError(f"its {METADATA_FILE} misuses message_count: that of topic {topic['topic_metadata']['name']} is no number")


def is_plain_mcap(metadata: dict) -> bool:
    """Whether the files are MCAP as it stands, and not SQLite, nor compressed as a whole or message by message."""
    mode = str(metadata.get("compression_mode") or "none").lower()
    return metadata.get("storage_identifier", "mcap") == "mcap" and mode not in ("file", "message")


def parse_record(values: Mapping[str, str]) -> dict:
    """Metadata in the record of a file; empty if they cannot be read."""
    try:
        found = load(values.get(RECORD_KEY, ""), f"the record {RECORD_NAME}")
        if isinstance(found, dict):
            _check_kinds(found)
            return found
    except ValueError:
        pass
    return {}


def parse_qos(topic: str, text: str) -> list:
    """QoS profiles of a topic from their YAML text."""
    return load(text, f"QoS of topic {topic}") or []


def profiles(topic: str, told: list | str) -> tuple[Qos, ...]:
    """QoS profiles of a topic as `rosbags` has them, from a list of them or its YAML text; what it does not know is UNKNOWN."""
    return tuple(_profile(one) for one in (parse_qos(topic, told) if isinstance(told, str) else told))


def _profile(told: dict) -> Qos:
    return Qos(
        _policy(QosHistory, told.get("history")),
        told["depth"],
        _policy(QosReliability, told.get("reliability")),
        _policy(QosDurability, told.get("durability")),
        QosTime(told["deadline"]["sec"], told["deadline"]["nsec"]),
        QosTime(told["lifespan"]["sec"], told["lifespan"]["nsec"]),
        _policy(QosLiveliness, told.get("liveliness")),
        QosTime(told["liveliness_lease_duration"]["sec"], told["liveliness_lease_duration"]["nsec"]),
        told["avoid_ros_namespace_conventions"],
    )


def _policy(kind: Any, told: int | str | None) -> Any:
    """A policy by its number, or by its name in small letters."""
    try:
        return kind(told) if isinstance(told, int) else kind[str(told).upper()]
    except (KeyError, ValueError):
        return kind.UNKNOWN


def _times(file: FileMetadata) -> dict:
    start = file.start_ns or 0
    return {
        "duration": {"nanoseconds": (file.end_ns or 0) - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": file.count,
    }


def _topic(topic: TopicMetadata) -> dict:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type_name,
            "serialization_format": topic.encoding,
            "offered_qos_profiles": topic.qos,
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.count,
    }


_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class _NoAliases(_Dumper):
    """yaml-cpp, which rosbag2 reads with, knows anchors, but people who read the file do not expect them."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def dump(content: Any) -> str:
    """YAML text."""
    return yaml.dump(content, Dumper=_NoAliases, sort_keys=False)
