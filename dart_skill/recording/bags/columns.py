"""The numbers of many messages at once: those of a topic mostly differ in their stamps and in
their numbers alone.

Each message as an object takes rosbags 0.1 ms. Here the first one is read so, and tells where the
numbers stand in its bytes; all others are taken as rows of a table of bytes, if they are as long
and have everything else in common.
"""

from __future__ import annotations

import copy
import itertools
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from dart_skill.common.constants import NS_PER_S
from dart_skill.common.extras import optional
from dart_skill.recording.bags.messages import deserialize, is_stamped

STAMP = slice(4, 12)
"""Bytes of the stamp of a message that begins with one, behind the head of its encapsulation."""
TIME = np.dtype([("sec", "<i4"), ("nanosec", "<u4")])
LITTLE_ENDIAN = 1


MOST_ELEMENTS = 64
"""Largest length of an array whose elements get a column each in a table of pandas."""
MOST_LAYOUTS = 16
"""Largest number of layouts of a topic that are taken at once; what is laid out otherwise is read
one by one.
"""


@dataclass(frozen=True, eq=False)
class Columns:
    """Messages that differ in stamps and numbers alone.

    Parameters
    ----------
    example
        One of them.
    index
        Places of all among the messages of their topic (n,).
    stamps
        (n,) [ns].
    numbers
        All float64 of each, in the order of its fields (n, k).
    """

    example: Any
    index: np.ndarray
    stamps: np.ndarray
    numbers: np.ndarray


@dataclass(frozen=True, eq=False)
class Pattern:
    """What messages of a topic have in common with one of them: their length, and all but their
    stamp and their float64.

    Parameters
    ----------
    example
        That one.
    bytes_of_numbers
        Of the float64 of a message, in the order of its fields (8 k,).
    common
        Which bytes of a message are the same in all (length,).
    first
        The bytes of the example (length,).
    """

    example: Any
    bytes_of_numbers: np.ndarray
    common: np.ndarray
    first: np.ndarray

    def table(self, payloads: Sequence[bytes]) -> np.ndarray | None:
        """Bytes of messages (n, length), None if one of them does not fit.

        Parameters
        ----------
        payloads
            (n,), CDR.
        """
        if any(len(one) != len(self.first) for one in payloads):
            return None
        table = np.frombuffer(b"".join(payloads), dtype=np.uint8).reshape(
            len(payloads), len(self.first)
        )
        return None if (table[:, self.common] != self.first[self.common]).any() else table

    def stamps_and_numbers(self, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Stamps (n,) [ns] and all float64 (n, k) of messages that fit.

        Parameters
        ----------
        table
            Of their bytes (n, length).
        """
        stamps = np.ascontiguousarray(table[:, STAMP]).view(TIME)[:, 0]
        numbers = np.ascontiguousarray(table[:, self.bytes_of_numbers]).view("<f8")
        return stamps["sec"].astype(np.int64) * NS_PER_S + stamps["nanosec"], numbers


def pattern_of(types: Typestore, type_name: str, payload: bytes) -> Pattern | None:
    """The pattern of a message; None for a type that does not begin with a stamp, where its
    numbers are not found in its bytes, and for bytes that are no such message.

    Parameters
    ----------
    types
        That know the message.
    type_name
        Of the message.
    payload
        CDR.
    """
    if (
        not is_stamped(types, type_name)
        or len(payload) < STAMP.stop
        or payload[1] != LITTLE_ENDIAN
    ):
        return None
    try:
        example = deserialize(types, type_name, payload)
    except ValueError:
        return None
    places = _places(types, type_name, example, len(payload))
    if places is None:
        return None
    common, of_numbers = (
        np.ones(len(payload), dtype=bool),
        (places[:, None] + np.arange(8)).ravel(),
    )
    common[STAMP] = common[of_numbers] = False
    return Pattern(example, of_numbers, common, np.frombuffer(payload, dtype=np.uint8))


class Decoder:
    """Tells which bytes are messages of a type: one by one, unless they differ from one that is in
    stamp and numbers alone.

    Parameters
    ----------
    types
        That know the messages.
    """

    def __init__(self, types: Typestore):
        self.types = types
        self._patterns: dict[str, Pattern | None] = {}

    def errors(self, type_name: str, payloads: Sequence[bytes]) -> list[str]:
        """Why each of some bytes are no message of a type; empty for those that are.

        Parameters
        ----------
        type_name
            That is known.
        payloads
            (n,), CDR.
        """
        pattern = self._patterns.get(type_name)
        if pattern is not None and pattern.table(payloads) is not None:
            return [""] * len(payloads)
        found = []
        for payload in payloads:
            try:
                deserialize(self.types, type_name, payload)
                found.append("")
            except ValueError as error:
                found.append(str(error))
        # those that come may be like the last one of these
        if len(payloads) > 1 and not any(found) and self._patterns.get(type_name, True):
            self._patterns[type_name] = pattern_of(self.types, type_name, payloads[-1])
        return found


def columns_by_layout(
    types: Typestore, type_name: str, payloads: Sequence[bytes]
) -> tuple[list[Columns], list[int]]:
    """Messages of a topic by their layouts, and the places of those (ascending) that have to be
    read one by one.

    Parameters
    ----------
    types
        That know the messages.
    type_name
        Of all messages.
    payloads
        (n,), CDR.
    """
    left = np.arange(len(payloads))
    found: list[Columns] = []
    lengths = np.array([len(one) for one in payloads], dtype=int)
    while len(left) and len(found) < MOST_LAYOUTS:
        pattern = pattern_of(types, type_name, bytes(payloads[left[0]]))
        if pattern is None:
            break
        alike = left[lengths[left] == lengths[left[0]]]
        table = np.frombuffer(
            b"".join(payloads[k] for k in alike.tolist()), dtype=np.uint8
        ).reshape(len(alike), -1)
        fits = (table[:, pattern.common] == pattern.first[pattern.common]).all(axis=1)
        found.append(
            Columns(pattern.example, alike[fits], *pattern.stamps_and_numbers(table[fits]))
        )
        left = left[~np.isin(left, alike[fits])]
    return found, left.tolist()


def _places(types: Typestore, type_name: str, example: Any, length: int) -> np.ndarray | None:
    """Where each float64 of a message begins in its bytes (k,); None if the message is not written
    back as it came.
    """
    # numbers that nothing else in a message looks like
    marks = (1e300 + k * 1e285 for k in itertools.count())
    marked = copy.deepcopy(example)
    used = list(_marked(types, type_name, marked, marks))
    data = bytes(types.serialize_cdr(marked, type_name))
    places = [data.find(struct.pack("<d", mark)) for mark in used]
    if len(data) != length or -1 in places:
        return None
    return np.array(places, dtype=int)


def _marked(
    types: Typestore, type_name: str, message: Any, marks: Iterator[float]
) -> Iterator[float]:
    """Give each float64 of a message, in the order of its fields, a mark of its own; yields the
    marks.
    """
    for name, (node, detail) in types.fielddefs[type_name][1]:
        value = getattr(message, name)
        if node == Nodetype.BASE and detail[0] == "float64":
            mark = next(marks)
            setattr(message, name, mark)
            yield mark
        elif (
            node in (Nodetype.ARRAY, Nodetype.SEQUENCE)
            and isinstance(value, np.ndarray)
            and value.dtype == np.float64
        ):
            own = np.array(list(itertools.islice(marks, len(value))))
            setattr(message, name, own)
            yield from own.tolist()
        elif node == Nodetype.NAME:
            yield from _marked(types, str(detail), value, marks)


def frame_of(messages: Iterable[Any]) -> Any:
    """A pandas.DataFrame: a row for each decoded message, by its log time; a column for each
    number and text in it, by its path.
    """
    pandas = optional("pandas")
    stamps, rows = [], []
    for one in messages:
        stamps.append(one.stamp_ns)
        rows.append(dict(_cells("", one.data)))
    return pandas.DataFrame(
        rows, index=pandas.Index(np.array(stamps, dtype=np.int64), name="log_time_ns")
    )


def _cells(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Paths and values of the leaves of a message."""
    if _is_time(value):
        yield path, int(value.sec) * 1_000_000_000 + int(value.nanosec)
    elif hasattr(value, "__dataclass_fields__"):
        for name in value.__dataclass_fields__:
            if name != "__msgtype__":
                yield from _cells(f"{path}.{name}" if path else name, getattr(value, name))
    elif isinstance(value, (np.ndarray, list, tuple)) and len(value) <= MOST_ELEMENTS:
        for k, item in enumerate(value):
            yield from _cells(f"{path}[{k}]", item)
    else:
        yield path, value.item() if isinstance(value, np.generic) else value


def _is_time(value: Any) -> bool:
    """A stamp or a duration, which is one number of nanoseconds."""
    fields: Mapping[str, Any] = getattr(value, "__dataclass_fields__", {})
    return {name for name in fields if name != "__msgtype__"} == {"sec", "nanosec"}
