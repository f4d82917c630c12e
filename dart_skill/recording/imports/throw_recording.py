"""Recordings of throws from anywhere as what the sensors saw of hand, ball, basket and arm: our bags, other people's bags, CSV files.

A mapping says where everything is (`mapping`); poses come out in our axes and units, without the faults that can be repaired
(`pose_faults`). `convert` writes them as a bag of ours.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.constants import N_JOINTS, NS_PER_S, UNTURNED, Grip
from dart_skill.recording.bags import (
    BagError,
    BagMessage,
    BagReader,
    BagWriter,
    GraphBag,
    columns_of,
    definition,
    deserialize,
    header_content,
    pose_content,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.grip_signal import GUIDED_NS, GripSignal, Opening, read_commands
from dart_skill.recording.imports._tables import read_pose_table, read_table
from dart_skill.recording.imports.mapping import (
    ANGLE_UNITS,
    LENGTH_UNITS,
    OWN,
    QUATERNION_ORDERS,
    PoseSource,
    RecordingMapping,
    SignalSource,
)
from dart_skill.recording.imports.motion_capture import read_capture
from dart_skill.recording.imports.pose_faults import Fault, repair
from dart_skill.recording.imports.pose_stream import PoseStream, transformed, with_continuous_signs
from dart_skill.world import joint_names, the_world

POSE_TYPES = ("PoseStamped", "PoseWithCovarianceStamped", "PointStamped", "TransformStamped", "Odometry", "TFMessage")
SIGNAL_TYPES = ("WamCommand", "Bool", "Empty")
PART_NS, PAUSE_NS = 180_000_000_000, 500_000_000
"""A part of a long recording takes so long, and ends with the next pause of so long, or when it is twice as long [ns]."""


@dataclass(frozen=True, eq=False)
class JointStream:
    """The arm's own sensors, in the order of recording.

    * stamp_ns: (n,) [ns].
    * position: (n, 7) [rad].
    * velocity: (n, 7) [rad/s].
    * names: of the joints; may be empty.
    """

    stamp_ns: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ThrowRecording:
    """What a recording holds.

    * source: where it comes from.
    * bodies: poses of hand, ball and basket, by role.
    * joints: joint states, None if they were not recorded.
    * openings: when the hand was told to open, in order of time.
    * has_button: whether somebody recorded at all when the hand was told to open.
    * faults: found in the poses.
    * frame_id: of the poses, default that of config/world.yaml.
    * command_stamps: of the commands to the arm (n,) [ns], in order of time; none where they were not recorded.
    """

    source: str
    bodies: dict[str, PoseStream]
    joints: JointStream | None
    openings: tuple[Opening, ...]
    has_button: bool
    faults: tuple[Fault, ...]
    frame_id: str = the_world().frame_id
    command_stamps: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))


def read_recording(source: str | os.PathLike, mapping: RecordingMapping | None = None, mend: bool = True) -> ThrowRecording:
    """Everything that a mapping names, without the faults that can be repaired.

    source: bag, or folder with CSV files.
    mapping: None for bags of our own.
    mend: whether to look for faults at all.

    ValueError says what is missing, in which file and line, and BagError what is wrong with a bag.
    """
    (recording,) = read_in_parts(source, mapping, part_ns=0, mend=mend)
    return recording


def read_in_parts(
    source: str | os.PathLike, mapping: RecordingMapping | None = None, part_ns: int = PART_NS, mend: bool = True
) -> Iterator[ThrowRecording]:
    """As `read_recording`, one part of a bag of ours after the other, so that only a part of a long one is in memory.

    A part ends in a pause, where there is one: a world that is set anew. Faults are looked for in each part by itself. Recordings of
    others, and without the command that opens the hand, are one part.

    * source, mapping, mend: as for that.
    * part_ns: log time of a part, about; 0: all is one part [ns].

    ValueError and BagError as there; for a body that was never seen at the end.
    """
    source, mapping = Path(source), mapping or OWN
    if not source.exists():
        raise BagError(f"{source}: no such bag or folder")
    never_seen = {role: where for role, where in mapping.bodies.items() if not where.fixed}
    for taken in _read_topics(source, mapping, part_ns if mapping is OWN else 0):
        recording = _recording(source, mapping, taken, mend)
        never_seen = {role: where for role, where in never_seen.items() if not len(recording.bodies[role])}
        if part_ns == 0:
            _require_seen(never_seen)
        yield recording
    _require_seen(never_seen)


def _require_seen(never_seen: dict[str, PoseSource]) -> None:
    for role, where in never_seen.items():
        name = where.topic or next(one.file for one in (where.table, where.capture) if one)
        raise ValueError(f"{name}: no pose of the {role}: was it tracked?")


def _recording(source: Path, mapping: RecordingMapping, taken: dict[str, Any], mend: bool) -> ThrowRecording:
    """What was collected, in our axes and units."""
    folder = source if source.is_dir() else source.parent
    bodies = {role: _body(role, where, taken, folder, mapping.frame) for role, where in mapping.bodies.items() if not where.fixed}
    repaired, faults = repair({role: body for role, body in bodies.items() if len(body)}) if mend else ({}, [])
    bodies |= repaired
    for role, where in mapping.bodies.items():
        if where.fixed:
            bodies[role] = _resting(role, where.fixed, bodies["hand"].stamp_ns, mapping.frame)
    joints = _joints(mapping.joints, taken.get("joints"), folder)
    openings = _openings(mapping, taken, folder)
    has_button = any(name in taken or (where is not None and where.table) for name, where in _buttons(mapping))
    commands = taken["command"].stamps if "command" in taken else ()
    stamps = np.unique(np.asarray(commands, dtype=np.int64))
    return ThrowRecording(source.name, bodies, joints, openings, has_button, tuple(faults), mapping.frame, stamps)


def convert(source: str | os.PathLike, output: str | os.PathLike, mapping: RecordingMapping | None = None) -> ThrowRecording:
    """Write a recording as a bag in our layout: our topics, `world` axes, Z up, quaternions of continuous sign; returns what was read.

    source, mapping: as for `read_recording`.
    output: folder of the bag, which must not exist.

    Where it came from and what was wrong with it stands in the bag's custom data.
    """
    recording = read_recording(source, mapping)
    types = typestore()
    faults = [asdict(fault) for fault in recording.faults if not fault.is_information]
    gaps = Counter(fault.body for fault in recording.faults if fault.is_information)
    about = {"source": recording.source, "faults": json.dumps(faults), "gaps": json.dumps(gaps)}
    messages = sorted(_messages(recording), key=lambda item: item[1])
    with BagWriter(output, custom_data=about) as bag:
        for topic, type_name in sorted({(topic, type_name) for topic, _, type_name, _ in messages}):
            bag.add_topic(topic, type_name, definition(types, type_name), qos_yaml(), type_hash(types, type_name))
        for topic, stamp, type_name, content in messages:
            bag.write(topic, stamp, stamp, serialize(types, type_name, content))
    return recording


# reading


@dataclass
class _Poses:
    """stamps: (n,) [ns]; rows: x, y, z, qx, qy, qz, qw of each."""

    stamps: Any
    rows: Any


@dataclass
class _States:
    """stamps: (n,) [ns]; names: of the first state; position, velocity: a row for each."""

    stamps: Any
    names: list[str]
    position: Any
    velocity: Any


class _Signal(GripSignal):
    """With the stamps of all commands (n,) [ns], in the order of recording."""

    stamps: np.ndarray = np.empty(0, dtype=np.int64)

    def begin_part(self) -> None:
        """Forget the part before, but for pushes after which the arm is guided still, and whether the hand is held open."""
        self.openings, self.stamps = [], np.empty(0, dtype=np.int64)
        if self.pushes:
            self.forget_before(self.pushes[-1] - GUIDED_NS)


def _buttons(mapping: RecordingMapping) -> list[tuple[str, SignalSource | None]]:
    return [("teacher", mapping.teacher), ("command", mapping.command)]


def _read_topics(source: Path, mapping: RecordingMapping, part_ns: int) -> Iterator[dict[str, Any]]:
    """What was collected for each role that is a topic, part by part; all at once for 0, or where nobody told the hand to open."""
    roles: dict[str, Any] = {**mapping.bodies, "joints": mapping.joints, **dict(_buttons(mapping))}
    wanted = {role: where for role, where in roles.items() if where is not None and where.topic}
    if not wanted:
        yield {}
        return
    with (GraphBag if mapping is OWN else BagReader)(source, typestore) as bag:
        there = {}
        for role, where in wanted.items():
            if where.topic in bag.topics:
                there[role] = where
            elif role not in mapping.optional:
                raise BagError(f"{source}: no topic {where.topic} for '{role}', only {sorted(bag.topics)}: name it in a mapping")
        signals = {role: _Signal() for role in there if role in ("teacher", "command")}
        for part in _parts(bag.messages({where.topic for where in there.values()}, decode=False), part_ns if signals else 0):
            yield _collected(part, there, bag, signals)


def _parts(messages: Iterator[BagMessage], part_ns: int) -> Iterator[Iterator[BagMessage]]:
    """The messages of each part, to be taken one after the other."""
    first = next(messages, None)
    if first is None:
        yield iter(())
    while first is not None:
        part = _Part(first, messages, part_ns)
        yield iter(part)
        first = part.following


class _Part:
    """Messages up to the end of a part; afterwards `following` is the first of the next one, None if there is none."""

    def __init__(self, first: BagMessage, messages: Iterator[BagMessage], part_ns: int):
        self._first, self._messages, self._part_ns = first, messages, part_ns
        self.following: BagMessage | None = None

    def __iter__(self) -> Iterator[BagMessage]:
        yield self._first
        begin = last = self._first.stamp_ns
        for message in self._messages:
            lasted = message.stamp_ns - begin
            if self._part_ns and lasted >= self._part_ns and (message.stamp_ns - last > PAUSE_NS or lasted >= 2 * self._part_ns):
                self.following = message
                return
            last = message.stamp_ns
            yield message


def _collected(
    messages: Iterator[BagMessage], wanted: dict[str, PoseSource | SignalSource], bag: BagReader, signals: dict[str, _Signal]
) -> dict[str, Any]:
    """What was collected of some messages for each role."""
    collectors: dict[str, list[Callable]] = {}
    collected: dict[str, Callable[[], Any]] = {}
    for role, where in wanted.items():
        collected[role], collect = _collector(role, where, bag.topics[where.topic].type_name, bag, signals)
        collectors.setdefault(where.topic, []).append(collect)
    for message in messages:
        for collect in collectors[message.topic]:
            collect(message)
    return {role: content() for role, content in collected.items()}


def _collector(
    role: str, where: PoseSource | SignalSource, type_name: str, bag: BagReader, signals: dict[str, _Signal]
) -> tuple[Callable[[], Any], Callable[[BagMessage], None]]:
    """Two functions: what was collected of a topic in the end, and one that takes a message."""
    name = type_name.rsplit("/", 1)[1]
    kinds = {"joints": ("JointState",), "teacher": SIGNAL_TYPES, "command": SIGNAL_TYPES}.get(role, POSE_TYPES)
    if name not in kinds:
        raise BagError(f"{bag.path}: {where.topic} has type {type_name}; for '{role}' it must be one of {', '.join(kinds)}")
    messages: list[BagMessage] = []
    if role in ("teacher", "command"):
        return lambda: _signal(messages, name, bag, signals[role]), messages.append
    if role == "joints":
        return lambda: _states(messages, bag), messages.append
    assert isinstance(where, PoseSource)  # as every body has
    return lambda: _poses(messages, role, where, name, bag), messages.append


def _decoded(bag: BagReader, message: BagMessage) -> Any:
    try:
        return deserialize(bag.types, message.type_name, message.data)
    except ValueError as error:
        raise BagError(f"{bag.path}: topic {message.topic}: {error}") from error


def _columns(messages: list[BagMessage], bag: BagReader) -> tuple[Any, np.ndarray, np.ndarray] | None:
    """The first message, stamps [ns] and numbers of all, where they have everything else in common."""
    if not messages:
        return None
    _decoded(bag, messages[0])  # or it says what is wrong with it
    return columns_of(bag.types, messages[0].type_name, [message.data for message in messages])


def _states(messages: list[BagMessage], bag: BagReader) -> _States:
    columns = _columns(messages, bag)
    if columns is not None:
        first, stamps, numbers = columns
        ends = np.cumsum([len(first.position), len(first.velocity)])
        return _States(stamps, list(first.name), numbers[:, : ends[0]], numbers[:, ends[0] : ends[1]])
    states = [_decoded(bag, message) for message in messages]
    names = list(states[0].name) if states else []
    return _States([_stamp_of(one) for one in states], names, [one.position for one in states], [one.velocity for one in states])


def _poses(messages: list[BagMessage], role: str, where: PoseSource, name: str, bag: BagReader) -> _Poses:
    columns = _columns(messages, bag) if name == "PoseStamped" else None
    if columns is not None:
        first, stamps, numbers = columns
        _check_frame(first, role, where, messages[0].topic)
        return _Poses(stamps, numbers)
    poses = _Poses([], [])
    for message in messages:
        _take_poses(poses, role, where, name, message, _decoded(bag, message))
    return poses


def _take_poses(poses: _Poses, role: str, where: PoseSource, name: str, message: BagMessage, content: Any) -> None:
    items = content.transforms if name == "TFMessage" else [content]
    for item in items:
        if where.child and getattr(item, "child_frame_id", where.child) != where.child:
            continue
        _check_frame(item, role, where, message.topic)
        poses.stamps.append(_stamp_of(item))
        poses.rows.append(_pose_row(name, item))


def _check_frame(item: Any, role: str, where: PoseSource, topic: str) -> None:
    frame = item.header.frame_id
    if where.frame and frame != where.frame:
        raise ValueError(f"{topic}: a pose of the {role} is in '{frame}', not '{where.frame}': give frame and axes in a mapping")


def _stamp_of(item: Any) -> int:
    return item.header.stamp.sec * NS_PER_S + item.header.stamp.nanosec


def _pose_row(name: str, item: Any) -> tuple:
    """x, y, z, qx, qy, qz, qw of a message."""
    if name == "PointStamped":
        return (item.point.x, item.point.y, item.point.z, *UNTURNED)
    if name in ("TransformStamped", "TFMessage"):
        p, q = item.transform.translation, item.transform.rotation
    else:
        pose = item.pose if name == "PoseStamped" else item.pose.pose
        p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def _signal(messages: list[BagMessage], name: str, bag: BagReader, signal: _Signal) -> _Signal:
    """What was told by messages of a type of `SIGNAL_TYPES`, after what a signal was told by those of the part before."""
    signal.begin_part()
    if name == "WamCommand":
        signal.stamps, pushed, grip = read_commands([message.data for message in messages])
        for k in np.flatnonzero(pushed | (grip == Grip.OPEN)).tolist():  # all others tell nothing
            signal.take_command(messages[k].data)
    elif name == "Bool":
        for message in messages:
            signal.take_button(message.stamp_ns, bool(_decoded(bag, message).data))  # these types have no stamp of their own
    else:
        signal.openings = [message.stamp_ns for message in messages]
    return signal


def _body(role: str, where: PoseSource, taken: dict, folder: Path, frame: str) -> PoseStream:
    scale, order = LENGTH_UNITS[where.length], QUATERNION_ORDERS[where.order]
    if where.topic:
        poses = taken[role]
        rows = np.array(poses.rows, dtype=float).reshape(-1, 7)
        stamps, position, quaternion = np.array(poses.stamps, dtype=np.int64), rows[:, :3], rows[:, 3:]
    elif where.table is not None:
        stamps, position, quaternion = read_pose_table(folder, where.table, where.clock.unit, where.length)
    else:
        stamps, position, quaternion, axes = read_capture(folder, where)
        where, scale, order = replace(where, axes=axes), 1.0, QUATERNION_ORDERS["xyzw"]  # as the file itself says
    stream = PoseStream(role, where.clock.corrected(stamps), scale * position, quaternion[:, order], frame)
    return (
        stream if where.is_plain else transformed(stream, where.world, where.offset, where.axes, where.orientation_axes, where.is_inverse)
    )


def _resting(role: str, position: tuple, stamps: np.ndarray, frame: str) -> PoseStream:
    """A body that was not tracked: at one place at each stamp."""
    return PoseStream(role, stamps, np.tile(position, (len(stamps), 1)), np.tile(UNTURNED, (len(stamps), 1)), frame)


def _joints(where: SignalSource | None, states: _States | None, folder: Path) -> JointStream | None:
    if where is None:
        return None
    if where.table is not None:
        columns = read_table(folder, where.table, where.clock.unit, {"position": where.angle})
        if (width := columns["position"].shape[1]) != N_JOINTS or columns["velocity"].shape[1] not in (0, N_JOINTS):
            raise ValueError(f"{folder / where.table.file}: {width} columns of positions of {N_JOINTS} joints")
        seen = np.isfinite(columns["position"]).all(axis=1)
        stamps, position, velocity = columns["time"][seen], columns["position"][seen], columns["velocity"][seen]
        names = where.names
    elif states is None:
        return None
    else:
        stamps, known = np.array(states.stamps, dtype=np.int64), states.names
        if not where.names and set(joint_names()) <= set(known):
            where = replace(where, names=joint_names())
        names = where.names or tuple(known)
        position = _joint_columns(states.position, "position", where, known)
        velocity = _joint_columns(states.velocity, "velocity", where, known)
    stamps = where.clock.corrected(stamps)
    position, velocity = _in_our_angles(position, where, True), _in_our_angles(velocity, where, False)
    if not velocity.size and len(stamps) > 1:
        velocity = np.gradient(position, 1e-9 * (stamps - stamps[0]), axis=0)
    return JointStream(stamps, position, velocity.reshape(-1, N_JOINTS), names)


def _in_our_angles(values: np.ndarray, where: SignalSource, has_zero: bool) -> np.ndarray:
    """Positions or velocities (n, 7) of the joints in radians, as our arm counts them; zeros count for positions."""
    if not values.size:
        return values
    signs = np.array(where.signs) if where.signs else 1.0
    return ANGLE_UNITS[where.angle] * signs * values + (np.array(where.zeros) if has_zero and where.zeros else 0.0)


def _joint_columns(rows: list | np.ndarray, field: str, where: SignalSource, known: list[str]) -> np.ndarray:
    """(n, 7) of a field of joint states; (0, 7) if velocities were not recorded.

    where: names the joints that are meant, in their order; `known` those that were recorded.
    """
    widths = {len(row) for row in rows}
    if not widths or (field == "velocity" and not any(widths)):
        return np.empty((0, N_JOINTS))
    expected = len(known) if where.names else N_JOINTS
    if wrong := widths - {expected}:
        raise ValueError(f"{where.topic}: {min(wrong)} values of {field} instead of {expected}: name the arm's joints in a mapping")
    rows = np.array(rows, dtype=float).reshape(len(rows), -1)
    if where.names:
        if missing := [name for name in where.names if name not in known]:
            raise ValueError(f"{where.topic}: no joint '{missing[0]}', only {known}")
        rows = rows[:, [known.index(name) for name in where.names]]
    if rows.shape[1] != N_JOINTS:
        raise ValueError(f"{where.topic}: {rows.shape[1]} values of {field} instead of {N_JOINTS}: name the arm's joints in a mapping")
    return rows


def _openings(mapping: RecordingMapping, taken: dict, folder: Path) -> tuple[Opening, ...]:
    found, pushes, pushed_late = [], GripSignal(), 0
    for name, where in _buttons(mapping):
        if where is None or (where.topic and name not in taken):
            continue
        signal = taken[name] if where.topic else None
        stamps = signal.openings if signal else []
        if signal is None and where.table is not None:
            stamps = read_table(folder, where.table, where.clock.unit)["time"].tolist()
        if name == "teacher" and signal:
            pushes, pushed_late = signal, where.clock.shift_ns
        for stamp in stamps:
            stamp = int(stamp) + where.clock.shift_ns
            found.append(Opening(stamp, name == "teacher" or pushes.pushed_before(stamp - pushed_late)))
    return tuple(sorted(found, key=lambda opening: opening.stamp_ns))


# writing


def _messages(recording: ThrowRecording) -> Iterator[tuple[str, int, str, dict]]:
    """Topic, stamp [ns], type and content of each message of a recording."""

    def header(stamp: int) -> dict:
        return header_content(stamp, recording.frame_id)

    for role, topic in the_world().pose_topics().items():
        stream = with_continuous_signs(recording.bodies[role])
        for stamp, p, q in zip(stream.stamp_ns.tolist(), stream.position.tolist(), stream.quaternion.tolist(), strict=True):
            yield topic, stamp, "geometry_msgs/msg/PoseStamped", {"header": header(stamp), "pose": pose_content(p, q)}
    joints = recording.joints
    if joints is not None:
        for stamp, q, v in zip(joints.stamp_ns.tolist(), joints.position, joints.velocity, strict=True):
            content = {"header": header(stamp), "name": list(joints.names), "position": q, "velocity": v}
            yield "/joint_states", stamp, "sensor_msgs/msg/JointState", content
    for opening in recording.openings:
        topic = "/wam/teacher_wrench" if opening.taught else "/wam/command"
        yield topic, opening.stamp_ns, "dart_skill_msgs/msg/WamCommand", {"header": header(opening.stamp_ns), "grip": int(Grip.OPEN)}
