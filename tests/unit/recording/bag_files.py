"""Files of bags in the forms in which others write them, made by the libraries below rosbag2:
`mcap` and SQLite.
"""

import sqlite3
from contextlib import closing

import yaml
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType, Writer

from dart_skill.recording import (
    BagWriter,
    definition,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)

TYPES = typestore()
POSE, STRING, START_NS, STEP_NS = (
    "geometry_msgs/msg/PoseStamped",
    "std_msgs/msg/String",
    10**18,
    10_000_000,
)
POSE_CDR = serialize(
    TYPES, POSE, {"header": {"frame_id": "world"}, "pose": {"position": {"x": 3.0}}}
)
mcap_ways = st.fixed_dictionaries(
    {
        "chunk_size": st.sampled_from([1, 300, 10**6]),
        "compression": st.sampled_from(CompressionType),
        "index_types": st.sampled_from(
            [IndexType.NONE, IndexType.MESSAGE, IndexType.CHUNK, IndexType.ALL]
        ),
        **{
            name: st.booleans()
            for name in (
                "repeat_channels",
                "repeat_schemas",
                "use_chunking",
                "use_statistics",
                "use_summary_offsets",
                "enable_crcs",
                "enable_data_crcs",
            )
        },
    }
)
"""How `mcap` may write a file."""
_SCHEMAS = {
    1: [
        "topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL)"
    ],
    2: [
        "topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,"
        " offered_qos_profiles TEXT NOT NULL)"
    ],
}
_SCHEMAS[3] = [
    *_SCHEMAS[2],
    "schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)",
    "metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL)",
]
_SCHEMAS[4] = [
    _SCHEMAS[2][0].replace("NOT NULL)", "NOT NULL, type_description_hash TEXT NOT NULL)"),
    *_SCHEMAS[3][1:],
    (
        "message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT,"
        " encoded_message_definition TEXT, hash TEXT)"
    ),
]


def stamps(count=20, start_ns=START_NS, step_ns=STEP_NS):
    return [start_ns + k * step_ns for k in range(count)]


def write_bag(path, messages):
    """A bag of ours with (topic, type, stamp, content or bytes), in order of stamps."""
    with BagWriter(path) as bag:
        for topic, name in dict.fromkeys((topic, name) for topic, name, *_ in messages):
            bag.add_topic(topic, name, definition(TYPES, name), qos_yaml(), type_hash(TYPES, name))
        for topic, name, stamp, content in sorted(messages, key=lambda item: item[2]):
            data = content if isinstance(content, bytes) else serialize(TYPES, name, content)
            bag.write(topic, stamp, stamp, data)
    return path


def mcap_file(path, channels, messages, profile="ros2", library="try", **options):
    """channels: topic, type, and what differs from CDR with a definition (encoding, schema, text,
    metadata).

    messages: channel, time, bytes, and a sequence number if there is one.
    """
    with open(path, "wb") as stream:
        writer = Writer(stream, **options)
        writer.start(profile, library=library)
        numbers = []
        for topic, type_name, *rest in channels:
            told = rest[0] if rest else {}
            text = told["text"] if "text" in told else definition(TYPES, type_name)
            schema = (
                writer.register_schema(type_name, told.get("schema", "ros2msg"), text.encode())
                if told.get("schema", "x")
                else 0
            )
            numbers.append(
                writer.register_channel(
                    topic, told.get("encoding", "cdr"), schema, told.get("metadata", {})
                )
            )
        for channel, stamp, data, *sequence in messages:
            writer.add_message(numbers[channel], stamp, data, stamp, *sequence)
        writer.finish()
    return path


def sqlite_file(path, topics, messages, version=4, definitions=(), wal=False):
    """topics: name, type, QoS, encoding; messages: topic, time, bytes; version: of rosbag2's
    tables.

    wal: leave a write-ahead log.
    """
    path.unlink(missing_ok=True)
    with closing(sqlite3.connect(path)) as database:
        for table in [
            *_SCHEMAS[version],
            "messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)",
        ]:
            database.execute(f"CREATE TABLE {table}")
        database.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        for number, (name, type_name, qos, encoding) in enumerate(topics, start=1):
            values = [number, name, type_name, encoding, qos, "RIHS01_0"][
                : {1: 4, 2: 5, 3: 5, 4: 6}[version]
            ]
            database.execute(f"INSERT INTO topics VALUES ({', '.join('?' * len(values))})", values)
        for number, told in enumerate(definitions, start=1):
            database.execute(
                "INSERT INTO message_definitions VALUES (?, ?, ?, ?, ?)", (number, *told, "")
            )
        database.commit()
        if wal:
            database.execute("PRAGMA journal_mode = WAL")
            database.execute("PRAGMA wal_autocheckpoint = 0")
        database.executemany(
            "INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)",
            [(t + 1, s, d) for t, s, d in messages],
        )
        database.commit()
        if wal:
            kept = [
                (file, file.read_bytes()) for file in (path, path.with_name(path.name + "-wal"))
            ]
    if wal:  # as a recorder leaves it that was killed
        for file, data in kept:
            file.write_bytes(data)
    return path


def metadata_of(
    version, files, topics, count, start_ns=START_NS, length_ns=19 * STEP_NS, storage="sqlite3"
):
    """Metadata as rosbag2 wrote them in a version: what it did not know then is missing."""
    times = {
        "duration": {"nanoseconds": length_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": count,
    }
    told = {
        "version": version,
        "storage_identifier": storage,
        "relative_file_paths": files,
        **times,
        "topics_with_message_count": [],
    }
    for name, type_name, topic_count in topics:
        topic = {"name": name, "type": type_name, "serialization_format": "cdr"}
        if version >= 4:
            topic["offered_qos_profiles"] = (
                "- history: 1\n  depth: 5\n"
                if version < 9
                else [{"history": "keep_last", "depth": 5}]
            )
        if version >= 7:
            topic["type_description_hash"] = "RIHS01_1"
        told["topics_with_message_count"].append(
            {"topic_metadata": topic, "message_count": topic_count}
        )
    later = {
        3: {"compression_format": "", "compression_mode": ""},
        6: {"custom_data": None},
        8: {"ros_distro": "jazzy"},
    }
    later[5] = {"files": [{"path": file, **times} for file in files]} if len(files) == 1 else {}
    for since, more in later.items():
        told |= more if version >= since else {}
    return told


def write_metadata(folder, told, encoding="utf-8", ending="\n"):
    text = yaml.safe_dump({"rosbag2_bagfile_information": told}, sort_keys=False).replace(
        "\n", ending
    )
    (folder / "metadata.yaml").write_bytes(text.encode(encoding))
