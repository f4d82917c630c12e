"""The check of the messages of one file, whatever kind of file it is: types, decoding, sequence
numbers, log times.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Channel, Schema
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags._definitions import embedded_types
from dart_skill.recording.bags._files import unpacker_of
from dart_skill.recording.bags._finding import RECOVER, Finding
from dart_skill.recording.bags._metadata import full_name, profiles
from dart_skill.recording.bags._time_line import OF_EVENTS, TimeLine
from dart_skill.recording.bags.columns import Pattern, pattern_of
from dart_skill.recording.bags.messages import deserialize, shared_types
from dart_skill.recording.mcap import DamagedError

LOST_BEFORE = "they were lost before or while they were recorded"
"""Said of messages that are missing by their sequence numbers."""
NO_MESSAGES = "the file holds no messages"
NOT_DEFINED = "which the bag does not define: its messages were not decoded"
GIVE_TYPES = "give the folder of its .msg files with --definitions, or read its messages raw"


@dataclass
class _CheckedTopic:
    """What is learned about a channel while its messages pass.

    reason: why its messages cannot be decoded; empty if they can.
    """

    name: str
    type_name: str
    encoding: str
    has_lost_schema: bool
    count: int
    reason: str = ""
    last_sequence: int | None = None
    gaps: int = 0
    missing: int = 0
    undecodable: int = 0
    first_reason: str = ""
    by_other: int = 0  # messages that only a definition from elsewhere fits
    pattern: Pattern | None = None
    has_pattern: bool = True  # until it turns out that it has none


class FileFacts:
    """What is found out about a file.

    Parameters
    ----------
    name
        Of the file in findings.

    Attributes
    ----------
    findings
        In the order in which they were found.
    counts
        Messages by topic.
    start_ns, end_ns
        Log times of the first and last message; None without messages.
    is_vouched_for
        Whether the file itself has counted as many messages as there are.
    """

    def __init__(self, name: str):
        self.name = name
        self.findings: list[Finding] = []
        self.counts: Counter[str] = Counter()
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self.is_vouched_for = False
        self._topics: dict[int, _CheckedTopic] = {}  # by channel

    @property
    def topic_types(self) -> dict[str, list[str]]:
        """Types by topic, of those that have messages."""
        found: dict[str, list[str]] = {}
        for topic in self._topics.values():
            if (
                topic.count
                and topic.type_name
                and topic.type_name not in found.setdefault(topic.name, [])
            ):
                found[topic.name].append(topic.type_name)
        return found

    def add(self, severity: str, message: str, remedy: str = "", where: str = "") -> None:
        """Add a finding about the file.

        Parameters
        ----------
        where
            In it.
        """
        self.findings.append(
            Finding(severity, self.name + (f", {where}" if where else ""), message, remedy)
        )

    def take_topic(
        self, number: int, channel: Channel, schema: Schema | None, count: int = 0
    ) -> _CheckedTopic:
        """Take a topic of the file.

        Parameters
        ----------
        number
            Of its channel.
        count
            Of its messages.
        """
        encoding = (
            "cdr" if channel.message_encoding.lower() in ("cdr", "") else channel.message_encoding
        )
        type_name = (
            (full_name(schema.name) if encoding == "cdr" else schema.name) if schema else ""
        )
        self._topics[number] = topic = _CheckedTopic(
            channel.topic, type_name, encoding, channel.schema_id != 0 and schema is None, count
        )
        return topic

    def file_findings(self, undefined: Mapping[int, int]) -> None:
        """Add what is to be said of the file once all messages are counted.

        Parameters
        ----------
        undefined
            Messages of channels that it does not define.
        """
        if undefined:
            told = (
                f"{sum(undefined.values())} messages are of channels {sorted(undefined)}, which"
                " the file does not define"
            )
            self.add("error", told, RECOVER)
        if not self.counts:
            self.add("warning", NO_MESSAGES)
        of_each: dict[str, list[str]] = {}
        for topic in self._topics.values():
            if (
                topic.count
                and topic.encoding == "cdr"
                and topic.type_name not in of_each.setdefault(topic.name, [])
            ):
                of_each[topic.name].append(topic.type_name)
        for name, types in of_each.items():
            if len(types) > 1:
                told = f"its messages have several types: {', '.join(types)}"
                self.add("warning", told, "each message is read by its own", f"topic {name}")


class MessageCheck(FileFacts):
    """The check of a file.

    Parameters
    ----------
    path
        Of the file.
    types
        Definitions for topics whose file holds none; None: those of ROS 2 Jazzy and ours.
    line
        Log times of the bag, to which those of the file are added.
    name
        Of the file in findings.
    """

    def __init__(
        self,
        path: Path,
        types: Typestore | None,
        line: TimeLine,
        name: str,
    ):
        super().__init__(name)
        self._line = line
        self._given = types
        self._n_messages: Counter[int] = Counter()  # by channel

    def define(self, schemas: Iterable[Schema], channels: dict[int, Channel]) -> None:
        """Take the types and topics of the file, before its messages.

        Parameters
        ----------
        channels
            By number.
        """
        known = {schema.id: schema for schema in schemas}
        texts = [
            (full_name(one.name), one.encoding, one.data.decode(errors="replace"))
            for one in known.values()
        ]
        self._others = shared_types() if self._given is None else self._given
        names = [
            full_name(known[channel.schema_id].name)
            for channel in channels.values()
            if channel.schema_id in known
        ]
        self._types, self._unknown = embedded_types(texts, self._others, names)
        ways = Counter(name for name, _encoding, _text in set(texts))
        # by channel, of types that the file defines in several ways
        self._own_types: dict[int, Typestore] = {}
        self._empty = {name for name, _encoding, text in texts if not text.strip()}
        self._defined = embedded_types(texts, None)[0].fielddefs.keys()
        for number, channel in channels.items():
            schema = known.get(channel.schema_id)
            if schema is not None and ways[full_name(schema.name)] > 1:
                own = (
                    full_name(schema.name),
                    schema.encoding,
                    schema.data.decode(errors="replace"),
                )
                others = [text for text in texts if text[0] != own[0]]
                self._own_types[number] = embedded_types([*others, own], self._others, names)[0]
            topic = self.take_topic(number, channel, schema)
            if topic.encoding == "cdr" and topic.type_name not in self._types.fielddefs:
                topic.reason = self._unknown.get(topic.type_name, NOT_DEFINED)
            qos = profiles(channel.topic, channel.metadata.get("offered_qos_profiles", ""))
            if topic.type_name in OF_EVENTS or any(
                profile.durability.name == "TRANSIENT_LOCAL" for profile in qos
            ):
                self._line.is_of_events(topic.name)

    def take(self, number: int, stamp_ns: int, sequence: int | None = None) -> None:
        """Count a message.

        Parameters
        ----------
        sequence
            Its number by its publisher; None or 0 without one.
        """
        self._n_messages[number] += 1
        topic = self._topics.get(number)
        if topic is None:
            return
        self.counts[topic.name] += 1
        topic.count += 1
        if sequence is not None:
            if topic.last_sequence is not None and sequence > topic.last_sequence + 1:
                topic.gaps += 1
                topic.missing += sequence - topic.last_sequence - 1
            topic.last_sequence = sequence
        self._line.add(
            topic.name if topic.encoding == "cdr" else f"{topic.name} ({topic.encoding})", stamp_ns
        )
        self.start_ns = stamp_ns if self.start_ns is None else min(self.start_ns, stamp_ns)
        self.end_ns = stamp_ns if self.end_ns is None else max(self.end_ns, stamp_ns)

    def decode(self, number: int, messages: list[tuple[int, bytes]]) -> None:
        """Whether messages can be decoded: one by one, unless they differ from one that could in
        stamp and numbers alone.

        Parameters
        ----------
        messages
            Log time and bytes of each.
        """
        topic = self._topics.get(number)
        if topic is None or topic.encoding != "cdr" or topic.reason or not messages:
            return
        try:
            unpack = unpacker_of(messages[0][1])
            messages = (
                messages
                if unpack is None
                else [(stamp_ns, unpack(data)) for stamp_ns, data in messages]
            )
        except DamagedError as error:
            self.add("error", str(error), RECOVER, f"topic {topic.name}")
            return
        if (
            topic.pattern is not None
            and topic.pattern.table([data for _, data in messages]) is not None
        ):
            return
        types = self._own_types.get(number, self._types)
        for stamp_ns, data in messages:
            self._decode(types, topic, stamp_ns, data)
        # those that come may be like this one
        if (
            topic.has_pattern
            and not topic.undecodable
            and not topic.by_other
            and len(messages) > 1
        ):
            topic.pattern = pattern_of(types, topic.type_name, messages[-1][1])
            topic.has_pattern = topic.pattern is not None

    def _decode(self, types: Typestore, topic: _CheckedTopic, stamp_ns: int, data: bytes) -> None:
        try:
            deserialize(types, topic.type_name, data)
        except ValueError as error:
            try:
                deserialize(self._others, topic.type_name, data)
                topic.by_other += 1
            except ValueError:
                topic.undecodable += 1
                topic.first_reason = (
                    topic.first_reason or f"the first at log time {stamp_ns} ns: {error}"
                )

    def topic_findings(self) -> None:
        """Add what is to be said of the topics, once all messages have passed."""
        for topic in self._topics.values():
            if topic.count:
                self._of_topic(topic, f"topic {topic.name}")
        self.file_findings(
            {
                number: count
                for number, count in self._n_messages.items()
                if number not in self._topics
            }
        )

    def _of_topic(self, topic: _CheckedTopic, where: str) -> None:
        # it was taken for one without fields
        if topic.undecodable and topic.type_name in self._empty:
            topic.reason, topic.undecodable = NOT_DEFINED, 0
        if topic.encoding != "cdr":
            self.add(
                "note",
                f"its messages are encoded as '{topic.encoding}', not as cdr: they are not"
                " decoded",
                "read them raw",
                where,
            )
        elif not topic.type_name:
            severity, text = (
                ("error", "its schema is missing")
                if topic.has_lost_schema
                else ("warning", "its schema names none")
            )
            self.add(severity, f"it has no type: {text}", "read its messages raw", where)
        elif topic.reason:
            severity = "error" if topic.type_name in self._unknown else "warning"
            self.add(severity, f"it has type {topic.type_name}, {topic.reason}", GIVE_TYPES, where)
        elif topic.type_name in self._unknown:
            text = (
                f"it has type {topic.type_name}, {self._unknown[topic.type_name]}: it was decoded"
                " as it is defined elsewhere"
            )
            self.add("warning", text, "", where)
        if topic.undecodable:
            text = f"{topic.undecodable} messages are no {topic.type_name}"
            if topic.type_name in self._defined:
                self.add("error", f"{text}; {topic.first_reason}", "read them raw", where)
            else:
                self.add(
                    "warning",
                    f"{text} as it is known here, and the bag does not define it;"
                    f" {topic.first_reason}",
                    GIVE_TYPES,
                    where,
                )
        if topic.by_other:
            text = (
                f"{topic.by_other} messages are no {topic.type_name} as the bag defines it, but as"
                " it is defined elsewhere"
            )
            self.add("warning", text, "they are read by that definition", where)
        if topic.gaps:
            text = (
                f"{topic.missing} messages are missing in {topic.gaps} gaps of the sequence"
                " numbers"
            )
            self.add("warning", text, LOST_BEFORE, where)
