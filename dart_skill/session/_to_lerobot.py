"""Demonstrations of a recording as a dataset for LeRobot: an episode for each, at one frame rate.

What stands where (docs/bags.md): observation.state has the joints and the pose of the hand,
observation.environment_state the poses of the other bodies, action what the arm was told, or where
the hand went.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from dart_skill.arm import Grip
from dart_skill.common.world import joint_names
from dart_skill.recording import HAND
from dart_skill.recording.imports import RecordingMapping
from dart_skill.recording.lerobot import (
    DatasetCamera,
    DatasetWriter,
    Feature,
    at_frames,
    frame_times,
    held_mean,
    seen_at,
    turned_at_frames,
)
from dart_skill.session._shown_in_recording import CommandStream, Shown, ShownSkill, read_shown
from dart_skill.skills.protocol import Skill

FPS = 100
"""Frames per second by default: as many as the cameras of config/optitrack.yaml make, so that none
is lost.
"""
LOWEST_FPS = 5
"""Least frames per second."""
HIGHEST_FPS = 1000
"""Most frames per second."""
ROBOT_TYPE = "barrett_wam"
STATE = "observation.state"
"""Feature of the hand and the joints."""
ENVIRONMENT = "observation.environment_state"
"""Feature of the bodies."""
ACTION = "action"
"""Feature of what the arm was told."""
OPEN = "hand.open"
POSE = 7
"""Numbers of a pose, before `seen`."""
PICTURES = "observation.images.scene"
ACTIONS = ("commands", "pose")
"""What an action may be: forces and torques that the arm was told, or the pose of the hand in the
next frame. Both have `hand.open`.
"""
HOLD = 0.1
"""A command counts until the next one, for so long at most [s]: an arm that hears nothing stops.
"""


class PictureMaker(Protocol):
    """Makes pictures of `width` and `height` pixels."""

    width: int
    height: int

    def picture(
        self, joint_position: np.ndarray, poses: Mapping[str, tuple[np.ndarray, np.ndarray]]
    ) -> np.ndarray:
        """(height, width, 3), uint8, of joints at (7,) [rad] and bodies at their positions (3,)
        [m] and quaternions (4,), by role.
        """
        ...


@dataclass(frozen=True)
class ExportedDataset:
    """What was written: the skill, episodes and frames, by its id why a demonstration is none, and
    whether there are commands.

    Parameters
    ----------
    ids
        Of the episodes.
    left_out
        Why, by id.
    action
        One of ACTIONS.
    """

    skill: str
    ids: tuple[str, ...]
    n_frames: int
    left_out: Mapping[str, str]
    has_commands: bool
    action: str = "commands"


def position_name(joint: str) -> str:
    return f"{joint}.position [rad]"


def velocity_name(joint: str) -> str:
    return f"{joint}.velocity [rad/s]"


def pose_names(role: str) -> tuple[str, ...]:
    """Elements of a tracked body: position, quaternion, and whether the cameras saw it."""
    return (
        *(f"{role}.{axis} [m]" for axis in "xyz"),
        *(f"{role}.q{axis}" for axis in "xyzw"),
        f"{role}.seen",
    )


def write_lerobot(
    source: str | os.PathLike,
    output: str | os.PathLike,
    mapping: RecordingMapping | None = None,
    *,
    fps: int = FPS,
    camera: Callable[[Skill], PictureMaker] | None = None,
    with_throws: bool = False,
    without: Sequence[str] = (),
    action: str = "commands",
) -> ExportedDataset:
    """Write the demonstrations of a recording as a LeRobotDataset v3.0.

    Parameters
    ----------
    output
        Folder, which must not exist.
    fps
        Frames per second.
    camera
        Makes pictures of a skill, which become a video. Others as those of `learn_from_bag`.
    action
        One of ACTIONS.

    Raises
    ------
    ValueError
        If there is nothing to write.
    """
    if not LOWEST_FPS <= fps <= HIGHEST_FPS:
        raise ValueError(f"fps is {fps}: give {LOWEST_FPS} to {HIGHEST_FPS}")
    if action not in ACTIONS:
        raise ValueError(f"action is '{action}': give {' or '.join(ACTIONS)}")
    shown = read_shown(source, mapping, with_throws=with_throws, without=without)
    if not all(len(one.joint_time) for one in shown.shown):
        raise ValueError(
            f"{source}: no joint states were recorded: a dataset needs them; a mapping may name"
            " them under 'joints'"
        )
    skill, maker = shown.skill, camera(shown.skill) if camera else None
    cameras = () if maker is None else (DatasetCamera(PICTURES, maker.width, maker.height),)
    with DatasetWriter(output, fps, ROBOT_TYPE, features_of(shown, action), cameras) as dataset:
        for one in shown.shown:
            frames = frames_of(one, shown, fps, action)
            pictures = {} if maker is None else {PICTURES: _pictures(maker, shown.skill, frames)}
            dataset.add(skill.task or skill.name, frames, pictures)
    return ExportedDataset(
        skill.name,
        tuple(one.id for one in shown.shown),
        dataset.n_frames,
        shown.left_out,
        bool(shown.commands),
        action,
    )


def features_of(shown: ShownSkill, action: str = "commands") -> tuple[Feature, ...]:
    """The vectors of each frame.

    Parameters
    ----------
    action
        One of ACTIONS.
    """
    joints = joint_names()
    state = (*map(position_name, joints), *map(velocity_name, joints), *pose_names(HAND))
    environment = tuple(name for role in shown.skill.bodies for name in pose_names(role))
    if action == "pose":
        told = pose_names(HAND)[:POSE]
    elif shown.commands:
        hand = (
            *(f"force.{axis} [N]" for axis in "xyz"),
            *(f"torque.{axis} [N m]" for axis in "xyz"),
        )
        told = (*hand, *(f"{joint}.torque [N m]" for joint in joints))
    else:
        told = tuple(map(position_name, joints))
    return tuple(
        Feature(key, names)
        for key, names in ((STATE, state), (ENVIRONMENT, environment), (ACTION, (*told, OPEN)))
        if names
    )


def frames_of(
    one: Shown, shown: ShownSkill, fps: int, action: str = "commands"
) -> dict[str, np.ndarray]:
    """Vectors (n, k) of a demonstration, by feature.

    Parameters
    ----------
    action
        One of ACTIONS.
    """
    frames = frame_times(one.duration, fps)
    position = at_frames(one.joint_time, one.joint_position, frames)
    joints = np.hstack([position, at_frames(one.joint_time, one.joint_velocity, frames)])
    hand = _pose_rows(one, HAND, frames, fps)
    found = {STATE: np.hstack([joints, hand])}
    if shown.skill.bodies:
        found[ENVIRONMENT] = np.hstack(
            [_pose_rows(one, role, frames, fps) for role in shown.skill.bodies]
        )
    if action == "pose":
        told = _next(hand[:, :POSE])
    elif shown.commands:
        rows = [_command_rows(one, stream, frames, fps) for stream in shown.commands]
        told = np.sum(rows, axis=0)
    else:
        told = _next(position)
    found[ACTION] = np.column_stack([told, _openness(one, frames, fps)])
    return found


def _next(rows: np.ndarray) -> np.ndarray:
    """What rows (n, k) are in the next frame; the last one stays."""
    return np.vstack([rows[1:], rows[-1:]])


def _pose_rows(one: Shown, role: str, frames: np.ndarray, fps: int) -> np.ndarray:
    """(n, 8) of a body; where it was not seen as it was last seen, and of one that was never seen
    zeros, unturned.
    """
    if role not in one.tracks:
        return np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0], (len(frames), 1))
    track = one.tracks[role]
    turned = turned_at_frames(track.time, track.quaternion, frames)
    if len(track.time) == 1:  # a body that stands there, which a mapping or another instant tells
        seen = np.ones(len(frames))
    else:
        seen = seen_at(track.time, frames, fps)
    return np.column_stack([at_frames(track.time, track.position, frames), turned, seen])


def _command_rows(one: Shown, stream: CommandStream, frames: np.ndarray, fps: int) -> np.ndarray:
    """(n, 13), means over the frames; nothing where the arm was told nothing."""
    begin = one.stamp_ns - round(1e9 * HOLD)
    kept = (stream.stamp_ns >= begin) & (
        stream.stamp_ns <= one.stamp_ns + round(1e9 * (frames[-1] + 1.0 / fps))
    )
    if not kept.any():
        return np.zeros((len(frames), stream.rows.shape[1]))
    return held_mean(
        1e-9 * (stream.stamp_ns[kept] - one.stamp_ns), stream.rows[kept], frames, fps, HOLD
    )


def _openness(one: Shown, frames: np.ndarray, fps: int) -> np.ndarray:
    """Share (n,) of each frame in which the hand was told to be open; before the first word it is
    what the word changes.
    """
    if not one.events:
        return np.zeros(len(frames))
    words = [float(told.grip == Grip.OPEN) for told in one.events]
    stamps = np.array([min(-1.0, one.events[0].time - 1.0), *(told.time for told in one.events)])
    return held_mean(
        stamps, np.array([[1.0 - words[0]], *([word] for word in words)]), frames, fps
    )[:, 0]


def _pictures(
    maker: PictureMaker, skill: Skill, frames: Mapping[str, np.ndarray]
) -> Iterator[np.ndarray]:
    """Picture of each frame, with the bodies that were seen by then."""
    states, n_joints = frames[STATE], len(joint_names())
    bodies = frames.get(ENVIRONMENT, np.empty((len(states), 0))).reshape(
        len(states), -1, len(pose_names(""))
    )
    seen = np.maximum.accumulate(bodies[:, :, -1] > 0.5, axis=0)
    for k, state in enumerate(states):
        poses = {
            role: (row[:3], row[3:7])
            for role, row, there in zip(skill.bodies, bodies[k], seen[k], strict=True)
            if there
        }
        yield maker.picture(state[:n_joints], poses)
