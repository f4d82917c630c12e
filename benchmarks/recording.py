#!/usr/bin/env python3
"""Bags against the writers of rosbags and mcap and the readers of both: 100,000 messages, raw CDR,
zstd-compressed chunks.

    python3 -m benchmarks.recording

Medians of interleaved repeats in the same process, each into a new file; a read takes every
message of the file in order of log time. Every side writes the same bytes, and the report checks
that every reader gets them all. The log times are 2 ms apart (500 Hz), so this package also
flushes each 500 messages, as its promise demands, and has them put on the disk, which the peers do
not do. The longest single write is given by the clock, in which a busy machine takes its turns,
and in processor time, in which it does not.
"""

import argparse
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer

from benchmarks.rows import tell
from dart_skill.recording import (
    BagReader,
    BagWriter,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)

START_NS = 1_700_000_000_000_000_000
"""Time of the first message [ns]."""
STEP_NS = 2_000_000
"""Time between two messages of a topic [ns]."""
MOST_STALL_MS = 5.0
"""Longest time for which a writer may be kept waiting [ms]."""
TYPES = typestore()


# data


def header(step: int) -> dict:
    sec, nanosec = divmod(START_NS + step * STEP_NS, 10**9)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": "world"}


def poses(count: int, rng: np.random.Generator) -> list[bytes]:
    """CDR of PoseStamped messages (84 bytes) along a random walk."""
    walk = np.cumsum(rng.normal(0.0, 1e-3, (count, 7)), axis=0)
    return [
        serialize(
            TYPES,
            "geometry_msgs/msg/PoseStamped",
            {
                "header": header(step),
                "pose": {
                    "position": dict(zip("xyz", row[:3], strict=True)),
                    "orientation": dict(zip("xyzw", row[3:], strict=True)),
                },
            },
        )
        for step, row in enumerate(walk)
    ]


def joint_states(count: int, rng: np.random.Generator) -> list[bytes]:
    """CDR of JointState messages of seven joints (about 320 bytes) along a random walk."""
    walk, names = (
        np.cumsum(rng.normal(0.0, 1e-3, (count, 3, 7)), axis=0),
        [f"wam/joint_{i}" for i in range(7)],
    )
    return [
        serialize(
            TYPES,
            "sensor_msgs/msg/JointState",
            {
                "header": header(step),
                "name": names,
                "position": row[0],
                "velocity": row[1],
                "effort": row[2],
            },
        )
        for step, row in enumerate(walk)
    ]


# writers: each writes all messages and returns the file


def write_own(folder: Path, type_name: str, messages: list[bytes]) -> Path:
    with BagWriter(folder / "own") as bag:
        bag.add_topic(
            "/topic",
            type_name,
            definition(TYPES, type_name),
            qos_yaml(),
            type_hash(TYPES, type_name),
        )
        stamp = START_NS
        for data in messages:
            bag.write("/topic", stamp, stamp, data)
            stamp += STEP_NS
    return bag.file


def write_rosbags(folder: Path, type_name: str, messages: list[bytes]) -> Path:
    writer = Writer(folder / "rosbags", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connection, stamp = writer.add_connection("/topic", type_name, typestore=TYPES), START_NS
        for data in messages:
            writer.write(connection, stamp, data)
            stamp += STEP_NS
    return folder / "rosbags" / "rosbags.mcap"


def write_mcap(folder: Path, type_name: str, messages: list[bytes]) -> Path:
    file = folder / "mcap.mcap"
    with open(file, "wb") as stream:
        writer, stamp = McapWriter(stream, compression=CompressionType.ZSTD), START_NS
        writer.start("ros2")
        schema = writer.register_schema(
            type_name, "ros2msg", definition(TYPES, type_name).encode()
        )
        channel = writer.register_channel("/topic", "cdr", schema)
        for data in messages:
            writer.add_message(channel, stamp, data, stamp)
            stamp += STEP_NS
        writer.finish()
    return file


# readers: each counts the messages and their bytes


def read_own(file: Path) -> tuple[int, int]:
    with BagReader(file) as bag:
        count = size = 0
        for message in bag.messages(decode=False):
            count, size = count + 1, size + len(message.data)
    return count, size


def read_rosbags(file: Path) -> tuple[int, int]:
    with Reader(file) as reader:
        count = size = 0
        for _connection, _stamp, data in reader.messages():
            count, size = count + 1, size + len(data)
    return count, size


def read_mcap(file: Path) -> tuple[int, int]:
    with open(file, "rb") as stream:
        count = size = 0
        for _schema, _channel, message in make_reader(stream).iter_messages():
            count, size = count + 1, size + len(message.data)
    return count, size


# measurement


def timed(work: Callable) -> tuple[float, object]:
    begin = time.perf_counter()
    result = work()
    return time.perf_counter() - begin, result


def rates(works: dict[str, Callable], count: int, repeats: int) -> dict[str, float]:
    """Median messages per second of each work, the works taking turns so that a disturbance meets
    all of them.
    """
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(repeats):
        for name, work in works.items():
            seconds[name].append(timed(work)[0])
    return {name: count / statistics.median(values) for name, values in seconds.items()}


def in_new_folder(write: Callable, folder: Path, *arguments) -> None:
    place = Path(tempfile.mkdtemp(dir=folder))
    write(place, *arguments)
    shutil.rmtree(place)


@contextmanager
def opened_own(folder: Path, type_name: str, **options) -> Iterator[Callable[[int, bytes], None]]:
    """Writes messages of one topic; so do the next two."""
    with BagWriter(folder / "own", **options) as bag:
        bag.add_topic(
            "/topic",
            type_name,
            definition(TYPES, type_name),
            qos_yaml(),
            type_hash(TYPES, type_name),
        )
        yield lambda stamp, data: bag.write("/topic", stamp, stamp, data)


@contextmanager
def opened_rosbags(folder: Path, type_name: str) -> Iterator[Callable[[int, bytes], None]]:
    writer = Writer(folder / "rosbags", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/topic", type_name, typestore=TYPES)
        yield lambda stamp, data: writer.write(connection, stamp, data)


@contextmanager
def opened_mcap(folder: Path, type_name: str) -> Iterator[Callable[[int, bytes], None]]:
    with open(folder / "mcap.mcap", "wb") as stream:
        writer = McapWriter(stream, compression=CompressionType.ZSTD)
        writer.start("ros2")
        channel = writer.register_channel(
            "/topic",
            "cdr",
            writer.register_schema(type_name, "ros2msg", definition(TYPES, type_name).encode()),
        )
        yield lambda stamp, data: writer.add_message(channel, stamp, data, stamp)
        writer.finish()


def longest_write_ms(
    opened: Callable,
    folder: Path,
    type_name: str,
    messages: list[bytes],
    pace_hz: float,
    **options,
) -> tuple[float, float]:
    """Longest single write of a bag by the clock, and by the processor time that it takes; paced,
    or at 0 Hz as fast as it goes.
    """
    longest, longest_work, begin = 0.0, 0.0, time.perf_counter()
    with opened(Path(tempfile.mkdtemp(dir=folder)), type_name, **options) as write:
        for step, data in enumerate(messages):
            if pace_hz:
                time.sleep(max(0.0, begin + step / pace_hz - time.perf_counter()))
            stamp, before, worked = (
                START_NS + step * STEP_NS,
                time.perf_counter(),
                time.thread_time(),
            )
            write(stamp, data)
            longest, longest_work = (
                max(longest, time.perf_counter() - before),
                max(longest_work, time.thread_time() - worked),
            )
    return 1e3 * longest, 1e3 * longest_work


def report(kind: str, own: str, found: dict[str, float], least_ratio: float = 1.0) -> None:
    for peer in (name for name in found if name != own):
        ratio = found[own] / found[peer]
        print(
            f"{kind:<34}{found[own] / 1e3:>9.0f}k/s{peer:>10}{found[peer] / 1e3:>8.0f}k/s{ratio:>8.2f}   ",
            end="",
        )
        print(f"{least_ratio:g}{', missed' if ratio < least_ratio else ''}")
        ours, beside = f"{found[own] / 1e3:.0f} k/s", f"{peer} {found[peer] / 1e3:.0f} k/s"
        tell(kind, ours, beside, ratio, f"{least_ratio:g}", ratio >= least_ratio)


def compare(folder: Path, name: str, type_name: str, messages: list[bytes], repeats: int) -> None:
    """The rows of one message type."""
    writers = {"dart_skill": write_own, "rosbags": write_rosbags, "mcap": write_mcap}
    readers = {"dart_skill": read_own, "rosbags": read_rosbags, "mcap": read_mcap}
    kept = Path(tempfile.mkdtemp(dir=folder))
    files = {side: write(kept, type_name, messages) for side, write in writers.items()}
    expected = (len(messages), sum(map(len, messages)))
    for side, read in readers.items():
        for file in files.values():
            if read(file) != expected:
                raise SystemExit(
                    f"the comparison is void: {side} does not read all of {file.name}"
                )
    writing = {
        side: lambda write=write: in_new_folder(write, folder, type_name, messages)
        for side, write in writers.items()
    }
    report(
        f"write {name}, {len(messages[0])} B", "dart_skill", rates(writing, len(messages), repeats)
    )
    for source, file in files.items():
        reading = {
            side: lambda read=read, file=file: read(file)
            for side, read in readers.items()
            if side != "mcap"
        }
        report(
            f"read {name}, written by {source}",
            "dart_skill",
            rates(reading, len(messages), repeats),
        )
    sizes = ", ".join(f"{side} {file.stat().st_size / 1e6:.2f} MB" for side, file in files.items())
    print(f"{name}: sizes {sizes}")


def report_stalls(
    folder: Path, name: str, type_name: str, messages: list[bytes], repeats: int
) -> None:
    """Longest single writes, the writers taking turns: median, least and most of the repeats by
    the clock, median of the work.
    """
    fast, paced = dict(pace_hz=0.0), dict(pace_hz=2000.0)
    cases = {
        ("dart_skill", "as fast as it goes"): (opened_own, fast),
        ("rosbags", "as fast as it goes"): (opened_rosbags, fast),
        ("mcap", "as fast as it goes"): (opened_mcap, fast),
        ("dart_skill", "the same, split each 4 MB"): (
            opened_own,
            {**fast, "max_bytes": 4_000_000},
        ),
        ("dart_skill", "2000 per second"): (opened_own, paced),
    }
    found: dict[tuple, list] = {case: [] for case in cases}
    for _ in range(repeats):
        for case, (opened, options) in cases.items():
            chosen = messages[:10_000] if options["pace_hz"] else messages
            found[case].append(longest_write_ms(opened, folder, type_name, chosen, **options))
    for (side, case), pairs in found.items():
        stalls, work = zip(*pairs, strict=True)
        middle = statistics.median(stalls)
        spread = (
            f"least {min(stalls):.2f}, most {max(stalls):.2f}; of work"
            f" {statistics.median(work):.2f}"
        )
        goal = (
            f"   under {MOST_STALL_MS:g} ms{'' if middle < MOST_STALL_MS else ', missed'}"
            if side == "dart_skill"
            else ""
        )
        print(f"longest write, {name:<15}{case:<27}{side:<12}{middle:>7.2f} ms ({spread}){goal}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--messages", type=int, default=100_000, help="messages per bag (default 100000)"
    )
    parser.add_argument("--repeats", type=int, default=5, help="repeats per task (default 5)")
    options, rng = parser.parse_args(), np.random.default_rng(0)
    kinds = [
        ("PoseStamped", "geometry_msgs/msg/PoseStamped", poses(options.messages, rng)),
        ("JointState(7)", "sensor_msgs/msg/JointState", joint_states(options.messages, rng)),
    ]
    print(f"median of {options.repeats} repeats of {options.messages} messages")
    print(f"{'work':<34}{'dart_skill':>12}{'peer':>10}{'':>11}{'ratio':>8}   target")
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            compare(Path(folder), *kind, options.repeats)
        for kind in kinds:
            report_stalls(Path(folder), *kind, options.repeats)


if __name__ == "__main__":
    main()
