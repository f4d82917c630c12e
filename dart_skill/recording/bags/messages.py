"""Messages without ROS: definitions, type hashes, CDR bytes, and Python objects, for any interface
package.

Standard types come from the tables of `rosbags` (ROS 2 Jazzy), our own from the .msg, .srv and
.action files of the interface package.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from dart_skill.common.configuration import ros_prefixes, shared_folders
from dart_skill.recording.bags._definitions import interface_of, nested, parts_of, split_definition
from dart_skill.recording.bags.metadata import full_name

PACKAGE = "dart_skill_msgs"
_PARTS = {".msg": 1, ".srv": 2, ".action": 3}
_ZERO = {"bool": False, "string": "", "wstring": "", "float32": 0.0, "float64": 0.0}
_BYTES = ("byte", "char", "octet")
_NO_FIELD = "structure_needs_at_least_one_member"
_ENCAPSULATIONS = {
    **{bytes((0, kind)): "a list of parameters (PL_CDR)" for kind in (2, 3)},
    **{bytes((0, kind)): "XCDR version 2" for kind in range(6, 12)},
    **{bytes((0, kind)): "XML" for kind in (4,)},
}
"""First two bytes of messages that some DDS send, and that no reader of bags decodes, and what
they mean.
"""
_STAMPED = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")


def interface_folder() -> Path:
    """Folder of our interfaces: in a wheel, msg_schemas/ of a checkout, or the installed package's
    share.

    Raises
    ------
    FileNotFoundError
        If it is nowhere.
    """
    folders = shared_folders("msg_schemas", PACKAGE)
    for folder in folders:
        if (folder / "msg").is_dir():
            return folder
    raise FileNotFoundError(
        f"no definitions of {PACKAGE} in {', '.join(map(str, folders))}: build the workspace"
    )


def typestore(*extra_folders: str | os.PathLike) -> Typestore:
    """Message types of ROS 2 Jazzy, of our interface package, and of the packages in
    `extra_folders`.

    A folder holds .msg, .srv and .action files in any subfolder; its package is named by the
    package.xml in it or above it, else by the folder itself.

    Parameters
    ----------
    extra_folders
        Of other packages.
    """
    types = get_typestore(Stores.ROS2_JAZZY)
    for folder in (interface_folder(), *map(Path, extra_folders)):
        types.register(_definitions(folder))
    return types


def types_for(type_name: str) -> Typestore:
    """Types that include one of any installed package, with all that it nests.

    Raises
    ------
    ValueError
        If its definition is not found.
    """
    types = shared_types()
    _install(types, full_name(type_name))
    return types


def is_stamped(types: Typestore, type_name: str) -> bool:
    """Whether messages of a type begin with a stamp, in a header or bare: 4 bytes of seconds and 4
    of nanoseconds behind CDR's header.
    """
    fields = types.fielddefs[_known(types, type_name)][1]
    if type_name == "builtin_interfaces/msg/Time":
        return True
    node, detail = fields[0][1] if fields else (None, None)
    return node == Nodetype.NAME and is_stamped(types, detail) if detail in _STAMPED else False


def definition(types: Typestore, type_name: str) -> str:
    """Definition text of a type with all nested ones, as MCAP's schema encoding `ros2msg`."""
    return types.generate_msgdef(_known(types, type_name), ros_version=2)[0]


def type_hash(types: Typestore, type_name: str) -> str:
    """RIHS01 hash of a type, the one that ROS 2 exchanges during discovery."""
    return types.hash_rihs01(_known(types, type_name))


def message(types: Typestore, type_name: str, value: Any = None) -> Any:
    """Message object of a type, filled from `value`: a mapping or any object with the type's field
    names.

    Fields that are missing, in nested messages too, are zero or empty; sequences may be lists or
    arrays. A field of `value` that the type does not have is an error.

    Raises
    ------
    ValueError
        For a field that the type does not have.
    """
    type_name = _known(types, type_name)
    fields = dict(types.fielddefs[type_name][1])
    if _is_mapping(value) and set(value) - set(fields):
        raise ValueError(
            f"{type_name} has no field {sorted(set(value) - set(fields))}, only {list(fields)}"
        )
    content = {
        name: _field(types, f"{type_name}.{name}", kind, _get(value, name))
        for name, kind in fields.items()
    }
    return types.types[type_name](**content)


def serialize(types: Typestore, type_name: str, value: Any) -> bytes:
    """CDR bytes (little endian, with encapsulation header) of whatever `message` accepts.

    Parameters
    ----------
    types
        Known message types.
    value
        As of `message`.
    """
    return encoded(types, type_name, message(types, type_name, value))


def encoded(types: Typestore, type_name: str, made: Any) -> bytes:
    """Encode a message object that `message` made; it is not checked again.

    Parameters
    ----------
    types
        Known message types.
    made
        Of one of them.
    """
    return bytes(
        types.serialize_cdr(
            made, type_name if type_name in types.fielddefs else full_name(type_name)
        )
    )


def deserialize(types: Typestore, type_name: str, data: bytes) -> Any:
    """Message object from CDR bytes.

    Raises
    ------
    ValueError
        If they are not a message of this type.
    """
    type_name = _known(types, type_name)
    try:
        return types.deserialize_cdr(data, type_name)
    except Exception as error:  # generated code meets arbitrary bytes
        if len(data) == 4 and dict(types.fielddefs[type_name][1]).keys() == {_NO_FIELD}:
            # some writers leave out what stands for no field
            return types.deserialize_cdr(bytes(data) + b"\0", type_name)
        kind = _ENCAPSULATIONS.get(bytes(data[:2]), "")
        reason = f"they are encoded as {kind}, not as plain CDR" if kind else repr(error)
        raise ValueError(f"{len(data)} bytes are no {type_name}: {reason}") from error


def stamp_content(stamp_ns: int) -> dict[str, int]:
    """Fields of a stamp, as `message` accepts them; so are the next three."""
    sec, nanosec = divmod(int(stamp_ns), 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}


def header_content(stamp_ns: int, frame_id: str) -> dict[str, Any]:
    """Fields of a header.

    Parameters
    ----------
    frame_id
        Of what follows.
    """
    return {"stamp": stamp_content(stamp_ns), "frame_id": frame_id}


def vector_content(values: Sequence[float]) -> dict[str, float]:
    """Fields of a point or vector x, y, z, or of a quaternion x, y, z, w.

    Parameters
    ----------
    values
        (3,) or (4,).
    """
    return dict(zip("xyzw", values, strict=False))


def pose_content(position: Sequence[float], quaternion: Sequence[float]) -> dict[str, Any]:
    """Fields of a pose."""
    return {"position": vector_content(position), "orientation": vector_content(quaternion)}


@cache
def shared_types() -> Typestore:
    """The store of `typestore`, made once; only `types_for` adds to it."""
    return typestore()


def _install(types: Typestore, type_name: str) -> None:
    """Add a type and those that it nests to a store, from the definitions that its package
    installed.
    """
    if type_name in types.fielddefs:
        return
    package, kind, _name = type_name.split("/")
    file_name = f"{interface_of(type_name).split('/')[-1]}.{kind}"
    for prefix in ros_prefixes():
        file = prefix / "share" / package / kind / file_name
        if file.is_file():
            found = _defined_in(file, package)
            for name in (
                set().union(*(nested(fields) for _constants, fields in found.values()))
                - found.keys()
            ):
                _install(types, name)
            types.register(
                {key: fields for key, fields in found.items() if key not in types.fielddefs}
            )
            return
    raise ValueError(
        f"no definition of {type_name}: source the workspace in which the package {package} is"
        " installed"
    )


def _definitions(folder: Path) -> dict:
    """Parsed definitions of an interface package's folder."""
    files = sorted(file for file in folder.rglob("*") if file.suffix in _PARTS)
    if not files:
        raise ValueError(f"no .msg, .srv or .action files in {folder}")
    package, found = _package_name(folder), {}
    for file in files:
        found.update(_defined_in(file, package))
    return found


def _defined_in(file: Path, package: str) -> dict:
    """Types that a .msg, .srv or .action file of a package defines."""
    parts = split_definition(file.read_text(encoding="utf-8-sig"))
    if len(parts) != _PARTS[file.suffix]:
        raise ValueError(
            f"{file}: {len(parts)} parts between '---' lines, need {_PARTS[file.suffix]}"
        )
    try:
        return parts_of(f"{package}/{file.suffix[1:]}/{file.stem}", parts)
    except Exception as error:
        raise ValueError(f"{file}: {error}") from error


def _package_name(folder: Path) -> str:
    folder = folder.resolve()
    for place in (folder, folder.parent):
        if (place / "package.xml").is_file():
            return ElementTree.parse(place / "package.xml").getroot().findtext("name", "").strip()
    return folder.name


def _known(types: Typestore, type_name: str) -> str:
    """The type under its full name; ValueError if it is not known."""
    if type_name in types.fielddefs:
        return type_name
    type_name = full_name(type_name)
    if type_name not in types.fielddefs:
        raise ValueError(
            f"unknown message type '{type_name}': write it as package/msg/Name, and give the"
            " folder of its .msg files to typestore()"
        )
    return type_name


def _is_mapping(value: Any) -> bool:
    # a dictionary is told in a tenth of the time
    return type(value) is dict or isinstance(value, Mapping)


def _get(value: Any, name: str) -> Any:
    if value is None:
        return None
    if _is_mapping(value):
        return value.get(name)
    if not hasattr(value, name) and name != _NO_FIELD:
        raise ValueError(f"{type(value).__name__} has no field '{name}'")
    return getattr(value, name, None)


def _field(types: Typestore, place: str, kind: tuple, value: Any) -> Any:
    """Value of a field as the generated serialisers want it."""
    node, detail = kind
    if node == Nodetype.NAME:
        return message(types, detail, value)
    if node == Nodetype.BASE:
        return _base(place, detail[0], value)
    (item_node, item), length = detail
    values = [None] * (length if node == Nodetype.ARRAY else 0) if value is None else value
    if isinstance(values, (str, Mapping)) or not hasattr(values, "__len__"):
        raise ValueError(f"{place} is a sequence, got {type(values).__name__}")
    if node == Nodetype.SEQUENCE and length and len(values) > length:
        raise ValueError(f"{place}: {len(values)} elements, at most {length}")
    if node == Nodetype.ARRAY and len(values) != length:
        raise ValueError(f"{place} has {length} elements, got {len(values)}")
    if item_node == Nodetype.NAME:
        return [message(types, item, element) for element in values]
    if item[0] in ("string", "wstring"):
        return [_base(place, item[0], text) for text in values]
    dtype = np.dtype("uint8" if item[0] in _BYTES else item[0])
    if value is None:
        return np.zeros(len(values), dtype)
    array = np.array(list(values) if isinstance(values, tuple) else values, dtype=dtype)
    if array.ndim != 1:
        raise ValueError(f"{place} is a flat sequence, got shape {array.shape}")
    return array


def _base(place: str, name: str, value: Any) -> Any:
    if value is None:
        return _ZERO.get(name, 0)
    is_text = name in ("string", "wstring")
    if is_text != isinstance(value, str):
        raise ValueError(f"{place} is a {name}, got {value!r}")
    if is_text:
        return value
    kind = bool if name == "bool" else float if name.startswith("float") else int
    try:
        number = kind(value[0]) if isinstance(value, bytes) else kind(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{place} is a {name}, got {value!r}") from error
    if kind is int:
        is_same = number == value or isinstance(value, bytes)
        if not is_same or not _limits(name)[0] <= number <= _limits(name)[1]:
            raise ValueError(f"{place} is a {name}, got {value!r}")
    return number


@cache
def _limits(name: str) -> tuple[int, int]:
    """Smallest and largest number of a whole type."""
    limits = np.iinfo("uint8" if name in _BYTES else name)
    return int(limits.min), int(limits.max)
