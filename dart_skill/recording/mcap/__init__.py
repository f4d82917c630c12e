"""The container: MCAP files read whole, walked when damaged, and written so that a crash costs
little.
"""

from typing import TYPE_CHECKING

from dart_skill.common.lazy import on_first_use
from dart_skill.recording.mcap.reader import (
    AT_ONCE,
    END_OF_TIME,
    BagMessage,
    McapInput,
    Part,
    in_arrays,
    in_time_order,
)
from dart_skill.recording.mcap.records import (
    Chunk,
    DamagedError,
    Message,
    Summary,
    crc_of,
    data_end_before,
    give_back,
    mapped,
    messages_of,
    parse_header,
    read_summary,
)
from dart_skill.recording.mcap.walk import (
    LARGEST_UNPACKED,
    USUAL_RATIO,
    Damage,
    Record,
    Unpacked,
    all_definitions,
    belongs,
    definitions_in,
    extents,
    read_definitions,
    walk,
)

if TYPE_CHECKING:
    from dart_skill.recording.mcap.writer import CHUNK_SIZE, McapChannel, McapFile
else:
    __getattr__, __dir__ = on_first_use(__name__, {"writer": "CHUNK_SIZE McapChannel McapFile"})

__all__ = [
    "AT_ONCE",
    "CHUNK_SIZE",
    "END_OF_TIME",
    "BagMessage",
    "Chunk",
    "Damage",
    "DamagedError",
    "LARGEST_UNPACKED",
    "McapChannel",
    "McapFile",
    "McapInput",
    "Message",
    "Part",
    "Record",
    "Summary",
    "USUAL_RATIO",
    "Unpacked",
    "all_definitions",
    "belongs",
    "crc_of",
    "data_end_before",
    "definitions_in",
    "extents",
    "give_back",
    "in_arrays",
    "in_time_order",
    "mapped",
    "messages_of",
    "parse_header",
    "read_definitions",
    "read_summary",
    "walk",
]
