"""What a bag holds on the topics that a mapping names: poses, joint states, and when the hand was
told to open, each with both times.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.constants import NS_PER_S, UNTURNED, Grip
from dart_skill.recording.bags import (
    BagError,
    BagMessage,
    BagReader,
    Columns,
    Finding,
    GraphBag,
    TopicInfo,
    columns_by_layout,
    glance,
)
from dart_skill.recording.imports.faults import BAG, NOTE, Fault
from dart_skill.recording.imports.frame_tree import FrameTree, read_frame_tree
from dart_skill.recording.imports.joint_streams import read_states
from dart_skill.recording.imports.mapping import OWN, PoseSource, RecordingMapping, SignalSource
from dart_skill.recording.signals import GUIDED_NS, GripSignal, read_commands

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
PART_NS = 180_000_000_000
"""Shortest part of a long recording; the longest one is twice as long [ns]."""
PAUSE_NS = 500_000_000
"""Shortest pause with which a part ends [ns]."""
SAME_POSE = 1e-6
"""Largest difference between two poses that are the same [m] and [1]."""


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses of a body as they were recorded, in the order of recording.

    Parameters
    ----------
    stamps, log
        When they are said to be, and when they were recorded (n,) [ns].
    rows
        x, y, z, qx, qy, qz, qw of each (n, 7).
    faults
        What was left out, taken for something, or transformed, on account of frames.
    frame
        Name of their frame.
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
    """Topics of a bag that have messages of some types, in whichever package.

    Parameters
    ----------
    bag
        Is open.
    kinds
        Names of types without their package.
    """
    return [
        name
        for name, topic in bag.topics.items()
        if topic.count and topic.type_name.rsplit("/", 1)[-1] in kinds
    ]


def buttons(mapping: RecordingMapping) -> list[tuple[str, SignalSource | None]]:
    """Who tells the hand to open, and where it was recorded; None where it was not."""
    return [("teacher", mapping.teacher), ("command", mapping.command)]


def bag_faults(source: Path, mapping: RecordingMapping = OWN) -> list[Fault]:
    """What a glance at a bag finds wrong with it and with the topics that a mapping names.

    Parameters
    ----------
    source
        The bag, or what is none.
    """
    topics = tuple(where.topic for where in _sources(mapping).values() if where.topic)
    files = [source, *(source.iterdir() if source.is_dir() else ())]
    changed_ns = max((file.stat().st_mtime_ns for file in files if file.exists()), default=0)
    found = _glance(source, topics, changed_ns)
    return [
        Fault(BAG, one.place, 0, 0, 0, one.message, False, one.remedy)
        for one in found
        if one.severity != "note"
    ]


@lru_cache(maxsize=4)
def _glance(source: Path, topics: tuple[str, ...], _changed_ns: int) -> list[Finding]:
    """As `glance`, once for a command that reads a bag several times."""
    return glance(source, topics) if topics else []


def _sources(mapping: RecordingMapping) -> dict[str, PoseSource | SignalSource]:
    return {**mapping.bodies, **mapping.signals}


def read_topics(
    source: Path, mapping: RecordingMapping, part_ns: int, in_graph: bool
) -> Iterator[dict[str, Any]]:
    """What was collected for each role that is a topic, part by part; all at once for 0, or where
    the hand was not told to open.

    Parameters
    ----------
    source
        The bag.
    mapping
        Says which topics.
    part_ns
        Log time of a part, about; 0: all is one part [ns].
    in_graph
        Whether the bag is of a graph of ours, in whichever namespace; another one is one part.
    """
    wanted = {role: where for role, where in _sources(mapping).items() if where.topic}
    if not wanted:
        yield {}
        return
    with (GraphBag if in_graph else BagReader)(source) as bag:
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
            part_ns if signals and in_graph else 0,
        ):
            found = _collected(part, there, bag, signals, tree)
            _require_told_frames(found, there, tree)
            yield found


def _parts(messages: Iterator[BagMessage], part_ns: int) -> Iterator[Iterator[BagMessage]]:
    """The messages of each part, to be taken one after the other; at least one part."""
    number, begin, last = -1, 0, 0

    def number_of(message: BagMessage) -> int:
        nonlocal number, begin, last
        lasted, pause, last = message.stamp_ns - begin, message.stamp_ns - last, message.stamp_ns
        ends = part_ns and lasted >= part_ns and (pause > PAUSE_NS or lasted >= 2 * part_ns)
        if ends or number < 0:
            number, begin = number + 1, message.stamp_ns
        return number

    for _number, part in groupby(messages, number_of):
        yield part
    if number < 0:
        yield iter(())


def _collected(
    messages: Iterator[BagMessage],
    wanted: dict[str, PoseSource | SignalSource],
    bag: BagReader,
    signals: dict[str, Signal],
    tree: Callable[[], FrameTree],
) -> dict[str, Any]:
    """What was collected of some messages for each role."""
    kinds = {
        role: (where.topic, _type_for(role, bag.topics[where.topic], bag.path))
        for role, where in wanted.items()
    }
    found: dict[tuple, list[BagMessage]] = {kind: [] for kind in kinds.values()}
    for message in messages:
        if message[:2] in found:
            found[message[:2]].append(message)
    collected: dict[str, Any] = {}
    for role, where in wanted.items():
        own, name = found[kinds[role]], kinds[role][1].rsplit("/", 1)[-1]
        if role in signals:
            is_by_log = where.clock.source == "log"
            collected[role] = _signal(own, name, bag, signals[role], is_by_log)
        elif isinstance(where, SignalSource):
            types = bag.typed(own[0])[0] if own else bag.types
            collected[role] = read_states(
                own, types, lambda one: bag.typed(one)[1], where, _stamp_of
            )
        else:
            collected[role] = _poses(_by_frame(own, where, name, bag), role, where, tree)
    return collected


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

    An empty frame, and one with a slash before it as in ROS 1, are taken for it.
    From others /tf leads there, or nothing.
    """
    n, stamps = len(poses.stamps), poses.stamps
    if not where.frame or frame == where.frame:
        return poses
    if frame in ("", f"/{where.frame}"):
        text = (
            f"{n} poses are in the frame '{frame}'"
            if frame
            else f"{n} poses are in a frame that nobody filled in"
        )
        text += f": taken to be '{where.frame}'"
        return replace(poses, faults=(Fault.of(NOTE, role, stamps, text, True),))
    rows = _moved(poses, frame, where.frame, where, tree)
    if rows is None:
        text = (
            f"{n} poses in '{frame}', and not in '{where.frame}', are left out, for no /tf leads"
            " there"
        )
        return Poses(faults=(Fault.of("frame", role, stamps, text, True),))
    known = np.isfinite(rows).all(axis=1) | ~np.isfinite(poses.rows).all(axis=1)
    count, gone, faults = int(known.sum()), int((~known).sum()), []
    if count:
        text = f"{count} poses in '{frame}' are taken to '{where.frame}' by /tf"
        faults.append(Fault.of(NOTE, role, stamps, text, True, count=count))
    if gone:
        text = (
            f"{gone} poses in '{frame}' are left out, for /tf does not tell where"
            f" '{where.frame}' was then"
        )
        faults.append(Fault.of("frame", role, stamps, text, True, count=gone))
    return Poses(poses.stamps[known], poses.log[known], rows[known], tuple(faults))


def _moved(
    poses: Poses, frame: str, target: str, where: PoseSource, tree: Callable[[], FrameTree]
) -> np.ndarray | None:
    """The poses (n, 7) in another frame as it was when they were seen, by the clock of the
    mapping; nan where /tf does not tell it, None where it does not lead there.
    """
    by_log, frame = where.clock.source == "log", frame.removeprefix("/")
    return tree().moved(poses.rows, frame, target, poses.log if by_log else poses.stamps, by_log)


def _require_told_frames(
    found: Mapping[str, Any],
    sources: Mapping[str, PoseSource | SignalSource],
    tree: Callable[[], FrameTree],
) -> None:
    """ValueError if bodies are in frames that /tf tells apart, and the mapping does not say in
    which one they are wanted.
    """
    bodies = [
        (role, found[role], where)
        for role, where in sources.items()
        if isinstance(where, PoseSource) and not where.frame
    ]
    for role, poses, where in bodies[1:]:
        first, other = bodies[0][0], bodies[0][1].frame.removeprefix("/")
        frame = poses.frame.removeprefix("/")
        rows = None if frame == other else _moved(poses, frame, other, where, tree)
        if rows is not None and np.nanmax(np.abs(rows - poses.rows), initial=0.0) > SAME_POSE:
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
            # these types have no stamp of their own
            signal.take_button(message.stamp_ns, bool(bag.typed(message)[1].data))
    else:
        signal.openings = [message.stamp_ns for message in messages]
    return signal


def _stamped_by_log(message: BagMessage) -> bytes:
    """A serialised message that begins with a stamp, stamped when it was recorded."""
    data, order = bytes(message.data), "<" if message.data[1] & 1 else ">"
    return data[:4] + struct.pack(f"{order}iI", *divmod(message.stamp_ns, NS_PER_S)) + data[12:]
