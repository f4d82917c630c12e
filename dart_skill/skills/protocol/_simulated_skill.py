"""How a skill is shown and tried in simulation, and how its world looks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.arm import ArmDescription
from dart_skill.common.situation import Pose, Situation
from dart_skill.skills.protocol._skill_base import SkillBase
from dart_skill.skills.protocol._words import Solid

if TYPE_CHECKING:
    from dart_skill.darts import ModelBasedAgent


class SimulatedSkill(SkillBase):
    """The world of a skill, and the situations in it."""

    @property
    def shown_by(self) -> str:
        """How a simulated person shows it: "carry" the first body to its goal, "stir" with it there,
        "follow" the body that moves, or "swing". Default: "follow" if it reacts, else "carry".
        """
        return "follow" if self.reacts else "carry"

    @property
    def person_settings(self) -> Mapping[str, Any]:
        """What a simulated person who carries its first body takes from its settings, by name: of
        one who stirs, fields of `simulation.Stirring`. Default: nothing.
        """
        return {}

    @property
    def world_settings(self) -> Mapping[str, Any]:
        """What its simulated world takes from its settings, by name: fields of `simulation.Bench`.
        Default: nothing.
        """
        return {}

    def loaded(self, description: ArmDescription) -> ArmDescription:
        """The arm with what its hand may hold, as the skill's user knows it
        (`arm.with_box`). Default: as it is described.
        """
        return description

    def solids(self, role: str) -> Sequence[Solid]:
        """How a body looks, for viewers. Default: nothing is known, so a small box stands for it."""
        return ()

    def surroundings(self) -> Sequence[Solid]:
        """What stands around in the world, where nothing tracks it, for viewers. Default: nothing."""
        return ()

    def goal(self, situation: Situation) -> Pose:
        """Where a simulated person who shows the skill carries its first body, in the world.

        Raises
        ------
        ValueError
            If it cannot be shown.
        """
        raise ValueError(
            f"the skill '{self.name}' cannot be shown in simulation: write"
            f" {type(self).__name__}.goal"
        )

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A situation in which the skill is shown in simulation, or, wide, tried: where the bodies
        that can be put somewhere are put.

        Raises
        ------
        ValueError
            If the skill has none to offer.
        """
        raise ValueError(
            f"the skill '{self.name}' offers no situations: write {type(self).__name__}.draw, or"
            " name one"
        )

    def draws(self, rng: np.random.Generator, n: int) -> list[Situation]:
        """Situations in which the skill is shown n times. Default: n that are drawn one by one."""
        return [self.draw(rng) for _ in range(n)]

    def unhurried(self, situation: Situation) -> Situation:
        """A situation in which the skill is shown, for a person with a mouse, who takes their
        time. Default: the same.
        """
        return situation

    def agent(self) -> ModelBasedAgent | None:
        """What chooses the aim of each trial (6.1). Default: None, situations are drawn."""
        return None

    def situations(
        self, seed: int, shown: int, tried: int
    ) -> tuple[Iterator[Situation], Iterator[Situation]]:
        """Situations of a seed in which the skill is shown, and then others in which it is tried.

        Default: both are drawn from one stream of random numbers, so that the second depend on how
        many of the first were taken. Where none is shown they are others than those of a lesson.

        Parameters
        ----------
        shown, tried
            How many are needed. More to be shown follow, for lessons that fail.
        """
        rng = np.random.default_rng([seed, 7])

        def lessons() -> Iterator[Situation]:
            yield from self.draws(rng, shown)
            while True:
                yield self.draw(rng)

        def trials() -> Iterator[Situation]:
            if not shown:
                rng.random(1000)
            for _ in range(tried):
                yield self.draw(rng, wide=True)

        return lessons(), trials()

    @property
    def looks(self) -> bool:
        """Whether a trial in simulation is planned for what the cameras see, and not for where the
        bodies were put. Default: where it depends on them.
        """
        return self.reacts or bool(self.situated)
