"""Any skill learned from a bag, as the learner node would learn it."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from typing import Any

from dart_skill.recording import check_known, read_demonstrations, unwanted
from dart_skill.skills.learning import AnySkill, configuration, learn_usable
from dart_skill.skills.practice import Practice
from dart_skill.skills.protocol import Skill
from dart_skill.skills.throw import Throw


def learn_skill_from_bag(
    path: str | os.PathLike, skill: Skill, without: Collection[str] = ()
) -> tuple[AnySkill, dict[str, str]]:
    """The skill that a bag teaches, and by the id of each demonstration that was left out, why.

    without: ids that are left out, besides those that were dropped while they were recorded.
    ValueError if too few are left.
    """
    shown = read_demonstrations(path, skill.name)
    out = _left_out(path, shown, without)
    try:
        learned, unfit = learn_usable(skill, [one for one in shown if one.id not in out])
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    return learned, {**out, **unfit}


def learn_throws_from_bag(
    path: str | os.PathLike, skill: Throw, name: str = "default", without: Collection[str] = ()
) -> tuple[Practice, dict[str, str]]:
    """What a bag shows of a skill of throwing, to be learned with a configuration; and by its id
    why a demonstration was left out.

    ValueError for a bag of another skill.
    """
    shown = read_demonstrations(path, skill.name)
    out = _left_out(path, shown, without)
    practice = Practice(
        [one for one in shown if one.id not in out], skill.configured_for(configuration(name))
    )
    return practice, {**out, **practice.kept_out}


def _left_out(
    path: str | os.PathLike, shown: Sequence[Any], without: Collection[str]
) -> dict[str, str]:
    """By its id, why a demonstration is left out."""
    check_known(without, [one.id for one in shown], str(path))
    reasons = unwanted(path, without)
    return {one.id: reasons[one.id] for one in shown if one.id in reasons}
