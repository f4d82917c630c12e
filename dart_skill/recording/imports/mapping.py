"""What a recording from elsewhere calls its topics, files and columns, and in which axes and units
it is: a YAML file, read strictly.

docs/bags.md explains it, config/recordings/example.yaml has every key. Our own bags need none:
`OWN`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from dart_skill.common.arm_choice import joint_count
from dart_skill.common.configuration import read_yaml
from dart_skill.common.constants import UNTURNED
from dart_skill.common.world import ROLES, the_world
from dart_skill.recording.imports.faults import Fault
from dart_skill.recording.imports.pose_stream import (
    AS_OURS,
    UP_AXES,
    Axes,
    RigidTransform,
    axes_matrix,
)

TIME_UNITS = {"s": 1e9, "ms": 1e6, "us": 1e3, "ns": 1.0}
"""Nanoseconds of each unit of time."""
TIME_SOURCES = ("stamp", "log")
"""What tells the time of a message: its own stamp, or when it was recorded."""
REGULAR = "regular"
"""Word for samples that are evenly spaced, whatever their stamps say."""
LENGTH_UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254, "ft": 0.3048}
"""Metres of each unit of length."""
ANGLE_UNITS = {"rad": 1.0, "deg": np.pi / 180.0}
"""Radians of each unit of angle."""
QUATERNION_ORDERS = {"xyzw": (0, 1, 2, 3), "wxyz": (1, 2, 3, 0)}
"""Places of x, y, z, w in each order."""

EULER_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
"""Orders of three angles about the axes x, y, z."""
ROTATIONS = {
    "helical": "",
    **{one: one for one in EULER_ORDERS},
    **{f"fixed {one}": one.lower() for one in EULER_ORDERS},
}
"""How three numbers tell an orientation: as an axis that is as long as the angle, or as angles
about the axes of the body, or about fixed axes, in this order; and the sequence of SciPy that is
meant.
"""
TABLE_KINDS = ("table", "csv")
"""Keys of a table of columns; both mean the same."""
CAPTURE_KINDS = ("capture", "motive")
"""Keys of a file of motion capture; both mean the same."""


class MappingError(ValueError):
    """A mapping that cannot be read; the message names the place in the file."""


@dataclass(frozen=True)
class Clock:
    """How the time of a sample follows from what was recorded.

    Parameters
    ----------
    source
        One of TIME_SOURCES; a table has its column of times instead.
    unit
        Of what is recorded as seconds, of TIME_UNITS.
    is_regular
        Whether samples are evenly spaced, whatever their stamps say.
    shift_ns
        Added to every stamp [ns].
    drift
        Added to every stamp, as a share of the time since the first one.
    steps
        Stamp at which the clock was set, as recorded, and what is added from then on, in order of
        recording [s].
    """

    source: str = "stamp"
    unit: str = "s"
    is_regular: bool = False
    shift_ns: int = 0
    drift: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()

    def corrected(self, stamp_ns: np.ndarray) -> np.ndarray:
        """Stamps (n,) [ns] with steps, drift and shift.

        Parameters
        ----------
        stamp_ns
            As they were recorded (n,) [ns], in the order of recording.
        """
        stamps = np.array(stamp_ns, dtype=np.int64)
        row = 0
        for at, by in self.steps:
            row += _row_of_step(np.asarray(stamp_ns)[row:], 1e9 * at, 1e9 * by)
            stamps[row:] += round(1e9 * by)
        if self.drift and len(stamps):
            stamps = stamps + np.rint(self.drift * (stamps - stamps[0])).astype(np.int64)
        return stamps + self.shift_ns


def _row_of_step(stamps: np.ndarray, at: float, by: float) -> int:
    """The first of stamps (n,), in the order of recording, after their clock went from `at` to `at
    - by` [ns]; n if none is.

    Of a clock that was set back they run back there; a body that was not seen meanwhile is silent
    there.
    """
    before, after = np.concatenate([[-np.inf], stamps]), np.concatenate([stamps, [np.inf]])
    fits = (before <= at + 0.5 * abs(by)) & (after >= at - by - 0.5 * abs(by))
    holds = (before <= at - 0.5 * by) & (after >= at - 0.5 * by)
    leap = (
        np.clip((after - before) - float(np.median(np.diff(stamps))), -abs(by), 0.6 * abs(by))
        if len(stamps) > 1
        else 0.0
    )
    return int(
        np.argmax(np.where(fits, np.maximum(leap, -2.0 * leap) + 0.1 * abs(by) * holds, -1.0))
    )


@dataclass(frozen=True)
class Table:
    """A file of columns: text, or arrays of NumPy, MATLAB or Parquet.

    Parameters
    ----------
    file
        Its name, in the folder of the recording.
    columns
        Names or numbers (from 1) of its columns by what they hold.
    delimiter
        Between columns of text; empty: as the file itself tells.
    header_lines
        How many stand before the numbers of a text; they name the columns.
    """

    file: str
    columns: Mapping[str, tuple]
    delimiter: str = ""
    header_lines: int = 1


@dataclass(frozen=True)
class CaptureFile:
    """A body in a file of a motion capture program, and what the file may not say of itself.

    Parameters
    ----------
    file
        Its name, in the folder of the recording.
    body
        Name of a rigid body, a bone or a marker.
    markers
        Names of the markers that it carries, in place of the body.
    rotation
        How its orientation is told, words of ROTATIONS and ANGLE_UNITS; empty: as the file says.
    rate
        Frames per second, 0: as the file says [1/s].
    space
        "global" if positions are those of the world, which a file may not say; empty: as the file
        says.
    """

    file: str
    body: str = ""
    markers: tuple[str, ...] = ()
    rotation: tuple[str, ...] = ()
    rate: float = 0.0
    space: str = ""


@dataclass(frozen=True)
class PoseSource:
    """Where the poses of a body come from: a topic, a table, a file of motion capture, or a fixed
    position.

    Parameters
    ----------
    topic
        Name of the topic.
    child
        Of which transform on it.
    table
        Columns of a file.
    capture
        A body in a file of a motion capture program.
    fixed
        A position that never changes (3,) [m].
    frame
        Header.frame_id that is wanted, to which /tf takes other poses; "" for any.
    axes
        Where our axes x, y, z point in the recorded ones, as ("x", "-z", "y").
    orientation_axes
        The same for orientations, where a driver turns positions only; None: those of the
        positions.
    length
        Unit of lengths, of LENGTH_UNITS.
    order
        Of the numbers of a quaternion, of QUATERNION_ORDERS.
    is_inverse
        Whether quaternions turn the axes of the world into those of the body, instead of the other
        way.
    world
        From the recorded axes, once they point like ours, to ours.
    offset
        The frame that we mean, in the axes of the tracked body.
    clock
        How stamps are read.
    told
        Which of up, xyz and length the mapping itself says; a file of motion capture may say them,
        too.
    """

    topic: str = ""
    child: str = ""
    table: Table | None = None
    capture: CaptureFile | None = None
    fixed: tuple[float, ...] = ()
    frame: str = ""
    axes: Axes = AS_OURS
    orientation_axes: Axes | None = None
    length: str = "m"
    order: str = "xyzw"
    is_inverse: bool = False
    world: RigidTransform = field(default_factory=RigidTransform)
    offset: RigidTransform = field(default_factory=RigidTransform)
    clock: Clock = field(default_factory=Clock)
    told: frozenset[str] = frozenset()

    @property
    def name(self) -> str:
        """What it is called where it was recorded."""
        of_capture = self.capture and (", ".join(self.capture.markers) or self.capture.body)
        return self.topic or of_capture or (self.table.file if self.table else "")

    @property
    def is_plain(self) -> bool:
        """Whether the poses are in our axes already."""
        moved = any(t.position.any() or t.quaternion[:3].any() for t in (self.world, self.offset))
        return (
            self.axes == AS_OURS
            and self.orientation_axes in (None, AS_OURS)
            and not self.is_inverse
            and not moved
        )


@dataclass(frozen=True)
class SignalSource:
    """Where joint states or commands come from: a topic or a table.

    Parameters
    ----------
    names
        Of the seven joints in their order; empty: those of config/wam.yaml where they are there,
        else as recorded.
    angle
        Unit of the positions, of ANGLE_UNITS.
    signs
        1 or -1 for each joint that turns the other way; empty for none.
    zeros
        What each joint of the arm says where the recording says 0 [rad]; empty for zeros.
    listed
        Names of all joints of the messages that are meant, as these list them; empty for any.
    frame
        Header.frame_id of the messages that are meant, "" for any.
    clock
        How stamps are read.
    """

    topic: str = ""
    table: Table | None = None
    names: tuple[str, ...] = ()
    angle: str = "rad"
    signs: tuple[float, ...] = ()
    zeros: tuple[float, ...] = ()
    listed: tuple[str, ...] = ()
    frame: str = ""
    clock: Clock = field(default_factory=Clock)


@dataclass(frozen=True)
class RecordingMapping:
    """What a recording holds, and where.

    Parameters
    ----------
    bodies
        Sources of the poses of hand, ball and basket, by role.
    joints
        Source of the joint states, None for none.
    teacher, command
        Who tells the hand to open: a guiding person, or the arm's own controller.
    frame
        Name of the world's axes, default that of config/world.yaml.
    optional
        Roles that a recording may lack.
    """

    bodies: Mapping[str, PoseSource]
    joints: SignalSource | None = None
    teacher: SignalSource | None = None
    command: SignalSource | None = None
    frame: str = the_world().frame_id
    optional: tuple[str, ...] = ()

    @property
    def signals(self) -> dict[str, SignalSource]:
        """Sources of joint states and commands by their names, of those that there are."""
        sources = {name: getattr(self, name) for name in ("joints", "teacher", "command")}
        return {name: where for name, where in sources.items() if where is not None}

    @property
    def is_own(self) -> bool:
        """Whether everything is where our own recorder writes it."""
        return self.bodies == OWN.bodies and self.joints == OWN.joints


OWN = RecordingMapping(
    {
        role: PoseSource(topic=topic, frame=the_world().frame_id)
        for role, topic in the_world().pose_topics().items()
    },
    SignalSource("/joint_states"),
    SignalSource("/wam/teacher_wrench"),
    SignalSource("/wam/command"),
    optional=("joints", "teacher", "command"),
)
"""What our own recorder writes."""


def load_mapping(path: str | os.PathLike) -> RecordingMapping:
    """The mapping in a YAML file.

    Raises
    ------
    MappingError
        Names what is wrong with it, and where.
    """
    path = Path(path)
    try:
        content = read_yaml(path)
    except OSError as error:
        raise MappingError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise MappingError(str(error)) from error
    return parse_mapping(content, str(path))


def parse_mapping(content: Any, place: str = "mapping") -> RecordingMapping:
    """The mapping in nested dictionaries as YAML gives them.

    Parameters
    ----------
    place
        Names them in errors.
    content
        Of the file.

    Raises
    ------
    MappingError
    """
    values = _Section(content, place)
    shared = values.section("axes") or _Section({}, f"{place}: axes")
    axes = _axes(shared)
    shared.nothing_else()
    bodies = {role: _pose_source(part, axes) for role in ROLES if (part := values.section(role))}
    signals = {
        name: _signal_source(part, name)
        for name in ("joints", "teacher", "command")
        if (part := values.section(name))
    }
    frame = values.text("frame", the_world().frame_id)
    values.nothing_else()
    if missing := [role for role in ROLES if role not in bodies]:
        raise MappingError(
            f"{place}: nothing says where the {missing[0]} is: add '{missing[0]}:' with topic,"
            " table, capture or position"
        )
    return RecordingMapping(
        bodies, signals.get("joints"), signals.get("teacher"), signals.get("command"), frame=frame
    )


def with_remedies(mapping: RecordingMapping, faults: Iterable[Fault]) -> RecordingMapping:
    """A mapping with what mends faults of stamps.

    Parameters
    ----------
    faults
        As a recording has them that was read with it.
    mapping
        The one without.
    """
    bodies: dict[str, Any] = dict(mapping.bodies)
    signals: dict[str, Any] = dict(mapping.signals)
    for fault in faults:
        group = bodies if fault.body in bodies else signals
        if fault.remedy and (where := group.get(fault.body)):
            group[fault.body] = replace(
                where,
                clock=_clock(
                    _Section(yaml.safe_load(f"{{{fault.remedy}}}"), fault.body), where.clock
                ),
            )
    return replace(mapping, bodies=bodies, **signals)


class _Section:
    """A mapping of the file: every key that is asked for is taken, and what is left at the end is
    unknown.
    """

    def __init__(self, content: Any, place: str):
        if not isinstance(content, Mapping):
            raise MappingError(f"{place}: need keys and values, got {content!r}")
        self.place, self._left = place, dict(content)
        self._asked: list[str] = []

    def has(self, key: str) -> bool:
        """Whether a key is there that was not taken yet."""
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
        return self.take(
            key, default, lambda value: isinstance(value, str) and value != "", "a text"
        )

    def choice(self, key: str, default: str, choices: Mapping) -> str:
        return self.take(
            key,
            default,
            lambda value: isinstance(value, str) and value in choices,
            f"one of {', '.join(choices)}",
        )

    def number(self, key: str, default: float) -> float:
        return float(self.take(key, default, _is_number, "a number"))

    def vector(self, key: str, size: int, default: tuple[float, ...]) -> tuple[float, ...]:
        value = self.take(
            key,
            default,
            lambda value: _are_numbers(value) and len(value) == size,
            f"a list of {size} numbers",
        )
        return tuple(float(x) for x in value)

    def nothing_else(self) -> None:
        """MappingError if there are keys that were not taken."""
        if self._left:
            raise MappingError(
                f"{self.place}: unknown key '{next(iter(self._left))}'; known are"
                f" {', '.join(self._asked)}"
            )


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, (int, float))
        and not isinstance(value, bool)
        and bool(np.isfinite(value))
    )


def _are_numbers(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def mended_pose(where: PoseSource, keys: Mapping[str, Any]) -> PoseSource:
    """A source of poses with other values of some keys, as a mapping has them.

    Parameters
    ----------
    where
        The source.
    keys
        Of the section of a body: topic, offset and those of axes.

    Raises
    ------
    MappingError
    """
    section = _Section(keys, "mended")
    found = replace(
        _axes(section, where),
        topic=section.text("topic", where.topic),
        offset=_rigid(section, "offset", where.offset),
    )
    section.nothing_else()
    return found


def mended_joints(where: SignalSource, keys: Mapping[str, Any]) -> SignalSource:
    """A source of joint states with other values of some keys, as a mapping has them.

    Parameters
    ----------
    where
        The source.
    keys
        Of the section of the joints, but for topic and csv; those of the clock for teacher and
        command, too.

    Raises
    ------
    MappingError
    """
    section = _Section(keys, "mended")
    found = replace(_joint_keys(section, where), clock=_clock(section, where.clock))
    part = section.section("columns")
    if part is not None and where.table is not None:
        columns = {
            name: _columns(part, name, (len(of_this),))
            for name, of_this in where.table.columns.items()
            if part.has(name)
        }
        part.nothing_else()
        found = replace(
            found, table=replace(where.table, columns={**where.table.columns, **columns})
        )
    section.nothing_else()
    return found


def flow_text(keys: Mapping[str, Any]) -> str:
    """Keys and values of a mapping in one line of YAML.

    Parameters
    ----------
    keys
        By section.
    """
    return yaml.safe_dump(
        dict(keys), default_flow_style=True, sort_keys=False, width=10**6
    ).strip()[1:-1]


def mapping_text(mapping: RecordingMapping) -> str:
    """A mapping as the text of a file, which `load_mapping` reads as the same mapping.

    Parameters
    ----------
    mapping
        To be written.
    """
    content: dict[str, Any] = {"frame": mapping.frame}
    content |= {role: _pose_keys(where) for role, where in mapping.bodies.items()}
    content |= {name: _signal_keys(where) for name, where in mapping.signals.items()}
    return yaml.safe_dump(
        content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=140
    )


def clocks_of(mapping: RecordingMapping) -> dict[str, dict[str, Any]]:
    """How stamps are read, as the keys of a mapping by body, joints and signals; of those whose
    stamps are taken as they are, nothing.

    Parameters
    ----------
    mapping
        Says it.
    """
    sources: dict[str, PoseSource | SignalSource] = {**mapping.bodies, **mapping.signals}
    return {name: keys for name, where in sources.items() if (keys := _clock_keys(where.clock))}


def _pose_keys(where: PoseSource) -> dict[str, Any]:
    if where.fixed:
        return {"position": list(where.fixed)}
    default = PoseSource()
    named = ("topic", "child", "frame", "length", "order")
    keys: dict[str, Any] = {
        name: getattr(where, name)
        for name in named
        if getattr(where, name) != getattr(default, name) or name in where.told
    }
    keys |= _table_keys(where.table) | _capture_keys(where.capture)
    if where.axes != default.axes or where.told & {"up", "xyz"}:
        keys["xyz"] = list(where.axes)
    if where.orientation_axes is not None:
        keys["orientation_xyz"] = list(where.orientation_axes)
    if where.is_inverse:
        keys["inverse"] = True
    for name, one in (("transform", where.world), ("offset", where.offset)):
        if one.position.any() or one.quaternion[:3].any():
            quaternion = one.quaternion.tolist()
            keys[name] = {"position": one.position.tolist(), "quaternion": quaternion}
    return keys | _clock_keys(where.clock)


def _signal_keys(where: SignalSource) -> dict[str, Any]:
    keys = {
        name: getattr(where, name)
        for name in ("topic", "names", "signs", "zeros", "listed", "frame", "angle")
        if getattr(where, name) not in ("", (), "rad")
    }
    lists = {name: list(value) for name, value in keys.items() if isinstance(value, tuple)}
    return keys | lists | _table_keys(where.table) | _clock_keys(where.clock)


def _table_keys(table: Table | None) -> dict[str, Any]:
    if table is None:
        return {}
    columns = {
        name: list(found) if len(found) > 1 else found[0]
        for name, found in table.columns.items()
        if found
    }
    form = {"delimiter": table.delimiter} if table.delimiter else {}
    return {"table": table.file, **form, "header_lines": table.header_lines, "columns": columns}


def _capture_keys(capture: CaptureFile | None) -> dict[str, Any]:
    if capture is None:
        return {}
    keys: dict[str, Any] = {
        "capture": capture.file,
        "markers": list(capture.markers),
        "body": "" if capture.markers else capture.body,
        "rotation": list(capture.rotation),
        "rate": capture.rate,
        "space": capture.space,
    }
    return {name: value for name, value in keys.items() if value}


def _clock_keys(clock: Clock) -> dict[str, Any]:
    words = [clock.source, clock.unit, REGULAR if clock.is_regular else "stamp"]
    words = [word for word in words if word not in ("stamp", "s")]
    keys: dict[str, Any] = {
        "time": words,
        "time_shift": 1e-9 * clock.shift_ns,
        "time_steps": [list(one) for one in clock.steps],
        "time_drift": clock.drift,
    }
    return {name: value for name, value in keys.items() if value}


def _axes(section: _Section, default: PoseSource | None = None) -> PoseSource:
    default = default or PoseSource()
    keys = {key for key in ("up", "xyz", "length") if section.has(key)}
    if keys >= {"up", "xyz"}:
        raise MappingError(f"{section.place}: give up or xyz, not both")
    up = section.choice("up", "", UP_AXES)
    axes = UP_AXES[up] if up else _signed_axes(section, "xyz", default.axes) or default.axes
    return replace(
        default,
        told=default.told | keys,
        axes=axes,
        orientation_axes=_signed_axes(section, "orientation_xyz", default.orientation_axes),
        length=section.choice("length", default.length, LENGTH_UNITS),
        order=section.choice("order", default.order, QUATERNION_ORDERS),
        is_inverse=section.take(
            "inverse", default.is_inverse, lambda value: isinstance(value, bool), "true or false"
        ),
        world=_rigid(section, "transform", default.world),
        clock=_clock(section, default.clock),
    )


def _signed_axes(section: _Section, key: str, default: Axes | None) -> Axes | None:
    """Three signed axes below a key."""
    found = section.take(
        key,
        default,
        lambda value: isinstance(value, list) and axes_matrix(tuple(map(str, value))) is not None,
        "where our x, y, z point in the recorded axes, as [x, -z, y]",
    )
    return None if found is None else (str(found[0]), str(found[1]), str(found[2]))


def _clock(section: _Section, default: Clock | None = None) -> Clock:
    default = default or Clock()
    known = (*TIME_SOURCES, REGULAR, *TIME_UNITS)

    def check(value: Any) -> bool:
        words = value if isinstance(value, list) else [value]
        return all(isinstance(one, str) and one in known for one in words)

    value = section.take("time", [], check, f"one or several of {', '.join(known)}")
    words = value if isinstance(value, list) else [value]
    steps = section.take(
        "time_steps",
        default.steps,
        lambda value: (
            isinstance(value, list) and all(_are_numbers(one) and len(one) == 2 for one in value)
        ),
        "for each time that the clock was set its last stamp before and what is added from then"
        " on, as [[12.4, 0.3]]",
    )
    return Clock(
        source=next((one for one in words if one in TIME_SOURCES), default.source),
        unit=next((one for one in words if one in TIME_UNITS), default.unit),
        is_regular=default.is_regular or REGULAR in words,
        shift_ns=round(1e9 * section.number("time_shift", 1e-9 * default.shift_ns)),
        drift=section.number("time_drift", default.drift),
        steps=tuple((float(at), float(by)) for at, by in steps),
    )


def _rigid(section: _Section, key: str, default: RigidTransform) -> RigidTransform:
    part = section.section(key)
    if part is None:
        return default
    position = part.vector("position", 3, (0.0, 0.0, 0.0))
    quaternion = part.vector("quaternion", 4, ())
    degrees = part.vector("roll_pitch_yaw_deg", 3, ())
    part.nothing_else()
    if quaternion and degrees:
        raise MappingError(f"{part.place}: give quaternion or roll_pitch_yaw_deg, not both")
    try:
        return RigidTransform(np.array(position), _turn(quaternion or UNTURNED, degrees))
    except ValueError as error:
        raise MappingError(f"{part.place}: {error}") from error


def _turn(quaternion: Sequence[float], degrees: Sequence[float]) -> np.ndarray:
    """A quaternion (4,); that of roll, pitch and yaw about fixed axes if they are given."""
    if not degrees:
        return np.array(quaternion)
    # our own bags need none, and it takes longer to import than all that reads them
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", degrees, degrees=True).as_quat()


def _pose_source(section: _Section, axes: PoseSource) -> PoseSource:
    kind = _one_of(section, "topic", *TABLE_KINDS, *CAPTURE_KINDS, "position")
    own = _axes(section, axes)
    where: dict[str, Any] = {}
    if kind == "position":
        where["fixed"] = section.vector("position", 3, ())
    elif kind == "topic":
        where = {name: section.text(name) for name in ("topic", "child", "frame")}
    elif kind in CAPTURE_KINDS:
        where["capture"] = _capture(section, kind)
    else:
        where["table"] = _table(
            section, kind, {"time": (1,), "position": (3, 1), "quaternion": (4, 1, 0)}
        )
    offset = _rigid(section, "offset", RigidTransform())
    section.nothing_else()
    if own.clock.source == "log" and "topic" not in where:
        raise MappingError(
            f"{section.place}: time is log, but only messages of a bag have a log time: give time:"
            " stamp here"
        )
    return replace(own, **where, offset=offset)


def _one_of(section: _Section, *kinds: str) -> str:
    """The one of these keys that is there."""
    given = [kind for kind in kinds if section.has(kind)]
    if len(given) != 1:
        known = ", ".join(
            kind for kind in kinds if kind not in (*TABLE_KINDS[1:], *CAPTURE_KINDS[1:])
        )
        raise MappingError(
            f"{section.place}: give exactly one of {known}; got"
            f" {', '.join(given) or 'none of them'}"
        )
    return given[0]


def _capture(section: _Section, kind: str) -> CaptureFile:
    file, role = section.text(kind), section.place.rsplit(": ", 1)[1]
    if section.has("body") and section.has("markers"):
        raise MappingError(f"{section.place}: give body or markers, not both")
    words = (*ROTATIONS, *ANGLE_UNITS)

    def are_words(value: Any) -> bool:
        given = value if isinstance(value, list) else [value]
        return all(isinstance(one, str) and one in words for one in given) and len(given) <= 2

    said = section.take(
        "rotation", [], are_words, f"one or two of {', '.join(words)}, as [XYZ, deg]"
    )
    markers = section.take(
        "markers",
        (),
        lambda value: _are_names(value) and len(set(value)) == len(value) > 0,
        "a list of different names of markers",
    )
    rate = section.take(
        "rate", 0.0, lambda value: _is_number(value) and value > 0, "the frames per second"
    )
    return CaptureFile(
        file,
        section.text("body", role),
        tuple(markers),
        tuple(said) if isinstance(said, list) else (said,),
        float(rate),
        section.choice("space", "", {"global": 1.0}),
    )


def _signal_source(section: _Section, name: str) -> SignalSource:
    kind = _one_of(section, "topic", *TABLE_KINDS)
    is_table = kind != "topic"
    clock = _clock(section)
    wanted: dict[str, tuple[int, ...]] = {"time": (1,)}
    source = SignalSource()
    if name == "joints":
        wanted |= {"position": (joint_count(), 1), "velocity": (joint_count(), 1, 0)}
        source = _joint_keys(section, source)
    table = _table(section, kind, wanted) if is_table else None
    topic = "" if is_table else section.text("topic")
    section.nothing_else()
    return replace(source, topic=topic, table=table, clock=clock)


def _joint_keys(section: _Section, default: SignalSource) -> SignalSource:
    return replace(
        default,
        names=tuple(
            section.take(
                "names",
                default.names,
                lambda value: _are_names(value) and len(set(value)) == len(value) == joint_count(),
                f"the names of {joint_count()} joints",
            )
        ),
        angle=section.choice("angle", default.angle, ANGLE_UNITS),
        signs=tuple(
            section.take(
                "signs",
                default.signs,
                lambda value: (
                    _are_numbers(value)
                    and len(value) == joint_count()
                    and all(abs(one) == 1 for one in value)
                ),
                f"1 or -1 for each of {joint_count()} joints",
            )
        ),
        zeros=section.vector("zeros", joint_count(), default.zeros),
        listed=tuple(section.take("listed", default.listed, _are_names, "names of joints")),
        frame=section.text("frame", default.frame),
    )


def _are_names(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(one, str) for one in value)


def _table(section: _Section, kind: str, wanted: Mapping[str, tuple[int, ...]]) -> Table:
    """wanted: how many columns each name may have; 0: it may be missing; 1 beside others: one
    array with all of them.
    """
    file = section.text(kind)
    delimiter = section.take(
        "delimiter", "", lambda value: isinstance(value, str) and len(value) == 1, "one character"
    )
    lines = section.take(
        "header_lines",
        1,
        lambda value: isinstance(value, int) and not isinstance(value, bool) and value >= 0,
        "a number",
    )
    part = section.section("columns")
    if part is None:
        raise MappingError(
            f"{section.place}: columns are missing: name those of {', '.join(wanted)}"
        )
    columns = {name: _columns(part, name, sizes) for name, sizes in wanted.items()}
    part.nothing_else()
    if lines == 0 and (
        words := [c for group in columns.values() for c in group if isinstance(c, str)]
    ):
        raise MappingError(
            f"{part.place}: column '{words[0]}' has a name, but header_lines is 0: give numbers,"
            " the first column is 1"
        )
    return Table(file, columns, delimiter, lines)


def _columns(section: _Section, name: str, sizes: tuple[int, ...]) -> tuple:
    def is_column(value: Any) -> bool:
        return isinstance(value, str) or (
            isinstance(value, int) and not isinstance(value, bool) and value >= 1
        )

    def check(value: Any) -> bool:
        columns = value if isinstance(value, list) else [value]
        return len(columns) in sizes and all(map(is_column, columns))

    what = f"{sizes[0]} name{'s' * (sizes[0] > 1)} or numbers (the first column is 1)"
    value = section.take(name, [], check, what)
    columns = tuple(value) if isinstance(value, list) else (value,)
    if len(columns) not in sizes:
        raise MappingError(f"{section.place}: {name} is missing: give {what}")
    return columns
