"""Throw a ball into a basket.

What is particular to throwing is learned by machinery of its own (`skills.learning`,
`skills.practice`): aim, release and the delay of the hand are solved for through the flight. This
class says the rest in the words of all skills, and what differs from throw to throw: what is
thrown at what (`game`), and where a situation says that it shall go (`target`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from dart_skill.arm import Speed
from dart_skill.common.regions import REGION, Region, targets_for
from dart_skill.common.situation import Pose, Situation
from dart_skill.common.surface import Game
from dart_skill.common.world import THROW, THROW_BODIES, the_world
from dart_skill.movement import VelocityThreshold
from dart_skill.recording import HAND, Demonstration, demonstration_id
from dart_skill.skills.observation import (
    Outcome,
    SensorLog,
    ThrowLog,
    judge_flight,
    judged,
    seen_down,
)
from dart_skill.skills.protocol import (
    CONFIGURATIONS,
    LADDER,
    PRACTICE_METHODS,
    Skill,
    SkillWords,
    TaskOutcome,
    ThrowSettings,
)

LANDING = "landing"
"""Instant at which the ball came down."""
RELEASE = "release"
"""Instant at which the ball left the hand."""

if TYPE_CHECKING:
    from dart_skill.skills.practice import CorrectionSettings


class Throw(Skill):
    """Throw the ball in the hand at the basket; the pose of a basket is the centre of its rim."""

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
            "targets": {"worst": "dart_skill.skills.throw._target_choice:WorstTarget"},
        }
    )
    settings_type = ThrowSettings
    settings: ThrowSettings
    configurations = MappingProxyType({**CONFIGURATIONS, **LADDER})
    reacts = False
    practised_by_hand = True
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

    def check_seen(self, aimed_at: np.ndarray) -> None:
        """A basket can be anywhere.

        Parameters
        ----------
        aimed_at
            The place.

        Raises
        ------
        ValueError
            If what is thrown at cannot be where it was seen (3,) [m].
        """

    def draw(self, rng: np.random.Generator, wide: bool = False) -> Situation:
        """A basket in the region of config/world.yaml."""
        return self.at(self.region.spread(1, rng)[0])

    def cut(self, demonstration: Demonstration) -> tuple[float, float]:
        """All of it: a throw is cut when it is recorded (`skills.observation`)."""
        return float(demonstration.hand_time[0]), float(demonstration.hand_time[-1])

    @property
    def awaited(self) -> tuple[str, ...]:
        """All but what is thrown: it may fly until it was seen to land."""
        return (HAND, self.bodies[1])

    @property
    def decisive(self) -> tuple[str, ...]:
        return (self.moves,)

    def take_world(self, parameters: Mapping[str, Any]) -> None:
        self.rim_radius = parameters.get("basket_radius", self.rim_radius)
        if "near" in parameters:
            own = {name: parameters[name] for name in ("near", "far", "side", "rim")}
            self.region = Region(**own)

    def sensor_log(self, joint_period_ns: int = 10_000_000) -> ThrowLog:
        return ThrowLog(joint_period_ns, self.name, self.bodies)

    def infer_events(self, log: SensorLog, since_ns: int, until_ns: int) -> None:
        """Where the hand was told nothing, its release is found in the flight."""
        assert isinstance(log, ThrowLog)
        if log.opened_ns is not None:
            return
        if release := log.release_between(since_ns, until_ns, self.game.projectile):
            log.add_release(since_ns + round(1e9 * release.time))

    def record(
        self, log: SensorLog, until_ns: int, thresholds: VelocityThreshold
    ) -> Demonstration:
        """The throw in which the hand was opened, cut where it was fast enough (8.4.3)."""
        assert isinstance(log, ThrowLog)
        return log.cut(demonstration_id(log.opened_ns or 0), until_ns, thresholds)

    def is_decided(
        self, log: SensorLog, situation: Situation, told_ns: int, until_ns: int
    ) -> bool:
        """Whether what was thrown was seen to pass the surface of its target."""
        assert isinstance(log, ThrowLog)
        return seen_down(log, self._target_of(situation), told_ns, until_ns, self.game)

    def _target_of(self, situation: Situation) -> np.ndarray:
        """Where a throw was meant to go (3,), by a situation that was asked for or recorded."""
        if self.bodies[1] in situation.poses:
            return situation.pose(self.bodies[1]).position
        return self.target(situation)

    def judged_since(self, begun_ns: int, told_ns: int) -> int:
        return told_ns

    def outcome(
        self, log: SensorLog, asked: Situation, begun_ns: int, told_ns: int, until_ns: int
    ) -> tuple[TaskOutcome, Situation]:
        """By where the ball came down, or the dart met the board: the flight since the hand was
        told to open.
        """
        assert isinstance(log, ThrowLog)
        target = self.target(asked)
        if log.basket.rows:
            self.check_seen(log.basket.rows[-1])
        outcome, release = judged(log, target, self.rim_radius, told_ns, until_ns, self.game)
        unseen = np.full(3, np.nan)
        left = (release.position, release.velocity) if release else (unseen, unseen)
        observed = {LANDING: (outcome.landing, unseen), RELEASE: left}
        error = float(outcome.landing_error) if outcome.landing_seen else np.nan
        return TaskOutcome(bool(outcome.in_basket), error, observed=observed), self.about(asked)

    def described(self, seen: Demonstration) -> Demonstration:
        """As it is: it was cut when it was recorded."""
        return seen

    def situation(self, demonstration: Demonstration, start: float) -> Situation:
        """The one that it shows how to serve: where the throw went.

        Parameters
        ----------
        start
            Of the movement [s].

        Raises
        ------
        ValueError
            If that was not seen.
        """
        middle = self.at(np.array(self.middle))
        outcome = self.judge(demonstration, middle)
        if not np.isfinite(outcome.miss).all():
            raise ValueError(
                f"demonstration {demonstration.id}: {outcome.reason or 'the landing was not seen'}"
            )
        return self.at(self.target(middle) + outcome.miss)

    def judge(self, seen: Demonstration, situation: Situation) -> TaskOutcome:
        """Where the ball came down on the plane of the rim, or the dart met the board, and whether
        it is in.

        Parameters
        ----------
        seen
            The throw.
        """
        opened = seen.opened
        thrown, aimed_at = self.bodies
        if np.isnan(opened):
            return TaskOutcome(
                False, np.nan, "the hand was never told to open: nothing was thrown"
            )
        track, target, game = seen.track(thrown), self.target(situation), self.game
        after = track.time >= opened
        time, position = track.time[after] - opened, track.position[after]
        outcome = judge_flight(
            time,
            position,
            target,
            self.rim_radius,
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

        Parameters
        ----------
        shown, tried
            How many are needed.
        """
        to_show, to_try = targets_for(seed, shown, tried, self.region)
        spare = self.region.spread(shown, np.random.default_rng([seed, 3]))
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
