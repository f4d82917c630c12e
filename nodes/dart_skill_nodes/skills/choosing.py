"""In which situations the coach lets a skill be tried: of a throw, and of every other skill."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from dart_skill_msgs.msg import Outcome, Situation

from dart_skill.common.regions import Region
from dart_skill.skills.practice import Curriculum
from dart_skill.skills.protocol import Skill
from dart_skill_nodes.comms import conversions

if TYPE_CHECKING:
    from dart_skill.skills.darts import Darts


class Choosing(Protocol):
    """One skill, as the coach needs it. looks: whether a plan needs what the cameras see of the
    bodies first.
    """

    looks: bool

    def check(self, situation: Situation) -> None:
        """ValueError for a situation that is none."""

    def candidates(self) -> list[Situation]:
        """Situations to try next, first the one that teaches most; ValueError if the skill offers
        none.
        """

    def tell(self, situation: Situation, error: float, outcome: Outcome) -> str:
        """What was wrong in a situation [m], nan if nobody saw it, and what became of it; what
        there is to say of it.
        """

    def give_up(self, situation: Situation) -> None:
        """There was no movement in a situation."""


class ThrowChoosing:
    """Baskets where throws are worst."""

    looks = False

    def __init__(self, region: Region, candidates: int, seed: int):
        self._region, self._candidates = region, candidates
        self._rng, self._curriculum = np.random.default_rng([seed, 5]), Curriculum()

    def check(self, situation: Situation) -> None:
        conversions.target_of(situation)

    def candidates(self) -> list[Situation]:
        baskets = self._region.spread(self._candidates, self._rng)
        return [conversions.at_place(baskets[k]) for k in self._curriculum.order(baskets)]

    def tell(self, situation: Situation, error: float, outcome: Outcome) -> str:
        self._curriculum.tell(conversions.target_of(situation), error)
        return ""

    def give_up(self, situation: Situation) -> None:
        self._curriculum.give_up(conversions.target_of(situation))


class DartsChoosing:
    """What to aim at, by the spread of the own darts (chapter 6)."""

    looks = False

    def __init__(self, skill: Darts):
        self._skill, self._agent = skill, skill.agent()

    def check(self, situation: Situation) -> None:
        conversions.aimed(situation, self._skill)

    def candidates(self) -> list[Situation]:
        return [conversions.situation_msg(self._skill.aimed(self._agent.aim))]

    def tell(self, situation: Situation, error: float, outcome: Outcome) -> str:
        landing = conversions.seen_at(outcome, conversions.LANDING)
        if not outcome.seen:
            return "nobody saw where the dart went"
        points, where = self._skill.points(landing)
        said, before = f"{where}, {points} points", self._agent.bed
        if self._is_mine(
            situation
        ):  # a dart at what somebody else aimed at says nothing of how the own aims were met
            self._agent.tell(self._skill.face.on_board(landing))
        return f"{said}; {self._said_of_the_aim(before)}"

    def give_up(self, situation: Situation) -> None:
        if self._is_mine(situation):
            self._agent.cannot()

    def _is_mine(self, situation: Situation) -> bool:
        return (
            conversions.situation_msg(conversions.aimed(situation, self._skill))
            == self.candidates()[0]
        )

    def _said_of_the_aim(self, before: str) -> str:
        """Which aim is best now, and whether that is another one."""
        agent = self._agent
        if agent.spread is None:
            return f"the aim is {agent.bed} until the spread is known"
        across, up = np.sqrt(np.diag(agent.spread.covariance))
        known = (
            f"{agent.expected_score:.1f} points expected with a spread of {across:.0f} by"
            f" {up:.0f} mm"
        )
        return (
            f"the aim is {agent.bed}, {known}"
            if agent.bed == before
            else f"the best aim jumps from {before} to {agent.bed}: {known}"
        )


class TaskChoosing:
    """Situations that the skill draws."""

    looks = True

    def __init__(self, skill: Skill, candidates: int, seed: int):
        self._skill, self._candidates, self._rng = (
            skill,
            candidates,
            np.random.default_rng([seed, 5]),
        )

    def check(self, situation: Situation) -> None:
        conversions.situation(situation)

    def candidates(self) -> list[Situation]:
        return [
            conversions.situation_msg(self._skill.draw(self._rng, wide=True))
            for _ in range(self._candidates)
        ]

    def tell(self, situation: Situation, error: float, outcome: Outcome) -> str:
        """Every situation is as good as another."""
        return ""

    def give_up(self, situation: Situation) -> None:
        """Every situation is as good as another."""
