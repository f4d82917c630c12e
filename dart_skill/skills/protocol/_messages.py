"""Demonstrations of any skill as messages, and in bags; without ROS.

The conversions work on any object with the fields of dart_skill_msgs/msg/Demonstration: on those
of rclpy, and on those decoded without it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import numpy as np
from rosbags.typesys.store import Typestore

from dart_skill.arm import Grip
from dart_skill.common.constants import N_JOINTS
from dart_skill.common.world import joint_names, the_world
from dart_skill.recording import (
    DEMONSTRATION_TOPIC,
    DEMONSTRATION_TYPE,
    BagError,
    GraphBag,
    arm_rows,
    duration_content,
    message,
    named,
    pose_rows,
    stamp_ns,
    times_after,
)
from dart_skill.recording.bags import header_content, pose_content, stamp_content
from dart_skill.skills.protocol._demonstration import TaskDemonstration, Told, Track
from dart_skill.skills.protocol._situation import Situation
from dart_skill.skills.protocol._skill import Skill

WORDS = {Grip.OPEN: "open", Grip.CLOSE: "close"}
"""What the fingers are told, as events have it."""


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


def task_demonstration_content(one: TaskDemonstration, skill: Skill) -> dict[str, Any]:
    """Fields of the message; ValueError where the skill finds no movement in it. one: the
    demonstration.
    """
    start, stop = skill.cut(one)
    frame = the_world().frame_id

    def after(seconds: float) -> int:
        return one.stamp_ns + round(float(seconds) * 1e9)

    def items(time: np.ndarray, contents: Iterable[dict]) -> list[dict]:
        return [
            {"header": header_content(after(t), frame), **content}
            for t, content in zip(time, contents, strict=True)
        ]

    def poses(track: Track) -> list[dict]:
        both = zip(track.position.tolist(), track.quaternion.tolist(), strict=True)
        return items(track.time, ({"pose": pose_content(*pose)} for pose in both))

    names, states = (
        list(joint_names()),
        zip(one.joint_position.tolist(), one.joint_velocity.tolist(), strict=True),
    )
    return {
        "header": header_content(one.stamp_ns, frame),
        "skill": skill.name,
        "id": one.id,
        "situation": situation_content(skill.situation(one, start)),
        "tracks": [{"body": role, "poses": poses(track)} for role, track in one.tracks.items()],
        "joints": items(
            one.joint_time, ({"name": names, "position": q, "velocity": v} for q, v in states)
        ),
        "motion_start": stamp_content(after(start)),
        "motion_stop": stamp_content(after(stop)),
        "events": [
            {"name": WORDS[told.grip], "time_from_start": duration_content(told.time)}
            for told in one.told
        ],
    }


def task_demonstration_message(types: Typestore, one: TaskDemonstration, skill: Skill) -> Any:
    """The message of a demonstration as an object of `types`, without ROS. one: the demonstration."""
    return message(types, DEMONSTRATION_TYPE, task_demonstration_content(one, skill))


def task_demonstration_from_message(msg: Any, skill: Skill) -> TaskDemonstration:
    """The demonstration in a message object; ValueError for one of another skill, in another
    frame, or without what it needs.
    """
    what = f"demonstration {msg.id}"
    if not hasattr(msg, "tracks"):
        raise ValueError(f"{what} is of a version that knew of throws only")
    if msg.skill != skill.name:
        raise ValueError(f"{what} is of the skill '{msg.skill}', not of '{skill.name}'")
    if msg.header.frame_id != the_world().frame_id:
        raise ValueError(
            f"{what} is in frame '{msg.header.frame_id}', not '{the_world().frame_id}'"
        )
    origin = stamp_ns(msg.header.stamp)
    tracks = named(
        f"{what}: tracks", [one.body for one in msg.tracks], [one.poses for one in msg.tracks]
    )
    return TaskDemonstration(
        id=msg.id,
        tracks={
            role: Track(times_after(poses, origin), *pose_rows(poses))
            for role, poses in tracks.items()
        },
        joint_time=times_after(msg.joints, origin),
        joint_position=arm_rows(msg.joints, "position").reshape(-1, N_JOINTS),
        joint_velocity=arm_rows(msg.joints, "velocity").reshape(-1, N_JOINTS),
        told=tuple(
            Told(stamp_ns(one.time_from_start) * 1e-9, grip_of(what, one.name))
            for one in msg.events
        ),
        stamp_ns=origin,
    )


def read_task_demonstrations(bag_path: str | os.PathLike, skill: Skill) -> list[TaskDemonstration]:
    """Demonstrations of a skill in a bag, in the order of recording; BagError if it has none, or
    they are not valid.
    """
    with GraphBag(bag_path) as bag:
        if DEMONSTRATION_TOPIC not in bag.topics:
            raise BagError(
                f"{bag_path}: no topic {DEMONSTRATION_TOPIC}, only {sorted(bag.topics)}: was it"
                " recorded?"
            )
        try:
            return [
                task_demonstration_from_message(item.data, skill)
                for item in bag.messages([DEMONSTRATION_TOPIC])
            ]
        except BagError:
            raise
        except (ValueError, AttributeError) as error:
            raise BagError(f"{bag_path}: {DEMONSTRATION_TOPIC}: {error}") from error


def grip_of(what: str, name: str) -> Grip:
    """What an event tells the fingers, by its name; ValueError, with `what` has the event, for
    another one.
    """
    for grip, word in WORDS.items():
        if word == name:
            return grip
    raise ValueError(
        f"{what}: an event is called '{name}': the fingers are told {' or '.join(WORDS.values())}"
    )
