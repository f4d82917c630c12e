"""What a bag holds on the topics that a mapping names: poses, joint states, and when the hand was
told to open, each with both times.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.constants import NS_PER_S, UNTURNED, Grip
from dart_skill.recording.bags import (
    BagError,
    BagMessage,
    BagReader,
    Columns,
    GraphBag,
    TopicInfo,
    columns_by_layout,
    glance,
    typestore,
)
from dart_skill.recording.grip_signal import GUIDED_NS, GripSignal, read_commands
from dart_skill.recording.imports.faults import BAG, NOTE, Fault
from dart_skill.recording.imports.frame_tree import FrameTree, read_frame_tree
from dart_skill.recording.imports.joint_streams import States, read_states
from dart_skill.recording.imports.mapping import OWN, PoseSource, RecordingMapping, SignalSource

BODY_TYPES = (
    "PoseStamped",
    "PoseWithCovarianceStamped",
    "PointStamped",
    "TransformStamped",
    "Odometry",
)
"""Types of which every message is a pose of one body."""
POSE_TYPES = (*BODY_TYPES, "TFMessage")
SIGNAL_TYPES = ("WamCommand", "Bool", "Empty")
PART_NS, PAUSE_NS = 180_000_000_000, 500_000_000
"""A part of a long recording takes so long, and ends with the next pause of so long, or when it is
twice as long [ns].
"""
SAME_POSE = 1e-6
"""Largest difference between two poses that are the same [m] and [1]."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of a body as they were recorded, in the order of recording.

    * stamps, log: when they are said to be, and when they were recorded (n,) [ns].
    * rows: x, y, z, qx, qy, qz, qw of each (n, 7).
    * faults: what was left out, taken for something, or transformed, on account of frames.
    * frame: name of their frame.
    """

    stamps: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    log: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    rows: np.ndarray = field(default_factory=lambda: np.empty((0, 7)))
    faults: tuple[Fault, ...] = ()
    frame: str = ""


class Signal(GripSignal):
    """With stamps and log times of all commands (n,) [ns], in the order of recording."""

    stamps: np.ndarray = np.empty(0, dtype=np.int64)
    log: np.ndarray = np.empty(0, dtype=np.int64)

    def begin_part(self) -> None:
        """Forget the part before, but for pushes after which the arm is guided still, and whether
        the hand is held open.
        """
        self.openings, self.stamps, self.log = (
            [],
            np.empty(0, dtype=np.int64),
            np.empty(0, dtype=np.int64),
        )
        if self.pushes:
            self.forget_before(self.pushes[-1] - GUIDED_NS)


def filled_topics(bag: BagReader, *kinds: str) -> list[str]:
    """Topics of a bag that have messages of some types, in whichever package. bag: is open; kinds:
    names of types without their package.
    """
    return [
        name
        for name, topic in bag.topics.items()
        if topic.count and topic.type_name.rsplit("/", 1)[-1] in kinds
    ]


def buttons(mapping: RecordingMapping) -> list[tuple[str, SignalSource | None]]:
    """Who tells the hand to open, and where. mapping: says it."""
    return [("teacher", mapping.teacher), ("command", mapping.command)]


def bag_faults(source: Path, mapping: RecordingMapping = OWN) -> list[Fault]:
    """What a glance at a bag finds wrong with it and with the topics that a mapping names. source:
    the bag, or what is none.
    """
    topics = tuple(where.topic for where in _sources(mapping).values() if where.topic)
    found = glance(source, topics) if topics else []
    return [
        Fault(BAG, one.place, 0, 0, 0, one.message, False, one.remedy)
        for one in found
        if one.severity != "note"
    ]


def _sources(mapping: RecordingMapping) -> dict[str, PoseSource | SignalSource]:
    sources = {**mapping.bodies, "joints": mapping.joints, **dict(buttons(mapping))}
    return {role: where for role, where in sources.items() if where is not None}


def read_topics(source: Path, mapping: RecordingMapping, part_ns: int) -> Iterator[dict[str, Any]]:
    """What was collected for each role that is a topic, part by part; all at once for 0, or where
    nobody told the hand to open.

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
                raise BagError(
                    f"{source}: no topic {where.topic} for '{role}', only {sorted(bag.topics)}:"
                    " name it in a mapping"
                )
        signals = {role: Signal() for role in there if role in ("teacher", "command")}
        tree = cache(lambda: read_frame_tree(source))
        for part in _parts(
            bag.messages({where.topic for where in there.values()}, decode=False),
            part_ns if signals else 0,
        ):
            found = _collected(part, there, bag, signals, tree)
            _require_told_frames(
                {
                    role: one
                    for role, one in found.items()
                    if isinstance(one, Poses) and not there[role].frame
                },
                tree,
            )
            yield found


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
    """Messages up to the end of a part; afterwards `following` is the first of the next one, None
    if there is none.
    """

    def __init__(self, first: BagMessage, messages: Iterator[BagMessage], part_ns: int):
        self._first, self._messages, self._part_ns = first, messages, part_ns
        self.following: BagMessage | None = None

    def __iter__(self) -> Iterator[BagMessage]:
        yield self._first
        begin = last = self._first.stamp_ns
        for message in self._messages:
            lasted = message.stamp_ns - begin
            if (
                self._part_ns
                and lasted >= self._part_ns
                and (message.stamp_ns - last > PAUSE_NS or lasted >= 2 * self._part_ns)
            ):
                self.following = message
                return
            last = message.stamp_ns
            yield message


def _collected(
    messages: Iterator[BagMessage],
    wanted: dict[str, PoseSource | SignalSource],
    bag: BagReader,
    signals: dict[str, Signal],
    tree: Callable[[], FrameTree],
) -> dict[str, Any]:
    """What was collected of some messages for each role."""
    collectors: dict[tuple, list[Callable]] = {}  # by topic and type
    collected: dict[str, Callable[[], Any]] = {}
    for role, where in wanted.items():
        type_name = _type_for(role, bag.topics[where.topic], bag.path)
        collected[role], collect = _collector(
            role, where, type_name.rsplit("/", 1)[-1], bag, signals, tree
        )
        collectors.setdefault((where.topic, type_name), []).append(collect)
    for message in messages:
        for collect in collectors.get(message[:2], ()):
            collect(message)
    return {role: content() for role, content in collected.items()}


def _type_for(role: str, topic: TopicInfo, path: Path) -> str:
    """The type of a topic's messages that a role takes, the first of several; BagError."""
    kinds = {"joints": ("JointState",), "teacher": SIGNAL_TYPES, "command": SIGNAL_TYPES}.get(
        role, POSE_TYPES
    )
    types = (topic.type_name, *topic.other_types)
    if fitting := [one for one in types if one.rsplit("/", 1)[-1] in kinds]:
        return fitting[0]
    raise BagError(
        f"{path}: {topic.name} has type {', '.join(types) or 'none'}; for '{role}' it must be one"
        f" of {', '.join(kinds)}"
    )


def _collector(
    role: str,
    where: PoseSource | SignalSource,
    name: str,
    bag: BagReader,
    signals: dict[str, Signal],
    tree: Callable[[], FrameTree],
) -> tuple[Callable[[], Any], Callable[[BagMessage], None]]:
    """Two functions: what was collected of a topic in the end, and one that takes a message. name:
    of its type, without the package.
    """
    messages: list[BagMessage] = []
    if role in ("teacher", "command"):
        return (
            lambda: _signal(messages, name, bag, signals[role], where.clock.source == "log"),
            messages.append,
        )
    if isinstance(where, SignalSource):
        return lambda: _states(messages, where, bag), messages.append
    assert isinstance(where, PoseSource)  # as every body has
    return (
        lambda: _poses(_by_frame(messages, where, name, bag), role, where, tree),
        messages.append,
    )


def _states(messages: list[BagMessage], where: SignalSource, bag: BagReader) -> States:
    types = bag.typed(messages[0])[0] if messages else bag.types
    return read_states(messages, types, lambda one: bag.typed(one)[1], where, _stamp_of)


def _poses(
    told: Mapping[str, Poses], role: str, where: PoseSource, tree: Callable[[], FrameTree]
) -> Poses:
    """The poses of a body. told: those in each frame."""
    if not where.frame:
        _require_one_frame(role, where, told)
    kept = [_in_frame(frame, poses, role, where, tree) for frame, poses in told.items()]
    poses = _together(kept, where.frame or next(iter(told), ""))
    if told and not len(poses.stamps):
        n, frames = (
            sum(len(one.stamps) for one in told.values()),
            " and ".join(f"'{frame}'" for frame in sorted(told)),
        )
        what = f"a pose of the {role} is" if n == 1 else f"all {n} poses of the {role} are"
        raise ValueError(
            f"{where.topic}: {what} in {frames}, not '{where.frame}': give frame and axes in a"
            " mapping"
        )
    return poses


def _by_frame(
    messages: list[BagMessage], where: PoseSource, name: str, bag: BagReader
) -> dict[str, Poses]:
    """The poses in each frame, in the order of recording."""
    found: list[Columns] = []
    left = list(range(len(messages)))
    if name == "PoseStamped" and messages:
        types, _ = bag.typed(messages[0])  # or it says what is wrong with it
        found, left = columns_by_layout(
            types, messages[0].type_name, [message.data for message in messages]
        )
    parts: dict[str, list[tuple]] = {}
    for columns in found:
        parts.setdefault(columns.example.header.frame_id, []).append(
            (columns.index, columns.stamps, columns.numbers)
        )
    for k in left:
        content = bag.typed(messages[k])[1]
        for item in content.transforms if name == "TFMessage" else [content]:
            if not where.child or getattr(item, "child_frame_id", where.child) == where.child:
                row = np.array([_pose_row(name, item)], dtype=float)
                parts.setdefault(item.header.frame_id, []).append(([k], [_stamp_of(item)], row))
    log = np.array([message.stamp_ns for message in messages], dtype=np.int64)
    poses = {}
    for frame, of_this in parts.items():
        index, stamps, rows = (np.concatenate(column) for column in zip(*of_this, strict=True))
        order = np.argsort(index, kind="stable")
        poses[frame] = Poses(stamps[order], log[index[order]], rows[order])
    return poses


def _require_one_frame(role: str, where: PoseSource, told: Mapping[str, Poses]) -> None:
    counts: Counter[str] = Counter()
    for frame, poses in told.items():
        counts[frame.removeprefix("/")] += len(poses.stamps)
    if len(counts) > 1:
        frames = ", ".join(f"{count} in '{frame}'" for frame, count in counts.most_common())
        most = counts.most_common(1)[0][0]
        raise ValueError(
            f"{where.topic}: poses of the {role} are told in several frames: {frames}: choose one,"
            f" as {role}: {{frame: {most}}}; where /tf leads there, the others are taken to it"
        )


def _in_frame(
    frame: str, poses: Poses, role: str, where: PoseSource, tree: Callable[[], FrameTree]
) -> Poses:
    """The poses in the frame that is asked for, which is any if none is, and what was done for
    that.

    A frame that nobody filled in, and one with a slash before it as in ROS 1, are taken for it.
    From others /tf leads there, or nothing.
    """
    n = len(poses.stamps)

    def fault(kind: str, count: int, text: str) -> Fault:
        return Fault(
            kind, role, int(poses.stamps.min()), int(poses.stamps.max()), count, text, True
        )

    if not where.frame or frame == where.frame:
        return poses
    if frame in ("", f"/{where.frame}"):
        text = (
            f"{n} poses are in the frame '{frame}'"
            if frame
            else f"{n} poses are in a frame that nobody filled in"
        )
        return replace(poses, faults=(fault(NOTE, n, f"{text}: taken to be '{where.frame}'"),))
    one, by_log = frame.removeprefix("/"), where.clock.source == "log"
    if not tree().connects(one, where.frame):
        text = (
            f"{n} poses in '{frame}', and not in '{where.frame}', are left out, for no /tf leads"
            " there"
        )
        return Poses(faults=(fault("frame", n, text),))
    rows = tree().moved(
        poses.rows, one, where.frame, poses.log if by_log else poses.stamps, by_log
    )
    known = np.isfinite(rows).all(axis=1) | ~np.isfinite(poses.rows).all(axis=1)
    faults = (
        [
            fault(
                NOTE,
                int(known.sum()),
                f"{known.sum()} poses in '{frame}' are taken to '{where.frame}' by /tf",
            )
        ]
        if known.any()
        else []
    )
    if not known.all():
        text = (
            f"{(~known).sum()} poses in '{frame}' are left out, for /tf does not tell where"
            f" '{where.frame}' was then"
        )
        faults.append(fault("frame", int((~known).sum()), text))
    return Poses(poses.stamps[known], poses.log[known], rows[known], tuple(faults))


def _require_told_frames(bodies: Mapping[str, Poses], tree: Callable[[], FrameTree]) -> None:
    """ValueError if bodies are in frames that /tf tells apart, and nobody said in which one they
    are wanted. bodies: by role.
    """
    first = next(iter(bodies), "")
    for role, poses in bodies.items():
        frame, other = poses.frame.removeprefix("/"), bodies[first].frame.removeprefix("/")
        if frame == other or not tree().connects(frame, other):
            continue
        moved = np.abs(tree().moved(poses.rows, frame, other, poses.stamps) - poses.rows)
        if moved[np.isfinite(moved)].max(initial=0.0) > SAME_POSE:
            raise ValueError(
                f"the {first} is told in '{other}' and the {role} in '{frame}', and /tf says that"
                f" these differ: give both a frame, as {role}: {{frame: {other}}}, to which /tf"
                f" takes it; with frame: {frame} it is taken as it is"
            )


def _together(poses: list[Poses], frame: str) -> Poses:
    """Poses of several frames in the order of recording."""
    if len(poses) == 1:
        return replace(poses[0], frame=frame)
    parts = [(one.stamps, one.log, one.rows) for one in [Poses(), *poses]]
    stamps, log, rows = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(log, kind="stable")
    return Poses(
        stamps[order],
        log[order],
        rows[order],
        tuple(fault for one in poses for fault in one.faults),
        frame,
    )


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


def _signal(
    messages: list[BagMessage], name: str, bag: BagReader, signal: Signal, by_log: bool
) -> Signal:
    """What was told by messages of a type of `SIGNAL_TYPES`, after what a signal was told by those
    of the part before.
    """
    signal.begin_part()
    if name == "WamCommand":
        payloads: Sequence[bytes] = [
            _stamped_by_log(message) if by_log else message.data for message in messages
        ]
        try:
            signal.stamps, pushed, grip = read_commands(payloads)
        except ValueError as error:
            raise BagError(f"{bag.path}: topic {messages[0].topic}: {error}") from error
        signal.log = np.array([message.stamp_ns for message in messages], dtype=np.int64)
        for k in np.flatnonzero(pushed | (grip == Grip.OPEN)).tolist():  # all others tell nothing
            signal.take_command(payloads[k])
    elif name == "Bool":
        for message in messages:
            signal.take_button(
                message.stamp_ns, bool(bag.typed(message)[1].data)
            )  # these types have no stamp of their own
    else:
        signal.openings = [message.stamp_ns for message in messages]
    return signal


def _stamped_by_log(message: BagMessage) -> bytes:
    """A serialised message that begins with a stamp, stamped when it was recorded."""
    data, order = bytes(message.data), "<" if message.data[1] & 1 else ">"
    return data[:4] + struct.pack(f"{order}iI", *divmod(message.stamp_ns, NS_PER_S)) + data[12:]
