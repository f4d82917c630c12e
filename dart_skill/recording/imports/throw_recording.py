"""Recordings of throws from anywhere as what the sensors saw of hand, ball, basket and arm: our
bags, other people's bags, CSV files.

A mapping says where everything is (`mapping`); poses come out in our axes and units, without the
faults that can be repaired (`pose_faults`). `convert` writes them as a bag of ours.
"""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from dart_skill.common.arm_choice import joint_count
from dart_skill.common.constants import UNTURNED, Grip
from dart_skill.common.world import the_world
from dart_skill.recording.bags import (
    BagError,
    BagWriter,
    definition,
    header_content,
    pose_content,
    qos_yaml,
    serialize,
    type_hash,
    typestore,
)
from dart_skill.recording.imports._tables import read_pose_table, read_table
from dart_skill.recording.imports.bag_topics import (
    PART_NS,
    Poses,
    bag_faults,
    buttons,
    read_topics,
)
from dart_skill.recording.imports.clocks import (
    bunched,
    clocks_apart,
    in_seconds,
    timed,
    without_running_back,
)
from dart_skill.recording.imports.faults import BACKWARDS, GAP, NOTE, UNSTAMPED, Fault, in_words
from dart_skill.recording.imports.joint_streams import JOINTS, JointStream, joint_stream
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
from dart_skill.recording.imports.pose_faults import repair
from dart_skill.recording.imports.pose_stream import PoseStream, transformed, with_continuous_signs
from dart_skill.recording.signals import GripSignal, Opening

FEW = 10
"""Number of poses from which a body is tracked; one with fewer that did not move stands still: it is
published once, for all who come later.
"""
STILL = 1e-3
"""Largest distance between poses of a body that did not move [m]."""


@dataclass(frozen=True, eq=False)
class ThrowRecording:
    """What a recording holds.

    Parameters
    ----------
    source
        Where it comes from.
    bodies
        Poses of hand, ball and basket, by role.
    joints
        Joint states, None if they were not recorded.
    openings
        When the hand was told to open, in order of time.
    has_button
        Whether anything was recorded when the hand was told to open.
    faults
        Found in poses, joint states and stamps.
    frame_id
        Of the poses, default that of config/world.yaml.
    command_stamps
        Of the commands to the arm (n,) [ns], in order of time; none where they were not recorded.
    recorded
        How many poses of each body were recorded, by role, whatever was wrong with them.
    """

    source: str
    bodies: dict[str, PoseStream]
    joints: JointStream | None
    openings: tuple[Opening, ...]
    has_button: bool
    faults: tuple[Fault, ...]
    frame_id: str = the_world().frame_id
    command_stamps: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    recorded: Mapping[str, int] = field(default_factory=dict)


def read_recording(
    source: str | os.PathLike, mapping: RecordingMapping | None = None, mend: bool = True
) -> ThrowRecording:
    """Everything that a mapping names, without the faults that can be repaired.

    Parameters
    ----------
    source
        Bag, or folder with CSV files.
    mapping
        None for bags of our own.
    mend
        Whether to look for faults at all.

    Raises
    ------
    ValueError
        Says what is missing, in which file and line, and BagError what is wrong with a bag.
    """
    (recording,) = read_in_parts(source, mapping, part_ns=0, mend=mend)
    return recording


def read_in_parts(
    source: str | os.PathLike,
    mapping: RecordingMapping | None = None,
    part_ns: int = PART_NS,
    mend: bool = True,
) -> Iterator[ThrowRecording]:
    """As `read_recording`, one part of a bag of ours after the other, so that only a part of a
    long one is in memory.

    A part ends in a pause, where there is one: a world that is set anew. Faults are looked for in
    each part by itself. Recordings of others, and without the command that opens the hand, are one
    part.

    Parameters
    ----------
    source, mapping, mend
        As for that.
    part_ns
        Log time of a part, about; 0: all is one part [ns].

    Raises
    ------
    ValueError, BagError
        As there; for a body that was never seen at the end.
    """
    source, mapping = Path(source), mapping or OWN
    if not source.exists():
        raise BagError(f"{source}: no such bag or folder")
    tracked = {role: where for role, where in mapping.bodies.items() if not where.fixed}
    seen: set[str] = set()
    recorded: Counter[str] = Counter()
    faults: list[Fault] = []
    still: dict[str, np.ndarray] = {}
    of_bag = bag_faults(source, mapping) if mend else []
    told = of_bag
    with _beside(of_bag):
        for taken in read_topics(source, mapping, part_ns, mapping is OWN):
            recording = _recording(source, mapping, taken, mend, still)
            seen |= {role for role, stream in recording.bodies.items() if len(stream)}
            recorded.update(recording.recorded)
            faults += [fault for fault in recording.faults if fault.kind != GAP][
                : FEW - len(faults)
            ]
            if part_ns == 0:
                _require_seen(tracked, seen, recorded, faults)
            yield replace(recording, faults=(*told, *recording.faults))
            told = []
        _require_seen(tracked, seen, recorded, faults)


@contextmanager
def _beside(of_bag: list[Fault]) -> Iterator[None]:
    """What cannot be read may be so for what is wrong with the bag: that is told with it."""
    try:
        yield
    except ValueError as error:
        error.args = ("; ".join([str(error), *map(in_words, of_bag)]),)
        raise


def _require_seen(
    tracked: Mapping[str, PoseSource],
    seen: set[str],
    recorded: Mapping[str, int],
    faults: list[Fault],
) -> None:
    for role, where in tracked.items():
        name = where.topic or next(one.file for one in (where.table, where.capture) if one)
        if role in seen:
            continue
        if not recorded.get(role):
            raise ValueError(f"{name}: no pose of the {role}: was it tracked?")
        why = "; ".join(in_words(fault) for fault in faults if fault.body == role)
        raise ValueError(
            f"{name}: {recorded[role]} poses of the {role} were recorded, and none of them is"
            f" left: {why}"
        )


def _recording(
    source: Path,
    mapping: RecordingMapping,
    taken: dict[str, Any],
    mend: bool,
    still: dict[str, np.ndarray],
) -> ThrowRecording:
    """What was collected, in our axes and units. still: poses (7,) of bodies that were published
    once, by role; found ones are added.
    """
    folder = source if source.is_dir() else source.parent
    faults: list[Fault] = []
    bodies, recorded = {}, {}
    for role, where in mapping.bodies.items():
        if not where.fixed:
            bodies[role], found = _body(role, where, taken, folder, mapping.frame)
            recorded[role] = len(bodies[role]) + sum(
                fault.count for fault in found if fault.kind == UNSTAMPED and fault.repaired
            )
            faults += found
    joints, found = _joints(mapping.joints, taken.get(JOINTS), folder)
    faults += [
        *found,
        *clocks_apart(
            _clocks(mapping, taken, {fault.body for fault in faults if not fault.repaired})
        ),
    ]
    if mend:
        timeless = {fault.body for fault in faults if fault.is_of_time}
        repaired, found = repair(
            {role: body for role, body in bodies.items() if len(body) and role not in timeless}
        )
        bodies |= repaired
        faults += [*found, *_never_moving(bodies)]
    else:
        faults = []
    for role, where in mapping.bodies.items():
        if where.fixed:
            bodies[role] = _resting(
                role, np.array([*where.fixed, *UNTURNED]), bodies["hand"].stamp_ns, mapping.frame
            )
    bodies |= _standing(bodies, mapping.frame, still, faults)
    openings = _openings(mapping, taken, folder)
    has_button = any(
        name in taken or (where is not None and where.table) for name, where in buttons(mapping)
    )
    stamps = np.unique(
        mapping.command.clock.corrected(taken["command"].stamps)
        if mapping.command and "command" in taken
        else ()
    )
    return ThrowRecording(
        source.name,
        bodies,
        joints,
        openings,
        has_button,
        tuple(faults),
        mapping.frame,
        stamps,
        recorded,
    )


def _clocks(
    mapping: RecordingMapping, taken: dict[str, Any], faulty: set[str]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Stamps and log times (n,) [ns] of what has both, and no fault that is known."""
    sources: dict[str, PoseSource | SignalSource | None] = {
        **mapping.bodies,
        JOINTS: mapping.joints,
        **dict(buttons(mapping)),
    }
    found = {}
    for role, content in taken.items():
        where = sources[role]
        if (
            where is None
            or where.clock.source == "log"
            or where.clock.is_regular
            or role in faulty
        ):
            continue
        stamps, log_ns = (
            (content.stamp_ns, content.log_ns)
            if isinstance(content, JointStream)
            else (content.stamps, content.log)
        )
        filled = stamps != 0
        found[role] = (
            where.clock.corrected(in_seconds(stamps[filled], where.clock.unit)),
            log_ns[filled],
        )
    return found


def _never_moving(bodies: Mapping[str, PoseStream]) -> list[Fault]:
    """A hand and a ball whose poses are all the same to the last bit."""
    faults = []
    for role in ("hand", "ball"):
        stream = bodies.get(role)
        if stream is not None and len(stream) >= FEW and not np.ptp(stream.position, axis=0).any():
            text = (
                f"{len(stream)} poses that are the same to the last bit: a body that was lost, or"
                " is not the one that moved"
            )
            faults.append(Fault.of("stale", role, stream.stamp_ns, text))
    return faults


def _standing(
    bodies: Mapping[str, PoseStream], frame: str, still: dict[str, np.ndarray], faults: list[Fault]
) -> dict[str, PoseStream]:
    """Bodies that were published once or a few times at one place, at each stamp of the hand."""
    found, hand = {}, bodies["hand"].stamp_ns
    for role, stream in bodies.items():
        if (
            0 < len(stream) < FEW < len(hand)
            and role not in ("hand", "ball")
            and np.ptp(stream.position, axis=0).max() < STILL
        ):
            still[role] = np.concatenate([stream.position[0], stream.quaternion[0]])
            at = ", ".join(f"{x:.3f}" for x in still[role][:3])
            text = f"published {len(stream)} times, always at ({at}): taken to stand there"
            faults.append(Fault.of(NOTE, role, stream.stamp_ns, text, True))
        if role in still and len(stream) < FEW:
            found[role] = _resting(role, still[role], hand, frame)
    return found


def convert(
    source: str | os.PathLike,
    output: str | os.PathLike,
    mapping: RecordingMapping | None = None,
    storage: str = "mcap",
) -> ThrowRecording:
    """Write a recording as a bag in our layout: our topics, `world` axes, Z up, quaternions of
    continuous sign.

    Where it came from and what was wrong with it stands in the bag's custom data.

    Parameters
    ----------
    source, mapping
        As for `read_recording`.
    output
        Folder of the bag, which must not exist.
    storage
        Format of its files, mcap or sqlite3.

    Returns
    -------
    ThrowRecording
        What was read.
    """
    recording = read_recording(source, mapping)
    faults = [asdict(fault) for fault in recording.faults if not fault.is_information]
    gaps = Counter(fault.body for fault in recording.faults if fault.kind == GAP)
    about = {"source": recording.source, "faults": json.dumps(faults), "gaps": json.dumps(gaps)}
    messages = sorted(_messages(recording), key=lambda item: item[1])
    {"mcap": _write_mcap, "sqlite3": _write_sqlite}[storage](Path(output), about, messages)
    return recording


def _write_mcap(
    output: Path, about: dict[str, str], messages: list[tuple[str, int, str, dict]]
) -> None:
    types = typestore()
    with BagWriter(output, custom_data=about) as bag:
        for topic, type_name in sorted(
            {(topic, type_name) for topic, _, type_name, _ in messages}
        ):
            bag.add_topic(
                topic,
                type_name,
                definition(types, type_name),
                qos_yaml(),
                type_hash(types, type_name),
            )
        for topic, stamp, type_name, content in messages:
            bag.write(topic, stamp, stamp, serialize(types, type_name, content))


def _write_sqlite(
    output: Path, about: dict[str, str], messages: list[tuple[str, int, str, dict]]
) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer

    types = typestore()
    with Writer(output, version=9, storage_plugin=StoragePlugin.SQLITE3) as bag:
        for name, text in about.items():
            bag.set_custom_data(name, text)
        topics = sorted({(topic, type_name) for topic, _, type_name, _ in messages})
        connections = {
            topic: bag.add_connection(topic, type_name, typestore=types)
            for topic, type_name in topics
        }
        for topic, stamp, type_name, content in messages:
            bag.write(connections[topic], stamp, serialize(types, type_name, content))


def _body(
    role: str, where: PoseSource, taken: dict, folder: Path, frame: str
) -> tuple[PoseStream, list[Fault]]:
    """The poses of a body in our axes, and what is wrong with their stamps."""
    scale, order, log_ns = LENGTH_UNITS[where.length], QUATERNION_ORDERS[where.order], None
    faults: list[Fault] = []
    if where.topic:
        poses: Poses = taken.get(role, Poses())
        stamps, log_ns, position, quaternion = (
            poses.stamps,
            poses.log,
            poses.rows[:, :3],
            poses.rows[:, 3:],
        )
        faults += poses.faults
    elif where.table is not None:
        stamps, position, quaternion = read_pose_table(
            folder, where.table, where.clock.unit, where.length
        )
    else:
        stamps, position, quaternion, axes = read_capture(folder, where)
        # as the file itself says
        where, scale, order = (
            replace(where, axes=axes),
            1.0,
            QUATERNION_ORDERS["xyzw"],
        )
    stamps, kept, found = timed(role, stamps, log_ns, where.clock)
    stream = PoseStream(role, stamps, scale * position[kept], quaternion[kept][:, order], frame)
    if not where.is_plain:
        stream = transformed(
            stream, where.world, where.offset, where.axes, where.orientation_axes, where.is_inverse
        )
    return stream, faults + found


def _resting(role: str, pose: np.ndarray, stamps: np.ndarray, frame: str) -> PoseStream:
    """A body that was not tracked: with one pose (7,) at each stamp."""
    rows = np.tile(pose, (len(stamps), 1))
    return PoseStream(role, stamps, rows[:, :3], rows[:, 3:], frame)


def _joints(
    where: SignalSource | None, states: JointStream | None, folder: Path
) -> tuple[JointStream | None, list[Fault]]:
    """The joint states in our angles, and what is wrong with them."""
    if where is None or (where.table is None and states is None):
        return None, []
    log_ns = None
    if where.table is not None:
        columns = read_table(folder, where.table, where.clock.unit, {"position": where.angle})
        if (width := columns["position"].shape[1]) != joint_count() or columns["velocity"].shape[
            1
        ] not in (0, joint_count()):
            raise ValueError(
                f"{folder / where.table.file}: {width} columns of positions of {joint_count()} joints"
            )
        n = len(columns["time"])
        velocity = (
            columns["velocity"]
            if columns["velocity"].shape[1]
            else np.full((n, joint_count()), np.nan)
        )
        unit = ANGLE_UNITS[where.angle]
        time, position = columns["time"], unit * columns["position"]
        states = JointStream(time, position, unit * velocity, where.names, time)
        states = states.take(np.isfinite(states.position).all(axis=1))
    else:
        assert states is not None  # as was just asked
        log_ns = states.log_ns
    stamps, kept, of_time = timed(JOINTS, states.stamp_ns, log_ns, where.clock)
    stream, found = joint_stream(states.take(kept), stamps, where)
    found += [] if where.clock.is_regular else bunched(JOINTS, stream.stamp_ns)
    back = int(np.sum(np.diff(without_running_back(stamps) - stamps) != 0))
    if back and not of_time:
        found.append(
            Fault.of(
                BACKWARDS,
                JOINTS,
                stamps,
                f"stamps run back {back} times, and stay behind: was the clock set?",
                count=back,
            )
        )
    return stream, [*states.faults, *of_time, *found]


def _openings(mapping: RecordingMapping, taken: dict, folder: Path) -> tuple[Opening, ...]:
    found, pushes = [], GripSignal()
    for name, where in buttons(mapping):
        if where is None or (where.topic and name not in taken):
            continue
        signal = taken[name] if where.topic else None
        stamps = signal.openings if signal else []
        if signal is None and where.table is not None:
            stamps = read_table(folder, where.table, where.clock.unit)["time"].tolist()
        if name == "teacher" and signal:
            pushes.pushes = np.sort(
                where.clock.corrected(np.array(signal.pushes, dtype=np.int64))
            ).tolist()
        found += [
            Opening(one, name == "teacher" or pushes.pushed_before(one))
            for one in where.clock.corrected(np.array(stamps)).tolist()
        ]
    return tuple(sorted(found, key=lambda opening: opening.stamp_ns))


# writing


def _messages(recording: ThrowRecording) -> Iterator[tuple[str, int, str, dict]]:
    """Topic, stamp [ns], type and content of each message of a recording."""

    def header(stamp: int) -> dict:
        return header_content(stamp, recording.frame_id)

    for role, topic in the_world().pose_topics().items():
        stream = with_continuous_signs(recording.bodies[role])
        for stamp, p, q in zip(
            stream.stamp_ns.tolist(),
            stream.position.tolist(),
            stream.quaternion.tolist(),
            strict=True,
        ):
            yield (
                topic,
                stamp,
                "geometry_msgs/msg/PoseStamped",
                {"header": header(stamp), "pose": pose_content(p, q)},
            )
    joints = recording.joints
    if joints is not None:
        for stamp, q, v in zip(
            joints.stamp_ns.tolist(), joints.position, joints.velocity, strict=True
        ):
            content = {
                "header": header(stamp),
                "name": list(joints.names),
                "position": q,
                "velocity": v,
            }
            yield "/joint_states", stamp, "sensor_msgs/msg/JointState", content
    for opening in recording.openings:
        topic = "/wam/teacher_wrench" if opening.taught else "/wam/command"
        yield (
            topic,
            opening.stamp_ns,
            "dart_skill_msgs/msg/WamCommand",
            {"header": header(opening.stamp_ns), "grip": int(Grip.OPEN)},
        )
