"""Definitions of types that are known here: the standard ones, ours, and those of installed
packages.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from typing import Any

from mcap.records import Schema
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags._names import full_name
from dart_skill.recording.bags.messages import definition, type_hash, types_for, typestore


def installed_definition(type_name: str) -> str:
    """Definition text of a type, as `ros2msg`; empty if it is known nowhere."""
    type_name = full_name(type_name)
    types = _types_with(type_name)
    return definition(types, type_name) if types is not None else ""


def installed_fields(type_name: str) -> Any:
    """Constants and fields of a type, as `rosbags` has them; None if it is known nowhere.
    type_name: as package/msg/Name.
    """
    types = _types_with(type_name)
    return types.fielddefs[type_name] if types is not None else None


def installed_hash(type_name: str, text: str) -> str:
    """RIHS01 of a type whose definition is that which is known here; empty for another one. text:
    the definition.
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
    """A definition as `mcap` has it. encoding: of the text; number: in a file."""
    return Schema(id=number, name=type_name, encoding=encoding, data=text.encode())


@cache
def _types_with(type_name: str) -> Typestore | None:
    """Types that include one, None if it is installed nowhere."""
    standard = _standard_types()
    if type_name in standard.fielddefs:
        return standard
    with suppress(ValueError):
        return types_for(type_name)
    return None


@cache
def _standard_types() -> Typestore:
    return typestore()


@cache
def _names_by_hash() -> dict[str, str]:
    types, found = _standard_types(), {}
    for name in types.fielddefs:
        with suppress(Exception):  # some have no hash
            found[type_hash(types, name)] = name
    return found
