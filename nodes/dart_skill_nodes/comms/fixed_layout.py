"""Messages that come hundreds of times a second and differ in their stamp and in their numbers
alone, read and written as bytes.

rclpy makes a Python object of each part of a message, which for a state of the arm takes as long
as the control law. Names, frames and lengths are the same in all messages of a publisher, so they
are decoded once, and after that only the stamp and the numbers.
"""

import re
import struct

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
SEVERAL = re.compile(r"sequence<(?P<one>.+?)(, \d+)?>|(?P<each>.+)\[\d+\]")


class FixedLayout:
    """Bytes of messages that begin with a header and have everything in common but its stamp, and
    their numbers: all that is float64.

    * example: one of these messages. ValueError if it has fields that this class does not know.
    * counters: names of those of its fields of type uint32 that differ, too.

    Attributes: `count`, how many numbers there are, and `numbers` (count,), those of the example.
    """

    def __init__(self, example, counters: tuple[str, ...] = ()):
        self.example = example
        cdr = _Cdr(counters)
        cdr.message(example)
        self._counters = cdr.counters
        data = serialize_message(example)
        if cdr.at > len(data):
            raise ValueError(f"{type(example).__name__} takes {len(data)} bytes, not {cdr.at}")
        self.count, self.numbers = len(cdr.numbers), np.array(cdr.values, dtype=float)
        self._at = (np.array(cdr.numbers, dtype=int) - BODY) // 8
        self._words = int(self._at.max(initial=-1)) + 1
        # behind the two parts of the stamp
        self._fixed = [(start, end, data[start:end]) for start, end in _joined(cdr.meant[2:])]
        self._bytes = bytearray(cdr.at)  # what lies between aligned fields is 0
        for start, end, fixed in [(0, BODY, data[:BODY]), *self._fixed]:
            self._bytes[start:end] = fixed
        self._view = np.frombuffer(self._bytes, dtype="<f8", count=self._words, offset=BODY)

    def pack(self, stamp_ns: int, values: np.ndarray, *counters: int) -> bytes:
        """The bytes of a message. stamp_ns: of its header [ns]; values: its numbers (count,) in
        the order of its fields; counters, too.
        """
        TIME.pack_into(self._bytes, BODY, *divmod(stamp_ns, NS_PER_S))
        self._view[self._at] = values
        for at, counter in zip(self._counters, counters, strict=True):
            COUNTER.pack_into(self._bytes, at, counter)
        return bytes(self._bytes)

    def fits(self, data: bytes) -> bool:
        """Whether bytes are such a message; a few may follow, as serialisers make them that take
        too much room for empty sequences.
        """
        if len(data) < len(self._bytes) or data[:2] != self._bytes[:2]:
            return False
        # not all(...): this is asked of every message of the arm
        for (
            start,
            end,
            fixed,
        ) in self._fixed:
            if data[start:end] != fixed:
                return False
        return True

    def values(self, data: bytes) -> np.ndarray:
        """The numbers (count,) in the bytes of such a message."""
        return np.frombuffer(data, dtype="<f8", count=self._words, offset=BODY)[self._at]

    def counters(self, data: bytes) -> list[int]:
        """The counters in the bytes of such a message."""
        return [COUNTER.unpack_from(data, at)[0] for at in self._counters]


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
                return (
                    layout.example,
                    leading_stamp_ns(data),
                    layout.values(data),
                    layout.counters(data),
                )
        return self._first_of_its_kind(data)

    def _first_of_its_kind(self, data: bytes) -> tuple[object, int, np.ndarray, list[int]]:
        message = decoded(data, self._type)
        stamp_ns, layout = (
            checked_stamp_ns(message.header.stamp),
            FixedLayout(message, self._counters),
        )
        if layout.fits(data):  # not those of a machine with another order of bytes
            self._layouts = [layout, *self._layouts[: LAYOUTS - 1]]
        return (
            message,
            stamp_ns,
            layout.numbers,
            [getattr(message, name) for name in self._counters],
        )


def _joined(stretches: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Stretches of bytes, those that follow each other without a gap as one."""
    joined = stretches[:1]
    for start, end in stretches[1:]:
        if start == joined[-1][1]:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((start, end))
    return joined


class _Cdr:
    """Goes through a message's fields as the serialisation of ROS does (CDR, version 1, as
    rmw_fastrtps and others write it).

    at: where the next byte stands. numbers, values: where each float64 stands, and what it is.
    counters: where those stand that are named. meant: stretches of what else is said.
    """

    def __init__(self, counters: tuple[str, ...] = ()) -> None:
        self.at, self._names = BODY, counters
        self.counters: list[int] = []
        self.numbers: list[int] = []
        self.values: list[float] = []
        self.meant: list[tuple[int, int]] = []

    def message(self, message) -> None:
        for name, kind in message.get_fields_and_field_types().items():
            if name in self._names:
                self._align(COUNTER.size)
                self.counters.append(self.at)
                self.at += COUNTER.size
            else:
                self._field(kind, getattr(message, name))

    def _field(self, kind: str, value) -> None:
        if several := SEVERAL.fullmatch(kind):
            if several["one"]:
                self._mean(4, 4)
            self._several(several["one"] or several["each"], value)
        elif kind == "double":
            self._doubles([value])
        elif kind == "string":
            self._mean(4, 4)
            self._mean(len(value.encode()) + 1, 1)
        elif kind in BYTES:
            self._mean(BYTES[kind], BYTES[kind])
        elif "/" in kind:
            self.message(value)
        else:
            raise ValueError(f"{kind}: no field of a message with a fixed layout")

    def _several(self, kind: str, values) -> None:
        if kind == "double":
            self._doubles(values)
        else:
            for one in values:
                self._field(kind, one)

    def _doubles(self, values) -> None:
        """Numbers in a row; no number is not aligned either."""
        if len(values):
            self._align(8)
            self.numbers.extend(range(self.at, self.at + 8 * len(values), 8))
            self.values.extend(values)
            self.at += 8 * len(values)

    def _align(self, size: int) -> None:
        self.at += -(self.at - BODY) % size

    def _mean(self, count: int, size: int) -> None:
        self._align(size)
        self.meant.append((self.at, self.at + count))
        self.at += count
