#!/usr/bin/env python3
"""What check, learn and recover take of time and memory with bags of growing size, as a long day
of recording makes them.

    source tools/env.sh && python3 -m benchmarks.graph.large_bags --sizes 0.1 0.3 1 3 10

A bag repeats the streams of bags/demonstrations with later stamps, 13 demonstrations every 68 s of
its clock: poses of three bodies, joint states, commands, transforms, demonstrations, in one file.
Each command runs in a process of its own. Memory is the most that was resident at a time, with
pages of files. `learn` remembers as many demonstrations as it does by itself. For `recover` the
end of the file is cut off, with a part of its last chunk.
"""

import argparse
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from dart_skill.common.constants import REMEMBERED

BAG = Path(__file__).parents[2] / "bags" / "demonstrations"
GIGABYTE = 1_000_000_000
BEGIN = 10_000
"""Time at which the clock of a bag begins [s]."""
PERIOD = 68
"""Duration of a repetition [s]."""
END = 100_000
"""Time up to which all stamps have the same number of digits [s]."""
DIGITS = 14
"""Of a stamp in the id of a demonstration."""
ONCE = "/robot_description", "/tf_static"
"""Topics of which a recording has one message, however long it is."""
CUT = 50_000
"""So many bytes before its summary are cut off [bytes]."""
COMMANDS = "check", "learn", "recover"
PROGRAM = "-m", "dart_skill.cli"


class Cost(NamedTuple):
    """Of a process: time by the clock [s], processor time [s], most resident memory [bytes], and
    what it printed.
    """

    clock: float
    processor: float
    memory: float
    said: str


def cost_of(arguments: list[str]) -> Cost:
    """Run a command to its end. This process stays small: what it holds counts for its children
    until they begin.
    """
    begun = time.monotonic()
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen([sys.executable, *arguments], stdout=said)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        text = said.read()
    if process.returncode:
        sys.exit(f"{' '.join(arguments)} ended with status {process.returncode}: {text[-500:]}")
    factor = 1 if sys.platform == "darwin" else 1024
    return Cost(
        time.monotonic() - begun, usage.ru_utime + usage.ru_stime, factor * usage.ru_maxrss, text
    )


# a long bag, in a process of its own


def times_in(message: Any) -> Iterator[Any]:
    """Every stamp of a message that is set; durations are none."""
    for value in vars(message).values() if hasattr(message, "__dict__") else ():
        if type(value).__name__.endswith("builtin_interfaces__msg__Time"):
            if value.sec or value.nanosec:
                yield value
        elif isinstance(value, list):
            for one in value:
                yield from times_in(one)
        else:
            yield from times_in(value)


class Streams:
    """The messages of a bag as one row of bytes, and where the seconds of their stamps stand in
    it.
    """

    def __init__(self, bag: Any, topics: set[str]):
        import numpy as np

        data, seconds, ids = [], [], []
        self.rows = []
        place = 0
        for topic, type_name, stamp, payload in bag.messages(topics, decode=False):
            payload, its, where = self._places(bag.types, type_name, payload)
            seconds += [(place + one, second) for one, second in its]
            ids += [] if where is None else [(place + where, stamp)]
            self.rows.append((topic, stamp, place, place + len(payload)))
            data.append(payload)
            place += len(payload)
        self._data = np.frombuffer(b"".join(data), dtype=np.uint8).copy()
        self._places_of_seconds, self._seconds = np.array(seconds, dtype=np.int64).T
        self._ids = ids

    @staticmethod
    def _places(
        types: Any, type_name: str, payload: bytes
    ) -> tuple[bytes, list[tuple[int, int]], int | None]:
        """A message, place and value of the seconds of its stamps in it, and place of the stamp in
        its id if it is a demonstration.
        """
        from dart_skill.recording.bags import is_stamped

        if is_stamped(types, type_name) and not type_name.endswith("/Demonstration"):
            return payload, [(4, struct.unpack_from("<i", payload, 4)[0])], None
        message = types.deserialize_cdr(payload, type_name)
        where = None
        if type_name.endswith("/Demonstration"):
            message.id = "demonstration_" + DIGITS * "0"
        before = bytes(types.serialize_cdr(message, type_name))
        for one in times_in(message):
            one.sec += 1  # all are small: only the lowest byte of the seconds changes
        after = bytes(types.serialize_cdr(message, type_name))
        its = [
            (k, struct.unpack_from("<i", before, k)[0])
            for k, (a, b) in enumerate(zip(before, after, strict=True))
            if a != b
        ]
        if type_name.endswith("/Demonstration"):
            where = before.index(message.id.encode()) + len("demonstration_")
        return before, its, where

    def later(self, seconds: int) -> Iterator[tuple[str, int, bytes]]:
        """Topic, stamp [ns] and bytes of each message, so much later [s]."""
        import numpy as np

        shifted = (self._seconds + seconds).astype("<i4").view(np.uint8).reshape(-1, 4)
        self._data[self._places_of_seconds[:, None] + np.arange(4)] = shifted
        for place, stamp in self._ids:
            self._data[place : place + DIGITS] = np.frombuffer(
                f"{stamp + seconds * GIGABYTE:0{DIGITS}d}".encode(), dtype=np.uint8
            )
        data, by = self._data.tobytes(), seconds * GIGABYTE
        for topic, stamp, begin, end in self.rows:
            yield topic, stamp + by, data[begin:end]


def make(path: Path, size: float) -> None:
    """A bag of about so many bytes; prints how many messages and demonstrations it has."""
    from dart_skill.recording import BagReader, BagWriter, definition, qos_yaml

    with BagReader(BAG) as bag, BagWriter(path, max_bytes=0) as writer:
        filled = {name: one for name, one in bag.topics.items() if one.count}
        for name, one in filled.items():
            writer.add_topic(
                name,
                one.type_name,
                definition(bag.types, one.type_name),
                qos_yaml(),
                one.type_hash,
            )
        for name, _, _, data in bag.messages(set(ONCE) & filled.keys(), decode=False):
            writer.write(
                name, bag.start_ns + BEGIN * GIGABYTE, bag.start_ns + BEGIN * GIGABYTE, data
            )
        streams, seconds = Streams(bag, set(filled) - set(ONCE)), BEGIN
        while seconds == BEGIN or writer.file.stat().st_size < size:
            for topic, stamp, data in streams.later(seconds):
                writer.write(topic, stamp, stamp, data)
            seconds += PERIOD
            if seconds + PERIOD + 20 > END:
                sys.exit(
                    f"a day has no more than {writer.file.stat().st_size / GIGABYTE:.1f} GB: give"
                    " smaller --sizes"
                )
    print(
        json.dumps(
            {
                "messages": sum(writer.counts.values()),
                "demonstrations": writer.counts["/demonstrations"],
            }
        )
    )


def cut_off(path: Path) -> None:
    """Leave the bag as a power cut does."""
    (path / "metadata.yaml").unlink()
    (file,) = path.glob("*.mcap")
    with file.open("rb") as stream:
        stream.seek(-28, os.SEEK_END)
        (summary,) = struct.unpack("<Q", stream.read(8))
    os.truncate(file, summary - CUT)


# measurement


def learned_from(path: Path, folder: Path) -> tuple[Cost, int]:
    """Cost of a model of a bag, and of how many demonstrations it is."""
    cost = cost_of([*PROGRAM, "learn", str(path), "--output", str(folder / "model.npz"), "--json"])
    return cost, len(json.loads(cost.said)["learned_from"])


def recovered(path: Path, folder: Path) -> tuple[Cost, int]:
    """Cost of a new bag of one that is cut off, and how many messages are in it."""
    cut_off(path)
    cost = cost_of(
        [*PROGRAM, "bag", "recover", str(path), "--output", str(folder / "whole"), "--json"]
    )
    return cost, json.loads(cost.said)["message_count"]


def measure(folder: Path, gigabytes: float, commands: list[str]) -> dict[str, Any]:
    """Costs of commands, and what they said, of a bag of one size; the script ends if one of them
    went wrong.
    """
    path = folder / "bag"
    costs = {"make": cost_of([__file__, "--make", str(path), "--sizes", str(gigabytes)])}
    made = json.loads(costs["make"].said)
    found = {"size": sum(file.stat().st_size for file in path.iterdir()), **made}
    if "check" in commands:
        costs["check"] = cost_of([*PROGRAM, "bag", "check", str(path)])
    if "learn" in commands:
        costs["learn"], count = learned_from(path, folder)
        if count != min(made["demonstrations"], REMEMBERED):
            sys.exit(f"of {made['demonstrations']} demonstrations {count} were learned from")
    if "recover" in commands:
        costs["recover"], count = recovered(path, folder)
        if not made["messages"] - 2000 < count < made["messages"]:
            sys.exit(f"of {made['messages']} messages {count} were recovered")
    return found | {
        name: {"clock": one.clock, "processor": one.processor, "memory": one.memory}
        for name, one in costs.items()
    }


def told(cost: dict[str, float] | None) -> str:
    """Of one command in a row of the table."""
    return (
        f"{cost['clock']:9.1f} s{cost['processor']:8.1f} s{1e-6 * cost['memory']:7.0f} MB"
        if cost
        else f"{'':29}"
    )


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--sizes",
        type=float,
        nargs="+",
        default=[0.1, 0.3, 1.0],
        metavar="GB",
        help="of the bags (default 0.1 0.3 1)",
    )
    parser.add_argument(
        "--commands",
        nargs="+",
        choices=COMMANDS,
        default=COMMANDS,
        help="that are measured (default: all)",
    )
    parser.add_argument(
        "--results", type=Path, metavar="FILE", help="write the numbers there, as JSON"
    )
    parser.add_argument("--make", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.make:
        return make(options.make, options.sizes[0] * GIGABYTE)
    found = []
    print(
        f"{'bag':>8}{'messages':>13}{'demonstrations':>16}"
        + "".join(f"{name:>29}" for name in ("make", *COMMANDS)),
        flush=True,
    )
    for gigabytes in options.sizes:
        if shutil.disk_usage(tempfile.gettempdir()).free < 2.5e9 * gigabytes:
            sys.exit(
                f"{tempfile.gettempdir()} has no room for two bags of {gigabytes} GB: name another"
                " folder with TMPDIR"
            )
        with tempfile.TemporaryDirectory() as folder:
            one = measure(Path(folder), gigabytes, options.commands)
        found.append(one)
        costs = "".join(told(one.get(name)) for name in ("make", *COMMANDS))
        print(
            f"{one['size'] / GIGABYTE:5.2f}"
            f" GB{one['messages']:>13}{one['demonstrations']:>16}{costs}",
            flush=True,
        )
        if options.results:
            options.results.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
