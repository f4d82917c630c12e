"""A skill from a dataset of LeRobot: every episode is a demonstration, cut as those of a recording
are.

The elements are found by their names, wherever they stand: those that `write_lerobot` gives them.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dart_skill.arm import Grip
from dart_skill.common.world import joint_names
from dart_skill.recording import HAND, Demonstration
from dart_skill.recording.lerobot import Episode, LeRobotDataset, changes_at, read_dataset
from dart_skill.session._to_lerobot import OPEN, pose_names, position_name, velocity_name
from dart_skill.skills.observation import THRESHOLDS
from dart_skill.skills.protocol import Skill, load_skill, skill_names, skill_type

BEGIN_NS = 1_000_000_000
"""Stamp of the first frame of every episode: each is a world of its own."""
MOST_NAMES = 8
"""So many elements of a feature are named in an error."""


def skill_of_dataset(dataset: LeRobotDataset) -> Skill:
    """The skill whose words, or name, are the task of all episodes.

    Raises
    ------
    ValueError
        If there is none.
    """
    texts = {episode.task for episode in dataset.episodes}
    known = {
        text: name for name in skill_names() for text in (name, skill_type(name).task) if text
    }
    if len(texts) == 1 and (text := next(iter(texts))) in known:
        return load_skill(known[text])
    told = ", ".join(map(repr, sorted(texts))) or "none"
    raise ValueError(
        f"{dataset.path}: its tasks are {told}: all episodes need the task of one skill,"
        f" {' or '.join(map(repr, known))}"
    )


def open_dataset(path: str | os.PathLike) -> LeRobotDataset:
    """A dataset with at least one episode.

    Raises
    ------
    ValueError
    """
    dataset = read_dataset(path)
    if not dataset.episodes:
        raise ValueError(f"{path}: the dataset has no episodes")
    return dataset


def demonstration_in_episode(
    dataset: LeRobotDataset, episode: Episode, skill: Skill
) -> Demonstration:
    """The demonstration of an episode, as the recorder would have cut it.

    Raises
    ------
    ValueError
        Says what is missing.
    """
    log, stamps = skill.sensor_log(joint_period_ns=1), _stamps(episode).tolist()
    for role in (HAND, *skill.bodies):
        seen, rows = _seen(dataset, episode, role)
        for stamp, row in zip(seen.tolist(), rows, strict=True):
            log.take(role, stamp, row[:3], row[3:])
    for stamp, position, velocity in zip(stamps, *_joints(dataset, episode), strict=True):
        log.add_joints(stamp, position, velocity)
    for instant, opens in _told(dataset, episode):
        log.add_told(BEGIN_NS + round(1e9 * instant), Grip.OPEN if opens else Grip.CLOSE)
    skill.infer_events(log, BEGIN_NS, stamps[-1])
    try:
        cut = skill.record(log, stamps[-1], THRESHOLDS)
    except ValueError as error:
        raise ValueError(f"{dataset.path}: episode {episode.index}: {error}") from error
    return replace(cut, id=id_of_episode(episode))


def id_of_episode(episode: Episode) -> str:
    return f"episode_{episode.index}"


def _stamps(episode: Episode) -> np.ndarray:
    return BEGIN_NS + np.round(1e9 * episode.time).astype(np.int64)


def _some(names: Sequence[str]) -> str:
    return f"{', '.join(names[:MOST_NAMES])}{' ...' if len(names) > MOST_NAMES else ''}"


def _columns(dataset: LeRobotDataset, episode: Episode, names: Sequence[str]) -> np.ndarray:
    """(n, k) of elements by their names; ValueError names the first one that is missing."""
    found = [dataset.column(episode, name) for name in names]
    missing = [name for name, column in zip(names, found, strict=True) if column is None]
    if missing:
        others = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        there = (
            "; ".join(f"{key}: {_some(elements)}" for key, elements in dataset.names.items())
            or "none"
        )
        remedy = "write these names into meta/info.json (docs/recordings.md)"
        raise ValueError(
            "; ".join(
                [
                    f"{dataset.path}: no element is called '{missing[0]}'{others}, only {there}",
                    *dataset.notes,
                    remedy,
                ]
            )
        )
    return np.column_stack([column for column in found if column is not None])


def _seen(dataset: LeRobotDataset, episode: Episode, role: str) -> tuple[np.ndarray, np.ndarray]:
    """Stamps (m,) [ns] and rows (m, 7), position and quaternion, of the frames in which a body was
    seen; without `seen`, of all.
    """
    *pose, seen_name = pose_names(role)
    rows, seen = _columns(dataset, episode, pose), dataset.column(episode, seen_name)
    norms = np.linalg.norm(rows[:, 3:], axis=1)
    if (wrong := np.abs(norms - 1.0) > 1e-2).any():
        where = f"{dataset.path}: episode {episode.index}, frame {wrong.argmax()}"
        raise ValueError(
            f"{where}: the quaternion of the {role} has norm {norms[wrong.argmax()]:.3g}: give x,"
            " y, z, w of norm 1"
        )
    rows[:, 3:] /= norms[:, None]
    kept = np.full(len(rows), True) if seen is None else seen > 0.5
    return _stamps(episode)[kept], rows[kept]


def _joints(dataset: LeRobotDataset, episode: Episode) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 7) [rad] and velocities (n, 7) [rad/s]; these from the positions, where the
    dataset has none.
    """
    position = _columns(dataset, episode, [position_name(joint) for joint in joint_names()])
    if dataset.column(episode, velocity_name(joint_names()[0])) is None:
        return position, (
            np.gradient(position, episode.time, axis=0)
            if len(position) > 1
            else np.zeros_like(position)
        )
    return position, _columns(dataset, episode, [velocity_name(joint) for joint in joint_names()])


def _told(dataset: LeRobotDataset, episode: Episode) -> list[tuple[float, bool]]:
    """When the hand was told to open, or to close [s]; nothing where the dataset does not say it."""
    openness = dataset.column(episode, OPEN)
    return [] if openness is None else changes_at(openness, dataset.fps)
