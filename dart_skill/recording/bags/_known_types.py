"""Types that are known here, and whether messages for which no CRC vouches are messages of their
type at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from functools import cache
from typing import Any

from mcap.records import Schema
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags._definitions import embedded_types
from dart_skill.recording.bags._metadata import full_name
from dart_skill.recording.bags.columns import Pattern, pattern_of
from dart_skill.recording.bags.messages import (
    definition,
    deserialize,
    shared_types,
    type_hash,
    types_for,
)


def installed_definition(type_name: str) -> str:
    """Definition text of a type, as `ros2msg`; empty if it is known nowhere."""
    type_name = full_name(type_name)
    types = _types_with(type_name)
    return definition(types, type_name) if types is not None else ""


def installed_fields(type_name: str) -> Any:
    """Constants and fields of a type, as `rosbags` has them; None if it is known nowhere.

    Parameters
    ----------
    type_name
        As package/msg/Name.
    """
    types = _types_with(type_name)
    return types.fielddefs[type_name] if types is not None else None


def installed_hash(type_name: str, text: str) -> str:
    """RIHS01 of a type whose definition is that which is known here; empty for another one.

    Parameters
    ----------
    text
        The definition.
    """
    type_name = full_name(type_name)
    types = _types_with(type_name)
    return (
        type_hash(types, type_name)
        if types is not None and definition(types, type_name) == text
        else ""
    )


def type_of_hash(digest: str) -> str:
    """Name of the standard type with a RIHS01 hash; empty if there is none."""
    return _names_by_hash().get(digest, "") if digest else ""


def schema_of(type_name: str, encoding: str, text: str, number: int = 0) -> Schema:
    """A definition as `mcap` has it.

    Parameters
    ----------
    encoding
        Of the text.
    number
        In a file.
    """
    return Schema(id=number, name=type_name, encoding=encoding, data=text.encode())


@cache
def _types_with(type_name: str) -> Typestore | None:
    """Types that include one, None if it is installed nowhere."""
    standard = shared_types()
    if type_name in standard.fielddefs:
        return standard
    with suppress(ValueError):
        return types_for(type_name)
    return None


@cache
def _names_by_hash() -> dict[str, str]:
    types, found = shared_types(), {}
    for name in types.fielddefs:
        with suppress(Exception):  # some have no hash
            found[type_hash(types, name)] = name
    return found


class Decoder:
    """Decodes messages by the definitions of their file.

    Parameters
    ----------
    schemas
        Of the file.
    """

    def __init__(self, schemas: Iterable[Schema]):
        texts = [
            (full_name(schema.name), schema.encoding, schema.data.decode(errors="replace"))
            for schema in schemas
        ]
        self._types, self.unknown = embedded_types(texts, None)
        self._patterns: dict[str, Pattern | None] = {}
        # types of which a message could be decoded, or that are as they are installed here
        self._proved: set[str] = set()

    def decodable(self, type_name: str, payloads: Sequence[bytes]) -> list[bool]:
        """Which of the payloads are messages of a type.

        All of them if its definition is not known, or fits none of its messages so far and is not
        that which is installed here.
        """
        type_name = full_name(type_name)
        if type_name not in self._types.fielddefs:
            return [True] * len(payloads)
        pattern = self._patterns.get(type_name)
        if pattern is not None and pattern.table(payloads) is not None:
            return [True] * len(payloads)
        found = [self._is_one(type_name, payload) for payload in payloads]
        if any(found):
            self._proved.add(type_name)
            if type_name not in self._patterns:
                last = max(index for index, is_one in enumerate(found) if is_one)
                self._patterns[type_name] = pattern_of(self._types, type_name, payloads[last])
        if type_name not in self._proved and self._types.fielddefs[type_name] == installed_fields(
            type_name
        ):
            self._proved.add(type_name)
        return found if type_name in self._proved else [True] * len(payloads)

    def fits(self, type_name: str, payloads: Sequence[bytes]) -> bool:
        """Whether the definition of a type is known, and all payloads are messages of it."""
        type_name = full_name(type_name)
        return type_name in self._types.fielddefs and all(
            self._is_one(type_name, payload) for payload in payloads
        )

    def _is_one(self, type_name: str, payload: bytes) -> bool:
        try:
            deserialize(self._types, type_name, payload)
        except ValueError:
            return False
        return True
