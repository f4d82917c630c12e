"""What the experiments of skills of poses, `place` and `reach`, have in common: the skill, the
arm, and how often a person shows it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from dart_skill.recording import Demonstration
from dart_skill.session import SkillTrial
from dart_skill.skills.place import Place
from dart_skill.skills.reach import Reach

ATTEMPTS = 3
"""Largest number of movements that a person shows for each that succeeds."""

PoseSkill = TypeVar("PoseSkill", Place, Reach)


def configured(skill: type[PoseSkill], representation: str = "") -> PoseSkill:
    """A skill with the settings of its file.

    Parameters
    ----------
    skill
        Its class.
    representation
        Name, in place of the file's; default: that of the file.
    """
    made = skill.configured()
    if not representation:
        return made
    return made.with_settings(replace(made.settings, representation=representation))


def arm_of(arm: str, seed: int) -> str:
    """The arm of one seed: of the fleet, by name; of "fleet" another one for every seed.

    Parameters
    ----------
    arm
        Its name, or "fleet".
    seed
        Of the session.
    """
    return f"fleet:{seed}" if arm == "fleet" else arm


def shown(show: Callable[[], SkillTrial], demonstrations: int, what: str) -> list[Demonstration]:
    """Demonstrations that succeeded; one that fails is shown again.

    Parameters
    ----------
    show
        A person shows one, of a new situation.
    demonstrations
        How many must succeed.
    what
        The person did with how many, in words, "reached {} cups".

    Raises
    ------
    ValueError
        Where most fail.
    """
    kept: list[Demonstration] = []
    for _ in range(ATTEMPTS * demonstrations):
        trial = show()
        kept += [trial.seen] if trial.outcome.success else []
        if len(kept) == demonstrations:
            return kept
    raise ValueError(
        f"the person {what.format(f'only {len(kept)} of {ATTEMPTS * demonstrations}')}; the last:"
        f" {trial.outcome.reason}"
    )
