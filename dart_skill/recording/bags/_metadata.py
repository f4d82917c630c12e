"""What rosbag2 tells about a bag: the content of metadata.yaml and of the records in its files.
Written is version 9 (ROS 2 Jazzy).

All of it is optional where a bag is read: files tell by themselves which messages are in them.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from dart_skill.common.files import open_file
from dart_skill.recording.bags._files import sync_folder

if TYPE_CHECKING:
    from dart_skill.recording.mcap import McapFile

METADATA_VERSION = 9
METADATA_FILE = "metadata.yaml"
RECORD_NAME, RECORD_KEY = "rosbag2", "serialized_metadata"
_ROOT = "rosbag2_bagfile_information"
_DDS = re.compile(r"(\w+)::(msg|srv|action)::(?:dds_::)?(\w+?)_?")


@dataclass(frozen=True)
class TopicMetadata:
    """A topic of a bag.

    Parameters
    ----------
    name
        Of the topic.
    type_name
        As package/msg/Name.
    qos
        List of profiles as rosbag2 writes them.
    type_hash
        Of the message type, by REP 2011 (RIHS01).
    count
        Messages.
    encoding
        Of the messages.
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

    Parameters
    ----------
    name
        In the folder of the bag.
    count
        Messages.
    start_ns, end_ns
        Log times of its first and last message [ns]; None without messages.
    """

    name: str
    count: int
    start_ns: int | None
    end_ns: int | None

    @classmethod
    def of(cls, file: McapFile) -> FileMetadata:
        """Metadata of a file that is being written, as far as it is."""
        return cls(file.path.name, file.message_count, file.start_ns, file.end_ns)


def full_name(type_name: str) -> str:
    """A message type as package/msg/Name, which is also written in two parts, or as DDS does
    (package::msg::dds_::Name_).
    """
    if match := _DDS.fullmatch(type_name):
        return "/".join(match.groups())
    package, slash, name = type_name.partition("/")
    return f"{package}/msg/{name}" if slash and package and name and "/" not in name else type_name


def bag_metadata(
    files: list[FileMetadata],
    topics: Iterable[TopicMetadata],
    custom_data: Mapping[str, str],
    ros_distro: str,
) -> dict:
    """Metadata of a bag as rosbag2 nests them."""
    starts = [file.start_ns for file in files if file.start_ns is not None]
    ends = [file.end_ns for file in files if file.end_ns is not None]
    whole = FileMetadata(
        "", sum(file.count for file in files), min(starts, default=None), max(ends, default=None)
    )
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
    """Values of the Metadata record (named `RECORD_NAME`) with which a lone file tells its
    metadata.
    """
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


def read_metadata_file(folder: Path, faults: list[str] | None = None) -> dict:
    """Metadata of a bag folder, as far as each of them is of the kind that rosbag2 writes (any
    version); the others are left out.

    Parameters
    ----------
    faults
        What was left out is added, a text each.

    Raises
    ------
    ValueError
        If its metadata.yaml says nothing at all, FileNotFoundError without one.
    """
    with open_file(folder / METADATA_FILE) as stream:
        text = _decoded(stream.read(4 * LARGEST_TEXT + 1))
    content = load(text, METADATA_FILE)
    found = content.get(_ROOT) if isinstance(content, dict) else None
    if not isinstance(found, dict):
        raise ValueError(f"{METADATA_FILE} has no mapping '{_ROOT}'")
    return _cleaned(found, [] if faults is None else faults)


def known_metadata(folder: Path) -> dict:
    """The same; empty where there is none, or none that can be read: nothing in it is needed to
    read messages.
    """
    try:
        return read_metadata_file(folder)
    except (OSError, ValueError):
        return {}


def extent_of(told: Mapping[str, Any]) -> tuple[int, int, int] | None:
    """Number of messages, first and last log time [ns], of a bag or of an item of `files`; None if
    it does not tell all of them.
    """
    start, duration = told.get("starting_time"), told.get("duration")
    if not isinstance(start, dict) or not isinstance(duration, dict):
        return None
    count, first, length = (
        told.get("message_count"),
        start.get("nanoseconds_since_epoch"),
        duration.get("nanoseconds"),
    )
    if not (isinstance(count, int) and isinstance(first, int) and isinstance(length, int)):
        return None
    return count, first, first + length


def topics_of(metadata: Mapping[str, Any]) -> dict[str, dict]:
    """What the metadata say of each topic (name, type, offered_qos_profiles ...), and its
    message_count, by its name.
    """
    items = metadata.get("topics_with_message_count") or []
    return {
        item["topic_metadata"]["name"]: {
            **item["topic_metadata"],
            "message_count": item.get("message_count"),
        }
        for item in items
    }


def lost_in(custom_data: Mapping[str, str]) -> dict[str, int] | None:
    """Messages that the recorder lost, by topic; None if it does not say."""
    try:
        lost = json.loads(custom_data.get("lost", ""))
    except ValueError:
        return None
    return lost if isinstance(lost, dict) else None


def _decoded(data: bytes) -> str:
    """Text of a file, in UTF-8 or as editors of Windows write it."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    return data.decode("utf-8-sig", errors="replace")


def _cleaned(found: dict, faults: list[str]) -> dict:
    """Metadata without the entries that are of another kind than rosbag2 writes, of which `faults`
    gets a text each.
    """
    metadata = dict(found)
    for name, (wanted, clean) in _KINDS.items():
        value = metadata.get(name)
        if value is None:
            metadata.pop(name, None)
            continue
        kept = clean(value)
        if kept is None or (
            isinstance(kept, (list, dict))
            and isinstance(value, (list, dict))
            and len(kept) != len(value)
        ):
            faults.append(f"it misuses {name}: it must be {wanted}")
        metadata.pop(name)
        if kept is not None:
            metadata[name] = kept
    return metadata


def _texts(value: Any) -> list[str] | None:
    items = [value] if isinstance(value, str) else value
    return [item for item in items if isinstance(item, str)] if isinstance(items, list) else None


def _files(value: Any) -> list[dict] | None:
    return (
        [item for item in value if isinstance(item, dict) and isinstance(item.get("path"), str)]
        if isinstance(value, list)
        else None
    )


def _named_topics(value: Any) -> list[dict] | None:
    """Items with a dict topic_metadata, and in it a name; other texts in it that are none are left
    out.
    """
    if not isinstance(value, list):
        return None
    found = []
    for item in value:
        told = item.get("topic_metadata") if isinstance(item, dict) else None
        if isinstance(told, dict) and isinstance(told.get("name"), str):
            texts = {
                key: text
                for key, text in told.items()
                if isinstance(text, str) or key == "offered_qos_profiles"
            }
            count = item.get("message_count")
            found.append(
                {
                    "topic_metadata": texts,
                    **({"message_count": count} if type(count) is int else {}),
                }
            )
    return found


def _custom(value: Any) -> dict[str, str] | None:
    """Texts by name; yaml-cpp, which rosbag2 reads with, takes a number for its text."""
    if not isinstance(value, dict):
        return None
    return {
        str(key): str(text) for key, text in value.items() if isinstance(text, (str, int, float))
    }


def _only(kind: type) -> Callable[[Any], Any]:
    """What returns a value of this kind, and None in place of another one."""
    return lambda value: value if type(value) is kind else None


_KINDS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "version": ("a number", _only(int)),
    "relative_file_paths": ("a list of texts", _texts),
    "files": ("a list of mappings with a path", _files),
    "topics_with_message_count": (
        "a list of topics, each with topic_metadata and in it a name",
        _named_topics,
    ),
    "custom_data": ("a mapping of texts", _custom),
    "message_count": ("a number", _only(int)),
    "duration": ("a mapping", _only(dict)),
    "starting_time": ("a mapping", _only(dict)),
    **{
        name: ("a text", _only(str))
        for name in ("storage_identifier", "compression_format", "compression_mode", "ros_distro")
    },
}
"""What an entry must be, and what makes it so or says None."""


def parse_record(values: Mapping[str, str]) -> dict:
    """Metadata in the record of a file; empty if they cannot be read."""
    try:
        found = load(values.get(RECORD_KEY, ""), f"the record {RECORD_NAME}")
    except ValueError:
        return {}
    return _cleaned(found, []) if isinstance(found, dict) else {}


def parse_qos(topic: str, text: str) -> list:
    """QoS profiles of a topic from their YAML text."""
    return load(text, f"QoS of topic {topic}") or []


def profiles(topic: str, told: Any) -> tuple[Qos, ...]:
    """QoS profiles of a topic as `rosbags` has them, from a list of them or its YAML text; none of
    what cannot be read.

    What a profile does not say is as ROS 2 has it without being told; an unknown policy
    is UNKNOWN.
    """
    try:
        found = parse_qos(topic, told) if isinstance(told, str) else told
    except ValueError:
        return ()
    found = [found] if isinstance(found, dict) else found
    return (
        tuple(_profile(one) for one in found if isinstance(one, dict))
        if isinstance(found, list)
        else ()
    )


def _profile(told: dict) -> Qos:
    depth = told.get("depth")
    return Qos(
        _policy(QosHistory, told.get("history", "keep_last")),
        depth if type(depth) is int else 0,
        _policy(QosReliability, told.get("reliability", "reliable")),
        _policy(QosDurability, told.get("durability", "volatile")),
        _period(told.get("deadline")),
        _period(told.get("lifespan")),
        _policy(QosLiveliness, told.get("liveliness", "automatic")),
        _period(told.get("liveliness_lease_duration")),
        bool(told.get("avoid_ros_namespace_conventions")),
    )


def _period(told: Any) -> QosTime:
    """A period [s, ns]; 0 is ROS 2's for none."""
    told = told if isinstance(told, dict) else {}
    sec, nsec = (
        value if type(value) is int else 0 for value in (told.get("sec"), told.get("nsec"))
    )
    return QosTime(sec, nsec)


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
    """yaml-cpp, which rosbag2 reads with, knows anchors, but people who read the file do not
    expect them.
    """

    def ignore_aliases(self, data: Any) -> bool:
        return True


def dump(content: Any) -> str:
    """YAML text."""
    return yaml.dump(content, Dumper=_NoAliases, sort_keys=False)


LARGEST_TEXT = 2_000_000
"""Size of the metadata of a bag of ten thousand files [characters]."""
DEEPEST, MOST_NODES = 30, 200_000
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def load(text: str, what: str) -> Any:
    """What a YAML text says.

    Raises
    ------
    ValueError
        With `what` it is, for one that is no YAML, or that asks for too much.
    """
    check(text, what)
    try:
        return yaml.load(text, Loader=_LOADER)
    # the second: numbers and dates that are none
    except (
        yaml.YAMLError,
        ValueError,
        RecursionError,
    ) as error:
        raise ValueError(f"{what} is no YAML: {error}") from error


def check(text: str, what: str) -> None:
    """ValueError for a text that `load` refuses without building anything of it."""
    if len(text) > LARGEST_TEXT:
        raise ValueError(
            f"{what} has {len(text)} characters, more than the {LARGEST_TEXT} of any bag"
        )
    count, too_deep = _Count(), f"{what} is nested deeper than {DEEPEST} levels"
    try:
        for event in yaml.parse(text, Loader=_LOADER):
            count.take(event)
            if len(count.open) > DEEPEST:
                raise ValueError(too_deep)
            if count.total > MOST_NODES:
                raise ValueError(
                    f"{what} has more than {MOST_NODES} entries once its aliases are followed"
                )
    except yaml.YAMLError as error:
        # PyYAML 6.0.4 looks far enough ahead of its events to meet a limit of its own before ours
        raise ValueError(
            too_deep if "nesting depth" in str(error) else f"{what} is no YAML: {error}"
        ) from error


@dataclass
class _Count:
    """Nodes so far, each as often as aliases repeat it. open: anchor and number of nodes before
    each collection that has not ended.
    """

    total: int = 0
    open: list[tuple[str | None, int]] = field(default_factory=list)
    sizes: dict[str, int] = field(default_factory=dict)

    def take(self, event: yaml.Event) -> None:
        if isinstance(event, yaml.AliasEvent):
            # one that is within itself never ends
            self.total += self.sizes.get(event.anchor, MOST_NODES)
        elif isinstance(event, yaml.CollectionStartEvent):
            self.open.append((event.anchor, self.total))
            self.total += 1
        elif isinstance(event, yaml.ScalarEvent):
            self.total += 1
            self._name(event.anchor, 1)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = self.open.pop()
            self._name(anchor, self.total - before)

    def _name(self, anchor: str | None, size: int) -> None:
        if anchor is not None:
            self.sizes[anchor] = size
