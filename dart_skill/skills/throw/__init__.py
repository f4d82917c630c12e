"""Throw a ball into a basket.

What is particular to throwing is learned by machinery of its own (`skills.learning`,
`skills.practice`): aim, release and the delay of the hand are solved for through the flight. This
class says the rest in the words of all skills, and what differs from throw to throw: what is
thrown at what (`game`), and where a situation says that it shall go (`target`).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from dart_skill.arm import Grip, Speed
from dart_skill.common.regions import REGION, targets_for
from dart_skill.common.surface import BASKETS, Game
from dart_skill.common.world import THROW, THROWN, the_world
from dart_skill.skills.observation import Outcome, judge_flight
from dart_skill.skills.protocol import (
    Pose,
    Situation,
    Skill,
    SkillWords,
    TaskDemonstration,
    TaskOutcome,
)

if TYPE_CHECKING:
    from dart_skill.skills.learning import SkillConfiguration
    from dart_skill.skills.practice import CorrectionSettings


class Throw(Skill):
    """Throw the ball in the hand at the basket; the pose of a basket is the centre of its rim."""

    name = THROW
    task = "throw the ball into the basket"
    bodies = THROWN[THROW]
    world = "basket"
    speed = Speed.THROW
    corrects = "basket"
    by_pointer = False
    has_configurations = True
    told_by = "landings"
    cocked: tuple[float, float, float] | None = None
    """Angles of J2, J4 and J6 before the swing of a simulated person [rad]; None: as they swing
    for baskets.
    """

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
        )

    @property
    def situated(self) -> tuple[str, ...]:
        return ("basket",)

    @property
    def game(self) -> Game:
        """What is thrown at what."""
        return BASKETS

    @property
    def middle(self) -> tuple[float, float, float]:
        """A place (3,) [m] of the surface that a throw goes through."""
        return (0.5 * (REGION.near + REGION.far), 0.0, REGION.rim)

    @property
    def correction(self) -> CorrectionSettings | None:
        """How misses are learned from; None: as those of baskets are."""
        return None

    @property
    def steady_every(self) -> int:
        """Own throws between two looks at when to let go; 0: that is not practised."""
        return 0

    def configured_for(self, configuration: SkillConfiguration) -> SkillConfiguration:
        """A configuration of throws, as this skill uses it."""
        return configuration

    def target(self, situation: Situation) -> np.ndarray:
        """Where a throw shall go (3,) [m], in the world; ValueError if the situation does not say
        it.
        """
        return situation.pose("basket").position

    def at(self, target: np.ndarray) -> Situation:
        """The situation in which a throw shall go to a point (3,) [m] of the world."""
        return Situation({"basket": Pose(target)})

    def about(self, situation: Situation) -> Situation:
        """What a throw needs of a situation; ValueError if it is not there."""
        return self.at(self.target(situation))

    def check_seen(self, aimed_at: np.ndarray) -> None:
        """ValueError if what is thrown at cannot be where it was seen (3,) [m]. A basket can be
        anywhere. aimed_at: the place.
        """

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A basket in the region of config/world.yaml."""
        return self.at(REGION.spread(1, rng)[0])

    def cut(self, demonstration: TaskDemonstration) -> tuple[float, float]:
        """All of it: a throw is cut when it is recorded (`skills.observation`)."""
        return float(demonstration.hand_time[0]), float(demonstration.hand_time[-1])

    def situation(self, demonstration: TaskDemonstration, start: float) -> Situation:
        """The one that it shows how to serve: where the throw went; ValueError if nobody saw that.
        start: of the movement [s].
        """
        middle = self.at(np.array(self.middle))
        outcome = self.judge(demonstration, middle)
        if not np.isfinite(outcome.miss).all():
            raise ValueError(
                f"demonstration {demonstration.id}: {outcome.reason or 'the landing was not seen'}"
            )
        return self.at(self.target(middle) + outcome.miss)

    def judge(self, seen: TaskDemonstration, situation: Situation) -> TaskOutcome:
        """Where the ball came down on the plane of the rim, or the dart met the board, and whether
        it is in. seen: the throw.
        """
        opened = [one.time for one in seen.told if one.grip == Grip.OPEN]
        thrown, aimed_at = self.bodies
        if not opened:
            return TaskOutcome(
                False, np.nan, "the hand was never told to open: nothing was thrown"
            )
        track, target, game = seen.track(thrown), self.target(situation), self.game
        after = track.time >= opened[0]
        time, position = track.time[after] - opened[0], track.position[after]
        outcome = judge_flight(
            time,
            position,
            target,
            the_world().basket_radius,
            game.projectile,
            surface=game.surface,
        )
        error = outcome.landing_error if outcome.landing_seen else np.nan
        return TaskOutcome(
            bool(outcome.in_basket),
            float(error),
            _why(outcome, aimed_at),
            np.asarray(outcome.landing, dtype=float) - target,
        )

    def situations(
        self, seed: int, shown: int, tried: int
    ) -> tuple[Iterator[Situation], Iterator[Situation]]:
        """Baskets spread over the region, each for one lesson or one throw.

        shown, tried: how many are needed.
        """
        to_show, to_try = targets_for(seed, shown, tried)
        spare = REGION.spread(shown, np.random.default_rng([seed, 3]))
        return map(self.at, chain(to_show, spare)), map(self.at, to_try)

    def in_words(self, situation: Situation) -> str:
        """Distance and azimuth of the basket."""
        x, y, _ = self.target(situation)
        return f"basket at {np.hypot(x, y):.2f} m, {np.degrees(np.arctan2(y, x)):+.0f} degrees"

    @property
    def looks(self) -> bool:
        """A throw is planned for where the basket was put."""
        return False


def _why(outcome: Outcome, aimed_at: str) -> str:
    """Why a throw failed; empty for one that did not."""
    if outcome.in_basket:
        return ""
    return f"it missed the {aimed_at}" if outcome.landing_seen else "the landing was not seen"
