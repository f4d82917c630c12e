"""Messages that come hundreds of times a second and differ in their stamp and in their numbers
alone, read and written as bytes.

rclpy makes a Python object of each part of a message, which for a state of the arm takes as long
as the control law. Names, frames and lengths are the same in all messages of a publisher, so they
are decoded once, and after that only the stamp and the numbers.
"""

import re
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

from dart_skill.common.constants import NS_PER_S
from dart_skill_nodes.comms.conversions import TIME, checked_stamp_ns, decoded, leading_stamp_ns

BODY = 4
"""Where the content of a message begins, behind its encapsulation: fields are aligned to that
(CDR).
"""
COUNTER = struct.Struct("<I")
LAYOUTS = 8
"""That are remembered of one topic: commands of each grip and speed, of a few publishers."""
BYTES = {
    "boolean": 1,
    "octet": 1,
    "uint8": 1,
    "int8": 1,
    "uint16": 2,
    "int16": 2,
    "uint32": 4,
    "int32": 4,
    "float": 4,
}
"""Sizes of the plain fields that are no numbers here; those of 8 bytes are none that such messages
have.
"""
NUMBER = "number"
"""A float64."""
COUNTED = "counted"
"""One of the uint32 that differ."""
MEANT = "meant"
"""What is the same in all messages."""
SEVERAL = re.compile(r"sequence<(?P<one>.+?)(, \d+)?>|(?P<each>.+)\[\d+\]")


class FixedLayout:
    """Bytes of messages that begin with a header and have everything in common but its stamp, and
    their numbers: all that is float64.

    * example: one of these messages. ValueError if it has fields that this class does not know.
    * counters: names of those of its fields of type uint32 that differ, too.

    Attributes: `count`, how many numbers there are, and `numbers` (count,), those of the example.
    """

    def __init__(self, example, counters: tuple[str, ...] = ()):
        self.example, self._counters = example, []
        at, places, values, meant = BODY, [], [], []
        for kind, size, length, value in _parts(example, counters):
            at += -(at - BODY) % size
            if kind == NUMBER:
                places.append(at)
                values.append(value)
            else:
                (self._counters if kind == COUNTED else meant).append((at, at + length))
            at += length
        data = serialize_message(example)
        if at > len(data):
            raise ValueError(f"{type(example).__name__} takes {len(data)} bytes, not {at}")
        self.count, self.numbers = len(values), np.array(values, dtype=float)
        self._at = (np.array(places, dtype=int) - BODY) // 8
        self._words = int(self._at.max(initial=-1)) + 1
        # behind the two parts of the stamp
        self._fixed = [(start, end, data[start:end]) for start, end in _joined(meant[2:])]
        self._bytes = bytearray(at)  # what lies between aligned fields is 0
        for start, end, fixed in [(0, BODY, data[:BODY]), *self._fixed]:
            self._bytes[start:end] = fixed
        self._view = np.frombuffer(self._bytes, dtype="<f8", count=self._words, offset=BODY)

    def pack(self, stamp_ns: int, values: np.ndarray, *counters: int) -> bytes:
        """The bytes of a message. stamp_ns: of its header [ns]; values: its numbers (count,) in
        the order of its fields; counters, too.
        """
        TIME.pack_into(self._bytes, BODY, *divmod(stamp_ns, NS_PER_S))
        self._view[self._at] = values
        for (at, _), counter in zip(self._counters, counters, strict=True):
            COUNTER.pack_into(self._bytes, at, counter)
        return bytes(self._bytes)

    def fits(self, data: bytes) -> bool:
        """Whether bytes are such a message; a few may follow, as serialisers make them that take
        too much room for empty sequences.
        """
        if len(data) < len(self._bytes) or data[:2] != self._bytes[:2]:
            return False
        # not all(...): this is asked of every message of the arm
        for start, end, fixed in self._fixed:
            if data[start:end] != fixed:
                return False
        return True

    def values(self, data: bytes) -> np.ndarray:
        """The numbers (count,) in the bytes of such a message."""
        return np.frombuffer(data, dtype="<f8", count=self._words, offset=BODY)[self._at]

    def counters(self, data: bytes) -> list[int]:
        """The counters in the bytes of such a message."""
        return [COUNTER.unpack_from(data, at)[0] for at, _ in self._counters]


class LayoutReader:
    """Reads serialised messages of a type; those of a layout that has come before at a tenth of
    the cost.

    * message_type: of the messages.
    * counters: as of `FixedLayout`.
    """

    def __init__(self, message_type: type, counters: tuple[str, ...] = ()):
        self._type, self._counters, self._layouts = message_type, counters, []

    def read(self, data: bytes) -> tuple[object, int, np.ndarray]:
        """A message that has all but its stamp and numbers in common with this one, the stamp
        [ns], and the numbers (n,) in the order of the fields. ValueError for bytes that are no
        such message, and a stamp that is none.
        """
        message, stamp_ns, values, _ = self.read_all(data)
        return message, stamp_ns, values

    def read_all(self, data: bytes) -> tuple[object, int, np.ndarray, list[int]]:
        """What `read` gives, and the counters."""
        for layout in self._layouts:
            if layout.fits(data):
                ns, numbers = leading_stamp_ns(data), layout.values(data)
                return layout.example, ns, numbers, layout.counters(data)
        message = decoded(data, self._type)
        ns = checked_stamp_ns(message.header.stamp)
        layout = FixedLayout(message, self._counters)
        if layout.fits(data):  # not those of a machine with another order of bytes
            self._layouts = [layout, *self._layouts[: LAYOUTS - 1]]
        return message, ns, layout.numbers, [getattr(message, one) for one in self._counters]


def _joined(stretches: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Stretches of bytes, those that follow each other without a gap as one."""
    joined = stretches[:1]
    for start, end in stretches[1:]:
        if start == joined[-1][1]:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((start, end))
    return joined


def _parts(message, counters: tuple[str, ...] = ()) -> Iterator[tuple[str, int, int, Any]]:
    """What the serialisation of ROS makes of a message, in order (CDR, version 1, as rmw_fastrtps
    and others write it): whether it is a NUMBER, COUNTED or MEANT, to how many bytes it is aligned,
    its length in bytes, and its value.
    """
    for name, kind in message.get_fields_and_field_types().items():
        if name in counters:
            yield COUNTED, COUNTER.size, COUNTER.size, None
        else:
            yield from _parts_of(kind, getattr(message, name))


def _parts_of(kind: str, value) -> Iterator[tuple[str, int, int, Any]]:
    """Parts of the layout of a field."""
    if several := SEVERAL.fullmatch(kind):
        if several["one"]:
            yield MEANT, 4, 4, None
        for one in value:
            yield from _parts_of(several["one"] or several["each"], one)
    elif kind == "double":
        yield NUMBER, 8, 8, value
    elif kind == "string":
        yield MEANT, 4, 4, None
        yield MEANT, 1, len(value.encode()) + 1, None
    elif kind in BYTES:
        yield MEANT, BYTES[kind], BYTES[kind], None
    elif "/" in kind:
        yield from _parts(value)
    else:
        raise ValueError(f"{kind}: no field of a message with a fixed layout")
