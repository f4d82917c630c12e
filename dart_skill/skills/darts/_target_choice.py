"""The best aim for the spread of the own darts (chapter 6)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dart_skill.common.situation import Situation
from dart_skill.skills.practice import TargetChoice
from dart_skill.skills.protocol import TaskOutcome
from dart_skill.skills.throw import LANDING

if TYPE_CHECKING:
    from dart_skill.skills.darts import Darts


class BestAim(TargetChoice):
    """The aim that `Darts.agent` finds best."""

    looks = False
    skill: Darts

    def __init__(self, skill: Darts, candidates: int, seed: int):
        super().__init__(skill, candidates, seed)
        self._agent = skill.agent()

    def candidates(self) -> list[Situation]:
        return [self.skill.aimed(self._agent.aim)]

    def tell(self, situation: Situation, error: float, outcome: TaskOutcome) -> str:
        if not np.isfinite(outcome.error):
            return "the cameras did not see where the dart went"
        landing, _ = outcome.observed[LANDING]
        points, where = self.skill.points(landing)
        said, before = f"{where}, {points} points", self._agent.bed
        # a dart at what was asked for by others says nothing of how the own aims were met
        if self._is_own(situation):
            self._agent.tell(self.skill.face.on_board(landing))
        return f"{said}; {self._said_of_the_aim(before)}"

    def give_up(self, situation: Situation) -> None:
        if self._is_own(situation):
            self._agent.cannot()

    def _is_own(self, situation: Situation) -> bool:
        own = self.skill.about(self.candidates()[0])
        return self.skill.about(situation).numbers == own.numbers

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
        if agent.bed == before:
            return f"the aim is {agent.bed}, {known}"
        return f"the best aim jumps from {before} to {agent.bed}: {known}"
