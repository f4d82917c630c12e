"""Writing bags: a rosbag2 folder with one MCAP file, from messages that are serialised already.

The layout is that of rosbag2 in ROS 2 Jazzy (metadata version 9; MCAP profile `ros2`, schemas `ros2msg` with
all nested definitions), so that `ros2 bag`, Foxglove, Rerun and `rosbags` open it without this package.
Chunks of 256 KiB are zstd-compressed and are flushed each second of log time: a killed process loses no more.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml
from mcap.writer import CompressionType, Writer

CHUNK_SIZE = 256 * 1024
FLUSH_PERIOD_NS = 1_000_000_000
METADATA_VERSION = 9
_FOREVER = {"sec": 9223372036, "nsec": 854775807}


@dataclass
class _Topic:
    name: str
    type_name: str
    qos: str
    type_hash: str
    channel: int
    count: int = 0


def qos_yaml(reliability: str = "reliable", durability: str = "volatile", history: str = "keep_last", depth: int = 10) -> str:
    """A QoS profile as the YAML text that rosbag2 keeps in `offered_qos_profiles`."""
    allowed = {
        "reliability": ("reliable", "best_effort"),
        "durability": ("volatile", "transient_local"),
        "history": ("keep_last", "keep_all"),
    }
    given = {"reliability": reliability, "durability": durability, "history": history}
    for name, value in given.items():
        if value not in allowed[name]:
            raise ValueError(f"QoS {name} = '{value}': give one of {allowed[name]}")
    profile = {
        "history": history,
        "depth": int(depth),
        "reliability": reliability,
        "durability": durability,
        "deadline": dict(_FOREVER),
        "lifespan": dict(_FOREVER),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(_FOREVER),
        "avoid_ros_namespace_conventions": False,
    }
    return _dump([profile])


class BagWriter:
    """A bag that is being written; a context manager. What was written stays, also when the block raises.

    path: folder of the bag, which must not exist yet; it holds `<name>_0.mcap` and, once closed,
    metadata.yaml.
    custom_data: names and texts that go into the metadata (seed, version, who recorded).
    """

    def __init__(
        self,
        path: str | os.PathLike,
        custom_data: Mapping[str, str] | None = None,
        chunk_size: int = CHUNK_SIZE,
        flush_period_ns: int = FLUSH_PERIOD_NS,
        ros_distro: str = "jazzy",
    ):
        self.path = Path(path)
        self.custom_data = _check_custom_data(custom_data or {})
        self._ros_distro, self._flush_period_ns = ros_distro, int(flush_period_ns)
        self._topics: dict[str, _Topic] = {}
        self._schemas: dict[str, tuple[int, str]] = {}
        self._first_ns, self._last_ns, self._flushed_ns = None, None, None
        try:
            self.path.mkdir(parents=True)
        except FileExistsError:
            raise FileExistsError(f"{self.path} exists already: bags are never overwritten, choose another name") from None
        self.file = self.path / f"{self.path.name}_0.mcap"
        self._stream = open(self.file, "xb")
        self._writer = Writer(self._stream, chunk_size=chunk_size, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library="dart_skill")
        self._write_metadata_record()

    def add_topic(self, name: str, type_name: str, definition_text: str, qos_profile_yaml: str = "", type_hash: str = "") -> None:
        """Announce a topic before its first message.

        type_name: as package/msg/Name. definition_text: with all nested definitions
        (`messages.definition`).
        qos_profile_yaml: list of profiles (`qos_yaml`). type_hash: RIHS01 (`messages.type_hash`).
        """
        self._check_open()
        if not name.startswith("/"):
            raise ValueError(f"topic '{name}': give the full name, with its leading slash")
        if name in self._topics:
            raise ValueError(f"topic {name} is in the bag already, with type {self._topics[name].type_name}")
        if len(type_name.split("/")) != 3:
            raise ValueError(f"type '{type_name}' of topic {name}: write it as package/msg/Name")
        if not isinstance(_parse_qos(name, qos_profile_yaml), list):
            raise ValueError(f"QoS of topic {name} must be a YAML list of profiles, got {qos_profile_yaml!r}")
        channel = self._writer.register_channel(
            topic=name,
            message_encoding="cdr",
            schema_id=self._schema(type_name, definition_text),
            metadata={"offered_qos_profiles": qos_profile_yaml, "topic_type_hash": type_hash},
        )
        self._topics[name] = _Topic(name, type_name, qos_profile_yaml, type_hash, channel)

    def write(self, topic: str, log_time_ns: int, publish_time_ns: int, cdr_bytes: bytes) -> None:
        """Append a message. Log time: when it was received; publish time: when it was sent [ns]."""
        self._check_open()
        entry = self._topics.get(topic)
        if entry is None:
            raise ValueError(f"topic '{topic}' is not in the bag, only {sorted(self._topics)}: add_topic first")
        if log_time_ns < 0 or publish_time_ns < 0 or len(cdr_bytes) < 4:
            raise ValueError(
                f"{topic}: log time {log_time_ns} ns, publish time {publish_time_ns} ns, {len(cdr_bytes)}"
                " bytes: times must not be negative, and a CDR message has at least its 4-byte header"
            )
        if self._flushed_ns is None:
            self._first_ns = self._last_ns = self._flushed_ns = log_time_ns
        # Time that jumps back (a new simulation) flushes too, or the promise would not hold after it.
        elif not 0 <= log_time_ns - self._flushed_ns < self._flush_period_ns:
            self.flush()
            self._flushed_ns = log_time_ns
        self._writer.add_message(entry.channel, log_time_ns, cdr_bytes, publish_time_ns, entry.count)
        entry.count += 1
        self._first_ns = min(self._first_ns, log_time_ns)
        self._last_ns = max(self._last_ns, log_time_ns)

    def add_attachment(self, name: str, data: bytes | str, media_type: str = "text/plain", time_ns: int = 0) -> None:
        """Keep a file with the bag: parameters (YAML), robot description (URDF)."""
        self._check_open()
        data = data.encode() if isinstance(data, str) else bytes(data)
        self._writer.add_attachment(time_ns, time_ns, name, media_type, data)

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: topic.count for name, topic in self._topics.items()}

    def flush(self, to_disk: bool = False) -> None:
        """Hand all to the operating system, safe from a crash of this process; to_disk: of the machine."""
        self._check_open()
        self._writer.flush()
        if to_disk:
            os.fsync(self._stream.fileno())

    def close(self) -> None:
        """Write index, summary and metadata.yaml. Closing twice is no error."""
        if self._stream.closed:
            return
        try:
            self._write_metadata_record()
            self._writer.finish()
            self._stream.flush()
            os.fsync(self._stream.fileno())
        finally:
            self._stream.close()
        temporary = self.path / "metadata.yaml.tmp"
        temporary.write_text(_dump({"rosbag2_bagfile_information": self._metadata()}), encoding="utf-8")
        temporary.replace(self.path / "metadata.yaml")

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_exception) -> None:
        self.close()

    def _check_open(self):
        if self._stream.closed:
            raise ValueError(f"bag {self.path} is closed")

    def _schema(self, type_name, definition_text):
        known = self._schemas.get(type_name)
        if known is None:
            number = self._writer.register_schema(type_name, "ros2msg", definition_text.encode())
            known = self._schemas[type_name] = (number, definition_text)
        if known[1] != definition_text:
            raise ValueError(f"type {type_name} is in the bag already with another definition")
        return known[0]

    def _write_metadata_record(self):
        """What rosbag2 writes at opening and at closing, so that a lone .mcap file tells its metadata."""
        self._writer.add_metadata("rosbag2", {"serialized_metadata": _dump(self._metadata())})

    def _metadata(self):
        start = 0 if self._first_ns is None else self._first_ns
        duration = 0 if self._first_ns is None else self._last_ns - self._first_ns
        count = sum(self.counts.values())
        times = {
            "duration": {"nanoseconds": duration},
            "starting_time": {"nanoseconds_since_epoch": start},
            "message_count": count,
        }
        return {
            "version": METADATA_VERSION,
            "storage_identifier": "mcap",
            **times,
            "topics_with_message_count": [_topic_metadata(topic) for topic in self._topics.values()],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [self.file.name],
            "files": [{"path": self.file.name, **times}],
            "custom_data": self.custom_data or None,
            "ros_distro": self._ros_distro,
        }


def _topic_metadata(topic: _Topic) -> dict:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": _parse_qos(topic.name, topic.qos),
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.count,
    }


def _parse_qos(topic: str, text: str) -> list:
    try:
        return yaml.safe_load(text) or []
    except yaml.YAMLError as error:
        raise ValueError(f"QoS of topic {topic} is no YAML: {error}") from error


def _check_custom_data(data: Mapping[str, str]) -> dict[str, str]:
    for name, value in data.items():
        if not (isinstance(name, str) and isinstance(value, str)):
            raise ValueError(f"custom_data holds texts only, got {name!r}: {value!r}")
    return dict(data)


class _NoAliases(yaml.SafeDumper):
    """yaml-cpp, which rosbag2 reads with, knows anchors, but people who read the file do not expect
    them.
    """

    def ignore_aliases(self, data):
        return True


def _dump(content) -> str:
    return yaml.dump(content, Dumper=_NoAliases, sort_keys=False)
