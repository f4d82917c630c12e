"""Message types from the definitions in a bag: .msg, .srv, .action and .idl texts, as every
version of rosbag2 and others write them.

A service has its request, its response and the event of its introspection; an action has more
(`parts_of`). A type without fields has the byte that ROS 2 sends in their place.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import suppress
from functools import lru_cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from dart_skill.recording.bags.metadata import full_name

MOST_LINES = 5_000
"""Most lines of a type's definition with all that it nests; a line takes 0.4 ms."""
MOST_LINES_OF_ALL = 20_000
"""Most lines of all definitions of a bag."""
LARGEST_DEFINITION = 1_000_000
"""Most characters of a definition."""
_HEADS = re.compile(r"^={3,}[ \t]*\n(MSG|SRV|ACTION|IDL):[ \t]*(\S+)[ \t]*\n", re.MULTILINE)
_SERVICE = re.compile(r"(.+/srv/.+?)(?:_Request|_Response|_Event)?")
_ACTION = re.compile(
    r"(.+/action/.+?)(?:_Goal|_Result|_Feedback|_FeedbackMessage|_(?:SendGoal|GetResult)_(?:Request|Response|Event))?",
)
_NO_FIELD: Any = ("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))
_STANDARD = """service_msgs/ServiceEventInfo info
================================================================================
MSG: service_msgs/ServiceEventInfo
uint8 REQUEST_SENT = 0
uint8 REQUEST_RECEIVED = 1
uint8 RESPONSE_SENT = 2
uint8 RESPONSE_RECEIVED = 3
uint8 event_type
builtin_interfaces/Time stamp
char[16] client_gid
int64 sequence_number
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: unique_identifier_msgs/UUID
uint8[16] uuid
"""
"""What services and actions have beside the fields of their definitions."""


def embedded_types(
    definitions: Iterable[tuple[str, str, str]],
    types: Typestore | None,
    wanted: Iterable[str] = (),
) -> tuple[Typestore, dict[str, str]]:
    """Types that the bag defines, and those of `types` that are wanted and that it lacks; and why
    the others are unknown.

    A type with an empty definition is as `types` has it; where that does not know it, it is taken
    for one without fields.
    """
    found, unknown, lines = {}, {}, 0
    definitions = list(dict.fromkeys(definitions))  # each file of a split bag has all of them
    for name, encoding, text in definitions:
        own = text.count("\n") + text.count(";") + 1
        lines += own
        if own > MOST_LINES or lines > MOST_LINES_OF_ALL or len(text) > LARGEST_DEFINITION:
            unknown[name] = (
                f"whose definition in the bag is too long: {own} lines of {lines} so far,"
                f" {len(text)} characters"
            )
            continue
        try:
            found.update(_types_in(name, encoding, text))
        except Exception as error:  # generated parsers meet arbitrary text
            unknown[name] = _damaged(error)
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(found)
    # two definitions that cannot be in one store, or names that are none: as many as can be
    except Exception:
        for name, fields in found.items():
            try:
                store.register({name: fields})
            except Exception as error:
                unknown[name] = _damaged(error)
    if types is not None:
        missing = {*wanted}.union(*(nested(fields) for _, fields in store.fielddefs.values()))
        others: dict[str, Any] = {}
        while missing := {name for name in missing - others.keys() if name in types.fielddefs}:
            others |= {name: types.fielddefs[name] for name in missing}
            missing = set().union(*(nested(types.fielddefs[name][1]) for name in missing))
        store.register({k: one for k, one in others.items() if k not in store.fielddefs})
        for name, encoding, text in definitions:
            if encoding == "ros2msg" and not text.strip() and name not in store.fielddefs:
                with suppress(Exception):  # a name that is none
                    store.register({name: ([], [_NO_FIELD])})
    return store, unknown


def _damaged(error: Exception) -> str:
    text = " ".join(str(error).split())
    more = " ..." if len(text) > 120 else ""
    return f"whose definition in the bag is damaged ({text[:120]}{more})"


def parts_of(name: str, parts: list[str]) -> dict:
    """Types of the interface `name`, from the parts of its definition: one of a message, two of a
    service, three of an action.

    Nested types without a package are messages of the same one.

    Raises
    ------
    ValueError
        For another number of parts.
    """
    package = name.split("/")[0]
    if not 1 <= len(parts) <= 3:
        raise ValueError(
            f"{len(parts)} parts between '---' lines, need 1 of a message, 2 of a service or 3 of"
            " an action"
        )
    if len(parts) == 1:
        return _parsed(parts[0], full_name(name), package)
    if len(parts) == 2:
        request, response = parts
        return _service(
            name,
            _parsed(request, f"{name}_Request", package),
            _parsed(response, f"{name}_Response", package),
        )
    found: dict = {}
    for part, kind in zip(parts, ("Goal", "Result", "Feedback"), strict=True):
        found |= _parsed(part, f"{name}_{kind}", package)
    goal_id = _named("goal_id", "unique_identifier_msgs/msg/UUID")
    stamp = _named("stamp", "builtin_interfaces/msg/Time")
    status: Any = ("status", (Nodetype.BASE, ("int8", 0)))
    accepted: Any = ("accepted", (Nodetype.BASE, ("bool", 0)))
    found[f"{name}_FeedbackMessage"] = ([], [goal_id, _named("feedback", f"{name}_Feedback")])
    exchanges = {
        "SendGoal": ([goal_id, _named("goal", f"{name}_Goal")], [accepted, stamp]),
        "GetResult": ([goal_id], [status, _named("result", f"{name}_Result")]),
    }
    for exchange, (asked, answered) in exchanges.items():
        service = f"{name}_{exchange}"
        found |= _service(
            service, {f"{service}_Request": ([], asked)}, {f"{service}_Response": ([], answered)}
        )
    return found


def nested(fields: list) -> set[str]:
    """Names of the message types in the fields of a type."""
    kinds = [
        detail[0] if node in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (node, detail)
        for _, (node, detail) in fields
    ]
    return {detail for node, detail in kinds if node == Nodetype.NAME}


@lru_cache(maxsize=256)
def _types_in(name: str, encoding: str, text: str) -> dict:
    """Types that a definition of the type `name` defines, with all that it nests; none that is
    empty.
    """
    if encoding not in ("ros2msg", "ros2idl", "omgidl") or not text.strip():
        return {}
    found: dict = {}
    for kind, own_name, body in _sections(name, "MSG" if encoding == "ros2msg" else "IDL", text):
        if kind == "IDL":
            for key, (constants, fields) in (
                get_types_from_idl(body) if body.strip() else {}
            ).items():
                found[key] = (constants, fields or [_NO_FIELD])
        else:
            parts = split_definition(body)
            found.update(parts_of(own_name if len(parts) == 1 else interface_of(own_name), parts))
    return found


def _sections(name: str, kind: str, text: str) -> list[tuple[str, str, str]]:
    """Kind, name and text of the definition of a type and of each that it nests; the first has a
    head only in some versions.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n").removeprefix("\ufeff")
    heads = list(_HEADS.finditer(text))
    ends = [*(head.start() for head in heads), len(text)]
    found = [(kind, name, text[: ends[0]])] if text[: ends[0]].strip() or not heads else []
    return found + [
        (head[1], head[2], text[head.end() : end])
        for head, end in zip(heads, ends[1:], strict=True)
    ]


def interface_of(name: str) -> str:
    """The service or action that a type is a part of; a message is its own."""
    for pattern in (_SERVICE, _ACTION):
        if match := pattern.fullmatch(name):
            return match[1]
    return full_name(name)


def split_definition(text: str) -> list[str]:
    """Parts of a definition, which are separated by lines of three dashes."""
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.strip() == "---":
            parts.append([])
        else:
            parts[-1].append(line)
    return ["\n".join(part) + "\n" for part in parts]


def _parsed(text: str, name: str, package: str) -> dict:
    """A type from the text of its fields."""
    # so that what it nests is looked for among the messages
    as_message = f"{package}/msg/{name.split('/')[-1]}"
    ((constants, fields),) = get_types_from_msg(text, as_message).values()
    return {name: (constants, fields or [_NO_FIELD])}


def _service(name: str, request: dict, response: dict) -> dict:
    """Types of a service: request, response, and the event that its introspection publishes, which
    has one or none of each.
    """
    fields = [_named("info", "service_msgs/msg/ServiceEventInfo")]
    for kind in ("request", "response"):
        one = (Nodetype.NAME, f"{name}_{kind.capitalize()}")
        fields.append((kind, (Nodetype.SEQUENCE, (one, 1))))
    standard = get_types_from_msg(_STANDARD, "service_msgs/msg/Standard")
    del standard["service_msgs/msg/Standard"]
    return {**standard, **request, **response, f"{name}_Event": ([], fields)}


def _named(field: str, type_name: str) -> tuple[str, Any]:
    return field, (Nodetype.NAME, type_name)
