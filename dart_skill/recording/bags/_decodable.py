"""Whether messages for which no CRC vouches are messages at all: those that cannot be decoded have
changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from mcap.records import Schema

from dart_skill.recording.bags._definitions import embedded_types
from dart_skill.recording.bags._installed_types import installed_fields
from dart_skill.recording.bags._names import full_name
from dart_skill.recording.bags.columns import Pattern, pattern_of
from dart_skill.recording.bags.messages import deserialize


class Decoder:
    """Decodes messages by the definitions of their file.

    schemas: of the file.
    """

    def __init__(self, schemas: Iterable[Schema]):
        texts = [
            (full_name(schema.name), schema.encoding, schema.data.decode(errors="replace"))
            for schema in schemas
        ]
        self._types, self.unknown = embedded_types(texts, None)
        self._patterns: dict[str, Pattern | None] = {}
        self._proved: set[str] = (
            set()
        )  # types of which a message could be decoded, or that are as they are installed here

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
