"""Bags of earlier versions as bags of today: what has the message types of then gets those of now, all else is copied byte for byte.

Until December 2026 demonstrations knew of throws only: they had a target, a hand and a ball by name, and no skill. Until November 2026
commands did not say how fast the arm may become. Every verb that reads demonstrations takes such bags as they are; nodes do not.
"""

from __future__ import annotations

import os
import shutil
import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from rosbags.typesys.store import Typestore

from dart_skill.recording.bags import (
    BagReader,
    BagWriter,
    TopicInfo,
    definition,
    deserialize,
    encoded,
    is_stamped,
    qos_yaml,
    type_hash,
    types_for,
)
from dart_skill.recording.bags.messages import PACKAGE
from dart_skill.recording.demonstration import DEMONSTRATION_TYPE, demonstration_from_message, demonstration_message
from dart_skill.recording.grip_signal import OLDER_COMMAND, completed_command

STAMP = struct.Struct("<iI")


@dataclass(frozen=True)
class Upgrade:
    """What became of a bag.

    * path: of the new one.
    * converted: messages that got the type of today, by topic; copied: all others.
    * left_out: topics with a type of ours that is no more, or has another meaning, and why.
    """

    path: Path
    converted: dict[str, int] = field(default_factory=dict)
    copied: int = 0
    left_out: dict[str, str] = field(default_factory=dict)


def upgrade(path: str | os.PathLike, output: str | os.PathLike) -> Upgrade:
    """A new bag with the message types of today; the given one is not changed.

    BagError for a bag that cannot be read; FileExistsError if the output is there; ValueError if nothing in it is older than today.
    """
    with BagReader(path) as bag:
        ways = {name: _way(bag.types, topic) for name, topic in bag.topics.items()}
        if not any(way.older for way in ways.values()):
            raise ValueError(f"{path}: all of its types are those of today, there is nothing to convert")
        result = Upgrade(Path(output), left_out={name: way.refusal for name, way in ways.items() if way.refusal})
        try:
            copied = _write(bag, output, ways, result.converted)
        except ValueError:
            shutil.rmtree(output)  # no half of a bag is left where a whole one is expected
            raise
    return replace(result, copied=copied)


@dataclass(frozen=True)
class _Way:
    """What is done to the messages of a topic: from bytes to bytes; whether their type is older than today; why they are left out."""

    convert: Callable[[bytes], bytes] | None = None
    older: bool = False
    stamped: bool = False
    refusal: str = ""


def _write(bag: BagReader, output: str | os.PathLike, ways: dict[str, _Way], converted: dict[str, int]) -> int:
    """The new bag; how many messages were copied, and in `converted` how many were not."""
    with BagWriter(output, {**bag.custom_data, "upgraded_from": bag.path.resolve().name}) as writer:
        _add_topics(bag, writer, ways)
        copied = _copy(bag, writer, ways, converted)
        for one in bag.attachments():
            writer.add_attachment(one.name, one.data, one.media_type, one.log_time)
    return copied


def _add_topics(bag: BagReader, writer: BagWriter, ways: dict[str, _Way]) -> None:
    for name, topic in bag.topics.items():
        if ways[name].refusal:
            continue
        types = types_for(topic.type_name) if ways[name].older else bag.types
        hashed = type_hash(types, topic.type_name) if ways[name].older else topic.type_hash
        writer.add_topic(name, topic.type_name, definition(types, topic.type_name), _qos(topic), hashed)


def _copy(bag: BagReader, writer: BagWriter, ways: dict[str, _Way], converted: dict[str, int]) -> int:
    copied = 0
    for message in bag.messages([name for name, way in ways.items() if not way.refusal], decode=False):
        way = ways[message.topic]
        data = message.data if way.convert is None else way.convert(message.data)
        sent_ns = _stamp_ns(data) if way.stamped else message.stamp_ns
        writer.write(message.topic, message.stamp_ns, sent_ns, data)
        if way.older:
            converted[message.topic] = converted.get(message.topic, 0) + 1
        else:
            copied += 1
    return copied


def _way(types: Typestore, topic: TopicInfo) -> _Way:
    name = topic.type_name
    stamped = name in types.fielddefs and topic.encoding == "cdr" and is_stamped(types, name)
    if not name.startswith(f"{PACKAGE}/"):
        return _Way(stamped=stamped)
    try:
        now = types_for(name)
    except ValueError:
        return _Way(older=True, refusal=f"there is no {name} any more")
    if topic.type_hash in ("", type_hash(now, name)):
        return _Way(stamped=stamped)
    if topic.type_hash == OLDER_COMMAND:
        return _Way(completed_command, True, stamped)
    if name == DEMONSTRATION_TYPE:
        return _Way(lambda data: _demonstration(types, now, data), True, stamped)
    return _Way(older=True, refusal=f"its {name} is that of another version")


def _demonstration(then: Typestore, now: Typestore, data: bytes) -> bytes:
    one = demonstration_from_message(deserialize(then, DEMONSTRATION_TYPE, data))
    return encoded(now, DEMONSTRATION_TYPE, demonstration_message(now, one))


def _stamp_ns(data: bytes) -> int:
    """The stamp with which a serialised message begins [ns], as the recorder has it for the time of sending."""
    sec, nanosec = STAMP.unpack_from(data, 4)
    return max(0, sec * 1_000_000_000 + nanosec)


def _qos(topic: TopicInfo) -> str:
    if not topic.qos:
        return ""
    first = topic.qos[0]
    return qos_yaml(first.reliability.name.lower(), first.durability.name.lower(), first.history.name.lower(), first.depth)
