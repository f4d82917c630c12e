"""What is thrown at what, and where a situation says that it shall go."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.arm import Speed
from dart_skill.common.regions import REGION, targets_for
from dart_skill.common.situation import Pose, Situation
from dart_skill.common.surface import Game
from dart_skill.common.world import THROW, THROW_BODIES, the_world
from dart_skill.skills.protocol import (
    CONFIGURATIONS,
    LADDER,
    PRACTICE_METHODS,
    Skill,
    SkillWords,
    ThrowSettings,
)

if TYPE_CHECKING:
    from dart_skill.skills.practice import CorrectionSettings


class AimedSkill(Skill):
    """A skill that throws something at a place: what is thrown at what, and where it shall go."""

    name = THROW
    task = "throw the ball into the basket"
    bodies = THROW_BODIES
    world = "basket"
    speed = Speed.THROW
    corrects = "basket"
    turned = False
    model = "dart_skill.skills.learning:ThrowingSkill"
    parts = MappingProxyType(
        {
            "practice": dict.fromkeys(
                PRACTICE_METHODS, "dart_skill.skills.throw._practice:ThrowPractice"
            ),
            "targets": {"informative": "dart_skill.skills.throw._target_choice:InformativeTarget"},
        }
    )
    settings_type = ThrowSettings
    settings: ThrowSettings
    configurations = MappingProxyType({**CONFIGURATIONS, **LADDER})
    reacts = False
    shown_by = "swing"
    by_pointer = False
    cuts_itself = in_the_open = True
    rim_radius = the_world().basket_radius
    region = REGION
    told_by = "landings"

    @property
    def frame_names(self) -> tuple[str, ...]:
        return ("base", "start", "azimuth", "target")

    @property
    def in_hand(self) -> str:
        """What is thrown."""
        return self.bodies[0]

    @property
    def words(self) -> SkillWords:
        thrown, aimed_at = self.bodies
        return SkillWords(
            welcome=(
                "Press Teach: a person shows the arm some throws. Then press Learn, then Throw."
            ),
            shown="throws that a person guides by hand",
            begin=(
                f"put the {thrown} into the hand, bring it to where the throw begins, hold it"
                " still, and press Enter"
            ),
            show=(
                f"throw, press the hand's button, wait until the {thrown} has landed, and press"
                " Enter"
            ),
            stand=f"put the {aimed_at} where the cameras see it",
            load=f"put the {thrown} into the hand, then stand back",
            then="the arm throws",
            do="Throw",
            trials="throws",
            lessons=13,
            done=f"in the {aimed_at}",
            failed="missed",
            off="from the middle",
            unseen="landing not seen",
            outcome=f"where the {thrown} goes",
            unit=("cm", 100.0),
            result=("in", "out"),
            lesson="in",
            demo_seconds=17.0,
        )

    @property
    def situated(self) -> tuple[str, ...]:
        return (self.bodies[1],)

    @property
    def game(self) -> Game:
        """What is thrown at what."""
        return self.settings.game

    @property
    def cocked(self) -> tuple[float, float, float] | None:
        """Angles of J2, J4 and J6 before the swing of a simulated person [rad]; None: as they swing
        for baskets.
        """
        return None

    @property
    def middle(self) -> tuple[float, float, float]:
        """A place (3,) [m] of the surface that a throw goes through."""
        return (0.5 * (self.region.near + self.region.far), 0.0, self.region.rim)

    @property
    def correction(self) -> CorrectionSettings | None:
        """How misses are learned from; None: as those of baskets are."""
        return None

    @property
    def steady_every(self) -> int:
        """Own throws between two looks at when to let go; 0: that is not practised."""
        return 0

    def target(self, situation: Situation) -> np.ndarray:
        """Where a throw shall go (3,) [m], in the world.

        Raises
        ------
        ValueError
            If the situation does not say it.
        """
        return situation.pose(self.bodies[1]).position

    def at(self, target: np.ndarray) -> Situation:
        """The situation in which a throw shall go to a point (3,) [m] of the world."""
        return Situation({self.bodies[1]: Pose(target)})

    def about(self, situation: Situation) -> Situation:
        """What a throw needs of a situation.

        Raises
        ------
        ValueError
            If it is not there.
        """
        return self.at(self.target(situation))

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A basket in the region of config/world.yaml."""
        return self.at(self.region.spread(1, rng)[0])

    def situations(
        self, seed: int, shown: int, tried: int
    ) -> tuple[Iterator[Situation], Iterator[Situation]]:
        """Baskets spread over the region, each for one lesson or one throw.

        Parameters
        ----------
        shown, tried
            How many are needed.
        """
        to_show, to_try = targets_for(seed, shown, tried, self.region)
        spare = self.region.spread(shown, np.random.default_rng([seed, 3]))
        return map(self.at, chain(to_show, spare)), map(self.at, to_try)

    def where_to_put(self, role: str, pose: Pose) -> str:
        """Place of the centre of the rim."""
        x, y, z = pose.position
        return f"put the {role} at x {x:.2f}, y {y:.2f}, with its rim at z {z:.2f} m"

    def in_words(self, situation: Situation) -> str:
        """Distance and azimuth of the basket."""
        x, y, _ = self.target(situation)
        return f"basket at {np.hypot(x, y):.2f} m, {np.degrees(np.arctan2(y, x)):+.0f} degrees"

    @property
    def looks(self) -> bool:
        """A throw is planned for where the basket was put."""
        return False
