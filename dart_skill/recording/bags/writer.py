"""Writing bags: a rosbag2 folder of MCAP files, from messages that are serialised already.

The layout is that of rosbag2 in ROS 2 Jazzy (metadata version 9; MCAP profile `ros2`, schemas
`ros2msg` with all nested definitions), so that `ros2 bag`, Foxglove, Rerun and `rosbags` open it
without this package. Chunks of 256 KiB are zstd-compressed and, each second of log time, handed to
the operating system, which a thread asks to put them on the disk: a killed process loses no more
than that second, and a cut power line what the disk had not taken yet.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from io import FileIO
from pathlib import Path
from threading import Event

from dart_skill.recording.bags.files import sync_folder
from dart_skill.recording.bags.metadata import (
    RECORD_NAME,
    TopicMetadata,
    bag_metadata,
    dump,
    parse_qos,
    record_values,
    write_metadata_file,
)
from dart_skill.recording.mcap import CHUNK_SIZE, McapChannel, McapFile

FLUSH_PERIOD_NS = 1_000_000_000
PAUSE_SECONDS = 0.2
"""Pause between two syncs of files that are requested without pause."""
_FOREVER = {"sec": 9223372036, "nsec": 854775807}


class BagWriteError(OSError):
    """A bag that can be written no further: which file, why, how much of it is safe, and what to
    do.
    """


@dataclass
class _WrittenTopic(TopicMetadata):
    """A topic of the bag, with its messages in all. finished: those in finished files."""

    qos_text: str = ""
    channel: McapChannel | None = None  # in the current file
    finished: int = 0


def qos_yaml(
    reliability: str = "reliable",
    durability: str = "volatile",
    history: str = "keep_last",
    depth: int = 10,
) -> str:
    """A QoS profile as the YAML text that rosbag2 keeps in `offered_qos_profiles`.

    Parameters
    ----------
    reliability
        "reliable" or "best_effort".
    durability
        "volatile" or "transient_local".
    history
        "keep_last", "keep_all" or "unknown".
    depth
        Messages that are kept.

    Raises
    ------
    ValueError
        For a value that ROS does not have.
    """
    for name, value, allowed in (
        ("reliability", reliability, ("reliable", "best_effort")),
        ("durability", durability, ("volatile", "transient_local")),
        ("history", history, ("keep_last", "keep_all", "unknown")),
    ):
        if value not in allowed:
            raise ValueError(f"QoS {name} = '{value}': give one of {allowed}")
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
    return dump([profile])


class BagWriter:
    """A bag that is being written; a context manager. What was written stays, also when the block
    raises.

    One thread at a time may call its methods. Each of them raises BagWriteError once the disk
    takes no more; what was written until then stays readable (`recover`), and `close` adds no
    second error.

    Parameters
    ----------
    path
        Folder of the bag, which must not exist; it holds `<name>_0.mcap`, `<name>_1.mcap` ... and,
        once closed, metadata.yaml.
    custom_data
        Names and texts that go into the metadata (seed, version, who recorded); `note` adds some.
    chunk_size
        Bytes of messages after which they are compressed and handed to the operating system.
    flush_period_ns
        Log time after which they are in any case.
    ros_distro
        Goes into the metadata.
    max_bytes
        A new file begins before the current one gets larger; 0: never.
    max_duration_ns
        A new file begins before the current one gets as long in log time; 0: never.
    """

    def __init__(
        self,
        path: str | os.PathLike,
        custom_data: Mapping[str, str] | None = None,
        chunk_size: int = CHUNK_SIZE,
        flush_period_ns: int = FLUSH_PERIOD_NS,
        ros_distro: str = "jazzy",
        max_bytes: int = 0,
        max_duration_ns: int = 0,
    ):
        self.path = Path(path)
        self.custom_data = _check_custom_data(custom_data or {})
        self._chunk_size, self._max_bytes = int(chunk_size), int(max_bytes)
        self._max_duration_ns = int(max_duration_ns)
        if min(max_bytes, max_duration_ns) < 0 or 0 < max_bytes < 2 * chunk_size:
            raise ValueError(
                f"max_bytes = {max_bytes}, max_duration_ns = {max_duration_ns}: give 0 for no"
                f" limit, and at least two chunks ({2 * self._chunk_size} bytes)"
            )
        self._ros_distro, self._flush_period_ns = ros_distro, int(flush_period_ns)
        self._topics: dict[str, _WrittenTopic] = {}
        # the same, empty when nothing can be written any more
        self._writable: dict[str, _WrittenTopic] = {}
        self._types: dict[str, str] = {}
        self._finished: list[McapFile] = []
        self._file: McapFile | None = None  # none between two files
        self._flushed_ns = self._due_ns = (
            0  # log times: of the last flush, and when the next thing is due
        )
        self._file_first_ns: int | None = None
        self._failure: tuple[int | None, str, str] | None = None
        self._closed, self._full, self._synced_bytes = False, False, 0
        try:
            self.path.mkdir(parents=True)
        except FileExistsError:
            raise FileExistsError(
                f"{self.path} exists already: bags are never overwritten, choose another name"
            ) from None
        sync_folder(self.path.parent)
        with self._explained():
            self._open_file()
        self._sync = DiskSync(self._stopped)
        self._sync.request(self._current.stream)

    @property
    def _current(self) -> McapFile:
        """The file that is open."""
        assert self._file is not None
        return self._file

    @property
    def file(self) -> Path:
        """The file that is being written, or was the last."""
        return (
            self.path
            / f"{self.path.name}_{max(0, len(self._finished) - (self._file is None))}.mcap"
        )

    @property
    def counts(self) -> dict[str, int]:
        """Messages written so far, by topic."""
        return {name: topic.count for name, topic in self._topics.items()}

    def add_topic(
        self,
        name: str,
        type_name: str,
        definition_text: str,
        qos_profile_yaml: str = "",
        type_hash: str = "",
    ) -> None:
        """Announce a topic before its first message.

        Parameters
        ----------
        name
            With its leading slash.
        type_name
            As package/msg/Name.
        definition_text
            With all nested definitions (`definition`).
        qos_profile_yaml
            List of profiles (`qos_yaml`).
        type_hash
            RIHS01 (`type_hash`).

        Raises
        ------
        ValueError
            For a name, type or QoS that cannot be, or that contradicts what the bag has.
        """
        self._check_writable()
        if name in self._topics:
            raise ValueError(
                f"topic {name} is in the bag already, with type {self._topics[name].type_name}"
            )
        if not name.startswith("/"):
            raise ValueError(f"topic '{name}': give the full name, with its leading slash")
        if len(type_name.split("/")) != 3:
            raise ValueError(f"type '{type_name}' of topic {name}: write it as package/msg/Name")
        qos = parse_qos(name, qos_profile_yaml)
        if not isinstance(qos, list):
            raise ValueError(
                f"QoS of topic {name} must be a YAML list of profiles, got {qos_profile_yaml!r}"
            )
        if self._types.setdefault(type_name, definition_text) != definition_text:
            raise ValueError(f"type {type_name} is in the bag already with another definition")
        topic = _WrittenTopic(name, type_name, qos, type_hash, qos_text=qos_profile_yaml)
        with self._explained():
            topic.channel = self._channel(topic)
        self._topics[name] = self._writable[name] = topic

    def write(self, topic: str, log_time_ns: int, publish_time_ns: int, cdr_bytes: bytes) -> None:
        """Append a message.

        Parameters
        ----------
        log_time_ns
            When it was received.
        publish_time_ns
            When it was sent.
        cdr_bytes
            Any buffer of bytes.
        topic
            As in `add_topic`.

        Raises
        ------
        ValueError
            For times or bytes that cannot be.
        """
        entry = self._writable.get(topic)
        if entry is None:
            raise self._refusal(topic)
        if not self._flushed_ns <= log_time_ns < self._due_ns:
            self._turn(topic, log_time_ns)
        if type(cdr_bytes) is not bytes:
            cdr_bytes = memoryview(cdr_bytes).tobytes()
        if len(cdr_bytes) < 4:
            raise ValueError(
                f"{topic}: {len(cdr_bytes)} bytes: a CDR message has at least its 4-byte header"
            )
        file = self._file
        if file is None or entry.channel is None:
            raise self._refusal(topic)
        try:
            if file.add_message(
                entry.channel, entry.count & 0xFFFFFFFF, log_time_ns, publish_time_ns, cdr_bytes
            ):
                self._chunk_ended()
        except struct.error:
            raise ValueError(_bad_times(topic, log_time_ns, publish_time_ns)) from None
        except OSError as error:
            raise self._stopped(error) from error
        entry.count += 1

    def add_attachment(
        self, name: str, data: bytes | str, media_type: str = "text/plain", time_ns: int = 0
    ) -> None:
        """Keep a file with the bag: parameters (YAML), robot description (URDF).

        Parameters
        ----------
        data
            Its content.
        media_type
            As on the internet.
        time_ns
            When it was made [ns].
        """
        self._check_writable()
        data = data.encode() if isinstance(data, str) else bytes(data)
        with self._explained():
            self._current.add_attachment(name, media_type, data, time_ns, time_ns)

    def note(self, name: str, text: str) -> None:
        """Add to the custom data, or replace what it says by that name; until the bag is closed.

        Parameters
        ----------
        text
            What it says.
        """
        if self._closed:
            raise self._refusal()
        self.custom_data.update(_check_custom_data({name: text}))

    def flush(self, to_disk: bool = False) -> None:
        """Hand all to the operating system, safe from a crash of this process, and have it put on
        the disk soon.

        Parameters
        ----------
        to_disk
            Return only when it is there, safe from a crash of the machine. Costs nothing when
            nothing is new.
        """
        self._check_writable()
        with self._explained():
            if self._current.end_chunk():
                self._chunk_ended()
        if self._current.position > self._synced_bytes:
            self._synced_bytes = self._current.position
            self._sync.request(self._current.stream)
        if to_disk:
            self._sync.wait()
            self._check_writable()

    def close(self) -> None:
        """Write index, summary and metadata.yaml. Closing twice is no error, nor closing what
        cannot be written.

        Raises
        ------
        BagWriteError
            If the bag could not be written.
        """
        if self._closed:
            return
        self._closed, self._writable = True, {}
        failed_before = self._failure is not None
        if self._failure is not None:
            self.custom_data["writing_stopped"] = self._failure[1]
        stream = self._file.stream if self._file is not None else None
        try:
            if stream is not None:
                self._finish_file()
        except OSError as error:
            self._stopped(error)
        if stream is not None:
            self._sync.request(stream, close=True)
        self._sync.stop()
        try:
            if self._file is None and (failed_before or self._failure is None):
                write_metadata_file(self.path, self._metadata(self._finished, in_file=False))
        except OSError as error:
            self._stopped(error)
        if self._failure is not None and not failed_before:
            raise BagWriteError(*self._failure)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    def _check_writable(self) -> None:
        if self._failure is not None or self._closed:
            raise self._refusal()

    def _refusal(self, topic: str = "") -> Exception:
        """Why nothing can be written, or not on this topic."""
        if self._failure is not None:
            return BagWriteError(*self._failure)
        if self._closed:
            return ValueError(f"bag {self.path} is closed")
        return ValueError(
            f"topic '{topic}' is not in the bag, only {sorted(self._topics)}: add_topic first"
        )

    def _stopped(self, error: OSError) -> BagWriteError:
        """Write no more, for a reason that every later call meets. Called by the sync thread too."""
        self._writable = {}
        if self._failure is None:
            files = [*self._finished, *([self._file] if self._file is not None else [])]
            count = sum(file.message_count for file in files)
            ends = [file.end_ns for file in files if file.end_ns is not None]
            until = f", until log time {max(ends)} ns," if ends else ""
            self._failure = (
                error.errno,
                (
                    f"{error.strerror or error}: writing of the bag stopped; {count} messages{until}"
                    f" are in its files: make room, and see 'dart-skill bag check {self.path}'; if a"
                    " file is not whole, 'dart-skill bag recover' makes a new bag of it"
                ),
                str(self.file),
            )
        return BagWriteError(*self._failure)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except BagWriteError:
            raise
        except OSError as error:
            raise self._stopped(error) from error

    def _turn(self, topic: str, log_time_ns: int) -> None:
        """What is due before the message of this log time: a flush, or the next file."""
        if log_time_ns < 0:
            raise ValueError(_bad_times(topic, log_time_ns))
        if self._file_first_ns is not None:
            self._file_first_ns = min(self._file_first_ns, log_time_ns)
            lasted = log_time_ns - self._file_first_ns
            if self._full or 0 < self._max_duration_ns <= lasted:
                with self._explained():
                    self._next_file()
            else:
                self.flush()
        if self._file_first_ns is None:
            self._file_first_ns = log_time_ns
        # Time that jumps back (a new simulation) comes here too: else what is written after it
        # would not be flushed in time.
        self._flushed_ns, self._due_ns = log_time_ns, 0
        if not self._full:
            self._due_ns = log_time_ns + self._flush_period_ns
        if self._max_duration_ns:
            self._due_ns = min(self._due_ns, self._file_first_ns + self._max_duration_ns)

    def _chunk_ended(self) -> None:
        """Whether another chunk, with its index and the file's end, would be more than a file may
        hold.
        """
        texts = sum(len(text) for item in self.custom_data.items() for text in item)
        room = (
            3 * self._chunk_size // 2
            + 1000 * len(self._topics)
            + texts
            + self._current.summary_size
        )
        if self._max_bytes and self._current.position + room > self._max_bytes:
            self._full, self._due_ns = True, 0

    def _next_file(self) -> None:
        stream = self._current.stream
        self._finish_file()
        self._sync.request(stream, close=True)
        self._open_file()
        self._sync.request(self._current.stream)
        for topic in self._topics.values():
            topic.channel = self._channel(topic)

    def _open_file(self) -> None:
        """Begin the next file, with the metadata record that rosbag2 writes at opening."""
        file = McapFile(
            self.path / f"{self.path.name}_{len(self._finished)}.mcap", chunk_size=self._chunk_size
        )
        self._file = file
        self._schemas: dict[str, int] = {}
        self._full, self._file_first_ns, self._synced_bytes = False, None, 0
        file.add_metadata(RECORD_NAME, record_values(self._metadata([file])))

    def _finish_file(self) -> None:
        """End the file; the metadata record that rosbag2 writes at closing lets it tell what it
        holds by itself.
        """
        file = self._current
        file.end_chunk()
        file.add_metadata(RECORD_NAME, record_values(self._metadata([file])))
        file.finish()
        self._finished.append(file)
        for topic in self._topics.values():
            topic.finished += topic.channel.count if topic.channel is not None else 0
            topic.channel = None
        self._file = None

    def _channel(self, topic: _WrittenTopic) -> McapChannel:
        """The topic's channel in the current file."""
        if topic.type_name not in self._schemas:
            definition = self._types[topic.type_name].encode()
            self._schemas[topic.type_name] = self._current.add_schema(
                topic.type_name, "ros2msg", definition
            )
        metadata = {"offered_qos_profiles": topic.qos_text, "topic_type_hash": topic.type_hash}
        return self._current.add_channel(
            topic.name, "cdr", self._schemas[topic.type_name], metadata
        )

    def _metadata(self, files: list[McapFile], in_file: bool = True) -> dict:
        """Metadata of the current file by itself, or of the whole bag."""
        topics = []
        for topic in self._topics.values():
            in_current = topic.channel.count if topic.channel is not None else 0
            topics.append(replace(topic, count=in_current if in_file else topic.finished))
        return bag_metadata(files, topics, self.custom_data, self._ros_distro)


class DiskSync:
    """A thread that syncs files when asked to; what is asked for twice before it begins is done
    once.

    Parameters
    ----------
    on_error
        Called in the thread with the OSError of a sync, once; nothing is synced after it.
    """

    def __init__(self, on_error: Callable[[OSError], object]):
        # takes longer to import than all of bags, and who reads needs none
        from concurrent.futures import ThreadPoolExecutor

        self._on_error, self._failed = on_error, False
        self._thread = ThreadPoolExecutor(1, "bag sync")
        self._waiting: set[FileIO] = set()
        self._known: set[str] = set()  # files whose name is on the disk
        self._hurry = Event()

    def request(self, file: FileIO, close: bool = False) -> None:
        """Sync what `file` holds now, soon.

        Parameters
        ----------
        close
            And close it then.
        """
        if close or file not in self._waiting:
            self._waiting.add(file)
            self._thread.submit(self._sync, file, close)

    def wait(self) -> None:
        """Return when all that was asked for is on the disk, or has failed (`on_error` was called
        then).
        """
        self._hurry.set()
        self._thread.submit(lambda: None).result()
        self._hurry.clear()

    def stop(self) -> None:
        """Do what was asked for and end the thread."""
        self._hurry.set()
        self._thread.shutdown()

    def _sync(self, file: FileIO, close: bool) -> None:
        # before it is synced: what is written from now on needs another request
        self._waiting.discard(file)
        try:
            if not self._failed:
                os.fdatasync(file.fileno())
                if file.name not in self._known:
                    sync_folder(Path(file.name).parent)
                    self._known.add(file.name)
        except OSError as error:
            self._failed = True
            self._on_error(error)
        if close:
            with suppress(OSError):
                file.close()
        self._hurry.wait(PAUSE_SECONDS)


def _bad_times(topic: str, *times_ns: int) -> str:
    return (
        f"{topic}: log and publish time {', '.join(map(str, times_ns))} ns: times are integers and"
        " must not be negative"
    )


def _check_custom_data(data: Mapping[str, str]) -> dict[str, str]:
    for name, value in data.items():
        if not (isinstance(name, str) and isinstance(value, str)):
            raise ValueError(f"custom_data holds texts only, got {name!r}: {value!r}")
    return dict(data)
