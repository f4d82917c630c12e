"""What rosbag2 tells about a bag: the content of metadata.yaml and of the records in its files.
Written is version 9 (ROS 2 Jazzy).

All of it is optional where a bag is read: files tell by themselves which messages are in them.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
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
from dart_skill.recording.bags.files import sync_folder

if TYPE_CHECKING:
    from mcap.records import Channel, Schema

    from dart_skill.recording.mcap import McapFile

METADATA_VERSION = 9
METADATA_FILE = "metadata.yaml"
RECORD_NAME = "rosbag2"
"""Name of the record in a file that tells its metadata."""
RECORD_KEY = "serialized_metadata"
"""Key of them in it."""
_ROOT = "rosbag2_bagfile_information"
_DDS = re.compile(r"(\w+)::(msg|srv|action)::(?:dds_::)?(\w+?)_?")


@dataclass
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
    count: int = 0
    encoding: str = "cdr"


def full_name(type_name: str) -> str:
    """A message type as package/msg/Name, which is also written in two parts, or as DDS does
    (package::msg::dds_::Name_).
    """
    if match := _DDS.fullmatch(type_name):
        return "/".join(match.groups())
    package, slash, name = type_name.partition("/")
    return f"{package}/msg/{name}" if slash and package and name and "/" not in name else type_name


def definition_of(schema: Schema) -> tuple[str, str, str]:
    """Full type name, encoding and text of a definition."""
    return full_name(schema.name), schema.encoding, schema.data.decode(errors="replace")


def message_encoding(channel: Channel) -> str:
    """How messages of a channel are encoded; one that does not say it has CDR."""
    encoding = channel.message_encoding
    return "cdr" if encoding.lower() in ("cdr", "") else encoding


def bag_metadata(
    files: Sequence[McapFile],
    topics: Iterable[TopicMetadata],
    custom_data: Mapping[str, str],
    ros_distro: str,
) -> dict:
    """Metadata of a bag as rosbag2 nests them.

    Parameters
    ----------
    files
        As far as they are written.
    """
    return {
        "version": METADATA_VERSION,
        "storage_identifier": "mcap",
        **_extent(files),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type_name,
                    "serialization_format": topic.encoding,
                    "offered_qos_profiles": topic.qos,
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.path.name for file in files],
        "files": [{"path": file.path.name, **_extent([file])} for file in files],
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
        data = stream.read(4 * LARGEST_TEXT + 1)
    # in UTF-8, or as editors of Windows write it
    encoding = "utf-16" if data.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig"
    content = load(data.decode(encoding, errors="replace"), METADATA_FILE)
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
    first, length = start.get("nanoseconds_since_epoch"), duration.get("nanoseconds")
    count = told.get("message_count")
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


def _cleaned(found: dict, faults: list[str]) -> dict:
    """Metadata without the entries that are of another kind than rosbag2 writes, of which `faults`
    gets a text each.
    """
    metadata = {name: value for name, value in found.items() if name not in _KINDS}
    for name, (wanted, clean) in _KINDS.items():
        value = found.get(name)
        kept = None if value is None else clean(value)
        if kept is not None:
            metadata[name] = kept
        is_collection = isinstance(kept, (list, dict)) and isinstance(value, (list, dict))
        if value is not None and (kept is None or (is_collection and len(kept) != len(value))):
            faults.append(f"it misuses {name}: it must be {wanted}")
    return metadata


def _texts(value: Any) -> list[str] | None:
    items = [value] if isinstance(value, str) else value
    return [item for item in items if isinstance(item, str)] if isinstance(items, list) else None


def _files(value: Any) -> list[dict] | None:
    if not isinstance(value, list):
        return None
    return [item for item in value if isinstance(item, dict) and isinstance(item.get("path"), str)]


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
            count = _only(int)(item.get("message_count"))
            found.append({"topic_metadata": texts, "message_count": count})
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
    if not isinstance(found, list):
        return ()
    return tuple(
        Qos(
            _policy(QosHistory, one.get("history", "keep_last")),
            _only(int)(one.get("depth")) or 0,
            _policy(QosReliability, one.get("reliability", "reliable")),
            _policy(QosDurability, one.get("durability", "volatile")),
            _period(one.get("deadline")),
            _period(one.get("lifespan")),
            _policy(QosLiveliness, one.get("liveliness", "automatic")),
            _period(one.get("liveliness_lease_duration")),
            bool(one.get("avoid_ros_namespace_conventions")),
        )
        for one in found
        if isinstance(one, dict)
    )


def _period(told: Any) -> QosTime:
    """A period [s, ns]; 0 is ROS 2's for none."""
    told = told if isinstance(told, dict) else {}
    return QosTime(*(_only(int)(told.get(key)) or 0 for key in ("sec", "nsec")))


def _policy(kind: Any, told: int | str | None) -> Any:
    """A policy by its number, or by its name in small letters."""
    try:
        return kind(told) if isinstance(told, int) else kind[str(told).upper()]
    except (KeyError, ValueError):
        return kind.UNKNOWN


def _extent(files: Sequence[McapFile]) -> dict:
    start = min((file.start_ns for file in files if file.start_ns is not None), default=0)
    end = max((file.end_ns for file in files if file.end_ns is not None), default=0)
    return {
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(file.message_count for file in files),
    }


def dump(content: Any) -> str:
    """YAML text, without anchors: people who read the file do not expect them."""
    repeated = json.loads(json.dumps(content))  # so that nothing in it is there twice
    return yaml.dump(repeated, Dumper=_DUMPER, sort_keys=False)


_DUMPER = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
LARGEST_TEXT = 2_000_000
"""Size of the metadata of a bag of ten thousand files [characters]."""
DEEPEST = 30
"""Most levels of a text."""
MOST_NODES = 200_000
"""Most entries of a text, once its aliases are followed."""
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def load(text: str, what: str) -> Any:
    """What a YAML text says.

    Raises
    ------
    ValueError
        With `what` it is, for one that is no YAML, or that asks for too much.
    """
    if len(text) > LARGEST_TEXT:
        raise ValueError(
            f"{what} has {len(text)} characters, more than the {LARGEST_TEXT} of any bag"
        )
    try:
        fault = _too_much(text)
        if not fault:
            return yaml.load(text, Loader=_LOADER)
    # the second: numbers and dates that are none
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        # PyYAML 6.0.4 looks far enough ahead of its events to meet a limit of its own before ours
        fault = _TOO_DEEP if "nesting depth" in str(error) else f"is no YAML: {error}"
    raise ValueError(f"{what} {fault}")


_TOO_DEEP = f"is nested deeper than {DEEPEST} levels"


def _too_much(text: str) -> str:
    """What a YAML text has too much of, told without building anything of it; empty for another
    one. Its nodes are counted as often as aliases repeat them.
    """
    total = 0
    begun: list[tuple[str | None, int]] = []  # anchor and nodes before each open collection
    sizes: dict[str | None, int] = {}  # by anchor
    for event in yaml.parse(text, Loader=_LOADER):
        if isinstance(event, yaml.AliasEvent):
            # one that is within itself never ends
            total += sizes.get(event.anchor, MOST_NODES)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = begun.pop()
            sizes[anchor] = total - before
        elif isinstance(event, yaml.NodeEvent):
            total += 1
            if isinstance(event, yaml.CollectionStartEvent):
                begun.append((event.anchor, total - 1))
            else:
                sizes[event.anchor] = 1
        if len(begun) > DEEPEST:
            return _TOO_DEEP
        if total > MOST_NODES:
            return f"has more than {MOST_NODES} entries once its aliases are followed"
    return ""
