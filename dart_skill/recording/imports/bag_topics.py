"""What a bag holds on the topics that a mapping names: poses, joint states, and when the hand was told to open, each with both times."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.constants import NS_PER_S, UNTURNED, Grip
from dart_skill.recording.bags import BagError, BagMessage, BagReader, Columns, GraphBag, TopicInfo, columns_by_layout, glance, typestore
from dart_skill.recording.grip_signal import GUIDED_NS, GripSignal, read_commands
from dart_skill.recording.imports.faults import BAG, Fault
from dart_skill.recording.imports.joint_streams import States, read_states
from dart_skill.recording.imports.mapping import OWN, PoseSource, RecordingMapping, SignalSource

BODY_TYPES = ("PoseStamped", "PoseWithCovarianceStamped", "PointStamped", "TransformStamped", "Odometry")
"""Types of which every message is a pose of one body."""
POSE_TYPES = (*BODY_TYPES, "TFMessage")
SIGNAL_TYPES = ("WamCommand", "Bool", "Empty")
PART_NS, PAUSE_NS = 180_000_000_000, 500_000_000
"""A part of a long recording takes so long, and ends with the next pause of so long, or when it is twice as long [ns]."""


@dataclass
class Poses:
    """Poses of a body as they were recorded.

    * stamps, log: when they are said to be, and when they were recorded (n,) [ns].
    * rows: x, y, z, qx, qy, qz, qw of each.
    * elsewhere: how many were in other frames than the one that is asked for, by frame.
    * taken_for: how many were in a frame that is taken for it, by frame.
    * frames: how many were in each frame, where none is asked for.
    """

    stamps: Any = field(default_factory=list)
    log: Any = field(default_factory=list)
    rows: Any = field(default_factory=list)
    elsewhere: Counter[str] = field(default_factory=Counter)
    taken_for: Counter[str] = field(default_factory=Counter)
    frames: Counter[str] = field(default_factory=Counter)


class Signal(GripSignal):
    """With stamps and log times of all commands (n,) [ns], in the order of recording."""

    stamps: np.ndarray = np.empty(0, dtype=np.int64)
    log: np.ndarray = np.empty(0, dtype=np.int64)

    def begin_part(self) -> None:
        """Forget the part before, but for pushes after which the arm is guided still, and whether the hand is held open."""
        self.openings, self.stamps, self.log = [], np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64)
        if self.pushes:
            self.forget_before(self.pushes[-1] - GUIDED_NS)


def filled_topics(bag: BagReader, *kinds: str) -> list[str]:
    """Topics of a bag that have messages of some types, in whichever package. bag: is open; kinds: names of types without their package."""
    return [name for name, topic in bag.topics.items() if topic.count and topic.type_name.rsplit("/", 1)[-1] in kinds]


def buttons(mapping: RecordingMapping) -> list[tuple[str, SignalSource | None]]:
    """Who tells the hand to open, and where. mapping: says it."""
    return [("teacher", mapping.teacher), ("command", mapping.command)]


def bag_faults(source: Path, mapping: RecordingMapping = OWN) -> list[Fault]:
    """What a glance at a bag finds wrong with it and with the topics that a mapping names. source: the bag, or what is none."""
    topics = tuple(where.topic for where in _sources(mapping).values() if where.topic)
    found = glance(source, topics) if topics else []
    return [Fault(BAG, one.place, 0, 0, 0, one.message, False, one.remedy) for one in found if one.severity != "note"]


def _sources(mapping: RecordingMapping) -> dict[str, PoseSource | SignalSource]:
    sources = {**mapping.bodies, "joints": mapping.joints, **dict(buttons(mapping))}
    return {role: where for role, where in sources.items() if where is not None}


def read_topics(source: Path, mapping: RecordingMapping, part_ns: int) -> Iterator[dict[str, Any]]:
    """What was collected for each role that is a topic, part by part; all at once for 0, or where nobody told the hand to open.

    * source: the bag.
    * mapping: says which topics.
    * part_ns: log time of a part, about; 0: all is one part [ns].
    """
    wanted = {role: where for role, where in _sources(mapping).items() if where.topic}
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
        signals = {role: Signal() for role in there if role in ("teacher", "command")}
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
    messages: Iterator[BagMessage], wanted: dict[str, PoseSource | SignalSource], bag: BagReader, signals: dict[str, Signal]
) -> dict[str, Any]:
    """What was collected of some messages for each role."""
    collectors: dict[tuple, list[Callable]] = {}  # by topic and type
    collected: dict[str, Callable[[], Any]] = {}
    for role, where in wanted.items():
        type_name = _type_for(role, bag.topics[where.topic], bag.path)
        collected[role], collect = _collector(role, where, type_name.rsplit("/", 1)[-1], bag, signals)
        collectors.setdefault((where.topic, type_name), []).append(collect)
    for message in messages:
        for collect in collectors.get(message[:2], ()):
            collect(message)
    return {role: content() for role, content in collected.items()}


def _type_for(role: str, topic: TopicInfo, path: Path) -> str:
    """The type of a topic's messages that a role takes, the first of several; BagError."""
    kinds = {"joints": ("JointState",), "teacher": SIGNAL_TYPES, "command": SIGNAL_TYPES}.get(role, POSE_TYPES)
    types = (topic.type_name, *topic.other_types)
    if fitting := [one for one in types if one.rsplit("/", 1)[-1] in kinds]:
        return fitting[0]
    raise BagError(f"{path}: {topic.name} has type {', '.join(types) or 'none'}; for '{role}' it must be one of {', '.join(kinds)}")


def _collector(
    role: str, where: PoseSource | SignalSource, name: str, bag: BagReader, signals: dict[str, Signal]
) -> tuple[Callable[[], Any], Callable[[BagMessage], None]]:
    """Two functions: what was collected of a topic in the end, and one that takes a message. name: of its type, without the package."""
    messages: list[BagMessage] = []
    if role in ("teacher", "command"):
        return lambda: _signal(messages, name, bag, signals[role], where.clock.source == "log"), messages.append
    if isinstance(where, SignalSource):
        return lambda: _states(messages, where, bag), messages.append
    assert isinstance(where, PoseSource)  # as every body has
    return lambda: _poses(messages, role, where, name, bag), messages.append


def _states(messages: list[BagMessage], where: SignalSource, bag: BagReader) -> States:
    types = bag.typed(messages[0])[0] if messages else bag.types
    return read_states(messages, types, lambda one: bag.typed(one)[1], where, _stamp_of)


def _poses(messages: list[BagMessage], role: str, where: PoseSource, name: str, bag: BagReader) -> Poses:
    found: list[Columns] = []
    left = list(range(len(messages)))
    if name == "PoseStamped" and messages:
        types, _ = bag.typed(messages[0])  # or it says what is wrong with it
        found, left = columns_by_layout(types, messages[0].type_name, [message.data for message in messages])
    poses, alone, places = Poses(), Poses(), []
    parts = []
    for columns in found:
        if _is_meant(columns.example.header.frame_id, where.frame, poses, len(columns.index)):
            parts.append((columns.index, columns.stamps, columns.numbers))
    for k in left:
        before = len(alone.stamps)
        _take_poses(alone, poses, where, name, messages[k], bag.typed(messages[k])[1])
        places += [k] * (len(alone.stamps) - before)
    parts.append((np.array(places, dtype=int), np.array(alone.stamps, dtype=np.int64), np.array(alone.rows, dtype=float).reshape(-1, 7)))
    if len(poses.frames) > 1:
        frames = ", ".join(f"{count} in '{frame}'" for frame, count in poses.frames.most_common())
        most = poses.frames.most_common(1)[0][0]
        raise ValueError(
            f"{where.topic}: poses of the {role} are told in several frames: {frames}: choose one, as {role}: {{frame: {most}}}"
        )
    index, stamps, rows = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(index, kind="stable")
    poses.stamps, poses.rows = stamps[order], rows[order]
    poses.log = np.array([message.stamp_ns for message in messages], dtype=np.int64)[index[order]]
    if poses.elsewhere and not len(poses.stamps):
        n, frames = sum(poses.elsewhere.values()), " and ".join(f"'{frame}'" for frame in sorted(poses.elsewhere))
        what = f"a pose of the {role} is" if n == 1 else f"all {n} poses of the {role} are"
        raise ValueError(f"{where.topic}: {what} in {frames}, not '{where.frame}': give frame and axes in a mapping")
    return poses


def _take_poses(poses: Poses, told: Poses, where: PoseSource, name: str, message: BagMessage, content: Any) -> None:
    items = content.transforms if name == "TFMessage" else [content]
    for item in items:
        if where.child and getattr(item, "child_frame_id", where.child) != where.child:
            continue
        if _is_meant(item.header.frame_id, where.frame, told, 1):
            poses.stamps.append(_stamp_of(item))
            poses.rows.append(_pose_row(name, item))


def _is_meant(frame: str, wanted: str, told: Poses, count: int) -> bool:
    """Whether poses are in the frame that is asked for. One that nobody filled in, and one with a slash before it as in ROS 1, are
    taken for it, and that is told.
    """
    if not wanted:
        told.frames[frame.removeprefix("/")] += count
    if not wanted or frame == wanted:
        return True
    meant = frame in ("", f"/{wanted}")
    (told.taken_for if meant else told.elsewhere)[frame] += count
    return meant


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


def _signal(messages: list[BagMessage], name: str, bag: BagReader, signal: Signal, by_log: bool) -> Signal:
    """What was told by messages of a type of `SIGNAL_TYPES`, after what a signal was told by those of the part before."""
    signal.begin_part()
    if name == "WamCommand":
        payloads: Sequence[bytes] = [_stamped_by_log(message) if by_log else message.data for message in messages]
        try:
            signal.stamps, pushed, grip = read_commands(payloads)
        except ValueError as error:
            raise BagError(f"{bag.path}: topic {messages[0].topic}: {error}") from error
        signal.log = np.array([message.stamp_ns for message in messages], dtype=np.int64)
        for k in np.flatnonzero(pushed | (grip == Grip.OPEN)).tolist():  # all others tell nothing
            signal.take_command(payloads[k])
    elif name == "Bool":
        for message in messages:
            signal.take_button(message.stamp_ns, bool(bag.typed(message)[1].data))  # these types have no stamp of their own
    else:
        signal.openings = [message.stamp_ns for message in messages]
    return signal


def _stamped_by_log(message: BagMessage) -> bytes:
    """A serialised message that begins with a stamp, stamped when it was recorded."""
    data, order = bytes(message.data), "<" if message.data[1] & 1 else ">"
    return data[:4] + struct.pack(f"{order}iI", *divmod(message.stamp_ns, NS_PER_S)) + data[12:]
