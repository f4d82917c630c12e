"""Bags of every form that others write, small and made anew: `python3 -m
tests.unit.recording.make_corpus FOLDER`.

`mcap/` has what the conformance tests of MCAP have (six contents, each with and without chunks,
indexes, statistics and the other parts of a summary); `rosbag2/` has bags in the tables and
metadata of each version of rosbag2.
"""

import itertools
import sys
from pathlib import Path
from zlib import crc32

from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from dart_skill.recording.mcap.records import MAGIC, packed
from tests.unit.recording.bag_files import (
    POSE,
    POSE_CDR,
    STRING,
    mcap_file,
    metadata_of,
    sqlite_file,
    stamps,
    write_metadata,
)

CHANNEL = Channel(
    id=1, topic="example", schema_id=1, message_encoding="a", metadata={"foo": "bar"}
)
SCHEMA = Schema(id=1, name="Example", encoding="c", data=b"\4\5\6")


def _message(sequence, time):
    return Message(
        channel_id=1, sequence=sequence, log_time=time, publish_time=time, data=b"\1\2\3"
    )


CONTENTS = {
    "NoData": [],
    "OneMessage": [SCHEMA, CHANNEL, _message(10, 2)],
    "OneSchemalessMessage": [
        Channel(id=1, topic="example", schema_id=0, message_encoding="text", metadata={}),
        _message(10, 2),
    ],
    "OneAttachment": [
        Attachment(
            name="myFile",
            media_type="application/octet-stream",
            log_time=2,
            create_time=1,
            data=b"\1\2\3",
        )
    ],
    "OneMetadata": [Metadata(name="myMetadata", metadata={"foo": "bar"})],
    "TenMessages": [
        SCHEMA,
        CHANNEL,
        *(_message(k, time) for k, time in enumerate((0, 2, 1, 3, 3, 5, 4, 7, 8, 9))),
    ],
}
FEATURES = ("ch", "chx", "mx", "rch", "rsh", "st", "sum", "ax", "mdx")
"""Chunks, their index in the summary, message indexes, channels and schemas in the summary,
statistics, summary offsets, other indexes.
"""


def variants():
    """Name and bytes of each file of MCAP's forms that makes sense."""
    for name, records in CONTENTS.items():
        for chosen in itertools.product((False, True), repeat=len(FEATURES)):
            features = {feature for feature, is_on in zip(FEATURES, chosen, strict=True) if is_on}
            if _makes_sense(records, features):
                yield "-".join([name, *sorted(features)]), _file(records, features)


def _makes_sense(records, features):
    kinds = {type(record) for record in records}
    needs = {"ch": Channel, "rch": Channel, "rsh": Schema, "ax": Attachment, "mdx": Metadata}
    has_index = features & {"chx", "mx"}
    has_summary = features & {"chx", "rch", "rsh", "st", "ax", "mdx"}
    wants = all(needs[one] in kinds for one in features & needs.keys())
    return (
        wants
        and not (has_index and "ch" not in features)
        and not ("sum" in features and not has_summary)
    )


def _file(records, features):
    data, indexes = bytearray(MAGIC + packed(Header(profile="", library=""))), []
    in_chunk = (
        [record for record in records if isinstance(record, Schema | Channel | Message)]
        if "ch" in features
        else []
    )
    if in_chunk:
        indexes += _append_chunk(data, in_chunk, features)
    for record in records:
        if record not in in_chunk:
            begin, whole = len(data), packed(record)
            data += whole
            if isinstance(record, Attachment) and "ax" in features:
                told = {
                    name: getattr(record, name)
                    for name in ("log_time", "create_time", "name", "media_type")
                }
                indexes.append(
                    AttachmentIndex(
                        offset=begin, length=len(whole), data_size=len(record.data), **told
                    )
                )
            if isinstance(record, Metadata) and "mdx" in features:
                indexes.append(MetadataIndex(offset=begin, length=len(whole), name=record.name))
    data += packed(DataEnd(crc32(data)))
    return bytes(data + _summary(len(data), records, indexes, features) + MAGIC)


def _append_chunk(data, records, features):
    raw, begin, entries = bytearray(), len(data), []
    for record in records:
        if isinstance(record, Message):
            entries.append((record.log_time, len(raw)))
        raw += packed(record)
    times = [time for time, _ in entries]
    extent = {"message_start_time": min(times), "message_end_time": max(times)}
    chunk = Chunk(
        compression="",
        data=bytes(raw),
        uncompressed_crc=crc32(raw),
        uncompressed_size=len(raw),
        **extent,
    )
    data += packed(chunk)
    place = len(data)
    if "mx" in features:
        data += packed(MessageIndex(channel_id=1, records=entries))
    index = ChunkIndex(
        chunk_start_offset=begin,
        chunk_length=place - begin,
        message_index_offsets={1: place} if "mx" in features else {},
        message_index_length=len(data) - place,
        compression="",
        compressed_size=len(raw),
        uncompressed_size=len(raw),
        **extent,
    )
    return [index] if "chx" in features else []


def _summary(start, records, indexes, features):
    schemas = [record for record in records if isinstance(record, Schema)]
    channels = [record for record in records if isinstance(record, Channel)]
    groups = [
        (Opcode.SCHEMA, schemas if "rsh" in features else []),
        (Opcode.CHANNEL, channels if "rch" in features else []),
        (
            Opcode.STATISTICS,
            [_statistics(records, schemas, channels, features)] if "st" in features else [],
        ),
        (Opcode.CHUNK_INDEX, [one for one in indexes if isinstance(one, ChunkIndex)]),
        (Opcode.ATTACHMENT_INDEX, [one for one in indexes if isinstance(one, AttachmentIndex)]),
        (Opcode.METADATA_INDEX, [one for one in indexes if isinstance(one, MetadataIndex)]),
    ]
    summary, offsets = bytearray(), bytearray()
    for opcode, items in groups:
        begin = len(summary)
        summary += b"".join(map(packed, items))
        if items and "sum" in features:
            offsets += packed(
                SummaryOffset(
                    group_opcode=opcode,
                    group_start=start + begin,
                    group_length=len(summary) - begin,
                )
            )
    offset_start = start + len(summary) if offsets else 0
    summary += offsets
    footer = packed(Footer(start if summary else 0, offset_start, 0))[:-4]
    return summary + footer + crc32(summary + footer).to_bytes(4, "little")


def _statistics(records, schemas, channels, features):
    times = [record.log_time for record in records if isinstance(record, Message)]
    return Statistics(
        message_count=len(times),
        schema_count=len(schemas),
        channel_count=len(channels),
        attachment_count=sum(isinstance(record, Attachment) for record in records),
        metadata_count=sum(isinstance(record, Metadata) for record in records),
        chunk_count=int("ch" in features),
        message_start_time=min(times, default=0),
        message_end_time=max(times, default=0),
        channel_message_counts={1: len(times)} if times else {},
    )


def make(folder):
    """All of them."""
    (folder / "mcap").mkdir(parents=True)
    for name, data in variants():
        (folder / "mcap" / f"{name}.mcap").write_bytes(data)
    poses, topics = (
        [(0, stamp, POSE_CDR) for stamp in stamps()],
        [("/p", POSE, 20), ("/rosout", STRING, 0)],
    )
    for version in range(1, 10):
        for kind in ("sqlite3", "mcap") if version >= 4 else ("sqlite3",):
            bag = folder / "rosbag2" / f"{kind}_version_{version}"
            bag.mkdir(parents=True)
            file = "bag_0.mcap" if kind == "mcap" else "bag_0.db3"
            if kind == "mcap":
                mcap_file(bag / file, [("/p", POSE), ("/rosout", STRING)], poses)
            else:
                sqlite_file(
                    bag / file,
                    [(name, type_name, "", "cdr") for name, type_name, _ in topics],
                    poses,
                    min(4, (version + 1) // 2),
                )
            write_metadata(
                bag,
                metadata_of(
                    version,
                    [f"{bag.name}/{file}" if version < 4 else file],
                    topics,
                    20,
                    storage=kind,
                ),
            )


if __name__ == "__main__":
    make(Path(sys.argv[1]))
