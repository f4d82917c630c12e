"""Throw a ball into a basket.

What is particular to throwing is learned by machinery of its own (`skills.learning`,
`skills.practice`): aim, release and the delay of the hand are solved for through the flight. This
class says the rest in the words of all skills, and what differs from throw to throw: what is
thrown at what (`game`), and where a situation says that it shall go (`target`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dart_skill.common.regions import Region
from dart_skill.common.situation import Pose, Situation
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
from dart_skill.skills.protocol import TaskOutcome
from dart_skill.skills.throw._aimed import AimedSkill

LANDING = "landing"
"""Instant at which the ball came down."""
RELEASE = "release"
"""Instant at which the ball left the hand."""


OUT_OF_HAND = 0.5
"""A ball that is farther than this from the hand's tracked body is not in it [m]."""


class Throw(AimedSkill):
    """Throw the ball in the hand at the basket; the pose of a basket is the centre of its rim."""

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
            self.check_seen(self.bodies[1], Pose(log.basket.rows[-1]))
        outcome, release = judged(log, target, self.rim_radius, told_ns, until_ns, self.game)
        unseen = np.full(3, np.nan)
        left = (release.position, release.velocity) if release else (unseen, unseen)
        observed = {LANDING: (outcome.landing, unseen), RELEASE: left}
        error = float(outcome.landing_error) if outcome.landing_seen else np.nan
        reason = "" if outcome.landing_seen else self._empty_hand(log, told_ns)
        success = bool(outcome.in_basket) and not reason
        if not (success or outcome.landing_seen):
            reason = reason or f"the landing of the {self.bodies[0]} was not seen"
        return TaskOutcome(success, error, reason, observed=observed), self.about(asked)

    def _empty_hand(self, log: ThrowLog, told_ns: int) -> str:
        """What to say where the hand had nothing to throw when it was told to open; empty where it
        may have had.
        """
        thrown = log.ball.part(0, told_ns)
        hand = log.hand.part(0, thrown.stamps[-1]) if thrown.stamps else log.hand
        if not (thrown.rows and hand.rows):
            return ""
        away = float(np.linalg.norm(thrown.rows[-1] - hand.rows[-1][:3]))
        if away < OUT_OF_HAND:
            return ""
        return (
            f"the {self.bodies[0]} was not in the hand: when it was last seen, before the hand"
            f" opened, it was {away:.1f} m from it"
        )

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


def _why(outcome: Outcome, aimed_at: str) -> str:
    """Why a throw failed; empty for one that did not."""
    if outcome.in_basket:
        return ""
    return f"it missed the {aimed_at}" if outcome.landing_seen else "the landing was not seen"
