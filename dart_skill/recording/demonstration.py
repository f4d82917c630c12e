"""A demonstration: one guided throw as the sensors saw it, and its way to and from messages and bags.

The conversions work on any object with the fields of dart_skill_msgs/msg/Demonstration: on those of rclpy as
well as on those that are decoded without ROS.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rosbags.typesys.store import Typestore

from dart_skill.checks import FARTHEST, as_place, check_samples, check_unit_quaternions
from dart_skill.constants import N_JOINTS
from dart_skill.recording.bags import BagError, BagReader, header_content, message, pose_content, stamp_content, vector_content
from dart_skill.world import joint_names, joint_order, the_world

DEMONSTRATION_TYPE = "dart_skill_msgs/msg/Demonstration"
DEMONSTRATION_TOPIC = "/demonstrations"
_ITEMS = {"hand": "geometry_msgs/msg/PoseStamped", "ball": "geometry_msgs/msg/PointStamped", "joints": "sensor_msgs/msg/JointState"}
LONGEST = 120.0
"""No throw takes longer, with all that is recorded before and after it [s]."""
WIDEST_ANGLE, FASTEST_JOINT = 2.0 * np.pi, 100.0
"""No joint of an arm is farther from its zero [rad], or faster [rad/s]: beyond it are degrees, or errors."""


def _none(width: int | None = None) -> Callable[[], np.ndarray]:
    return lambda: np.empty(0 if width is None else (0, width))


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One throw. All of it is in frame_id; times are seconds after stamp_ns, lengths metres, quaternions x, y, z, w.

    id: unique in a recording.
    stamp_ns: the origin of all times.
    target: (3,), centre of the basket's rim.
    hand_time, hand_position, hand_quaternion: (n,), (n, 3), (n, 4), poses of the hand, n >= 2.
    ball_time, ball_position: (m,), (m, 3), from the grip to the landing; may be empty.
    joint_time, joint_position, joint_velocity: (k,), (k, 7) [rad], (k, 7) [rad/s], of the arm; may be empty.
    motion_start, motion_stop: when the speed crossed the thresholds; nan if unknown.
    hand_opened: when the hand was told to open; nan if unknown.
    joint_names: as the driver calls them; may be empty.

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

    def __post_init__(self) -> None:
        if not self.id or not isinstance(self.id, str):
            raise ValueError(f"id of a demonstration must be a non-empty text, got {self.id!r}")
        if int(self.stamp_ns) != self.stamp_ns or self.stamp_ns < 0:
            raise ValueError(f"{self}: stamp_ns = {self.stamp_ns} must be whole nanoseconds, not negative")
        name = f"demonstration {self.id}"
        target = as_place(self.target, f"{name}: its target")
        hand_time, hand_position = check_samples(f"{name}, hand", self.hand_time, self.hand_position, least=2)
        ball_time, ball_position = check_samples(f"{name}, ball", self.ball_time, self.ball_position, least=0)
        joint_time, joint_position = check_samples(f"{name}, joints", self.joint_time, self.joint_position, least=0, width=N_JOINTS)
        _, velocity = check_samples(f"{name}, joint velocity", self.joint_time, self.joint_velocity, least=0, width=N_JOINTS)
        self._set_arrays(
            target=target,
            hand_time=hand_time,
            hand_position=hand_position,
            hand_quaternion=check_unit_quaternions(f"{name}, hand", self.hand_quaternion, len(hand_time)),
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
        return f"Demonstration({self.id!r}, {len(self.hand_time)} poses, {len(self.ball_time)} of the ball)"

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
                sample, most = int(np.unravel_index(values.argmax(), values.shape)[0]), float(values.max())
                raise ValueError(f"{name}: {field_name} of sample {sample} is {most:.4g} {unit}: no throw goes beyond {limit:.4g} {unit}")

    def _check_events(self, name: str) -> None:
        events = {"motion_start": self.motion_start, "motion_stop": self.motion_stop, "hand_opened": self.hand_opened}
        for event, seconds in events.items():
            if abs(seconds) > LONGEST:
                raise ValueError(f"{name}: {event} = {seconds:.4g} s: give at most {LONGEST:.0f} s after its stamp, or nan if unknown")
            object.__setattr__(self, event, float(seconds))
        if self.motion_stop < self.motion_start:
            raise ValueError(f"{name}: motion_stop {self.motion_stop} s lies before motion_start {self.motion_start} s")
        if self.joint_names and len(self.joint_names) != N_JOINTS:
            raise ValueError(f"{name}: {len(self.joint_names)} joint names, need {N_JOINTS} or none")


def fill_demonstration_message(demonstration: Demonstration, msg: Any, new: Callable[[str], Any]) -> Any:
    """Write a demonstration into an empty message object; returns it.

    new: makes an empty message from a type name as "geometry_msgs/msg/PoseStamped".
    """
    return _filled(msg, _content(demonstration), new)


def demonstration_message(types: Typestore, demonstration: Demonstration) -> Any:
    """The message of a demonstration as an object of `types`, without ROS."""
    return message(types, DEMONSTRATION_TYPE, _content(demonstration))


def demonstration_from_message(msg: Any) -> Demonstration:
    """The demonstration in a message object, of rclpy or decoded without ROS."""
    origin = stamp_ns(msg.header.stamp)
    hand, ball, joints = msg.hand, msg.ball, msg.joints
    return Demonstration(
        id=msg.id,
        stamp_ns=origin,
        target=np.array(_vector(msg.target)),
        hand_time=_times(hand, origin),
        hand_position=_rows([_vector(item.pose.position) for item in hand], 3),
        hand_quaternion=_rows([[*_vector(item.pose.orientation), item.pose.orientation.w] for item in hand], 4),
        ball_time=_times(ball, origin),
        ball_position=_rows([_vector(item.point) for item in ball], 3),
        joint_time=_times(joints, origin),
        joint_position=_rows([_of_arm(item.name, item.position) for item in joints], N_JOINTS),
        joint_velocity=_rows([_of_arm(item.name, item.velocity) for item in joints], N_JOINTS),
        motion_start=_event(msg.motion_start, origin),
        motion_stop=_event(msg.motion_stop, origin),
        hand_opened=_event(msg.hand_opened, origin),
        frame_id=msg.header.frame_id,
        joint_names=_names(joints[0].name) if len(joints) else (),
    )


def read_demonstrations(bag_path: str | os.PathLike, topic: str = DEMONSTRATION_TOPIC) -> list[Demonstration]:
    """Demonstrations of a bag in the order of recording; BagError if it has none or they are not valid."""
    with BagReader(bag_path) as bag:
        if topic not in bag.topics:
            raise BagError(f"{bag_path}: no topic {topic}, only {sorted(bag.topics)}: was it recorded?")
        if bag.topics[topic].type_name != DEMONSTRATION_TYPE:
            raise BagError(f"{bag_path}: {topic} has type {bag.topics[topic].type_name}, not {DEMONSTRATION_TYPE}")
        try:
            return [demonstration_from_message(item.data) for item in bag.messages([topic])]
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
        return [{"header": header_content(after(t), one.frame_id), **content} for t, content in zip(time, contents, strict=True)]

    names, states = list(one.joint_names), zip(one.joint_position.tolist(), one.joint_velocity.tolist(), strict=True)
    poses = map(pose_content, one.hand_position.tolist(), one.hand_quaternion.tolist())
    return {
        "id": one.id,
        "header": header_content(one.stamp_ns, one.frame_id),
        "target": vector_content(one.target.tolist()),
        "motion_start": event(one.motion_start),
        "motion_stop": event(one.motion_stop),
        "hand_opened": event(one.hand_opened),
        "hand": items(one.hand_time, ({"pose": pose} for pose in poses)),
        "ball": items(one.ball_time, ({"point": vector_content(point)} for point in one.ball_position.tolist())),
        "joints": items(one.joint_time, ({"name": names, "position": q, "velocity": v} for q, v in states)),
    }


def _filled(msg: Any, content: dict[str, Any], new: Callable[[str], Any]) -> Any:
    for name, value in content.items():
        if isinstance(value, dict):
            _filled(getattr(msg, name), value, new)
        elif name in _ITEMS:
            setattr(msg, name, [_filled(new(_ITEMS[name]), item, new) for item in value])
        else:
            setattr(msg, name, value)
    return msg


def stamp_ns(stamp: Any) -> int:
    """A message's stamp as an integer [ns]."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _event(stamp: Any, origin: int) -> float:
    """Seconds after the origin; nan for a zero stamp."""
    nanoseconds = stamp_ns(stamp)
    return (nanoseconds - origin) * 1e-9 if nanoseconds else float("nan")


def _times(items: Iterable[Any], origin: int) -> np.ndarray:
    return np.array([stamp_ns(item.header.stamp) - origin for item in items], dtype=np.int64) * 1e-9


def _vector(item: Any) -> list[float]:
    return [item.x, item.y, item.z]


def _is_arm(names: Sequence[str]) -> bool:
    """Whether these are the names of the arm's joints; another driver has its own, and gives them in the arm's order."""
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
