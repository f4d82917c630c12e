"""A demonstration: one movement as the sensors saw it, and its way to and from messages and bags.

The conversions work on any object with the fields of dart_skill_msgs/msg/Demonstration: on those
of rclpy as well as on those that are decoded without ROS.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from rosbags.typesys.store import Typestore

from dart_skill.common.arm_choice import joint_count
from dart_skill.common.checks import FARTHEST, as_place, check_samples, check_unit_quaternions
from dart_skill.common.constants import HAND, Grip
from dart_skill.common.situation import Pose, Situation
from dart_skill.common.world import (
    DEMONSTRATION_TOPIC,
    THROW,
    joint_names,
    joint_order,
    the_world,
)
from dart_skill.recording.bags import (
    BagError,
    GraphBag,
    header_content,
    message,
    pose_content,
    stamp_content,
)

DEMONSTRATION_TYPE = "dart_skill_msgs/msg/Demonstration"
SKILL = THROW
"""Skill of a recording that does not say of which one it is."""
WORDS = {Grip.OPEN: "open", Grip.CLOSE: "close"}
"""Names of the events in which the fingers are told something."""
GRIPS = {name: grip for grip, name in WORDS.items()}
_ITEMS = {
    "tracks": "dart_skill_msgs/msg/BodyTrack",
    "poses": "geometry_msgs/msg/PoseStamped",
    "situation.poses": "geometry_msgs/msg/Pose",
    "joints": "sensor_msgs/msg/JointState",
    "events": "dart_skill_msgs/msg/Event",
}
"""Types of the elements of sequences, by the name of their field."""
LONGEST = 3600.0
"""Longest demonstration, with all that is recorded before and after the movement [s]."""
WIDEST_ANGLE = 2.0 * np.pi
"""Largest angle of a joint [rad]: beyond it are degrees, or errors."""
FASTEST_JOINT = 100.0
"""Largest speed of a joint [rad/s]: beyond it are degrees, or errors."""
BEFORE = 0.1
"""Length of the time before an instant in which the pose of a body at that instant is seen [s]."""


def _freeze(one: Any, **arrays: np.ndarray) -> None:
    """Copies of arrays as read-only fields of a frozen dataclass."""
    for name, array in arrays.items():
        array = array.copy()
        array.setflags(write=False)
        object.__setattr__(one, name, array)


@dataclass(frozen=True, eq=False)
class Track:
    """A tracked body, in the world of the cameras; its arrays are read-only.

    Parameters
    ----------
    time
        (n,) [s], stamps.
    position
        (n, 3) [m].
    quaternion
        (n, 4), of length 1.

    Raises
    ------
    ValueError
        Names what is not so.
    """

    time: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray

    def __post_init__(self) -> None:
        time, position = check_samples("track", self.time, self.position, least=0)
        turns = check_unit_quaternions("track", self.quaternion, len(time))
        _freeze(self, time=time, position=position, quaternion=turns)

    def __len__(self) -> int:
        return len(self.time)

    @classmethod
    def unturned(cls, time: np.ndarray, position: np.ndarray) -> Track:
        """A body of which only the position is known: (n,) [s], (n, 3) [m]."""
        return cls(time, position, np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)))

    def pose_at(self, instant: float) -> Pose:
        """Where the body was just before an instant [s]: the median of the positions, and the mean
        of the orientations seen then.

        Of a body that was not seen then, the last that was seen before; if nothing was, the first
        that was seen after.
        """
        seen = (self.time <= instant) & (self.time >= instant - BEFORE)
        if not seen.any():
            last = int(np.searchsorted(self.time, instant, side="right")) - 1
            seen = np.arange(len(self.time)) == max(last, 0)
        nearest = self.quaternion[seen][-1]
        same_sign = self.quaternion[seen] * np.sign(self.quaternion[seen] @ nearest)[:, None]
        return Pose(np.median(self.position[seen], axis=0), same_sign.mean(axis=0))

    def resampled(self, time: np.ndarray) -> Track:
        """The body at other stamps (n,) [s]: linear between samples; before the first and after
        the last as it was there.
        """
        turns = np.sign(np.sum(self.quaternion[1:] * self.quaternion[:-1], axis=1))
        signs = np.cumprod(np.concatenate([[1.0], np.where(turns == 0.0, 1.0, turns)]))
        rows = np.hstack([self.position, self.quaternion * signs[:, None]])
        there = np.column_stack([np.interp(time, self.time, column) for column in rows.T])
        length = np.linalg.norm(there[:, 3:], axis=1, keepdims=True)
        return Track(time, there[:, :3], there[:, 3:] / length)


UNSEEN = Track(np.empty(0), np.empty((0, 3)), np.empty((0, 4)))
"""Track of a body that was never seen."""


@dataclass(frozen=True)
class Event:
    """The fingers were told something.

    Parameters
    ----------
    name
        "open" or "close".
    time
        [s].
    """

    name: str
    time: float

    @property
    def grip(self) -> Grip:
        """What they were told."""
        return GRIPS[self.name]


def _none(*width: int) -> Callable[[], np.ndarray]:
    return lambda: np.empty((0, *width))


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One movement. All of it is in frame_id; times are seconds after stamp_ns, lengths metres,
    quaternions x, y, z, w. Its arrays are read-only.

    Parameters
    ----------
    id
        Unique in a recording.
    tracks
        Of the bodies by role; one is the hand.
    stamp_ns
        The origin of all times.
    skill
        That it shows.
    situation
        Where the bodies were when the movement began, and numbers, as far as they are known.
    joint_time, joint_position, joint_velocity
        (k,), (k, 7) [rad], (k, 7) [rad/s], of the arm; may be empty.
    events
        What the fingers were told, in order.
    motion_start, motion_stop
        When the movement began and ended; nan if unknown.
    frame_id
        Str.
    joint_names
        As the driver calls them.

    Raises
    ------
    ValueError
        Names what is not so.
    """

    id: str
    tracks: Mapping[str, Track]
    stamp_ns: int = 0
    skill: str = SKILL
    situation: Situation = field(default_factory=lambda: Situation({}))
    joint_time: np.ndarray = field(default_factory=_none())
    joint_position: np.ndarray = field(default_factory=lambda: np.empty((0, joint_count())))
    joint_velocity: np.ndarray = field(default_factory=lambda: np.empty((0, joint_count())))
    events: tuple[Event, ...] = ()
    motion_start: float = float("nan")
    motion_stop: float = float("nan")
    frame_id: str = the_world().frame_id
    joint_names: tuple[str, ...] = field(default_factory=joint_names)

    def __post_init__(self) -> None:
        if not self.id or not isinstance(self.id, str):
            raise ValueError(f"id of a demonstration must be a non-empty text, got {self.id!r}")
        name = f"demonstration {self.id}"
        if int(self.stamp_ns) != self.stamp_ns or self.stamp_ns < 0:
            raise ValueError(
                f"{name}: stamp_ns = {self.stamp_ns} must be whole nanoseconds, not negative"
            )
        if HAND not in self.tracks:
            raise ValueError(
                f"{name} has no track of the hand, only of"
                f" {', '.join(sorted(self.tracks)) or 'nothing'}"
            )
        if len(self.tracks[HAND]) < 2:
            raise ValueError(f"{name}, hand: {len(self.tracks[HAND])} samples, need at least 2")
        for role, pose in self.situation.poses.items():
            as_place(pose.position, f"{name}: the {role} of its situation")
        time, position = check_samples(
            f"{name}, joints", self.joint_time, self.joint_position, least=0, width=joint_count()
        )
        _, velocity = check_samples(
            f"{name}, joint velocity", time, self.joint_velocity, least=0, width=joint_count()
        )
        _freeze(self, joint_time=time, joint_position=position, joint_velocity=velocity)
        object.__setattr__(self, "stamp_ns", int(self.stamp_ns))
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        object.__setattr__(self, "events", tuple(self.events))
        self._check_ranges(name)
        self._check_events(name)

    def __repr__(self) -> str:
        seen = ", ".join(f"{len(track)} of the {role}" for role, track in self.tracks.items())
        return f"Demonstration({self.id!r}, {self.skill}, poses: {seen})"

    def _check_ranges(self, name: str) -> None:
        """No memory is asked for, and no sum overflows, on account of a number that no movement
        has.
        """
        limits = [
            *(
                (f"time of the {role}", one.time, LONGEST, "s")
                for role, one in self.tracks.items()
            ),
            *((f"the {role}", one.position, FARTHEST, "m") for role, one in self.tracks.items()),
            ("joint_time", self.joint_time, LONGEST, "s"),
            ("joint_position", self.joint_position, WIDEST_ANGLE, "rad"),
            ("joint_velocity", self.joint_velocity, FASTEST_JOINT, "rad/s"),
        ]
        for what, values, limit, unit in limits:
            if values.size and (most := float(np.abs(values).max())) > limit:
                sample = int(np.unravel_index(np.abs(values).argmax(), values.shape)[0])
                raise ValueError(
                    f"{name}: {what} of sample {sample} is {most:.4g} {unit}: no movement goes"
                    f" beyond {limit:.4g} {unit}"
                )

    def _check_events(self, name: str) -> None:
        instants = [("motion_start", self.motion_start), ("motion_stop", self.motion_stop)]
        for event, seconds in [*instants, *((one.name, one.time) for one in self.events)]:
            if abs(seconds) > LONGEST:
                raise ValueError(
                    f"{name}: {event} = {seconds:.4g} s: give at most {LONGEST:.0f} s after its"
                    " stamp, or nan if unknown"
                )
        for event, seconds in instants:
            object.__setattr__(self, event, float(seconds))
        if self.motion_stop < self.motion_start:
            raise ValueError(
                f"{name}: motion_stop {self.motion_stop} s lies before motion_start"
                f" {self.motion_start} s"
            )
        if len(self.joint_names) != joint_count():
            raise ValueError(f"{name}: {len(self.joint_names)} joint names, need {joint_count()}")

    def track(self, role: str) -> Track:
        """Track of one body.

        Raises
        ------
        ValueError
            If it was never seen.
        """
        if not self.tracks.get(role, UNSEEN):
            seen = sorted(name for name, track in self.tracks.items() if track)
            raise ValueError(
                f"demonstration {self.id}: the {role} was never seen; tracked were"
                f" {', '.join(seen)}"
            )
        return self.tracks[role]

    @property
    def hand_time(self) -> np.ndarray:
        return self.tracks[HAND].time

    @property
    def hand_position(self) -> np.ndarray:
        return self.tracks[HAND].position

    @property
    def hand_quaternion(self) -> np.ndarray:
        return self.tracks[HAND].quaternion

    @property
    def moved(self) -> Track:
        """Track of the first body beside the hand: of what is thrown or carried."""
        return next((track for role, track in self.tracks.items() if role != HAND), UNSEEN)

    @property
    def target(self) -> np.ndarray:
        """Place (3,) of the first body of the situation: of what is thrown at.

        Raises
        ------
        ValueError
            If it has none.
        """
        if not self.situation.poses:
            raise ValueError(f"demonstration {self.id} has a situation without a body")
        return next(iter(self.situation.poses.values())).position

    def aimed_at(self, place: np.ndarray) -> Demonstration:
        """The same with the first body of the situation at another place (3,)."""
        role = next(iter(self.situation.poses))
        return replace(self, situation=self.situation.moved(role, Pose(place)))

    @property
    def opened(self) -> float:
        """Time at which the fingers were first told to open; nan if they were not."""
        return next((one.time for one in self.events if one.grip == Grip.OPEN), float("nan"))


def fill_demonstration_message(one: Demonstration, msg: Any, new: Callable[[str], Any]) -> Any:
    """Write a demonstration into an empty message object.

    Parameters
    ----------
    one
        The demonstration.
    new
        Makes an empty message from a type name as "geometry_msgs/msg/PoseStamped".

    Returns
    -------
    Any
        It.
    """
    return filled(msg, _content(one), new)


def demonstration_message(types: Typestore, one: Demonstration) -> Any:
    """The message of a demonstration as an object of `types`, without ROS.

    Parameters
    ----------
    one
        It.
    """
    return message(types, DEMONSTRATION_TYPE, _content(one))


def demonstration_from_message(msg: Any, skill: str = "") -> Demonstration:
    """The demonstration in a message object, of rclpy or decoded without ROS.

    Parameters
    ----------
    skill
        Whose demonstrations are wanted, in the frame of the world; empty: of any skill, in any
        frame.

    Raises
    ------
    ValueError
        For another one, and for a message that holds no demonstration.
    """
    what = f"demonstration {msg.id}"
    if not hasattr(msg, "tracks"):
        raise ValueError(f"{what} is of a version that knew of throws only")
    if skill and msg.skill != skill:
        raise ValueError(f"{what} is of the skill '{msg.skill}', not of '{skill}'")
    if skill and msg.header.frame_id != the_world().frame_id:
        raise ValueError(
            f"{what} is in frame '{msg.header.frame_id}', not '{the_world().frame_id}'"
        )
    origin = stamp_ns(msg.header.stamp)
    tracks = named(
        f"{what}: tracks", [one.body for one in msg.tracks], [one.poses for one in msg.tracks]
    )
    return Demonstration(
        id=msg.id,
        tracks={role: _track(what, role, poses, origin) for role, poses in tracks.items()},
        stamp_ns=origin,
        skill=msg.skill,
        situation=situation_from_message(msg.situation, what),
        joint_time=times_after(msg.joints, origin),
        joint_position=arm_rows(msg.joints, "position"),
        joint_velocity=arm_rows(msg.joints, "velocity"),
        events=tuple(
            Event(WORDS[grip_of(what, one.name)], stamp_ns(one.time_from_start) * 1e-9)
            for one in msg.events
        ),
        motion_start=_event(msg.motion_start, origin),
        motion_stop=_event(msg.motion_stop, origin),
        frame_id=msg.header.frame_id,
        joint_names=(
            joint_names()
            if not len(msg.joints[0].name) or _is_arm(msg.joints[0].name)
            else tuple(msg.joints[0].name)
        )
        if len(msg.joints)
        else joint_names(),
    )


def _track(what: str, role: str, poses: Sequence[Any], origin: int) -> Track:
    try:
        return Track(times_after(poses, origin), *pose_rows(poses))
    except ValueError as error:
        raise ValueError(f"{what}, {role}: {error}") from error


def grip_of(what: str, name: str) -> Grip:
    """What an event tells the fingers, by its name.

    Raises
    ------
    ValueError
        With `what` has the event, for another one.
    """
    if name not in GRIPS:
        raise ValueError(
            f"{what}: an event is called '{name}': the fingers are told {' or '.join(GRIPS)}"
        )
    return GRIPS[name]


def situation_from_message(msg: Any, what: str) -> Situation:
    """The situation in a message object.

    Raises
    ------
    ValueError
        With `what` has it, for one that is none.
    """
    poses = named(f"{what}: situation", msg.bodies, msg.poses)
    numbers = named(f"{what}: situation", msg.names, msg.numbers)
    at = {
        role: Pose(np.array(_vector(one.position)), np.array(_quaternion(one.orientation)))
        for role, one in poses.items()
    }
    return Situation(at, {name: float(number) for name, number in numbers.items()})


def situation_content(situation: Situation) -> dict[str, Any]:
    """Fields of dart_skill_msgs/msg/Situation."""
    return {
        "bodies": list(situation.poses),
        "poses": [
            pose_content(pose.position.tolist(), pose.quaternion.tolist())
            for pose in situation.poses.values()
        ],
        "names": list(situation.numbers),
        "numbers": [float(number) for number in situation.numbers.values()],
    }


def named(what: str, names: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    """Values by their names, as messages hold them in two sequences.

    Raises
    ------
    ValueError
        With `what` it is, if they do not fit together.
    """
    if len(names) != len(values):
        raise ValueError(
            f"{what}: {len(names)} names and {len(values)} values: give one value for each name"
        )
    if twice := sorted({name for name in names if list(names).count(name) > 1}):
        raise ValueError(f"{what}: {', '.join(twice)} stands there twice")
    return dict(zip(names, values, strict=True))


def skill_of(bag_path: str | os.PathLike) -> str:
    """Skill of the demonstrations of a bag; throwing, where it has none or cannot be read: the
    command that learns from it says why.
    """
    try:
        with GraphBag(bag_path) as bag:
            topic = bag.topics.get(DEMONSTRATION_TOPIC)
            if topic is None or topic.type_name != DEMONSTRATION_TYPE:
                return SKILL
            first = next(iter(bag.messages([DEMONSTRATION_TOPIC])), None)
    except (BagError, OSError):
        return SKILL
    return SKILL if first is None else getattr(first.data, "skill", SKILL)


def read_demonstrations(bag_path: str | os.PathLike, skill: str = "") -> list[Demonstration]:
    """Demonstrations of a bag in the order of recording.

    Raises
    ------
    BagError
        If it has none, or they are not valid, or of another skill than `skill`, where this is
        given.
    """
    return list(each_demonstration(bag_path, skill))


def each_demonstration(bag_path: str | os.PathLike, skill: str = "") -> Iterator[Demonstration]:
    """As `read_demonstrations`, one after the other, with its BagError.

    Parameters
    ----------
    bag_path, skill
        The same.
    """
    topic = DEMONSTRATION_TOPIC
    with GraphBag(bag_path) as bag:
        if topic not in bag.topics:
            raise BagError(
                f"{bag_path}: no topic {topic}, only {sorted(bag.topics)}: was it recorded?"
            )
        if bag.topics[topic].type_name != DEMONSTRATION_TYPE:
            raise BagError(
                f"{bag_path}: {topic} has type {bag.topics[topic].type_name}, not"
                f" {DEMONSTRATION_TYPE}"
            )
        try:
            for item in bag.messages([topic]):
                yield demonstration_from_message(item.data, skill)
        except BagError:
            raise
        except (ValueError, AttributeError) as error:
            raise BagError(f"{bag_path}: {topic}: {error}") from error


def _content(one: Demonstration) -> dict[str, Any]:
    """The fields of the message as nested dictionaries and lists."""

    def after(seconds: float) -> int:
        return one.stamp_ns + round(float(seconds) * 1e9)

    def instant(seconds: float) -> dict[str, int]:
        return stamp_content(0 if np.isnan(seconds) else after(seconds))

    def items(time: np.ndarray, contents: Iterable[dict]) -> list[dict]:
        return [
            {"header": header_content(after(t), one.frame_id), **content}
            for t, content in zip(time, contents, strict=True)
        ]

    def poses(track: Track) -> list[dict]:
        both = zip(track.position.tolist(), track.quaternion.tolist(), strict=True)
        return items(track.time, ({"pose": pose_content(*pose)} for pose in both))

    names = list(one.joint_names)
    states = zip(one.joint_position.tolist(), one.joint_velocity.tolist(), strict=True)
    return {
        "header": header_content(one.stamp_ns, one.frame_id),
        "skill": one.skill,
        "id": one.id,
        "situation": situation_content(one.situation),
        "tracks": [{"body": role, "poses": poses(track)} for role, track in one.tracks.items()],
        "joints": items(
            one.joint_time, ({"name": names, "position": q, "velocity": v} for q, v in states)
        ),
        "motion_start": instant(one.motion_start),
        "motion_stop": instant(one.motion_stop),
        "events": [
            {"name": event.name, "time_from_start": duration_content(event.time)}
            for event in one.events
        ],
    }


def duration_content(seconds: float) -> dict[str, int]:
    """Fields of a duration, to the nanosecond.

    Parameters
    ----------
    seconds
        How long.
    """
    return stamp_content(round(float(seconds) * 1e9))


def filled(
    msg: Any, content: Mapping[str, Any], new: Callable[[str], Any], within: str = ""
) -> Any:
    """Fields of a demonstration's message written into an empty one of rclpy; `new` makes the
    messages in its sequences by type name.

    Parameters
    ----------
    msg
        The empty one.
    content
        By field.
    within
        Name of what it is a part of.
    """
    for name, value in content.items():
        kind = _ITEMS.get(f"{within}.{name}") or _ITEMS.get(name)
        if isinstance(value, dict):
            filled(getattr(msg, name), value, new, name)
        elif kind is not None:
            setattr(msg, name, [filled(new(kind), item, new, name) for item in value])
        else:
            setattr(msg, name, value)
    return msg


def stamp_ns(stamp: Any) -> int:
    """A message's stamp or duration as an integer [ns]."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _event(stamp: Any, origin: int) -> float:
    """Seconds after the origin; nan for a zero stamp."""
    nanoseconds = stamp_ns(stamp)
    return (nanoseconds - origin) * 1e-9 if nanoseconds else float("nan")


def times_after(items: Iterable[Any], origin: int) -> np.ndarray:
    """Stamps of stamped messages as seconds after an origin [ns] (n,).

    Parameters
    ----------
    items
        The messages.
    """
    return (
        np.array([stamp_ns(item.header.stamp) - origin for item in items], dtype=np.int64) * 1e-9
    )


def pose_rows(poses: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and quaternions (n, 4) of PoseStamped messages.

    Parameters
    ----------
    poses
        The messages.
    """
    turned = [_quaternion(item.pose.orientation) for item in poses]
    return _rows([_vector(item.pose.position) for item in poses], 3), _rows(turned, 4)


def arm_rows(states: Sequence[Any], field_name: str) -> np.ndarray:
    """A field of JointState messages (n, 7), in the order of the arm's joints.

    Parameters
    ----------
    field_name
        Position, velocity or effort.

    Raises
    ------
    ValueError
        For a state of another length.
    """
    return _rows([_of_arm(item.name, getattr(item, field_name)) for item in states], joint_count())


def _vector(item: Any) -> list[float]:
    return [item.x, item.y, item.z]


def _quaternion(item: Any) -> list[float]:
    return [item.x, item.y, item.z, item.w]


def _is_arm(names: Sequence[str]) -> bool:
    """Whether these are the names of the arm's joints; another driver has its own, and gives them
    in the arm's order.
    """
    return set(names) == set(joint_names())


def _of_arm(names: Sequence[str], values: Sequence[float]) -> Sequence[float]:
    """Values of one state in the order of the arm's joints, by their names where it has those."""
    if not _is_arm(names) or len(values) != len(names):
        return values
    order = joint_order(tuple(names))
    return values if isinstance(order, slice) else [values[k] for k in order]


def _rows(rows: Sequence[Sequence[float]], width: int) -> np.ndarray:
    wrong = [index for index, row in enumerate(rows) if len(row) != width]
    if wrong:
        raise ValueError(f"sample {wrong[0]} has {len(rows[wrong[0]])} values, need {width}")
    return np.array([list(row) for row in rows], dtype=float).reshape(-1, width)
