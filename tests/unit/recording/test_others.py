"""Bags between programs: ours read by others' code with every message equal, theirs read and
planned for playing by ours.

The viewer Rerun is asked too where there is one: `rerun` on the path, or the executable that
DART_SKILL_RERUN names (docs/bags.md).
"""

import os
import re
import shutil
import subprocess

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.highlevel import AnyReader
from rosbags.interfaces import (
    Nodetype,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from dart_skill.arm import fixed_transforms, joint_transforms, the_arm, write_urdf
from dart_skill.recording import (
    BagReader,
    BagWriter,
    definition,
    deserialize,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.bags import Playback, PlaybackSelection
from tests.unit.recording.bag_files import mcap_file

POSE, TEXT, STATE, TF = (
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/msg/String",
    "sensor_msgs/msg/JointState",
    "tf2_msgs/msg/TFMessage",
)
TYPES = typestore()
OWN = sorted(name for name in TYPES.fielddefs if name.startswith("dart_skill_msgs/msg/"))
START_NS, STEP_NS = 1_700_000_000_000_000_000, 20_000_000


def random_content(type_name, rng):
    """A message of any type with something in every field."""
    return {name: random_field(*kind, rng) for name, kind in TYPES.fielddefs[type_name][1]}


def random_field(node, detail, rng):
    if node == Nodetype.NAME:
        return random_content(detail, rng)
    if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        length = detail[1] if node == Nodetype.ARRAY else int(rng.integers(0, 4))
        return [random_field(*detail[0], rng) for _ in range(length)]
    kind = detail[0]
    if kind == "string":
        return "".join(map(chr, rng.integers(0x20, 0x3FF, size=rng.integers(0, 9))))
    if kind == "bool":
        return bool(rng.integers(2))
    if kind.startswith("float"):
        return float(np.float32(rng.normal()))
    limits = np.iinfo("uint8" if kind in ("byte", "char", "octet") else kind)
    return int(rng.integers(limits.min, limits.max, dtype=limits.dtype, endpoint=True))


def plain(value):
    """Message objects of any library as nested lists and dictionaries, to compare their content."""
    if isinstance(value, (str, bool, int, float)):
        return value
    if isinstance(value, bytes):
        return list(value)  # what some libraries make of uint8[]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    names = getattr(value, "__slots__", None) or vars(value)
    return {
        name: plain(getattr(value, name))
        for name in names
        if not name.startswith("__") and not name.isupper()
    }


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A bag of ours in several files with every message type of our package, and what was written:
    topic, log time, type, bytes.
    """
    path, rng, written = tmp_path_factory.mktemp("ours") / "bag", np.random.default_rng(0), []
    topics = {
        f"/{type_name.rsplit('/', 1)[1].lower()}": type_name
        for type_name in [*OWN, POSE, TEXT, STATE]
    }
    with BagWriter(path, max_bytes=60_000, chunk_size=8192) as writer:
        for topic, type_name in topics.items():
            writer.add_topic(
                topic,
                type_name,
                definition(TYPES, type_name),
                qos_yaml(),
                type_hash(TYPES, type_name),
            )
        for step in range(12):
            for place, (topic, type_name) in enumerate(topics.items()):
                stamp, data = (
                    START_NS + step * STEP_NS + place,
                    serialize(TYPES, type_name, random_content(type_name, rng)),
                )
                writer.write(topic, stamp, stamp - 5, data)
                written.append((topic, stamp, type_name, data))
    assert len(list(path.glob("*.mcap"))) > 1
    return path, written


# ours, read by others


@pytest.mark.slow
def test_rosbags_reads_every_type_of_ours_equal(bag):
    path, written = bag
    with Reader(path) as reader:
        assert [
            (one.topic, stamp, one.msgtype, bytes(data)) for one, stamp, data in reader.messages()
        ] == written
    with AnyReader([path]) as reader:  # with the definitions in the bag
        for (one, _, data), (*_, type_name, ours) in zip(reader.messages(), written, strict=True):
            assert plain(reader.deserialize(data, one.msgtype)) == plain(
                deserialize(TYPES, type_name, ours)
            ), type_name
        assert {one.msgtype: one.digest for one in reader.connections} == {
            name: type_hash(TYPES, name) for *_, name, _ in written
        }


def test_mcap_reads_every_message_of_ours_equal(bag):
    path, written = bag
    read = []
    for file in sorted(path.glob("*.mcap"), key=lambda file: int(file.stem.rsplit("_", 1)[1])):
        with open(file, "rb") as stream:
            for schema, channel, message in make_reader(
                stream, validate_crcs=True
            ).iter_messages():
                assert message.publish_time == message.log_time - 5
                read.append((channel.topic, message.log_time, schema.name, message.data))
    assert read == written


def test_mcap_ros2_support_decodes_every_type_of_ours_equal(bag):
    path, written = bag
    read = []
    for file in sorted(path.glob("*.mcap"), key=lambda file: int(file.stem.rsplit("_", 1)[1])):
        with open(file, "rb") as stream:
            for schema, channel, message, decoded in make_reader(
                stream, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages():
                read.append((channel.topic, message.log_time, schema.name, plain(decoded)))
    assert read == [
        (topic, stamp, name, plain(deserialize(TYPES, name, data)))
        for topic, stamp, name, data in written
    ]


# theirs, played by ours


def texts(count=200):
    """Topic, log time and bytes of messages on two topics."""
    for k in range(count):
        yield (
            ("/said", "/heard")[k % 3 == 0],
            START_NS + k * STEP_NS,
            serialize(TYPES, TEXT, {"data": f"text {k}"}),
        )


def by_rosbags(path, plugin):
    forever = QosTime(2**31 - 1, 2**32 - 1)
    latched = Qos(
        QosHistory.KEEP_LAST, 7, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, forever, forever,
        QosLiveliness.AUTOMATIC, forever, False,
    )  # fmt: skip
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections = {
            topic: writer.add_connection(
                topic,
                TEXT,
                typestore=TYPES,
                offered_qos_profiles=[latched] if topic == "/said" else [],
            )
            for topic in ("/said", "/heard")
        }
        for topic, stamp, data in texts():
            writer.write(connections[topic], stamp, data)
    return path


def by_mcap(path, **options):
    topics = ("/said", "/heard")
    return mcap_file(
        path,
        [(topic, TEXT) for topic in topics],
        [(topics.index(topic), stamp, data) for topic, stamp, data in texts()],
        chunk_size=2000,
        **options,
    )


def by_mcap_ros2_support(path):
    with open(path, "wb") as stream:
        writer = Ros2Writer(stream)
        schema = writer.register_msgdef(TEXT, definition(TYPES, TEXT))
        for topic, stamp, data in texts():
            writer.write_message(
                topic, schema, {"data": deserialize(TYPES, TEXT, data).data}, stamp, stamp
            )
        writer.finish()
    return path


THEIRS = {
    "rosbags, mcap": lambda folder: by_rosbags(folder / "bag", StoragePlugin.MCAP),
    "rosbags, sqlite3": lambda folder: by_rosbags(folder / "bag", StoragePlugin.SQLITE3),
    "mcap, zstd": lambda folder: by_mcap(folder / "bag.mcap"),
    "mcap, lz4": lambda folder: by_mcap(folder / "bag.mcap", compression=CompressionType.LZ4),
    "mcap, no chunks": lambda folder: by_mcap(folder / "bag.mcap", use_chunking=False),
    "mcap-ros2-support": lambda folder: by_mcap_ros2_support(folder / "bag.mcap"),
}


@pytest.mark.parametrize("writer", THEIRS)
def test_bags_of_others_are_planned_message_by_message(tmp_path, writer):
    expected = list(texts())
    with BagReader(THEIRS[writer](tmp_path)) as reader:
        playback = Playback(reader, PlaybackSelection(clock_rate=0.0))
        assert {topic: info.type_name for topic, info in playback.topics.items()} == {
            "/said": TEXT,
            "/heard": TEXT,
        }
        due = [(one.topic, one.stamp_ns, one.position_ns, bytes(one.data)) for one in playback]
        assert due == [(topic, stamp, stamp - START_NS, data) for topic, stamp, data in expected]
        part = Playback(
            reader,
            PlaybackSelection(
                ["/said"], remap={"/said": "/new"}, start=1.0, duration=1.0, clock_rate=0.0
            ),
        )
        since, until = START_NS + 10**9, START_NS + 2 * 10**9
        assert [(one.topic, one.stamp_ns) for one in part] == [
            ("/new", s) for t, s, _ in expected if t == "/said" and since <= s <= until
        ]
        if writer.startswith("rosbags"):
            (quality,) = playback.topics["/said"].qos
            assert (quality.reliability, quality.durability, quality.depth) == (
                QosReliability.RELIABLE,
                QosDurability.TRANSIENT_LOCAL,
                7,
            )
            assert playback.topics["/said"].type_hash == type_hash(TYPES, TEXT)


# the viewer Rerun


@pytest.fixture(scope="module")
def rerun():
    """Calls the command line of Rerun."""
    executable = os.environ.get("DART_SKILL_RERUN") or shutil.which("rerun")
    if executable is None:
        pytest.skip(
            "no 'rerun' on the path, and DART_SKILL_RERUN names none: see 'Rerun' in docs/bags.md"
        )

    def call(*arguments):
        done = subprocess.run(
            [executable, *map(str, arguments)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)

    return call


def tf_content(transforms, stamp):
    return {
        "transforms": [
            {
                "header": {"stamp": stamp, "frame_id": one.parent},
                "child_frame_id": one.child,
                "transform": {
                    "translation": dict(zip("xyz", one.translation.tolist(), strict=True)),
                    "rotation": dict(zip("xyzw", one.quaternion.tolist(), strict=True)),
                },
            }
            for one in transforms
        ]
    }


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A bag of an arm that moves, as the recorder writes it: description, transforms, joint
    states.
    """
    path, arm = tmp_path_factory.mktemp("scene") / "bag", the_arm()
    topics = {
        "/robot_description": TEXT,
        "/tf_static": TF,
        "/tf": TF,
        "/joint_states": STATE,
        "/demonstrations": OWN[0],
    }
    with BagWriter(path, chunk_size=16_384) as bag:
        for topic, type_name in topics.items():
            bag.add_topic(
                topic,
                type_name,
                definition(TYPES, type_name),
                qos_yaml(),
                type_hash(TYPES, type_name),
            )

        def write(topic, stamp_ns, content):
            bag.write(topic, stamp_ns, stamp_ns, serialize(TYPES, topics[topic], content))

        write("/robot_description", START_NS, {"data": write_urdf(arm)})
        stamp = {"sec": START_NS // 10**9}
        write("/tf_static", START_NS, tf_content(fixed_transforms(arm, "world"), stamp))
        write("/demonstrations", START_NS, random_content(OWN[0], np.random.default_rng(0)))
        for step in range(300):
            now = START_NS + step * STEP_NS
            stamp = dict(zip(("sec", "nanosec"), divmod(now, 10**9), strict=True))
            angles = np.full(7, 0.005 * step)
            write(
                "/joint_states",
                now,
                {
                    "header": {"stamp": stamp},
                    "name": [f"wam_j{k}" for k in range(1, 8)],
                    "position": angles,
                },
            )
            write("/tf", now, tf_content(joint_transforms(arm, angles), stamp))
    with BagReader(path) as bag:
        return bag.files[0].path, {topic: info.count for topic, info in bag.topics.items()}


def test_rerun_counts_every_message_and_finds_no_fault(scene, rerun):
    file, counts = scene
    said = rerun("mcap", "info", file)
    assert f"Messages                 {sum(counts.values())}" in said
    assert {
        topic: int(count)
        for topic, count in re.findall(r"^ *\d+ +(/\S+) +(\d+) ", said, re.MULTILINE)
    } == counts
    said = rerun("mcap", "check", file)
    assert set(re.findall(r"^(\w+) +\d+ +\d+ +/\S+", said, re.MULTILINE)) == {"ok"}, said


def test_rerun_shows_an_arm_that_moves(scene, rerun, tmp_path):
    """Geometry of the arm's links from /robot_description, and a transform of each link at each
    instant.
    """
    file, counts = scene
    rerun("mcap", "convert", file, "-o", tmp_path / "bag.rrd")
    entities = rerun("rrd", "stats", tmp_path / "bag.rrd")
    for link in ("wam_base", "wam_link4", "bhand_base"):
        assert f"/wam/visual_geometries/{link}/visual_0" in entities
    said = rerun("rrd", "print", "-vvv", "--entity", "/tf", tmp_path / "bag.rrd")
    for parent, link in (("wam_base", "wam_link1"), ("wam_link6", "wam_link7")):
        turned = re.findall(rf"\[{link}\] +┆ \[{parent}\] +┆ \[\[([-+.e0-9, ]+)\]\]", said)
        assert len(turned) == counts["/tf"] == len(set(turned)), (
            f"{link}: {len(turned)} orientations, {len(set(turned))} different ones"
        )
