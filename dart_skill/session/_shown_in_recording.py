"""What was shown of a skill in a recording, with all streams of it: from when the movement began
to when its end was seen.

Throws at baskets are found and cut as `dart-skill learn` does. Of other skills it is what their
recorder published on /demonstrations.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from dart_skill.common.arm_choice import joint_count
from dart_skill.common.constants import NS_PER_S
from dart_skill.common.world import THROW, the_world
from dart_skill.recording import (
    HAND,
    Demonstration,
    Event,
    GraphBag,
    Track,
    ids_named,
    read_demonstrations,
    skill_of,
    stamp_ns,
    unwanted,
)
from dart_skill.recording.imports import RecordingMapping, ThrowRecording
from dart_skill.session._from_bag import explained, throw_settings, throws_in_bag
from dart_skill.skills.protocol import Skill, load_skill

AROUND_NS = 50_000_000
"""Samples of so long before and after a movement help to tell where a body was at its ends; worlds
are farther apart.
"""
COMMANDS = ("/wam/command", "/wam/teacher_wrench")
"""Who moves the arm: its controller, and a guiding person. Where both do, the arm feels the sum.
"""
COMMAND_TYPE = "dart_skill_msgs/msg/WamCommand"


@dataclass(frozen=True, eq=False)
class Shown:
    """A movement that was shown, with what was seen around it; times are seconds after stamp_ns.

    * id, stamp_ns [ns].

    Parameters
    ----------
    duration : [s]
    tracks
        Of the hand and of the bodies, by role.
    joint_time : (m,) [s]
    joint_position : (m, 7) [rad]
    joint_velocity : (m, 7) [rad/s]
        m = 0 if they were not recorded.
    events
        What the fingers were told.
    """

    id: str
    stamp_ns: int
    duration: float
    tracks: Mapping[str, Track]
    joint_time: np.ndarray
    joint_position: np.ndarray
    joint_velocity: np.ndarray
    events: tuple[Event, ...] = ()


@dataclass(frozen=True, eq=False)
class CommandStream:
    """Commands of one who moves the arm: stamps (m,) [ns], and rows (m, 13): force [N], torque [N
    m], of the hand, joint torques [N m].
    """

    stamp_ns: np.ndarray
    rows: np.ndarray


@dataclass(frozen=True, eq=False)
class ShownSkill:
    """What a recording shows of a skill.

    Parameters
    ----------
    skill
    shown
        In the order of time.
    left_out
        By the id of a demonstration, or the time of a throw, why it is not among them.
    commands
        Of each who moves the arm; empty if they were not recorded.
    """

    skill: Skill
    shown: tuple[Shown, ...]
    left_out: Mapping[str, str]
    commands: tuple[CommandStream, ...] = field(default=(), repr=False)


def read_shown(
    path: str | os.PathLike,
    mapping: RecordingMapping | None = None,
    *,
    with_throws: bool = False,
    without: Sequence[str] = (),
) -> ShownSkill:
    """What a recording shows, without what was dropped; arguments as those of `learn_from_bag`.

    Raises
    ------
    ValueError
        If it shows nothing.
    """
    name = THROW if mapping else skill_of(path)
    skill = load_skill(name)
    if skill.cuts_itself:
        shown, left_out = _throws_at_baskets(path, mapping, with_throws, without)
    else:
        if with_throws:
            raise ValueError(
                f"--with-throws is for throws at baskets: {path} is of the skill '{name}'"
            )
        shown, left_out = _published(path, skill, without)
    if not shown:
        reasons = "; ".join(
            f"{why} ({count})" for why, count in Counter(left_out.values()).items()
        )
        raise ValueError(
            f"{path} shows nothing of the skill '{name}':"
            f" {explained(reasons) if reasons else 'was it recorded?'}"
        )
    return ShownSkill(skill, tuple(shown), left_out, () if mapping else _commands(path))


def _throws_at_baskets(
    path: str | os.PathLike,
    mapping: RecordingMapping | None,
    with_throws: bool,
    without: Sequence[str],
) -> tuple[list[Shown], dict[str, str]]:
    report, recording = throws_in_bag(
        path, mapping, throw_settings(), with_throws=with_throws, without=without
    )
    assert recording is not None  # as throws were looked for in it
    left_out = {}
    for throw in report.throws:
        if throw.reason:
            left_out[
                throw.demonstration.id
                if throw.demonstration
                else f"{throw.stamp_ns / NS_PER_S:.3f} s"
            ] = throw.reason
    return [_with_streams(one, recording) for one in report.learned_from], left_out


def _published(
    path: str | os.PathLike, skill: Skill, without: Sequence[str]
) -> tuple[list[Shown], dict[str, str]]:
    found = read_demonstrations(path, skill.name)
    without = ids_named(without, [one.id for one in found], str(path))
    reasons = unwanted(path, without)
    kept = [one for one in found if one.id not in reasons]
    return [_as_published(one) for one in kept], {
        one.id: reasons[one.id] for one in found if one.id in reasons
    }


def _with_streams(one: Demonstration, recording: ThrowRecording) -> Shown:
    """A throw with all that was recorded until the ball was down, the hand after its motion, too."""
    duration = _end(one)
    since, until = one.stamp_ns - AROUND_NS, one.stamp_ns + round(1e9 * duration) + AROUND_NS

    def within(stamps: np.ndarray) -> np.ndarray:
        return (stamps >= since) & (stamps <= until)

    tracks = {}
    for role, stream in recording.bodies.items():
        kept = stream.take(within(stream.stamp_ns))
        if len(kept):
            tracks[role] = Track(
                1e-9 * (kept.stamp_ns - one.stamp_ns), kept.position, kept.quaternion
            )
    if "basket" not in tracks:  # hidden all the time: where it was seen at other times
        tracks["basket"] = _resting(one.target)
    time, position, velocity = one.joint_time, one.joint_position, one.joint_velocity
    if recording.joints is not None:
        mask = within(recording.joints.stamp_ns)
        time = 1e-9 * (recording.joints.stamp_ns[mask] - one.stamp_ns)
        position, velocity = recording.joints.position[mask], recording.joints.velocity[mask]
    return Shown(one.id, one.stamp_ns, duration, tracks, time, position, velocity, one.events)


def _as_published(one: Demonstration) -> Shown:
    """A movement with what was published of it; what has no track rests where its situation has
    it.
    """
    resting = {
        role: _resting(pose.position)
        for role, pose in one.situation.poses.items()
        if role not in one.tracks
    }
    tracks = {role: track for role, track in one.tracks.items() if len(track)}
    joints = (one.joint_time, one.joint_position, one.joint_velocity)
    return Shown(one.id, one.stamp_ns, _end(one), {**resting, **tracks}, *joints, one.events)


def _end(one: Demonstration) -> float:
    """When the last of the hand and of what it moves was seen [s]."""
    return float(max(track.time[-1] for track in (one.tracks[HAND], one.moved) if len(track)))


def _resting(position: np.ndarray) -> Track:
    return Track(np.zeros(1), position[None], np.array([[0.0, 0.0, 0.0, 1.0]]))


def _commands(path: str | os.PathLike) -> tuple[CommandStream, ...]:
    """Commands of all who told the arm something; ValueError for a wrench in other axes than those
    of the world.
    """
    found: dict[str, list[tuple[int, list[float]]]] = {}
    nothing = [0.0] * joint_count()
    with GraphBag(path) as bag:
        topics = [
            name
            for name in COMMANDS
            if name in bag.topics
            and bag.topics[name].type_name == COMMAND_TYPE
            and bag.topics[name].count
        ]
        for item in bag.messages(topics) if topics else ():
            header, force, torque = (
                item.data.header,
                item.data.wrench.force,
                item.data.wrench.torque,
            )
            if header.frame_id not in ("", the_world().frame_id):
                raise ValueError(
                    f"{path}: {item.topic}: a wrench is in the axes of '{header.frame_id}', not"
                    f" '{the_world().frame_id}'"
                )
            row = [
                force.x,
                force.y,
                force.z,
                torque.x,
                torque.y,
                torque.z,
                *(item.data.joint_torque if len(item.data.joint_torque) else nothing),
            ]
            found.setdefault(item.topic, []).append((stamp_ns(header.stamp), row))
    streams = []
    for rows in found.values():
        rows.sort(key=lambda one: one[0])
        streams.append(
            CommandStream(
                np.array([one[0] for one in rows], dtype=np.int64),
                np.array([one[1] for one in rows], dtype=float),
            )
        )
    return tuple(streams)
