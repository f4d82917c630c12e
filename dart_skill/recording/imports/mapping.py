"""What a recording from elsewhere calls its topics, files and columns, and in which axes and units it is: a YAML file, read strictly.

docs/bags.md explains it, config/recordings/example.yaml has every key. Our own bags need none: `OWN`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from dart_skill.constants import N_JOINTS, UNTURNED
from dart_skill.recording.imports.pose_stream import UP_AXES, RigidTransform
from dart_skill.world import ROLES, the_world

TIME_UNITS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
QUATERNION_ORDERS = {"xyzw": (0, 1, 2, 3), "wxyz": (1, 2, 3, 0)}
"""For each order, where x, y, z, w stand in it."""


class MappingError(ValueError):
    """A mapping that cannot be read; the message names the place in the file."""


@dataclass(frozen=True)
class Table:
    """A CSV file.

    * file: its name, in the folder of the recording.
    * columns: names or numbers (from 1) of its columns by what they hold.
    * time: a unit of TIME_UNITS.
    * delimiter: between columns.
    * header_lines: how many stand before the numbers; the last of them names the columns.
    """

    file: str
    columns: Mapping[str, tuple]
    time: str = "s"
    delimiter: str = ","
    header_lines: int = 1


@dataclass(frozen=True)
class PoseSource:
    """Where the poses of a body come from: a topic, a table, a Motive export, or a fixed position.

    * topic: name of the topic; child: of which transform on it.
    * table: columns of a CSV file.
    * motive: file of a Motive export; body: the name of the body there.
    * fixed: a position that never changes (3,) [m].
    * frame: header.frame_id that the messages must have, "" for any.
    * up: axis that points up, of UP_AXES, default "z".
    * length: unit of lengths, of LENGTH_UNITS, default "m".
    * order: of the numbers of a quaternion, of QUATERNION_ORDERS, default "xyzw".
    * world: from the recorded axes, once z is up, to ours.
    * offset: the frame that we mean, in the axes of the tracked body.
    * shift_ns: added to stamps [ns].
    """

    topic: str = ""
    child: str = ""
    table: Table | None = None
    motive: str = ""
    body: str = ""
    fixed: tuple[float, ...] = ()
    frame: str = ""
    up: str = "z"
    length: str = "m"
    order: str = "xyzw"
    world: RigidTransform = field(default_factory=RigidTransform)
    offset: RigidTransform = field(default_factory=RigidTransform)
    shift_ns: int = 0

    @property
    def is_plain(self) -> bool:
        """Whether the poses are in our axes and units already."""
        moved = any(t.position.any() or t.quaternion[:3].any() for t in (self.world, self.offset))
        return self.up == "z" and self.length == "m" and not moved


@dataclass(frozen=True)
class SignalSource:
    """Where joint states or commands come from: a topic or a table.

    * names: of the seven joints in their order; empty: those of config/wam.yaml where they are there, else as recorded.
    * shift_ns: added to stamps.
    """

    topic: str = ""
    table: Table | None = None
    names: tuple[str, ...] = ()
    shift_ns: int = 0


@dataclass(frozen=True)
class RecordingMapping:
    """What a recording holds, and where.

    * bodies: sources of the poses of hand, ball and basket, by role.
    * joints: source of the joint states, None for none.
    * teacher, command: who tells the hand to open: a guiding person, or the arm's own controller.
    * frame: name of the world's axes, default that of config/world.yaml.
    * optional: roles that a recording may lack.
    """

    bodies: Mapping[str, PoseSource]
    joints: SignalSource | None = None
    teacher: SignalSource | None = None
    command: SignalSource | None = None
    frame: str = the_world().frame_id
    optional: tuple[str, ...] = ()


OWN = RecordingMapping(
    {role: PoseSource(topic=topic, frame=the_world().frame_id) for role, topic in the_world().pose_topics().items()},
    SignalSource("/joint_states"),
    SignalSource("/wam/teacher_wrench"),
    SignalSource("/wam/command"),
    optional=("joints", "teacher", "command"),
)
"""What our own recorder writes."""


def load_mapping(path: str | os.PathLike) -> RecordingMapping:
    """The mapping in a YAML file; MappingError names what is wrong with it, and where."""
    path = Path(path)
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise MappingError(f"{path}: {error.strerror}") from error
    except yaml.YAMLError as error:
        raise MappingError(f"{path}: no YAML: {error}") from error
    return parse_mapping(content, str(path))


def parse_mapping(content: Any, place: str = "mapping") -> RecordingMapping:
    """The mapping in nested dictionaries as YAML gives them; MappingError. place: names them in errors. content: of the file."""
    values = _Section(content, place)
    shared = values.section("axes") or _Section({}, f"{place}: axes")
    axes = _axes(shared)
    shared.nothing_else()
    bodies = {role: _pose_source(part, axes) for role in ROLES if (part := values.section(role))}
    signals = {name: _signal_source(part, name) for name in ("joints", "teacher", "command") if (part := values.section(name))}
    frame = values.text("frame", the_world().frame_id)
    values.nothing_else()
    if missing := [role for role in ROLES if role not in bodies]:
        raise MappingError(f"{place}: nothing says where the {missing[0]} is: add '{missing[0]}:' with topic, csv, motive or position")
    return RecordingMapping(bodies, signals.get("joints"), signals.get("teacher"), signals.get("command"), frame=frame)


class _Section:
    """A mapping of the file: every key that is asked for is taken, and what is left at the end is unknown."""

    def __init__(self, content: Any, place: str):
        if not isinstance(content, Mapping):
            raise MappingError(f"{place}: need keys and values, got {content!r}")
        self.place, self._left = place, dict(content)
        self._asked: list[str] = []

    def has(self, key: str) -> bool:
        """Whether a key is there that nobody has asked for yet."""
        return key in self._left

    def take(self, key: str, default: Any, check: Callable[[Any], bool], what: str) -> Any:
        """Value of a key, or the default; MappingError unless it passes the check."""
        self._asked.append(key)
        if key not in self._left:
            return default
        value = self._left.pop(key)
        if not check(value):
            raise MappingError(f"{self.place}: {key} is {value!r}; give {what}")
        return value

    def section(self, key: str) -> _Section | None:
        """The keys and values below a key, None if it is not there."""
        value = self.take(key, None, lambda _: True, "")
        return None if value is None else _Section(value, f"{self.place}: {key}")

    def text(self, key: str, default: str = "") -> str:
        return self.take(key, default, lambda value: isinstance(value, str) and value != "", "a text")

    def choice(self, key: str, default: str, choices: Mapping) -> str:
        return self.take(key, default, lambda value: isinstance(value, str) and value in choices, f"one of {', '.join(choices)}")

    def number(self, key: str, default: float) -> float:
        return float(self.take(key, default, _is_number, "a number"))

    def vector(self, key: str, size: int, default: tuple[float, ...]) -> tuple[float, ...]:
        def check(value: Any) -> bool:
            return isinstance(value, list) and len(value) == size and all(map(_is_number, value))

        return tuple(float(x) for x in self.take(key, default, check, f"a list of {size} numbers"))

    def nothing_else(self) -> None:
        """MappingError if there are keys that nobody asked for."""
        if self._left:
            raise MappingError(f"{self.place}: unknown key '{next(iter(self._left))}'; known are {', '.join(self._asked)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and bool(np.isfinite(value))


def _axes(section: _Section, default: PoseSource | None = None) -> PoseSource:
    default = default or PoseSource()
    return PoseSource(
        up=section.choice("up", default.up, UP_AXES),
        length=section.choice("length", default.length, LENGTH_UNITS),
        world=_rigid(section, "transform", default.world),
        shift_ns=round(1e9 * section.number("time_shift", 1e-9 * default.shift_ns)),
    )


def _rigid(section: _Section, key: str, default: RigidTransform) -> RigidTransform:
    part = section.section(key)
    if part is None:
        return default
    position = part.vector("position", 3, (0.0, 0.0, 0.0))
    quaternion, degrees = part.vector("quaternion", 4, ()), part.vector("roll_pitch_yaw_deg", 3, ())
    part.nothing_else()
    if quaternion and degrees:
        raise MappingError(f"{part.place}: give quaternion or roll_pitch_yaw_deg, not both")
    try:
        return RigidTransform(np.array(position), _turned(degrees) if degrees else np.array(quaternion or UNTURNED))
    except ValueError as error:
        raise MappingError(f"{part.place}: {error}") from error


def _turned(degrees: Sequence[float]) -> np.ndarray:
    """Quaternion (4,) of roll, pitch and yaw about fixed axes."""
    from scipy.spatial.transform import Rotation  # our own bags need none, and it takes longer to import than all that reads them

    return Rotation.from_euler("xyz", degrees, degrees=True).as_quat()


def _pose_source(section: _Section, axes: PoseSource) -> PoseSource:
    kinds = ("topic", "csv", "motive", "position")
    given = [kind for kind in kinds if section.has(kind)]
    if len(given) != 1:
        raise MappingError(f"{section.place}: give exactly one of {', '.join(kinds)}; got {', '.join(given) or 'none of them'}")
    own = _axes(section, axes)
    where: dict[str, Any] = {}
    if given == ["position"]:
        where["fixed"] = section.vector("position", 3, ())
    elif given == ["topic"]:
        where = {"topic": section.text("topic"), "child": section.text("child"), "frame": section.text("frame")}
    elif given == ["motive"]:
        where = {"motive": section.text("motive"), "body": section.text("body", section.place.rsplit(": ", 1)[1])}
    else:
        where["table"] = _table(section, {"time": (1,), "position": (3,), "quaternion": (4, 0)})
        where["order"] = section.choice("order", "xyzw", QUATERNION_ORDERS)
    offset = _rigid(section, "offset", RigidTransform())
    section.nothing_else()
    return replace(own, **where, offset=offset)


def _signal_source(section: _Section, name: str) -> SignalSource:
    is_table = section.has("csv")
    if section.has("topic") == is_table:
        raise MappingError(f"{section.place}: give either topic or csv")
    shift_ns = round(1e9 * section.number("time_shift", 0.0))
    names: tuple[str, ...] = ()
    wanted: dict[str, tuple[int, ...]] = {"time": (1,)}
    if name == "joints":
        names = tuple(section.take("names", (), _are_joints, f"the names of {N_JOINTS} joints"))
        wanted |= {"position": (N_JOINTS,), "velocity": (N_JOINTS, 0)}
    table = _table(section, wanted) if is_table else None
    topic = "" if is_table else section.text("topic")
    section.nothing_else()
    return SignalSource(topic, table, names, shift_ns)


def _are_joints(value: Any) -> bool:
    return isinstance(value, list) and len(set(value)) == N_JOINTS and all(isinstance(one, str) for one in value)


def _table(section: _Section, wanted: Mapping[str, tuple[int, ...]]) -> Table:
    """wanted: how many columns each name may have; 0: it may be missing."""
    file = section.text("csv")
    delimiter = section.take("delimiter", ",", lambda value: isinstance(value, str) and len(value) == 1, "one character")
    lines = section.take("header_lines", 1, lambda value: isinstance(value, int) and not isinstance(value, bool) and value >= 0, "a number")
    unit = section.choice("time", "s", TIME_UNITS)
    part = section.section("columns")
    if part is None:
        raise MappingError(f"{section.place}: columns are missing: name those of {', '.join(wanted)}")
    columns = {name: _columns(part, name, sizes) for name, sizes in wanted.items()}
    part.nothing_else()
    if lines == 0 and (words := [c for group in columns.values() for c in group if isinstance(c, str)]):
        raise MappingError(f"{part.place}: column '{words[0]}' has a name, but header_lines is 0: give numbers, the first column is 1")
    return Table(file, columns, unit, delimiter, lines)


def _columns(section: _Section, name: str, sizes: tuple[int, ...]) -> tuple:
    def is_column(value: Any) -> bool:
        return isinstance(value, str) or (isinstance(value, int) and not isinstance(value, bool) and value >= 1)

    def check(value: Any) -> bool:
        columns = value if isinstance(value, list) else [value]
        return len(columns) in sizes and all(map(is_column, columns))

    what = f"{sizes[0]} name{'s' * (sizes[0] > 1)} or numbers (the first column is 1)"
    value = section.take(name, [], check, what)
    columns = tuple(value) if isinstance(value, list) else (value,)
    if len(columns) not in sizes:
        raise MappingError(f"{section.place}: {name} is missing: give {what}")
    return columns
