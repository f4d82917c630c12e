"""A skill from a dataset of LeRobot: every episode is a demonstration, cut as those of a recording
are.

The elements are found by their names, wherever they stand: those that `write_lerobot` gives them.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from dart_skill.common.world import joint_names, the_world
from dart_skill.recording import AS_ASKED, HAND, Demonstration, Event, Track, check_known
from dart_skill.recording.lerobot import Episode, LeRobotDataset, changes_at, read_dataset
from dart_skill.session._from_bag import LearnReport
from dart_skill.session._to_lerobot import OPEN, pose_names, position_name, velocity_name
from dart_skill.skills.learning import (
    LEAST_DEMONSTRATIONS,
    ThrowSettings,
    prepare,
)
from dart_skill.skills.observation import FoundThrow, ThrowLog, judged
from dart_skill.skills.practice import PractisingSkill
from dart_skill.skills.protocol import Skill, load_skill, skill_names, skill_type
from dart_skill.skills.throw import Throw

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


def learn_throws_from_dataset(
    dataset: LeRobotDataset,
    name: str = "default",
    without: Sequence[str] = (),
    method: str = "residual",
) -> tuple[PractisingSkill, LearnReport]:
    """Throws at baskets that the episodes teach, and what became of each; as `learn_from_bag`.

    Raises
    ------
    ValueError
        If too few can be used.
    """
    skill = skill_of_dataset(dataset)
    assert isinstance(skill, Throw)
    chosen = skill.named(name).settings
    check_known(
        without, [id_of_episode(episode) for episode in dataset.episodes], str(dataset.path)
    )
    found = [_found(dataset, episode, skill, chosen, without) for episode in dataset.episodes]
    report = LearnReport(dataset.path.name, True, tuple(found))
    if len(report.learned_from) < LEAST_DEMONSTRATIONS:
        reasons = sorted({throw.reason for throw in found if throw.reason})
        few = (
            f"{len(report.learned_from)} demonstrations among {len(found)} episodes are too few:"
            f" at least {LEAST_DEMONSTRATIONS}"
        )
        raise ValueError("; ".join([f"{dataset.path}: {few} are needed", *reasons]))
    return PractisingSkill(list(report.learned_from), chosen, method), report


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


def throw_in_episode(
    dataset: LeRobotDataset, episode: Episode, skill: Throw
) -> tuple[Demonstration, ThrowLog]:
    """The throw of an episode, cut as the recorder cuts it, and what was seen.

    Raises
    ------
    ValueError
        Says what is missing.
    """
    log = skill.sensor_log(joint_period_ns=1)
    assert isinstance(log, ThrowLog)
    for role in (HAND, *skill.bodies):
        stamps, rows = _seen(dataset, episode, role)
        for stamp, row in zip(stamps.tolist(), rows, strict=True):
            log.take(role, stamp, row[:3], row[3:])
    stamps = _stamps(episode)
    for stamp, position, velocity in zip(stamps.tolist(), *_joints(dataset, episode), strict=True):
        log.add_joints(stamp, position, velocity)
    opened = [instant for instant, on in _told(dataset, episode) if on]
    if opened:
        log.add_opening(BEGIN_NS + round(1e9 * opened[0]))
    elif release := log.release_between(BEGIN_NS, int(stamps[-1]), skill.game.projectile):
        log.add_release(BEGIN_NS + round(1e9 * release.time))
    return log.cut(id_of_episode(episode), int(stamps[-1])), log


def demonstration_in_episode(
    dataset: LeRobotDataset, episode: Episode, skill: Skill
) -> Demonstration:
    """The demonstration of an episode.

    Raises
    ------
    ValueError
        Says what is missing.
    """
    if isinstance(skill, Throw):
        return throw_in_episode(dataset, episode, skill)[0]
    return movement_in_episode(dataset, episode, skill)


def movement_in_episode(dataset: LeRobotDataset, episode: Episode, skill: Skill) -> Demonstration:
    """The demonstration of an episode.

    Raises
    ------
    ValueError
        Says what is missing.
    """
    tracks = {}
    for role in (HAND, *skill.bodies):
        stamps, rows = _seen(dataset, episode, role)
        if not len(stamps):
            raise ValueError(f"{dataset.path}: episode {episode.index}: the {role} was never seen")
        tracks[role] = Track(1e-9 * (stamps - BEGIN_NS), rows[:, :3], rows[:, 3:])
    told = tuple(
        Event("open" if on else "close", instant) for instant, on in _told(dataset, episode)
    )
    position, velocity = _joints(dataset, episode)
    return Demonstration(
        id=id_of_episode(episode),
        tracks=tracks,
        stamp_ns=BEGIN_NS,
        skill=skill.name,
        joint_time=episode.time,
        joint_position=position,
        joint_velocity=velocity,
        events=told,
    )


def _found(
    dataset: LeRobotDataset,
    episode: Episode,
    skill: Throw,
    chosen: ThrowSettings,
    without: Collection[str],
) -> FoundThrow:
    """The throw of an episode, where the ball came down, and the reason why it is not learned
    from, if there is one.
    """
    try:
        one, log = throw_in_episode(dataset, episode, skill)
    except ValueError as error:
        return FoundThrow(BEGIN_NS, True, reason=f"{id_of_episode(episode)}: {error}")
    opened = log.left_ns if log.opened_ns is None else log.opened_ns
    assert opened is not None  # as it was cut
    outcome, _ = judged(
        log, one.target, the_world().basket_radius, opened, int(_stamps(episode)[-1])
    )
    throw = FoundThrow(opened, True, one, outcome)
    if one.id in without:
        return replace(throw, reason=AS_ASKED)
    try:
        prepare(one, chosen)
    except ValueError as error:
        return replace(throw, reason=str(error))
    return throw


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
