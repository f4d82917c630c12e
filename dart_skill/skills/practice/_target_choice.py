"""What to go for in the next trial: a part of a skill, chosen by its name."""

from __future__ import annotations

import numpy as np

from dart_skill.common.situation import Situation
from dart_skill.skills.protocol import Part, Skill, TaskOutcome, part_of


class TargetChoice(Part):
    """Situations that the skill draws, each as good as another.

    Attribute looks: whether a plan needs what the cameras see of the bodies first.

    Parameters
    ----------
    skill
        That is practised.
    candidates
        Number of situations to choose among.
    seed
        Of the random numbers.
    """

    looks = True

    def __init__(self, skill: Skill, candidates: int, seed: int):
        self.skill, self._candidates = skill, candidates
        self._rng = np.random.default_rng([seed, 5])

    def candidates(self) -> list[Situation]:
        """Situations to try next, first the one that teaches most.

        Raises
        ------
        ValueError
            If the skill offers none.
        """
        return [self.skill.draw(self._rng, wide=True) for _ in range(self._candidates)]

    def tell(self, situation: Situation, error: float, outcome: TaskOutcome) -> str:
        """Error in a situation [m], nan if it was not seen, and the outcome.

        Returns
        -------
        str
            What there is to say of the next one.
        """
        return ""

    def give_up(self, situation: Situation) -> None:
        """There was no movement in a situation."""


def target_choice_of(skill: Skill, candidates: int, seed: int) -> TargetChoice:
    """The choice that a skill's settings name; parameters as of `TargetChoice`."""
    return part_of(skill, "targets")(skill, candidates, seed)
