"""Any skill learned from demonstrations in a bag or a dataset, as the learner node learns it."""

from __future__ import annotations

import os
from collections.abc import Collection

from dart_skill.recording import (
    AS_ASKED,
    Demonstration,
    ids_named,
    read_demonstrations,
    unwanted,
)
from dart_skill.recording.lerobot import LeRobotDataset
from dart_skill.session._from_lerobot import demonstration_in_episode, id_of_episode
from dart_skill.skills.practice import Learner, Lesson
from dart_skill.skills.protocol import Skill


def learn_skill(
    source: str | os.PathLike | LeRobotDataset,
    skill: Skill,
    configuration: str = "",
    without: Collection[str] = (),
) -> tuple[Learner, Lesson]:
    """What the demonstrations of a bag, or the episodes of a dataset, teach.

    Parameters
    ----------
    configuration
        Name, of a skill that has such; empty: the usual one.
    without
        Ids that are left out, or numbers from 1 in the order of the source, besides those that
        were dropped while they were recorded.

    Raises
    ------
    ValueError
        If too few are left.
    """
    if isinstance(source, LeRobotDataset):
        where, (shown, left_out) = str(source.path), _in_dataset(source, skill, without)
    else:
        where, (shown, left_out) = str(source), _in_bag(source, skill, without)
    learner = Learner(skill)
    try:
        lesson = learner.learn(shown, configuration)
    except ValueError as error:
        raise ValueError("; ".join([f"{where}: {error}", *left_out.values()])) from error
    return learner, lesson.without(left_out)


Found = tuple[list[Demonstration], dict[str, str]]
"""Demonstrations, and by the id of each that was left out, why."""


def _in_bag(path: str | os.PathLike, skill: Skill, without: Collection[str]) -> Found:
    shown = read_demonstrations(path, skill.name)
    without = ids_named(without, [one.id for one in shown], str(path))
    reasons = unwanted(path, without)
    left_out = {one.id: reasons[one.id] for one in shown if one.id in reasons}
    return [one for one in shown if one.id not in left_out], left_out


def _in_dataset(dataset: LeRobotDataset, skill: Skill, without: Collection[str]) -> Found:
    without = ids_named(
        without, [id_of_episode(one) for one in dataset.episodes], str(dataset.path)
    )
    shown, left_out = [], {}
    for episode in dataset.episodes:
        name = id_of_episode(episode)
        if name in without:
            left_out[name] = AS_ASKED
            continue
        try:
            shown.append(demonstration_in_episode(dataset, episode, skill))
        except ValueError as error:
            left_out[name] = str(error)
    return shown, left_out
