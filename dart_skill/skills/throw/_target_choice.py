"""Baskets at which a throw teaches most."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dart_skill.common.situation import Situation
from dart_skill.skills.practice import Curriculum, TargetChoice
from dart_skill.skills.protocol import TaskOutcome

if TYPE_CHECKING:
    from dart_skill.skills.throw import Throw


class InformativeTarget(TargetChoice):
    """Baskets of the region, ordered by how much a throw there teaches of where throws are bad."""

    looks = False
    skill: Throw

    def __init__(self, skill: Throw, candidates: int, seed: int):
        super().__init__(skill, candidates, seed)
        self._curriculum = Curriculum()

    def candidates(self) -> list[Situation]:
        baskets = self.skill.region.spread(self._candidates, self._rng)
        return [self.skill.at(baskets[k]) for k in self._curriculum.order(baskets)]

    def tell(self, situation: Situation, error: float, outcome: TaskOutcome) -> str:
        self._curriculum.tell(self.skill.target(situation), error)
        return ""

    def give_up(self, situation: Situation) -> None:
        self._curriculum.give_up(self.skill.target(situation))
