"""What is left when a recorder dies: killed at random moments, with a full disk, beyond its
file-size limit.
"""

import errno
import json
import os
import resource
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from dart_skill.recording import BagError, BagReader
from dart_skill.recording.bags import BagWriteError, BagWriter, check_bag, recover
from dart_skill.recording.bags import writer as bag_writer
from tests.paths import ROOT

N_KILLS, SECOND_NS, STEP_NS, MOST_MESSAGES = 50, 1_000_000_000, 2_000_000, 6000
DEFINITION = "float64 x\nfloat64 y\nfloat64 z\n"

RECORDER = """
import json, os, signal, struct, sys
from dart_skill.recording.bags import BagWriter

signal.signal(signal.SIGCHLD, signal.SIG_IGN)
for line in sys.stdin:
    if os.fork() == 0:
        break
else:
    sys.exit()
path, told, flush_at, max_bytes = json.loads(line)
tell = open(told, "wb", buffering=0)
tell.write(struct.pack("<q", os.getpid()))
bag = BagWriter(path, chunk_size=16384, max_bytes=max_bytes)
for topic in ("/a", "/b"):
    bag.add_topic(topic, "geometry_msgs/msg/Point", "float64 x\\nfloat64 y\\nfloat64 z\\n")
step = 0
while True:
    topic = "/b" if step % 5 == 4 else "/a"
    data = b"\\0\\1\\0\\0" + struct.pack("<3d", step, step * 0.5, (step * 2654435761) % 1000003)
    bag.write(topic, step * 2_000_000, step * 1_999_999, data)
    step += 1
    if step == flush_at:
        bag.flush()
        tell.write(struct.pack("<q", -step))
    tell.write(struct.pack("<q", step))
"""
"""Imports once, then becomes a recorder, a process of its own, for every line that it reads."""


def message(step):
    data = b"\0\1\0\0" + struct.pack("<3d", step, step * 0.5, (step * 2654435761) % 1000003)
    return ("/b" if step % 5 == 4 else "/a", step * STEP_NS, step * (STEP_NS - 1), data)


def messages(folder):
    """All messages of a bag, by others' code that checks every CRC: topic, log time, publish time,
    bytes.
    """
    found = []
    for file in sorted(folder.glob("*.mcap"), key=lambda file: int(file.stem.rsplit("_", 1)[1])):
        with open(file, "rb") as stream:
            read = make_reader(stream, validate_crcs=True).iter_messages()
            found += [
                (channel.topic, one.log_time, one.publish_time, one.data)
                for _, channel, one in read
            ]
    return found


def killed_recorder(start, path, n_messages, flush_at, max_bytes):
    """Kill a recorder with SIGKILL once it has said that it wrote so many messages; returns what
    it said last: written, flushed.
    """
    told = path.with_suffix(".told")
    os.mkfifo(told)
    start([str(path), str(told), flush_at, max_bytes])
    written = flushed = 0
    # when it is closed, nobody hears a recorder any more, and it ends
    with open(told, "rb") as said:
        (pid,) = struct.unpack("<q", said.read(8))
        while data := said.read(8):
            (number,) = struct.unpack("<q", data)
            written, flushed = max(written, number), max(flushed, -number)
            if written == n_messages:
                os.kill(pid, signal.SIGKILL)  # what it still says until then counts too
    return written, flushed


@pytest.fixture(scope="module")
def kills(tmp_path_factory):
    """Recorders killed after random numbers of messages: folder, and what they said last."""
    rng, folder = np.random.default_rng(6), tmp_path_factory.mktemp("killed")
    jobs = [
        (
            folder / f"bag{i}",
            int(rng.integers(1, MOST_MESSAGES)),
            int(rng.integers(1, MOST_MESSAGES)),
            65536 * (i % 2),
        )
        for i in range(N_KILLS)
    ]
    with subprocess.Popen(
        [sys.executable, "-c", RECORDER], stdin=subprocess.PIPE, text=True
    ) as recorders:

        def start(job):
            recorders.stdin.write(json.dumps(job) + "\n")
            recorders.stdin.flush()

        return [(job[0], *killed_recorder(start, *job)) for job in jobs]


@pytest.mark.slow
def test_a_recorder_that_is_killed_at_50_random_moments_loses_at_most_the_last_second(
    kills, tmp_path
):
    losses = []
    for i, (path, written, flushed) in enumerate(kills):
        recovery = recover(path, tmp_path / f"recovered{i}")
        kept = messages(recovery.path)
        assert kept == [message(step) for step in range(len(kept))], (
            f"{path.name}: not what was written"
        )
        lost_ns = (written - len(kept)) * STEP_NS
        assert lost_ns <= SECOND_NS, f"{path.name}: {written} written, {len(kept)} kept"
        assert len(kept) >= flushed, f"{path.name}: {flushed} flushed, {len(kept)} kept"
        assert recovery.lost == {} and recovery.unverified == 0, recovery
        losses.append(lost_ns)
    assert max(losses) > 0, (
        "no kill found a recorder with something to lose: the test tests nothing"
    )
    assert any(flushed for _, _, flushed in kills)
    assert any(len(list(path.glob("*.mcap"))) > 1 for path, *_ in kills), "no split bag was killed"


def test_what_was_killed_is_refused_by_name_and_what_was_recovered_is_whole(kills, tmp_path):
    for path, *_ in kills[:12:2]:  # those of one file: a split bag may be killed between two
        with pytest.raises(BagError, match="cut off or damaged.*recover"):
            BagReader(path)
        assert any(finding.severity == "error" for finding in check_bag(path))
        recovery = recover(path, tmp_path / path.name)
        assert [
            str(finding) for finding in check_bag(recovery.path) if finding.severity != "note"
        ] == []
        with BagReader(recovery.path) as bag:
            assert bag.message_count == sum(recovery.messages.values())


# a disk that takes no more


def write_until_it_fails(bag, most=200_000):
    """The error, and how many messages were taken before it."""
    rng = np.random.default_rng(0)
    for step in range(most):
        try:
            bag.write("/a", step * STEP_NS, step * STEP_NS, b"\0\1\0\0" + rng.bytes(24))
        except BagWriteError as error:
            return error, step
    raise AssertionError(f"{most} messages and no error")


def check_full(path, expected_errno):
    """Fill a bag until the disk refuses; everything that the issue of a full disk promises."""
    bag = BagWriter(path, chunk_size=8192)
    bag.add_topic("/a", "geometry_msgs/msg/Point", DEFINITION)
    error, n_taken = write_until_it_fails(bag)
    assert error.errno == expected_errno and error.filename == str(bag.file)
    assert "writing of the bag stopped" in str(error) and "dart-skill bag recover" in str(error)
    for again in (
        lambda: bag.write("/a", 0, 0, b"\0\1\0\0"),
        bag.flush,
        lambda: bag.add_attachment("a", b"x"),
    ):
        with pytest.raises(BagWriteError) as caught:
            again()
        assert str(caught.value) == str(error)
    size = bag.file.stat().st_size
    bag.close()
    bag.close()
    assert bag.file.stat().st_size >= size
    assert not list(bag.path.glob("*.tmp"))
    return bag, error, n_taken


CHILD = """
import resource, signal, sys
from pathlib import Path
sys.path.insert(0, {folder!r})
from tests.unit.recording.test_survives import check_full
resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, 400_000))
bag, error, n_taken = check_full(Path(sys.argv[1]), {code})
print(n_taken, str(error).split("; ")[1].split()[0])
"""


def test_a_file_that_may_not_grow_leaves_a_bag_with_all_but_the_last_chunk(tmp_path):
    code = CHILD.format(folder=str(ROOT), code=errno.EFBIG)
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "bag")],
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert done.returncode == 0, done.stderr
    n_taken, n_safe = map(int, done.stdout.split())
    assert 0 < n_taken - n_safe < 2 * 8192 / 60, (n_taken, n_safe)
    recovery = recover(tmp_path / "bag", tmp_path / "recovered")
    assert recovery.messages == {"/a": n_safe}
    assert [one[1] for one in messages(recovery.path)] == [
        step * STEP_NS for step in range(n_safe)
    ]


def test_a_full_disk_leaves_a_bag_with_all_but_the_last_chunk(tmp_path):
    """On a file system of 300 kB of our own, where the system lets us have one."""
    saved = Path("/dev/shm") / f"{os.getpid()}_saved"
    script = (
        f'mount -t tmpfs -o size=300k none {tmp_path} && exec {sys.executable} -c "$0"'
        f" {tmp_path}/bag {saved}"
    )
    code = CHILD.format(folder=str(ROOT), code=errno.ENOSPC).replace("400_000", "40_000_000")
    code += "import shutil\nfrom dart_skill.recording.bags import recover\n"
    code += "print(recover(bag.path, sys.argv[2]).messages['/a'])\nshutil.rmtree(sys.argv[2])\n"
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", script, code], capture_output=True, text=True, timeout=100
    )
    if done.returncode and ("unshare" in done.stderr or "mount" in done.stderr):
        pytest.skip(f"no file system of our own: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    n_taken, n_safe, n_recovered = map(int, done.stdout.split())
    assert n_recovered == n_safe and 0 < n_taken - n_safe < 2 * 8192 / 60, done.stdout


class FailingStream:
    """A file that takes so many bytes and no more."""

    def __init__(self, stream, room):
        self._stream, self.room = stream, room

    def write(self, data):
        data = bytes(data[: max(0, self.room)])
        if not data:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self.room -= len(data)
        return self._stream.write(data)

    def __getattr__(self, name):
        return getattr(self._stream, name)


def open_bag(path):
    """A bag with 40 messages in its file, and the size of the file."""
    bag = BagWriter(path)
    bag.add_topic("/a", "geometry_msgs/msg/Point", DEFINITION)
    for step in range(40):
        bag.write("/a", step, step, message(step)[3])
    bag.flush()
    return bag, bag.file.stat().st_size


@pytest.mark.parametrize("part", np.linspace(0.0, 0.999, 12))
def test_a_disk_that_is_full_while_the_bag_is_closed_is_one_error_and_leaves_the_messages(
    tmp_path, part
):
    whole, size = open_bag(tmp_path / "whole" / "bag")
    whole.close()
    bag, size_again = open_bag(tmp_path / "bag")
    assert size == size_again
    bag._file.stream = FailingStream(
        bag._file.stream, room=int(part * (whole.file.stat().st_size - size)) - 10
    )
    with pytest.raises(BagWriteError, match="No space left.*40 messages, until log time 39 ns"):
        bag.close()
    bag.close()
    assert not list(bag.path.glob("metadata*"))
    assert recover(bag.path, tmp_path / "recovered").messages == {"/a": 40}


def test_a_disk_with_room_again_gets_a_whole_bag_that_says_what_happened(tmp_path):
    bag = BagWriter(tmp_path / "bag", chunk_size=4096)
    bag.add_topic("/a", "geometry_msgs/msg/Point", DEFINITION)
    bag._file.stream = FailingStream(bag._file.stream, 5000)
    write_until_it_fails(bag)
    bag._file.stream.room = 10**6
    bag.close()
    with BagReader(bag.path) as reader:
        assert 0 < reader.message_count < bag.counts["/a"]
        assert "No space left" in reader.custom_data["writing_stopped"]
    assert [finding.severity for finding in check_bag(bag.path)] == ["warning"]


def test_a_disk_without_room_for_the_next_file_leaves_the_files_before_whole(
    tmp_path, monkeypatch
):
    bag = BagWriter(tmp_path / "bag", max_duration_ns=100 * STEP_NS)
    bag.add_topic("/a", "geometry_msgs/msg/Point", DEFINITION)
    for step in range(200):
        bag.write("/a", step * STEP_NS, 0, message(step)[3])

    def no_room(*_arguments, **_options):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(bag_writer, "McapFile", no_room)
    for _ in range(2):
        with pytest.raises(
            BagWriteError, match=f"200 messages, until log time {199 * STEP_NS} ns.*bag_1.mcap"
        ):
            bag.write("/a", 200 * STEP_NS, 0, message(200)[3])
    bag.close()
    with BagReader(bag.path) as reader:
        assert [m.stamp_ns for m in reader.messages(decode=False)] == [
            step * STEP_NS for step in range(200)
        ]
        assert "No space left" in reader.custom_data["writing_stopped"]


def test_a_disk_that_fails_behind_our_back_is_told_by_the_next_call(tmp_path, monkeypatch):
    """What fdatasync reports in its thread surfaces where the recorder can see it."""
    bag = BagWriter(tmp_path / "bag")
    bag.add_topic("/a", "geometry_msgs/msg/Point", DEFINITION)
    bag.write("/a", 0, 0, message(0)[3])
    bag.flush(to_disk=True)

    def fail(_descriptor):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr(os, "fdatasync", fail)
    bag.write("/a", 1, 1, message(1)[3])
    with pytest.raises(BagWriteError, match="Input/output error"):
        bag.flush(to_disk=True)
    with pytest.raises(BagWriteError, match="Input/output error"):
        bag.write("/a", 2, 2, message(2)[3])
    bag.close()
    assert [one[1] for one in messages(bag.path)] == [0, 1]


def test_the_file_size_limit_is_known_here():
    """The child of the test above relies on a signal that Python ignores."""
    assert signal.getsignal(signal.SIGXFSZ) == signal.SIG_IGN
    assert resource.getrlimit(resource.RLIMIT_FSIZE)
