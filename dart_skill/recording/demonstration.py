"""A demonstration: one guided throw as the sensors saw it, and its way to and from messages and
bags.

The conversions work on any object with the fields of dart_skill_msgs/msg/Demonstration: on those
of rclpy as well as on those that are decoded without ROS.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rosbags.typesys.store import Typestore

from dart_skill.common.checks import FARTHEST, as_place, check_samples, check_unit_quaternions
from dart_skill.common.constants import N_JOINTS, UNTURNED
from dart_skill.common.world import (
    DEMONSTRATION_TOPIC,
    THROW,
    THROWN,
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
"""The skill of a demonstration that does not say of which one it is."""
OPEN = "open"
"""Event: the hand was told to open."""
_ITEMS = {
    "tracks": "dart_skill_msgs/msg/BodyTrack",
    "poses": "geometry_msgs/msg/PoseStamped",
    "situation.poses": "geometry_msgs/msg/Pose",
    "joints": "sensor_msgs/msg/JointState",
    "events": "dart_skill_msgs/msg/Event",
}
"""Types of the elements of sequences, by the name of their field."""
LONGEST = 120.0
"""No throw takes longer, with all that is recorded before and after it [s]."""
WIDEST_ANGLE, FASTEST_JOINT = 2.0 * np.pi, 100.0
"""No joint of an arm is farther from its zero [rad], or faster [rad/s]: beyond it are degrees, or
errors.
"""


def _none(width: int | None = None) -> Callable[[], np.ndarray]:
    return lambda: np.empty(0 if width is None else (0, width))


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One throw. All of it is in frame_id; times are seconds after stamp_ns, lengths metres,
    quaternions x, y, z, w.

    * id: unique in a recording.
    * stamp_ns: the origin of all times.
    * target: (3,), centre of the basket's rim, or of the board.
    * hand_time, hand_position, hand_quaternion: (n,), (n, 3), (n, 4), poses of the hand, n >= 2.
    * ball_time, ball_position: (m,), (m, 3), from the grip to the landing; may be empty.
    * joint_time, joint_position, joint_velocity: (k,), (k, 7) [rad], (k, 7) [rad/s], of the arm;
      may be empty.
    * motion_start, motion_stop: when the speed crossed the thresholds; nan if unknown.
    * hand_opened: when the hand was told to open; nan if unknown.
    * joint_names: as the driver calls them; may be empty.
    * skill: of throwing (`world.THROWN`), which says what the "ball" and the "basket" are: a dart
      and a board, too.

    ValueError names what is not so.
    """

    id: str
    stamp_ns: int
    target: np.ndarray
    hand_time: np.ndarray
    hand_position: np.ndarray
    hand_quaternion: np.ndarray
    ball_time: np.ndarray = field(default_factory=_none())
    ball_position: np.ndarray = field(default_factory=_none(3))
    joint_time: np.ndarray = field(default_factory=_none())
    joint_position: np.ndarray = field(default_factory=_none(N_JOINTS))
    joint_velocity: np.ndarray = field(default_factory=_none(N_JOINTS))
    motion_start: float = float("nan")
    motion_stop: float = float("nan")
    hand_opened: float = float("nan")
    frame_id: str = the_world().frame_id
    joint_names: tuple[str, ...] = ()
    skill: str = SKILL

    def __post_init__(self) -> None:
        if self.skill not in THROWN:
            raise ValueError(
                f"demonstration {self.id} is of the skill '{self.skill}': throws are of"
                f" {', '.join(THROWN)}"
            )
        if not self.id or not isinstance(self.id, str):
            raise ValueError(f"id of a demonstration must be a non-empty text, got {self.id!r}")
        if int(self.stamp_ns) != self.stamp_ns or self.stamp_ns < 0:
            raise ValueError(
                f"{self}: stamp_ns = {self.stamp_ns} must be whole nanoseconds, not negative"
            )
        name = f"demonstration {self.id}"
        target = as_place(self.target, f"{name}: its target")
        hand_time, hand_position = check_samples(
            f"{name}, hand", self.hand_time, self.hand_position, least=2
        )
        ball_time, ball_position = check_samples(
            f"{name}, ball", self.ball_time, self.ball_position, least=0
        )
        joint_time, joint_position = check_samples(
            f"{name}, joints", self.joint_time, self.joint_position, least=0, width=N_JOINTS
        )
        _, velocity = check_samples(
            f"{name}, joint velocity",
            self.joint_time,
            self.joint_velocity,
            least=0,
            width=N_JOINTS,
        )
        self._set_arrays(
            target=target,
            hand_time=hand_time,
            hand_position=hand_position,
            hand_quaternion=check_unit_quaternions(
                f"{name}, hand", self.hand_quaternion, len(hand_time)
            ),
            ball_time=ball_time,
            ball_position=ball_position,
            joint_time=joint_time,
            joint_position=joint_position,
            joint_velocity=velocity,
        )
        self._check_ranges(name)
        object.__setattr__(self, "stamp_ns", int(self.stamp_ns))
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        self._check_events(name)

    def __repr__(self) -> str:
        return (
            f"Demonstration({self.id!r}, {len(self.hand_time)} poses, {len(self.ball_time)} of the"
            " ball)"
        )

    def _set_arrays(self, **arrays: np.ndarray) -> None:
        for name, array in arrays.items():
            array = array.copy()
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def _check_ranges(self, name: str) -> None:
        """No memory is asked for, and no sum overflows, on account of a number that no throw has."""
        limits = {
            "hand_time": (LONGEST, "s"), "hand_position": (FARTHEST, "m"), "ball_time": (LONGEST, "s"), "ball_position": (FARTHEST, "m"),
            "joint_time": (LONGEST, "s"), "joint_position": (WIDEST_ANGLE, "rad"), "joint_velocity": (FASTEST_JOINT, "rad/s"),
        }  # fmt: skip
        for field_name, (limit, unit) in limits.items():
            values = np.abs(getattr(self, field_name))
            if values.size and values.max() > limit:
                sample, most = (
                    int(np.unravel_index(values.argmax(), values.shape)[0]),
                    float(values.max()),
                )
                raise ValueError(
                    f"{name}: {field_name} of sample {sample} is {most:.4g} {unit}: no throw goes"
                    f" beyond {limit:.4g} {unit}"
                )

    def _check_events(self, name: str) -> None:
        events = {
            "motion_start": self.motion_start,
            "motion_stop": self.motion_stop,
            "hand_opened": self.hand_opened,
        }
        for event, seconds in events.items():
            if abs(seconds) > LONGEST:
                raise ValueError(
                    f"{name}: {event} = {seconds:.4g} s: give at most {LONGEST:.0f} s after its"
                    " stamp, or nan if unknown"
                )
            object.__setattr__(self, event, float(seconds))
        if self.motion_stop < self.motion_start:
            raise ValueError(
                f"{name}: motion_stop {self.motion_stop} s lies before motion_start"
                f" {self.motion_start} s"
            )
        if self.joint_names and len(self.joint_names) != N_JOINTS:
            raise ValueError(
                f"{name}: {len(self.joint_names)} joint names, need {N_JOINTS} or none"
            )


def fill_demonstration_message(
    demonstration: Demonstration, msg: Any, new: Callable[[str], Any]
) -> Any:
    """Write a demonstration into an empty message object; returns it.

    new: makes an empty message from a type name as "geometry_msgs/msg/PoseStamped".
    """
    return filled(msg, _content(demonstration), new)


def demonstration_message(types: Typestore, demonstration: Demonstration) -> Any:
    """The message of a demonstration as an object of `types`, without ROS."""
    return message(types, DEMONSTRATION_TYPE, _content(demonstration))


def demonstration_from_message(msg: Any) -> Demonstration:
    """The demonstration in a message object, of rclpy or decoded without ROS.

    ValueError for one of another skill, or without what a throw has.
    """
    origin = stamp_ns(msg.header.stamp)
    seen = _parts(msg)
    hand, ball, joints = seen.hand, seen.ball, msg.joints
    return Demonstration(
        id=msg.id,
        stamp_ns=origin,
        target=np.array(_vector(seen.target)),
        hand_time=times_after(hand, origin),
        hand_position=pose_rows(hand)[0],
        hand_quaternion=pose_rows(hand)[1],
        ball_time=times_after(ball, origin),
        ball_position=pose_rows(ball)[0],
        joint_time=times_after(joints, origin),
        joint_position=arm_rows(joints, "position"),
        joint_velocity=arm_rows(joints, "velocity"),
        motion_start=_event(msg.motion_start, origin),
        motion_stop=_event(msg.motion_stop, origin),
        hand_opened=seen.hand_opened,
        frame_id=msg.header.frame_id,
        joint_names=_names(joints[0].name) if len(joints) else (),
        skill=seen.skill,
    )


@dataclass(frozen=True)
class _Parts:
    """Basket's rim in a message, poses of the hand, positions of the ball, and when the hand was
    told to open after the stamp [s].
    """

    target: Any
    hand: Sequence[Any]
    ball: Sequence[Any]
    hand_opened: float
    skill: str = SKILL


def _parts(msg: Any) -> _Parts:
    if msg.skill not in THROWN:
        raise ValueError(
            f"demonstration {msg.id} is of the skill '{msg.skill}', not of"
            f" {' or '.join(map(repr, THROWN))}"
        )
    thrown, aimed_at = THROWN[msg.skill]
    tracks = named(
        f"demonstration {msg.id}: tracks",
        [one.body for one in msg.tracks],
        [one.poses for one in msg.tracks],
    )
    where = named(f"demonstration {msg.id}: situation", msg.situation.bodies, msg.situation.poses)
    for what, role, found in (
        ("no track of the", "hand", tracks),
        ("a situation without the", aimed_at, where),
    ):
        if role not in found:
            raise ValueError(
                f"demonstration {msg.id} has {what} {role}, only of"
                f" {', '.join(sorted(found)) or 'nothing'}"
            )
    opened = [stamp_ns(one.time_from_start) * 1e-9 for one in msg.events if one.name == OPEN]
    told = opened[0] if opened else float("nan")
    return _Parts(
        where[aimed_at].position, tracks["hand"], tracks.get(thrown, ()), told, msg.skill
    )


def named(what: str, names: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    """Values by their names, as messages hold them in two sequences; ValueError, with `what` it
    is, if they do not fit together.
    """
    if len(names) != len(values):
        raise ValueError(
            f"{what}: {len(names)} names and {len(values)} values: give one value for each name"
        )
    if twice := sorted({name for name in names if list(names).count(name) > 1}):
        raise ValueError(f"{what}: {', '.join(twice)} stands there twice")
    return dict(zip(names, values, strict=True))


def skill_of(bag_path: str | os.PathLike) -> str:
    """The skill that a bag's demonstrations are of; throwing, where it has none or cannot be read:
    who learns of it says why.
    """
    try:
        with GraphBag(bag_path) as bag:
            if (
                DEMONSTRATION_TOPIC not in bag.topics
                or bag.topics[DEMONSTRATION_TOPIC].type_name != DEMONSTRATION_TYPE
            ):
                return SKILL
            first = next(iter(bag.messages([DEMONSTRATION_TOPIC])), None)
    except (BagError, OSError):
        return SKILL
    return SKILL if first is None else getattr(first.data, "skill", SKILL)


def read_demonstrations(
    bag_path: str | os.PathLike, topic: str = DEMONSTRATION_TOPIC
) -> list[Demonstration]:
    """Demonstrations of a bag in the order of recording; BagError if it has none or they are not
    valid. topic: of the demonstrations.
    """
    return list(each_demonstration(bag_path, topic))


def each_demonstration(
    bag_path: str | os.PathLike, topic: str = DEMONSTRATION_TOPIC
) -> Iterator[Demonstration]:
    """As `read_demonstrations`, one after the other, with its BagError. bag_path, topic: the same."""
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
                yield demonstration_from_message(item.data)
        except BagError:
            raise
        except (ValueError, AttributeError) as error:
            raise BagError(f"{bag_path}: {topic}: {error}") from error


def _content(one: Demonstration) -> dict[str, Any]:
    """The fields of the message as nested dictionaries and lists."""

    def after(seconds: float) -> int:
        return one.stamp_ns + round(float(seconds) * 1e9)

    def event(seconds: float) -> dict[str, int]:
        return stamp_content(0 if np.isnan(seconds) else after(seconds))

    def items(time: np.ndarray, contents: Iterable[dict]) -> list[dict]:
        return [
            {"header": header_content(after(t), one.frame_id), **content}
            for t, content in zip(time, contents, strict=True)
        ]

    names, states = (
        list(one.joint_names),
        zip(one.joint_position.tolist(), one.joint_velocity.tolist(), strict=True),
    )
    hand = map(pose_content, one.hand_position.tolist(), one.hand_quaternion.tolist())
    ball = (pose_content(point, UNTURNED) for point in one.ball_position.tolist())
    opened = (
        []
        if np.isnan(one.hand_opened)
        else [{"name": OPEN, "time_from_start": duration_content(one.hand_opened)}]
    )
    thrown, aimed_at = THROWN[one.skill]
    return {
        "header": header_content(one.stamp_ns, one.frame_id),
        "skill": one.skill,
        "id": one.id,
        "situation": {
            "bodies": [aimed_at],
            "poses": [pose_content(one.target.tolist(), UNTURNED)],
        },
        "tracks": [
            {"body": "hand", "poses": items(one.hand_time, ({"pose": pose} for pose in hand))},
            {"body": thrown, "poses": items(one.ball_time, ({"pose": pose} for pose in ball))},
        ],
        "joints": items(
            one.joint_time, ({"name": names, "position": q, "velocity": v} for q, v in states)
        ),
        "motion_start": event(one.motion_start),
        "motion_stop": event(one.motion_stop),
        "events": opened,
    }


def duration_content(seconds: float) -> dict[str, int]:
    """Fields of a duration, to the nanosecond. seconds: how long."""
    return stamp_content(round(float(seconds) * 1e9))


def filled(
    msg: Any, content: Mapping[str, Any], new: Callable[[str], Any], within: str = ""
) -> Any:
    """Fields of a demonstration's message written into an empty one of rclpy; `new` makes the
    messages in its sequences by type name.

    msg: the empty one; content: by field; within: name of what it is a part of.
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
    """Stamps of stamped messages as seconds after an origin [ns] (n,). items: the messages."""
    return (
        np.array([stamp_ns(item.header.stamp) - origin for item in items], dtype=np.int64) * 1e-9
    )


def pose_rows(poses: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) and quaternions (n, 4) of PoseStamped messages. poses: the messages."""
    turned = [[*_vector(item.pose.orientation), item.pose.orientation.w] for item in poses]
    return _rows([_vector(item.pose.position) for item in poses], 3), _rows(turned, 4)


def arm_rows(states: Sequence[Any], field_name: str) -> np.ndarray:
    """A field of JointState messages (n, 7), in the order of the arm's joints; ValueError for a
    state of another length.

    field_name: position, velocity or effort.
    """
    return _rows([_of_arm(item.name, getattr(item, field_name)) for item in states], N_JOINTS)


def _vector(item: Any) -> list[float]:
    return [item.x, item.y, item.z]


def _is_arm(names: Sequence[str]) -> bool:
    """Whether these are the names of the arm's joints; another driver has its own, and gives them
    in the arm's order.
    """
    return set(names) == set(joint_names())


def _names(names: Sequence[str]) -> tuple[str, ...]:
    return joint_names() if _is_arm(names) else tuple(names)


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
